"""Matrix Market files into symmetric sparse matrices."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import io, sparse

from frf_ipz.errors import FileFormatError, errors_of_file
from frf_ipz.numerics.definiteness import symmetrise

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.arrays import Matrix


def read_symmetric(path: Path, order: int, ordered_by: str) -> Matrix:
    """Read a real symmetric matrix.

    Small asymmetries, as they come from few printed digits, are averaged out.

    Parameters
    ----------
    path : Path
        The file, in coordinate or array form, general or symmetric.
    order : int
        Required number of rows.
    ordered_by : str
        File that names the rows, for messages.

    Returns
    -------
    (order, order) sparse array
        In the unit of the file.

    Raises
    ------
    FileFormatError
        If there is no such file, it is no Matrix Market file, not real, not square, of another size, holds values that
        are not finite, or is not symmetric to six digits.
    """
    matrix = _read(path)
    rows, columns = matrix.shape
    if rows != columns:
        raise FileFormatError(path, f"is {rows} x {columns}; a square matrix is needed")
    if rows != order:
        raise FileFormatError(
            path, f"is {rows} x {columns}, but {ordered_by} names {order} DOFs; one row a DOF is needed"
        )
    with errors_of_file(path):
        return symmetrise(matrix)


def _read(path: Path) -> Matrix:
    if not path.is_file():
        raise FileFormatError(path, "there is no such file; paths are relative to model.toml")
    try:
        field = io.mminfo(str(path))[4]
        if field not in {"real", "integer"}:
            raise FileFormatError(path, f"holds {field} values; real ones are needed")
        loaded: Any = io.mmread(str(path))
    except (ValueError, OverflowError, OSError, IndexError, UnicodeDecodeError) as error:
        if isinstance(error, FileFormatError):
            raise
        raise FileFormatError(path, f"cannot be read as a Matrix Market file: {error}") from None
    matrix: Matrix = sparse.csr_array(loaded, dtype=np.float64)
    return matrix
