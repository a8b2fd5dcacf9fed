"""Places of the entries of compressed sparse matrices, checked before SciPy follows them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scipy import sparse


def require_places(matrix: sparse.csr_array | sparse.csc_array) -> None:
    """Check that each entry lies within a matrix: one beyond its end would end the interpreter.

    SciPy's own check leaves out all but the first and last pointer where the last is 0.

    Parameters
    ----------
    matrix : csr_array or csc_array
        As it was put together from arrays of a file.

    Raises
    ------
    ValueError
        If pointers do not ascend, or an index lies outside.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy import sparse
    >>> require_places(sparse.csr_array((np.zeros(0), np.zeros(0, int), np.array([0, 7, 0])), shape=(2, 2)))
    Traceback (most recent call last):
    ...
    ValueError: the pointers of a sparse matrix do not ascend
    """
    pointers = np.asarray(matrix.indptr)
    if (pointers[1:] < pointers[:-1]).any():
        raise ValueError("the pointers of a sparse matrix do not ascend")
    matrix.check_format(full_check=True)
