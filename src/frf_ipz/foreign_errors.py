"""What libraries say of damaged or hostile files, as one line of the package's own."""

from __future__ import annotations

import importlib
import logging
import warnings
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.errors import FileFormatError, FrfIpzError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

LONGEST = 200  # letters of a foreign message


@contextmanager
def errors_of_reader(path: Path, kind: str) -> Iterator[None]:
    """Turn whatever a library raises on a file into one error that names it; its warnings are not the user's.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        What it should be, such as ``a MATLAB file``.

    Yields
    ------
    None
        While the library reads.

    Raises
    ------
    FileFormatError
        In the place of any error that is none of the package.
    """
    try:
        with warnings.catch_warnings(), _heard_logs() as heard:
            warnings.simplefilter("ignore")
            yield
    except FrfIpzError:
        raise
    except MemoryError:
        raise FileFormatError(path, f"does not fit into memory as {kind}; export less") from None
    except Exception as error:  # a library raises anything on damaged bytes
        raise _damaged(path, kind, str(error) or type(error).__name__) from None
    if heard:  # it was read all the same, as far as it goes
        raise _damaged(path, kind, heard[0])


def _damaged(path: Path, kind: str, text: str) -> FileFormatError:
    said = " ".join(text.split())[:LONGEST]
    return FileFormatError(
        path, f"cannot be read as {kind}: it is cut off or damaged ({said}); copy or export it again"
    )


@contextmanager
def _heard_logs() -> Iterator[list[str]]:
    """Keep what libraries log as a warning or worse off the user's screen, and hear it."""
    heard: list[str] = []

    def hear(record: logging.LogRecord) -> bool:
        if record.levelno >= logging.WARNING:
            heard.append(record.getMessage())
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
        problem = f"is {kind}, whose reader {module} is not installed; run: pip install 'frf_ipz[{extra}]'"
        raise FileFormatError(path, f"{problem}, or export it in another format") from None
