"""Bilinear forms of many symmetric matrices of low rank: a spring, an element, a pair of modes, a mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy import sparse

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray, Matrix

Vectors: TypeAlias = ComplexArray | FloatArray
ROUNDING = 1e-10  # of the largest entry or eigenvalue of a matrix
PAIRS_AT_ONCE = 64  # of vectors, for `add_forms`: what is made of them stays in the cache
SPARSE = 0.1  # of the entries of all vectors, up to which sparse products are faster


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LowRankMatrices:
    """Symmetric matrices ``A_p``: of one entry each, ``sum of e q q^T``, or whole where there are many q.

    Parameters
    ----------
    rows, columns : (l,) int array
        Where the entry of each matrix of one entry stands, and by symmetry another.
    entries : (l,) array
        These entries.
    entry_owners : (l,) int array
        Which matrices these are.
    vectors : (r, m) array
        All q of the others, those of one matrix next to one another; sparse where most entries are zero.
    weights : (m,) array
        All e.
    owners : (k,) int array
        Those of the others that are not zero.
    starts : (k,) int array
        Where the vectors of each of these begin.
    joined : (k, r, r) array
        The same matrices as they are.
    whole : (w, r, r) array
        Those whose vectors would be more than half as many as their rows.
    whole_owners : (w,) int array
        Which matrices these are.
    count : int
        Number of matrices.
    """

    rows: IntArray
    columns: IntArray
    entries: FloatArray
    entry_owners: IntArray
    vectors: FloatArray | Matrix
    weights: FloatArray
    owners: IntArray
    starts: IntArray
    joined: FloatArray
    whole: FloatArray
    whole_owners: IntArray
    count: int

    def forms(self, left: Vectors, right: Vectors) -> FloatArray:
        """Give the real parts of ``y^T A_p x`` of pairs of vectors.

        Parameters
        ----------
        left, right : (r, n) array
            y and x.

        Returns
        -------
        (n, p) array
            Of every pair and matrix.
        """
        result = np.zeros((left.shape[1], self.count))
        self.add_forms(result, left, right)
        return result

    def add_forms(self, result: FloatArray, left: Vectors, right: Vectors) -> None:
        """Add the real parts of ``y^T A_p x`` to a result, best of `PAIRS_AT_ONCE` pairs at a time.

        Parameters
        ----------
        result : (n, p) array
            What they are added to.
        left, right : (r, n) array
            y and x.
        """
        self._add(result, slice(None), left.real, right.real, 1.0)
        turned = np.flatnonzero(np.any(left.imag, axis=0) & np.any(right.imag, axis=0))
        if len(turned):
            self._add(result, turned, left.imag[:, turned], right.imag[:, turned], -1.0)

    def add_sums(self, result: FloatArray, amounts: FloatArray) -> None:
        """Add sums of the matrices, each times an amount, to a result.

        Parameters
        ----------
        result : (..., r, r) array
            What they are added to.
        amounts : (..., p) array
            Of every matrix.
        """
        order = result.shape[-1]
        is_beside = self.rows != self.columns
        at = np.concatenate([self.rows * order + self.columns, (self.columns * order + self.rows)[is_beside]])
        owners = np.concatenate([self.entry_owners, self.entry_owners[is_beside]])
        entries = np.concatenate([self.entries, self.entries[is_beside]])
        by_amount = sparse.csr_array((entries, (at, owners)), shape=(order**2, self.count))
        result += (by_amount @ amounts.reshape(-1, self.count).T).T.reshape(result.shape)
        for places, matrices in ((self.owners, self.joined), (self.whole_owners, self.whole)):
            if len(places):
                result += np.tensordot(amounts[..., places], matrices, 1)

    def _add(
        self, result: FloatArray, pairs: slice | IntArray, left: FloatArray, right: FloatArray, sign: float
    ) -> None:
        if len(self.entries):
            y, x = np.ascontiguousarray(left.T), np.ascontiguousarray(right.T)
            forms = np.take(y, self.rows, axis=1)
            forms *= np.take(x, self.columns, axis=1)
            mirrored = np.take(y, self.columns, axis=1)
            mirrored *= np.take(x, self.rows, axis=1)
            forms += mirrored
            forms *= sign * np.where(self.rows == self.columns, 0.5, 1.0) * self.entries
            _add_at(result, pairs, self.entry_owners, forms)
        if len(self.owners):
            turned = self.vectors.T
            products = np.asarray(turned @ left) * np.asarray(turned @ right) * (sign * self.weights[:, None])
            if len(self.starts) < len(products):
                products = np.add.reduceat(products, self.starts, axis=0)
            _add_at(result, pairs, self.owners, products.T)
        if len(self.whole):
            moved = (self.whole.reshape(-1, len(right)) @ right).reshape(len(self.whole), *right.shape)
            _add_at(result, pairs, self.whole_owners, sign * np.einsum("wrn,rn->nw", moved, left))


def _add_at(result: FloatArray, rows: slice | IntArray, columns: IntArray, forms: FloatArray) -> None:
    places = _places(columns)
    if isinstance(rows, slice) or isinstance(places, slice):
        result[rows, places] += forms
    else:
        result[rows[:, None], places] += forms


def _places(indices: IntArray) -> IntArray | slice:
    """Give ascending indices as a slice where none is left out."""
    first, last = int(indices[0]), int(indices[-1])
    return slice(first, last + 1) if last - first + 1 == len(indices) else indices


def of_entries(rows: IntArray, columns: IntArray) -> LowRankMatrices:
    """Give matrices that are 1 at one place each, and at the place opposite.

    Parameters
    ----------
    rows, columns : (p,) int array
        The places.

    Returns
    -------
    LowRankMatrices
        One matrix a place.

    Examples
    --------
    >>> of_entries(np.array([0]), np.array([1])).forms(np.eye(2)[:, :1], np.array([[2.0], [3.0]])).tolist()
    [[3.0]]
    """
    nothing = np.zeros(0, np.int64)
    return LowRankMatrices(
        rows=rows,
        columns=columns,
        entries=np.ones(len(rows)),
        entry_owners=np.arange(len(rows)),
        vectors=np.zeros((0, 0)),
        weights=np.zeros(0),
        owners=nothing,
        starts=nothing,
        joined=np.zeros((0, 0, 0)),
        whole=np.zeros((0, 0, 0)),
        whole_owners=nothing,
        count=len(rows),
    )


def factorise(matrices: FloatArray, turn: FloatArray | None = None) -> LowRankMatrices:
    """Find the entries or vectors of matrices that have few.

    Parameters
    ----------
    matrices : (p, r, r) array
        Symmetric.
    turn : (r, r) array, optional
        Coordinates T in which they are wanted, ``T^T A T``; their own by default.

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
    of_one: list[int] = []
    at_row: list[int] = []
    at_column: list[int] = []
    entries: list[float] = []
    vectors, weights, owners, starts, used = [], [], [], [], 0
    joined_matrices: list[FloatArray] = []
    whole_owners: list[int] = []
    whole_matrices: list[FloatArray] = []
    for number, own in enumerate(matrices):
        matrix = own if turn is None or not own.any() else turn.T @ own @ turn
        size = np.abs(matrix).max(axis=1, initial=0.0)
        rows = np.flatnonzero(size > ROUNDING * size.max(initial=0.0))
        if not len(rows):
            continue
        small = matrix[np.ix_(rows, rows)]
        upper = np.argwhere(np.triu(np.abs(small) > ROUNDING * size.max()))
        if len(upper) == 1:
            of_one.append(number)
            at_row.append(int(rows[upper[0, 0]]))
            at_column.append(int(rows[upper[0, 1]]))
            entries.append(float(matrix[at_row[-1], at_column[-1]]))
            continue
        values, directions = np.linalg.eigh(small)
        kept = np.abs(values) > ROUNDING * np.abs(values).max()
        if 2 * kept.sum() > order:
            whole_owners.append(number)
            whole_matrices.append(matrix)
            continue
        whole = np.zeros((order, int(kept.sum())))
        whole[rows] = directions[:, kept]
        vectors.append(whole)
        weights.append(values[kept])
        owners.append(number)
        joined_matrices.append(matrix)
        starts.append(used)
        used += whole.shape[1]
    joined = np.hstack(vectors) if vectors else np.zeros((order, 0))
    return LowRankMatrices(
        rows=np.array(at_row, np.int64),
        columns=np.array(at_column, np.int64),
        entries=np.array(entries, float),
        entry_owners=np.array(of_one, np.int64),
        vectors=sparse.csr_array(joined) if np.count_nonzero(joined) < SPARSE * joined.size else joined,
        weights=np.concatenate(weights) if weights else np.zeros(0),
        owners=np.array(owners, np.int64),
        starts=np.array(starts, np.int64),
        joined=np.reshape(joined_matrices, (len(owners), order, order)),
        whole=np.reshape(whole_matrices, (len(whole_owners), order, order)),
        whole_owners=np.array(whole_owners, np.int64),
        count=len(matrices),
    )
