"""Covariance of targets that is never formed as a whole, and its Cholesky factor, block by block.

All targets share the errors of the poles; beyond that the zeros of one FRF share that FRF's noise alone, and those of
one sensor its position. So the covariance is ``common common^T`` and a block for each sensor, and what it costs grows
as the targets do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.linalg import cholesky, lapack, solve_triangular
from scipy.sparse.csgraph import connected_components

from frf_ipz.arrays import FloatArray, IntArray
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
        Covariance beyond that: one of each group of data.
    places : tuple of (m,) int arrays
        The data of each group; one group after the other where they are left out.
    """

    common: FloatArray
    blocks: tuple[FloatArray, ...]
    places: tuple[IntArray, ...] = ()

    @property
    def variance(self) -> FloatArray:
        """Diagonal, (n,)."""
        variance = np.sum(self.common**2, axis=1)
        for part, block in self.parts():
            variance[part] += np.diagonal(block)
        return np.asarray(variance)

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
        return replace(self, common=self.common / sizes[:, None], blocks=blocks)

    def parts(self) -> Iterator[tuple[IntArray, FloatArray]]:
        """Give each block with its place.

        Yields
        ------
        (m,) int array, (m, m) array
            Rows, and the block.
        """
        if self.places:
            yield from zip(self.places, self.blocks, strict=True)
            return
        first = 0
        for block in self.blocks:
            yield np.arange(first, first + len(block)), block
            first += len(block)

    def squares(self, errors: FloatArray) -> FloatArray:
        """Weigh errors by the inverse of the covariance, which has to be positive definite.

        Parameters
        ----------
        errors : (n, m) array
            Of the data, one a column.

        Returns
        -------
        (m,) array
            ``e^T R^-1 e`` of each.
        """
        count = errors.shape[1]
        own, shared = np.zeros(count), np.zeros((self.common.shape[1], count))
        information = np.eye(len(shared))
        for part, block in self.parts():
            both = np.hstack([errors[part], self.common[part]])
            white, _ = lapack.dtrtrs(np.linalg.cholesky(block), both, lower=1)
            own += np.sum(white[:, :count] ** 2, axis=0)
            shared += white[:, count:].T @ white[:, :count]
            information += white[:, count:].T @ white[:, count:]
        return np.asarray(own - np.sum(shared * np.linalg.solve(information, shared), axis=0))

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
    blocks = sparse.csr_array(covariance.blocks)
    count, group = connected_components(blocks, directed=False)
    order = np.argsort(group, kind="stable")
    places = np.split(order, np.cumsum(np.bincount(group, minlength=count))[:-1])
    turned = sparse.csr_array(blocks[order][:, order])
    return TargetNoise(
        common=covariance.common,
        blocks=tuple(
            turned[first:end, first:end].toarray() for first, end in _bounds([len(place) for place in places])
        ),
        places=tuple(places),
    )


def _bounds(sizes: list[int]) -> list[tuple[int, int]]:
    ends = list(accumulate(sizes, initial=0))
    return list(pairwise(ends))


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
