"""Factors of large symmetric positive definite matrices, for solves with many right-hand sides.

SciPy's SuperLU in its symmetric mode, on a nested dissection by METIS, is what every installation has. CHOLMOD
(scikit-sparse) or PARDISO (pypardiso) take its place where the user has installed them; they are faster on solids, and
their licences keep them out of the requirements.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from scipy import linalg, sparse
from scipy.sparse import linalg as sparse_linalg

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.errors import IllConditionedError

if TYPE_CHECKING:
    from frf_ipz.arrays import Matrix

DENSE_ORDER = 600  # below, LAPACK on full matrices is faster than any sparse factor
POSITIVE_DEFINITE = 2  # PARDISO's name for real, symmetric, positive definite
SYMMETRIC_MODE = {"SymmetricMode": True}


class Factorization(Protocol):
    """Factors of a matrix, to solve linear systems with."""

    def solve(self, loads: FloatArray) -> FloatArray:
        """Solve for several right-hand sides at once.

        Parameters
        ----------
        loads : (n,) or (n, n_loads) array
            Right-hand sides.

        Returns
        -------
        (n,) or (n, n_loads) array
            Solutions.
        """


def factorize(matrix: Matrix, nodes: IntArray) -> Factorization:
    """Factor a symmetric positive definite matrix by the fastest installed package.

    Parameters
    ----------
    matrix : (n, n) sparse array
        The matrix; both triangles.
    nodes : (n,) int array
        Node of each row. Rows of a node are coupled to the same other nodes, so only nodes need be put in order.

    Returns
    -------
    Factorization
        Its factors.

    Raises
    ------
    IllConditionedError
        If the matrix is singular.
    """
    if matrix.shape[0] < DENSE_ORDER:
        return _dense(matrix)
    cholmod, pardiso = _import_optional("sksparse.cholmod"), _import_optional("pypardiso")
    if cholmod is not None and hasattr(cholmod, "cholesky"):
        factor = cholmod.cholesky(sparse.csc_matrix(matrix))
        if callable(factor):  # as in scikit-sparse 0.4
            return _Cholmod(factor)
    if pardiso is not None:
        return _Pardiso.of(matrix, pardiso)
    return _superlu(matrix, nodes)


def is_positive_definite(matrix: Matrix, nodes: IntArray) -> bool:
    """Test whether a symmetric matrix is positive definite, by the signs of its pivots (Sylvester's law of inertia).

    Parameters
    ----------
    matrix : (n, n) sparse array
        The matrix; both triangles.
    nodes : (n,) int array
        Node of each row.

    Returns
    -------
    bool
        False as well where it is singular to rounding.
    """
    try:
        factor = _superlu(matrix, nodes).factor
    except IllConditionedError:
        return False
    has_diagonal_pivots = bool((factor.perm_r == factor.perm_c).all())
    return has_diagonal_pivots and bool((factor.U.diagonal() > 0).all())


def _dense(matrix: Matrix) -> _Dense:
    try:
        return _Dense(linalg.cho_factor(matrix.toarray(), lower=True))
    except linalg.LinAlgError:
        raise _singular_error(matrix) from None


def _superlu(matrix: Matrix, nodes: IntArray) -> _SuperLu:
    """Factor with pivots kept on the diagonal, which a symmetric positive definite matrix allows."""
    order = _nested_dissection(matrix, nodes)
    ordered = sparse.csc_array(matrix[order][:, order] if order is not None else matrix)
    try:
        factor = sparse_linalg.splu(
            ordered,
            permc_spec="MMD_AT_PLUS_A" if order is None else "NATURAL",
            diag_pivot_thresh=0.0,
            options=SYMMETRIC_MODE,
        )
    except RuntimeError:  # SuperLU met a pivot that is exactly 0
        raise _singular_error(matrix) from None
    return _SuperLu(factor, np.arange(matrix.shape[0]) if order is None else order)


def _nested_dissection(matrix: Matrix, nodes: IntArray) -> IntArray | None:
    """Put nodes in an order that keeps factors sparse; None without METIS (there is no wheel for Windows)."""
    pymetis = _import_optional("pymetis")
    if pymetis is None:
        return None
    order = matrix.shape[0]
    _, group = np.unique(nodes, return_inverse=True)
    members = sparse.csr_array((np.ones(order), (group, np.arange(order))))
    graph = sparse.csr_array(members @ abs(matrix).sign() @ members.T)
    graph = sparse.csr_array(graph + graph.T)  # METIS reads beyond its arrays where an edge lacks its way back
    graph.setdiag(0)
    graph.eliminate_zeros()
    rank = np.empty(graph.shape[0], np.int64)
    permutation = pymetis.nested_dissection(pymetis.CSRAdjacency(graph.indptr, graph.indices))[0]
    rank[np.asarray(permutation)] = np.arange(graph.shape[0])
    return np.argsort(rank[group], kind="stable")


def _import_optional(name: str) -> Any:  # noqa: ANN401 - a module
    """Import an optional package; late, because it may be slow to load and is only for large models."""
    try:
        return import_module(name)
    except ImportError:
        return None


def _singular_error(matrix: Matrix) -> IllConditionedError:
    return IllConditionedError(
        f"a matrix of order {matrix.shape[0]} is singular or indefinite and cannot be solved with; "
        "check the model's mass and stiffness matrices"
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Dense:
    factor: tuple[FloatArray, bool]

    def solve(self, loads: FloatArray) -> FloatArray:
        return np.asarray(linalg.cho_solve(self.factor, loads))


@dataclass(frozen=True, slots=True, eq=False)
class _SuperLu:
    factor: sparse_linalg.SuperLU
    order: IntArray

    def solve(self, loads: FloatArray) -> FloatArray:
        solution = np.empty_like(loads)
        solution[self.order] = self.factor.solve(loads[self.order])
        return solution


@dataclass(frozen=True, slots=True, eq=False)
class _Cholmod:
    factor: Any

    def solve(self, loads: FloatArray) -> FloatArray:
        return np.asarray(self.factor(loads))


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class _Pardiso:
    solver: Any
    triangle: Any

    @classmethod
    def of(cls, matrix: Matrix, pardiso: Any) -> _Pardiso:  # noqa: ANN401 - a module
        solver = pardiso.PyPardisoSolver(mtype=POSITIVE_DEFINITE)
        triangle = sparse.csr_matrix(sparse.triu(matrix))
        solver.factorize(triangle)
        factorization = cls(solver, triangle)
        # MKL holds the factors until told to free them
        weakref.finalize(factorization, solver.free_memory, everything=True)
        return factorization

    def solve(self, loads: FloatArray) -> FloatArray:
        return np.asarray(self.solver.solve(self.triangle, loads))
