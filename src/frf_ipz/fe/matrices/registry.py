"""Finds the formats of matrices: every module of `fe.matrices.formats` with a ``FORMAT``."""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import FileFormatError
from frf_ipz.fe.matrices import formats
from frf_ipz.fe.matrices.stored import MatrixFormat
from frf_ipz.input_files import MISSING, open_input

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.fe.matrices.stored import MatrixRequest, StoredMatrix

HEAD_BYTES = 4096
LARGEST = 1e100  # in no unit does a structure have such an entry; products of larger ones overflow


def read_matrix(request: MatrixRequest) -> StoredMatrix:
    """Read a matrix of any format.

    Parameters
    ----------
    request : MatrixRequest
        Which matrix of which file.

    Returns
    -------
    StoredMatrix
        The matrix, and its rows where the file names them.

    Raises
    ------
    FileFormatError
        If it cannot be read, or holds what no structure has.
    """
    head = _read_head(request.path)
    chosen = next(candidate for candidate in _formats() if candidate.fits(request.path, head))
    stored = chosen.read(request)
    values = stored.matrix.data
    if not np.isfinite(values).all() or np.abs(values).max(initial=0.0) > LARGEST:
        raise FileFormatError(
            request.path, f"holds values that are not finite, or larger than {LARGEST:g}; check its export"
        )
    return stored


def matrix_names(path: Path) -> tuple[str, ...]:
    """Give what the matrices of a file are called, in the formats of Nastran.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    tuple of str
        Names of square matrices; none for a file of another format.

    Raises
    ------
    FileFormatError
        If it cannot be read.
    """
    head = _read_head(path)
    return next(candidate for candidate in _formats() if candidate.fits(path, head)).names(path)


def recognises(path: Path) -> bool:
    """Tell whether a file is of a format of matrices that says so itself.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    bool
        True for a known suffix or content.
    """
    head = _read_head(path)
    return any(candidate.fits(path, head) for candidate in _formats()[:-1])


def _read_head(path: Path) -> bytes:
    try:
        with open_input(path) as stream:
            return stream.read(HEAD_BYTES)
    except FileFormatError as error:
        if MISSING in str(error):
            raise FileFormatError(path, f"{MISSING}; paths are relative to model.toml") from None
        raise


@cache
def _formats() -> tuple[MatrixFormat, ...]:
    modules = [import_module(f"{formats.__name__}.{module.name}") for module in pkgutil.iter_modules(formats.__path__)]
    found = [module.FORMAT for module in modules if isinstance(getattr(module, "FORMAT", None), MatrixFormat)]
    return tuple(sorted(found, key=lambda candidate: candidate.rank))
