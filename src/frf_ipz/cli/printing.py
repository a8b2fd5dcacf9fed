"""The one way out for text to a terminal; no other module prints."""

from __future__ import annotations

import sys
import traceback
import warnings
from io import TextIOWrapper
from typing import TYPE_CHECKING, TextIO

from frf_ipz.visible_text import lines, one_line

if TYPE_CHECKING:
    from types import TracebackType


def say(text: str) -> None:
    """Print what a command gives.

    Parameters
    ----------
    text : str
        One or more lines.
    """
    print(lines(text), flush=True)


def say_error(text: str) -> None:
    """Print what is wrong, as one line.

    Parameters
    ----------
    text : str
        What is wrong.
    """
    print(f"frf-ipz: {one_line(text)}", file=sys.stderr, flush=True)


def say_progress(text: str) -> None:
    """Print how far a command is, where there is no terminal to draw on.

    Parameters
    ----------
    text : str
        One line.
    """
    print(one_line(text), file=sys.stderr, flush=True)


def guard_streams() -> None:
    """Let nothing else reach the terminal as it is: neither warnings of libraries nor faults of the program."""
    for stream in (sys.stdout, sys.stderr):  # a console or a pipe may know fewer letters than a user's names have
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    warnings.showwarning = _say_warning
    sys.excepthook = _say_fault


def _say_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    text = warnings.formatwarning(message, category, filename, lineno, line)
    print(lines(text), end="", file=sys.stderr if file is None else file)


def _say_fault(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    print(lines("".join(traceback.format_exception(kind, error, trace))), end="", file=sys.stderr, flush=True)
