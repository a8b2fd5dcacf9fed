"""Bilinear forms of many symmetric matrices of low rank: a spring, an element, a pair of modes, a mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray

Vectors: TypeAlias = ComplexArray | FloatArray
ROUNDING = 1e-10  # of the largest entry or eigenvalue of a matrix
COLUMNS_AT_ONCE = 1024


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LowRankMatrices:
    """Symmetric matrices ``A_p = sum of e q q^T``.

    Parameters
    ----------
    vectors : (r, m) array
        All q, those of one matrix next to one another.
    weights : (m,) array
        All e.
    owners : (k,) int array
        The matrices that are not zero.
    starts : (k,) int array
        Where the vectors of each of these begin.
    count : int
        Number of matrices.
    """

    vectors: FloatArray
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
        is_real = not (np.any(left.imag) or np.any(right.imag))
        y, x = (left.real, right.real) if is_real else (left, right)
        shape = (y.shape[1], self.count)
        result: Vectors = np.zeros(shape) if is_real else np.zeros(shape, np.complex128)
        if not len(self.owners):
            return result
        for first in range(0, y.shape[1], COLUMNS_AT_ONCE):
            part = slice(first, first + COLUMNS_AT_ONCE)
            products = (y[:, part].T @ self.vectors) * (x[:, part].T @ self.vectors) * self.weights
            result[part, self.owners] = np.add.reduceat(products, self.starts, axis=1)
        return result


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
    return LowRankMatrices(
        vectors=np.hstack(vectors) if vectors else np.zeros((order, 0)),
        weights=np.concatenate(weights) if weights else np.zeros(0),
        owners=np.array(owners, np.int64),
        starts=np.array(starts, np.int64),
        count=len(matrices),
    )
