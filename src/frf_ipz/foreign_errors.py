"""What libraries say of damaged or hostile files, as one line of the package's own."""

from __future__ import annotations

import importlib
import logging
import warnings
from contextlib import contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.errors import FileFormatError, FrfIpzError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

LONGEST = 200  # letters of a foreign message


@contextmanager
def errors_of_reader(path: Path, kind: str, *, losses: Sequence[str] = ()) -> Iterator[list[str]]:
    """Turn whatever a library raises on a file into one error that names it.

    What it logs or warns of is an error too where numbers are lost or changed: an error of its log, or one of the
    reader's ``losses``. Other lines of its log are handed on; other warnings of its code are not the user's.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        What it should be, such as ``a MATLAB file``.
    losses : sequence of str
        Parts of the library's messages by which it says that numbers are missing or not what the file means.

    Yields
    ------
    list of str
        While the library reads; holds what it logged otherwise, each once, when it has read.

    Raises
    ------
    FileFormatError
        In the place of any error that is none of the package.
    """
    said: list[str] = []
    try:
        with warnings.catch_warnings(record=True) as warned, _heard_logs() as heard:
            warnings.simplefilter("always")
            yield said
    except FrfIpzError:
        raise
    except MemoryError:
        raise FileFormatError(path, f"does not fit into memory as {kind}; export less") from None
    except Exception as error:  # a library raises anything on damaged bytes
        raise _damaged(path, kind, str(error) or type(error).__name__) from None
    for level, text in [*heard, *((logging.WARNING, str(warning.message)) for warning in warned)]:
        if level >= logging.ERROR or any(loss in text for loss in losses):
            raise _damaged(path, kind, text)
    said += dict.fromkeys(_in_one_line(text) for _, text in heard)


def _damaged(path: Path, kind: str, text: str) -> FileFormatError:
    return FileFormatError(
        path, f"cannot be read as {kind}: it is cut off or damaged ({_in_one_line(text)}); copy or export it again"
    )


def _in_one_line(text: str) -> str:
    return " ".join(text.split())[:LONGEST]


@contextmanager
def _heard_logs() -> Iterator[list[tuple[int, str]]]:
    """Keep what libraries log as a warning or worse off the user's screen, and hear it."""
    heard: list[tuple[int, str]] = []

    def hear(record: logging.LogRecord) -> bool:
        if record.levelno >= logging.WARNING:
            heard.append((record.levelno, record.getMessage()))
        return False

    loggers = [logger for logger in logging.root.manager.loggerDict.values() if isinstance(logger, logging.Logger)]
    foreign = [logger for logger in loggers if logger.name.partition(".")[0] != __package__]
    for logger in foreign:
        logger.addFilter(hear)
    try:
        yield heard
    finally:
        for logger in foreign:
            logger.removeFilter(hear)


def import_reader(path: Path, module: str, *, kind: str, extra: str) -> Any:  # noqa: ANN401 - a module has no type
    """Import the library that reads a kind of file, or say how it is installed.

    Parameters
    ----------
    path : Path
        The file that needs it.
    module : str
        Name of the library.
    kind : str
        What the file is, such as ``a TDMS file``.
    extra : str
        The extra of the package that installs it.

    Returns
    -------
    module
        The library.

    Raises
    ------
    FileFormatError
        If it is not installed: names the extra.
    """
    try:
        with np.printoptions():  # some set NumPy's for all: numbers would lose digits wherever they become text
            return importlib.import_module(module)
    except ImportError:
        raise _without_reader(path, module, kind=kind, extra=extra) from None


def require_reader(path: Path, module: str, *, kind: str, extra: str) -> None:
    """Say how the library is installed that reads a kind of file in another process, if it is not.

    Parameters
    ----------
    path : Path
        The file that needs it.
    module : str
        Name of the library.
    kind : str
        What the file is, such as ``a mesh``.
    extra : str
        The extra of the package that installs it.

    Raises
    ------
    FileFormatError
        If it is not installed: names the extra.
    """
    if find_spec(module) is None:
        raise _without_reader(path, module, kind=kind, extra=extra)


def _without_reader(path: Path, module: str, *, kind: str, extra: str) -> FileFormatError:
    problem = f"is {kind}, whose reader {module} is not installed; run: pip install 'frf_ipz[{extra}]'"
    return FileFormatError(path, f"{problem}, or export it in another format")
