"""Bilinear forms of many symmetric matrices of low rank: a spring, an element, a pair of modes, a mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy import sparse

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray, Matrix

Vectors: TypeAlias = ComplexArray | FloatArray
ROUNDING = 1e-10  # of the largest entry or eigenvalue of a matrix
COLUMNS_AT_ONCE = 1024
SPARSE = 0.1  # of the entries of all vectors, up to which sparse products are faster


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LowRankMatrices:
    """Symmetric matrices ``A_p = sum of e q q^T``.

    Parameters
    ----------
    vectors : (r, m) array
        All q, those of one matrix next to one another; sparse where most entries are zero.
    weights : (m,) array
        All e.
    owners : (k,) int array
        The matrices that are not zero.
    starts : (k,) int array
        Where the vectors of each of these begin.
    count : int
        Number of matrices.
    """

    vectors: FloatArray | Matrix
    weights: FloatArray
    owners: IntArray
    starts: IntArray
    count: int

    def forms(self, left: Vectors, right: Vectors) -> Vectors:
        """Give ``y^T A_p x`` of pairs of vectors.

        Parameters
        ----------
        left, right : (r, n) complex array
            y and x.

        Returns
        -------
        (n, p) array
            Of every pair and matrix; real where all vectors are.
        """
        own = self.own_forms(left, right)
        shape = (left.shape[1], self.count)
        result: Vectors = np.zeros(shape, np.complex128) if np.iscomplexobj(own) else np.zeros(shape)
        result[:, self.owners] = own
        return result

    def own_forms(self, left: Vectors, right: Vectors) -> Vectors:
        """Give ``y^T A_p x`` of those matrices that are not zero.

        Parameters
        ----------
        left, right : (r, n) complex array
            y and x.

        Returns
        -------
        (n, k) array
            In the order of `owners`; real where all vectors are.
        """
        y, x = (left, right) if _are_complex(left, right) else (left.real, right.real)
        shape = (y.shape[1], len(self.owners))
        result: Vectors = np.zeros(shape, np.complex128) if np.iscomplexobj(y) else np.zeros(shape)
        if not len(self.owners):
            return result
        turned = self.vectors.T
        for first in range(0, y.shape[1], COLUMNS_AT_ONCE):
            part = slice(first, first + COLUMNS_AT_ONCE)
            products = np.asarray(turned @ y[:, part]) * np.asarray(turned @ x[:, part]) * self.weights[:, None]
            result[part] = np.add.reduceat(products, self.starts, axis=0).T
        return result


def _are_complex(left: Vectors, right: Vectors) -> bool:
    return bool(np.any(left.imag) or np.any(right.imag))


def factorise(matrices: FloatArray) -> LowRankMatrices:
    """Find the vectors of matrices of low rank.

    Parameters
    ----------
    matrices : (p, r, r) array
        Symmetric.

    Returns
    -------
    LowRankMatrices
        The same to rounding.

    Examples
    --------
    >>> forms = factorise(np.array([np.zeros((2, 2)), [[2.0, 0.0], [0.0, 0.0]]])).forms(np.eye(2), np.eye(2))
    >>> forms.tolist()
    [[0.0, 2.0], [0.0, 0.0]]
    """
    order = matrices.shape[1]
    vectors, weights, owners, starts, used = [], [], [], [], 0
    for number, matrix in enumerate(matrices):
        size = np.abs(matrix).max(axis=1, initial=0.0)
        rows = np.flatnonzero(size > ROUNDING * size.max(initial=0.0))
        if not len(rows):
            continue
        values, directions = np.linalg.eigh(matrix[np.ix_(rows, rows)])
        kept = np.abs(values) > ROUNDING * np.abs(values).max()
        whole = np.zeros((order, int(kept.sum())))
        whole[rows] = directions[:, kept]
        vectors.append(whole)
        weights.append(values[kept])
        owners.append(number)
        starts.append(used)
        used += whole.shape[1]
    joined = np.hstack(vectors) if vectors else np.zeros((order, 0))
    return LowRankMatrices(
        vectors=sparse.csr_array(joined) if np.count_nonzero(joined) < SPARSE * joined.size else joined,
        weights=np.concatenate(weights) if weights else np.zeros(0),
        owners=np.array(owners, np.int64),
        starts=np.array(starts, np.int64),
        count=len(matrices),
    )
