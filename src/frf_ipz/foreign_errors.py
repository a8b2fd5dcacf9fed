"""What libraries say of damaged or hostile files, as one line of the package's own."""

from __future__ import annotations

import importlib
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
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except FrfIpzError:
        raise
    except MemoryError:
        raise FileFormatError(path, f"does not fit into memory as {kind}; export less") from None
    except Exception as error:  # a library raises anything on damaged bytes
        said = " ".join(str(error).split())[:LONGEST] or type(error).__name__
        problem = f"cannot be read as {kind}: it is cut off or damaged ({said}); copy or export it again"
        raise FileFormatError(path, problem) from None


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
