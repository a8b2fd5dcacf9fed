"""Covariance of targets that is never formed as a whole, and its Cholesky factor, block by block.

All targets share the errors of the poles; beyond that the zeros of one FRF share that FRF's noise alone. So the
covariance is ``common common^T`` and a block on the diagonal for each FRF, and what it costs grows as the targets do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.linalg import cholesky, solve_triangular

from frf_ipz.arrays import FloatArray
from frf_ipz.identification.root_covariance import RootCovariance

if TYPE_CHECKING:
    from collections.abc import Iterator


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetNoise:
    """Covariance of n data.

    Parameters
    ----------
    common : (n, c) array
        How each follows the errors that all share.
    blocks : tuple of (m, m) arrays
        Covariance beyond that, along the diagonal, in the order of the data.
    """

    common: FloatArray
    blocks: tuple[FloatArray, ...]

    @property
    def variance(self) -> FloatArray:
        """Diagonal, (n,)."""
        own = np.concatenate([np.diagonal(block) for block in self.blocks]) if self.blocks else np.zeros(0)
        return np.asarray(own + np.sum(self.common**2, axis=1))

    def plus(self, variance: FloatArray) -> TargetNoise:
        """Add independent noise.

        Parameters
        ----------
        variance : (n,) array
            Of each datum.

        Returns
        -------
        TargetNoise
            The sum.
        """
        return replace(self, blocks=tuple(block + np.diag(variance[part]) for part, block in self.parts()))

    def over(self, sizes: FloatArray) -> TargetNoise:
        """Divide the data by sizes.

        Parameters
        ----------
        sizes : (n,) array
            Positive.

        Returns
        -------
        TargetNoise
            Of the quotients.
        """
        blocks = tuple(block / np.outer(sizes[part], sizes[part]) for part, block in self.parts())
        return TargetNoise(common=self.common / sizes[:, None], blocks=blocks)

    def parts(self) -> Iterator[tuple[slice, FloatArray]]:
        """Give each block with its place.

        Yields
        ------
        slice, (m, m) array
            Rows, and the block.
        """
        first = 0
        for block in self.blocks:
            yield slice(first, first + len(block)), block
            first += len(block)

    def draw(self, white: FloatArray) -> FloatArray:
        """Give errors with this covariance: its lower Cholesky factor times white ones.

        Parameters
        ----------
        white : (count, n) array
            Independent unit normal numbers.

        Returns
        -------
        (count, n) array
            Errors.
        """
        errors = np.empty_like(white)
        shared = np.zeros((len(white), self.common.shape[1]))
        unknown = np.eye(self.common.shape[1])
        for part, block in self.parts():
            common = self.common[part]
            factor = cholesky(block + common @ unknown @ common.T, lower=True)
            told = solve_triangular(factor, common @ unknown, lower=True).T
            errors[:, part] = shared @ common.T + white[:, part] @ factor.T
            shared += white[:, part] @ told.T
            unknown = unknown - told @ told.T
        return errors


def noise_of(covariance: FloatArray | RootCovariance) -> TargetNoise:
    """Split a covariance into its blocks.

    Parameters
    ----------
    covariance : (n, n) array, or RootCovariance
        Positive semi-definite.

    Returns
    -------
    TargetNoise
        The same covariance.
    """
    if not isinstance(covariance, RootCovariance):
        covariance = RootCovariance(
            common=np.zeros((len(covariance), 0)), blocks=sparse.csr_array(np.asarray(covariance, float))
        )
    entries = sparse.coo_array(covariance.blocks)
    count = len(covariance.common)
    reach = np.arange(count)
    np.maximum.at(reach, entries.coords[0], entries.coords[1])
    ends = np.flatnonzero(np.maximum.accumulate(reach) == np.arange(count)) + 1
    starts = np.concatenate([[0], ends[:-1]])
    blocks = sparse.csr_array(covariance.blocks)
    return TargetNoise(
        common=covariance.common,
        blocks=tuple(
            blocks[first:end, first:end].toarray() for first, end in zip(starts.tolist(), ends.tolist(), strict=True)
        ),
    )


def project(covariance: FloatArray | RootCovariance, gradient: FloatArray) -> TargetNoise:
    """Covariance of one number a root, each with a gradient by its real and imaginary part.

    Parameters
    ----------
    covariance : (2 n, 2 n) array, or RootCovariance
        Of real and imaginary part of each root in turn.
    gradient : (n, 2) array
        Of each number.

    Returns
    -------
    TargetNoise
        Of the numbers.
    """
    count = len(gradient)
    if isinstance(covariance, RootCovariance):
        columns = np.arange(2 * count)
        turn = sparse.csr_array((gradient.ravel(), (np.repeat(np.arange(count), 2), columns)))
        blocks = sparse.csr_array(turn @ covariance.blocks @ turn.T)
        return noise_of(RootCovariance(common=np.asarray(turn @ covariance.common), blocks=blocks))
    pairs = covariance.reshape(count, 2, count, 2)
    return noise_of(np.asarray(np.einsum("ia,iajb,jb->ij", gradient, pairs, gradient)))
