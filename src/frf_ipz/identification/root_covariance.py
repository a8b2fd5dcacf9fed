"""Joint covariance of poles and zeros that is never formed as a whole.

Errors of all roots share those of the poles; beyond that the zeros of one FRF share that FRF's noise alone. So the
covariance is ``common common' + blocks`` with a block-diagonal matrix `blocks`: hundreds of FRFs with dozens of zeros
each need megabytes instead of gigabytes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from frf_ipz.arrays import FloatArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RootCovariance:
    """Covariance with the indexing of a matrix.

    Parameters
    ----------
    common : (n_rows, n_sources) array
        How each real and imaginary part follows the errors that all roots share, rad/s.
    blocks : (n_rows, n_rows) sparse array
        Covariance beyond that, one block an FRF, (rad/s)^2.

    Examples
    --------
    >>> from scipy import sparse
    >>> covariance = RootCovariance(common=np.array([[1.0], [2.0]]), blocks=sparse.csr_array(np.eye(2)))
    >>> covariance[np.ix_([0, 1], [1])]
    array([[2.],
           [5.]])
    >>> float(covariance[1, 1])
    5.0
    """

    common: FloatArray
    blocks: sparse.csr_array[np.float64, tuple[int, int]]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return len(self.common), len(self.common)

    @property
    def ndim(self) -> int:
        """Number of axes: 2."""
        return 2

    def __getitem__(self, key: Any) -> Any:  # noqa: ANN401 - whatever indexes a matrix: numbers, slices, `np.ix_`
        rows, columns = key if isinstance(key, tuple) else (key, slice(None))
        indices = np.arange(len(self.common))
        row, column = indices[rows], indices[columns]
        block = self.common[np.ravel(row)] @ self.common[np.ravel(column)].T
        block = block + self.blocks[np.ravel(row)][:, np.ravel(column)].toarray()
        if np.ndim(row) == 0 and np.ndim(column) == 0:
            return block[0, 0]
        if np.ndim(row) == 0 or np.ndim(column) == 0:
            return block.ravel()
        return block

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:  # noqa: ANN401, FBT001 - NumPy's protocol
        del copy
        return np.asarray(self[:, :], dtype)

    def select(self, rows: IntArray) -> RootCovariance:
        """Select roots.

        Parameters
        ----------
        rows : (k,) int array
            Rows, which are the columns too.

        Returns
        -------
        RootCovariance
            Of these.
        """
        return RootCovariance(common=self.common[rows], blocks=sparse.csr_array(self.blocks[rows][:, rows]))

    def diagonal(self) -> FloatArray:
        """Variances.

        Returns
        -------
        (n_rows,) array
            (rad/s)^2.
        """
        return np.asarray(np.einsum("ij,ij->i", self.common, self.common) + self.blocks.diagonal())

    def pair_blocks(self) -> FloatArray:
        """Covariance of the real and imaginary part of each root by itself.

        Returns
        -------
        (n_roots, 2, 2) array
            (rad/s)^2.
        """
        parts = self.common.reshape(-1, 2, self.common.shape[1])
        blocks = np.einsum("kim,kjm->kij", parts, parts)
        cross = self.blocks.diagonal(1)[::2]
        blocks[:, [0, 1], [0, 1]] += self.blocks.diagonal().reshape(-1, 2)
        blocks[:, 0, 1] += cross
        blocks[:, 1, 0] += cross
        return np.asarray(blocks)


def pair_blocks(covariance: FloatArray | RootCovariance) -> FloatArray:
    """Take the covariance of each root by itself.

    Parameters
    ----------
    covariance : (2 n, 2 n) array, or RootCovariance
        Real and imaginary part of each root in turn.

    Returns
    -------
    (n, 2, 2) array
        Diagonal blocks.
    """
    if isinstance(covariance, RootCovariance):
        return covariance.pair_blocks()
    pairs = np.arange(len(covariance) // 2)
    return np.asarray(covariance.reshape(len(pairs), 2, len(pairs), 2)[pairs, :, pairs, :])
