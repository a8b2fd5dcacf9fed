"""Sparse matrices times numbers: what an effect adds to a model for some values of its parameters.

The matrices stay the same while the numbers are fitted, so that each is brought into few coordinates once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from scipy import sparse

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray, Matrix


@dataclass(frozen=True, slots=True, eq=False)
class MatrixSum:
    """A sum of fixed matrices, each times a number.

    Parameters
    ----------
    terms : tuple of (float, sparse array)
        Numbers and (n_all, n_all) matrices.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy import sparse
    >>> unit = sparse.csr_array(np.eye(2))
    >>> (MatrixSum(((2.0, unit),)) + unit).toarray().tolist()
    [[3.0, 0.0], [0.0, 3.0]]
    """

    terms: tuple[tuple[float, Matrix], ...]

    def __add__(self, second: MatrixSum | Matrix) -> MatrixSum:
        """Add another sum, or a matrix."""
        return MatrixSum((*self.terms, *(second.terms if isinstance(second, MatrixSum) else ((1.0, second),))))

    def tocsr(self) -> Matrix:
        """Add up."""
        (factor, first), *further = self.terms
        total = factor * first
        for factor, matrix in further:
            total = total + factor * matrix
        return sparse.csr_array(total)

    def toarray(self) -> FloatArray:
        """Add up, as a full array."""
        return self.tocsr().toarray()
