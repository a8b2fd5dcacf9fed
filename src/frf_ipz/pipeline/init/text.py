"""How starting files are written: values in quotes, and the mark at the end of a line that was guessed."""

from __future__ import annotations

from frf_ipz.pipeline.check.open_marks import MARK

HEAD = (
    f"# Written by 'frf-ipz init'. Look at every line with {MARK} at its end, and take the word away where it is right."
)
WIDTH = 31  # of a key with its value, before the comment


def with_comment(key: str, comment: str) -> str:
    """Write a line that is known.

    Parameters
    ----------
    key, comment : str
        The key with its value; what it means.

    Returns
    -------
    str
        The line.
    """
    return f"{key:<{WIDTH}} # {comment}"


def guessed(key: str, comment: str) -> str:
    """Write a line that the user has to look at.

    Parameters
    ----------
    key, comment : str
        The key with its value; what else it may be.

    Returns
    -------
    str
        The line, with the mark at its end.
    """
    return f"{with_comment(key, comment)}   {MARK}"


def quoted(text: str) -> str:
    """Write a text as TOML has it.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        In quotes.
    """
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
