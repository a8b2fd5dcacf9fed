"""Lagrange multipliers in a stiffness matrix, and the constraint equations that they stand for.

A row without mass whose diagonal of the stiffness is not positive belongs to no motion of a structure: it is a
multiplier, and its row ``G u = 0`` an equation between the motions. Multipliers may be coupled among themselves, as
those of Code_Aster, which come in pairs. With the block L of the multipliers, the part of L that is not singular is
condensed, ``K - G^T L^+ G``, and its null space N gives the equations ``N^T G u = 0``. They are solved for one motion
each: ``u = T v``, where v are the remaining motions, exactly and without a penalty.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.csgraph import connected_components

from frf_ipz.arrays import BoolArray, FloatArray, IntArray
from frf_ipz.errors import InputError
from frf_ipz.numerics.definiteness import massless_rows
from frf_ipz.numerics.held_rows import NOTHING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from frf_ipz.arrays import Matrix

DEPENDENT = 1e-10  # of the largest entry: an equation that follows from others, to the digits of a file
MOST_EQUATIONS = 20_000  # that hang together: their matrix is dense


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AdmissibleMotions:
    """Motions that satisfy constraint equations, ``u = T v``.

    Parameters
    ----------
    matrix : (n, n_independent) sparse array
        T; the identity at the independent rows.
    independent : (n_independent,) int array
        Rows of v among those of u, ascending.
    """

    matrix: Matrix
    independent: IntArray

    def reduced(self, matrix: Matrix) -> Matrix:
        """Give the matrix of the independent motions.

        Parameters
        ----------
        matrix : (n, n) sparse array
            Of all motions.

        Returns
        -------
        (n_independent, n_independent) sparse array
            ``T^T A T``.
        """
        return sparse.csr_array(self.matrix.T @ matrix @ self.matrix)

    def rows(self, kept: IntArray) -> AdmissibleMotions:
        """Select rows that all remain independent or follow from those that remain.

        Parameters
        ----------
        kept : (k,) int array
            Rows of u, ascending.

        Returns
        -------
        AdmissibleMotions
            Without the columns of independent rows that are left out.
        """
        remain = np.isin(self.independent, kept)
        return AdmissibleMotions(
            matrix=sparse.csr_array(self.matrix[kept][:, np.flatnonzero(remain)]),
            independent=np.searchsorted(kept, self.independent[remain]),
        )

    def extended(self, count: int) -> AdmissibleMotions:
        """Add independent rows at the end.

        Parameters
        ----------
        count : int
            How many.

        Returns
        -------
        AdmissibleMotions
            With the identity there.
        """
        n_rows = self.matrix.shape[0]
        return AdmissibleMotions(
            matrix=sparse.csr_array(sparse.block_diag([self.matrix, sparse.eye_array(count)])),
            independent=np.concatenate([self.independent, n_rows + np.arange(count)]),
        )


def find_multipliers(mass: Matrix, stiffness: Matrix) -> BoolArray:
    """Find the rows of Lagrange multipliers.

    Parameters
    ----------
    mass, stiffness : (n, n) sparse array
        Symmetric.

    Returns
    -------
    (n,) bool array
        True for rows without mass whose stiffness is coupled, but not positive on the diagonal.

    Examples
    --------
    >>> stiffness = sparse.csr_array([[3.0, -1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, 0.0]])
    >>> find_multipliers(sparse.csr_array(np.diag([2.0, 1.0, 0.0])), stiffness)
    array([False, False,  True])
    """
    diagonal = stiffness.diagonal()
    scale = float(np.median(np.abs(diagonal[diagonal != 0]))) if diagonal.any() else 1.0
    is_coupled = np.asarray(abs(stiffness).sum(axis=1)).ravel() > np.abs(diagonal)
    return np.asarray(massless_rows(mass) & (diagonal <= NOTHING * scale) & is_coupled)


def eliminate_multipliers(stiffness: Matrix, multipliers: BoolArray) -> tuple[Matrix, Matrix]:
    """Replace multipliers by the equations that they stand for.

    Parameters
    ----------
    stiffness : (n, n) sparse array
        Symmetric, with the rows of multipliers.
    multipliers : (n,) bool array
        Marks of those rows.

    Returns
    -------
    stiffness : (m, m) sparse array
        Of the other rows.
    equations : (n_equations, m) sparse array
        Between the other rows, whose sums with their motions are 0.
    """
    rows, others = np.flatnonzero(multipliers), np.flatnonzero(~multipliers)
    across = sparse.csr_array(stiffness[rows][:, others])
    among = sparse.csr_array(stiffness[rows][:, rows])
    reduced = sparse.csr_array(stiffness[others][:, others])
    equations = [sparse.csr_array((0, len(others)))]
    for block in _components(among):
        values, vectors = np.linalg.eigh(among[block][:, block].toarray())
        coupled = sparse.csr_array(vectors.T @ across[block])
        is_null = np.abs(values) <= DEPENDENT * max(float(np.abs(values).max()), NOTHING)
        if not is_null.all():
            condensed = coupled[np.flatnonzero(~is_null)]
            reduced = reduced - condensed.T @ sparse.diags_array(1 / values[~is_null]) @ condensed
        equations.append(coupled[np.flatnonzero(is_null)])
    return sparse.csr_array(reduced), sparse.csr_array(sparse.vstack(equations))


def solve_equations(equations: Matrix) -> AdmissibleMotions:
    """Solve linear equations between motions, ``C u = 0``, for one motion each.

    Solved for are motions that stand in few equations and with large factors: the slaves of a rigid link, not its
    master.

    Parameters
    ----------
    equations : (n_equations, n) sparse array
        C.

    Returns
    -------
    AdmissibleMotions
        The motions that satisfy them all.

    Raises
    ------
    InputError
        If more equations hang together than can be solved.

    Examples
    --------
    >>> motions = solve_equations(sparse.csr_array([[1.0, -1.0, -0.5]]))
    >>> motions.independent, motions.matrix.toarray()[0]
    (array([1, 2]), array([1. , 0.5]))
    """
    n = equations.shape[1]
    dependent: list[IntArray] = []
    entries: list[tuple[IntArray, IntArray, FloatArray]] = []
    is_dependent = np.zeros(n, bool)
    pattern = sparse.csr_array(abs(equations).sign() @ abs(equations).sign().T)
    for block in _components(pattern):
        if len(block) > MOST_EQUATIONS:
            raise InputError(
                f"{len(block)} constraint equations hang together, at most {MOST_EQUATIONS} can be solved; "
                "let the FE program eliminate them"
            )
        part = equations[block]
        columns = np.unique(part.indices[part.data != 0])
        if not len(columns):
            continue
        solved, free, weights = _solve_block(part[:, columns].toarray())
        is_dependent[columns[solved]] = True
        dependent.append(columns[solved])
        row, column = np.nonzero(weights)
        entries.append((columns[solved][row], columns[free][column], weights[row, column]))
    independent = np.flatnonzero(~is_dependent)
    place = np.zeros(n, np.int64)
    place[independent] = np.arange(len(independent))
    rows = np.concatenate([independent, *(entry[0] for entry in entries)])
    columns = np.concatenate([place[independent], *(place[entry[1]] for entry in entries)])
    values = np.concatenate([np.ones(len(independent)), *(entry[2] for entry in entries)])
    matrix = sparse.csr_array(sparse.coo_array((values, (rows, columns)), shape=(n, len(independent))))
    return AdmissibleMotions(matrix=matrix, independent=independent)


def _solve_block(equations: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Columns that are solved for, the others, and the weights of these in those."""
    equations = equations / np.abs(equations).max(axis=1, keepdims=True)
    occurrences = np.count_nonzero(equations, axis=0)
    triangle, pivots = linalg.qr(equations / occurrences, mode="r", pivoting=True)
    diagonal = np.abs(np.diag(triangle))
    rank = int(np.count_nonzero(diagonal > DEPENDENT * diagonal[0]))
    order = np.asarray(pivots, np.int64)
    solved, free = order[:rank], order[rank:]
    weights: FloatArray = np.asarray(np.linalg.lstsq(equations[:, solved], -equations[:, free], rcond=None)[0])
    weights[np.abs(weights) <= DEPENDENT * np.abs(weights).max(initial=0.0)] = 0.0
    return solved, free, weights


def _components(pattern: Matrix) -> Iterator[IntArray]:
    count, label = connected_components(pattern, directed=False)
    order = np.argsort(label, kind="stable")
    return iter(np.split(order, np.searchsorted(label[order], np.arange(1, count)))) if count else iter(())
