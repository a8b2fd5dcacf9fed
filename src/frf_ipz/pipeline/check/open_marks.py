"""Lines that ``frf-ipz init`` had to guess, and that nobody has looked at since: they still carry its mark."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.input_files import read_text
from frf_ipz.pipeline.check.look import Look

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

MARK = "CHECK"


def look_for_marks(files: Iterable[Path]) -> Look:
    """List the lines that still carry the mark of ``frf-ipz init``.

    Parameters
    ----------
    files : iterable of Path
        TOML files.

    Returns
    -------
    Look
        An open point for each line, with its file and number.
    """
    found = [
        f"{path}:{number}: {_without_mark(line)}"
        for path in files
        for number, line in enumerate(read_text(path).splitlines(), start=1)
        if is_marked(line)
    ]
    return Look(open_points=tuple(found))


def is_marked(line: str) -> bool:
    """Tell whether a line of a TOML file ends with the mark, in a comment.

    Parameters
    ----------
    line : str
        The line.

    Returns
    -------
    bool
        True where it does.

    Examples
    --------
    >>> is_marked('dof = "1:+z"   # of the sensor   CHECK'), is_marked('name = "CHECK"')
    (True, False)
    """
    return "#" in line and line.rstrip().endswith(MARK)


def _without_mark(line: str) -> str:
    key, _, comment = line.strip().removesuffix(MARK).partition(" # ")
    return f"{key.strip()}  ({comment.strip()})" if comment.strip() else key.strip()
