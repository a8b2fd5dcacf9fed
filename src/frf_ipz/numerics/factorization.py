"""Factors of large symmetric positive definite matrices, for solves with many right-hand sides.

The multifrontal factors of this package (`multifrontal`), on a nested dissection by METIS, are what every installation
has. CHOLMOD (scikit-sparse) or PARDISO (pypardiso) take their place where the user has installed them: they use several
cores, and their licences keep them out of the requirements.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from scipy import linalg, sparse
from scipy.sparse import linalg as sparse_linalg

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.errors import IllConditionedError, InputError
from frf_ipz.numerics.free_memory import free_memory_bytes
from frf_ipz.numerics.multifrontal import CholeskyFactors, Elimination

if TYPE_CHECKING:
    from frf_ipz.arrays import Matrix

DENSE_ORDER = 600  # below, LAPACK on full matrices is faster than any sparse factor
POSITIVE_DEFINITE = 2  # PARDISO's name for real, symmetric, positive definite
NOT_POSITIVE_DEFINITE = -4  # PARDISO's name for a pivot that is zero or negative
GIGABYTE = 1e9


class Factorization(Protocol):
    """Factors of a matrix, to solve linear systems with.

    Parameters
    ----------
    made_by : str
        The package and, where it is not this one, its version.
    """

    @property
    def made_by(self) -> str:
        """The package that made the factors."""

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
    InputError
        If the factors need more memory than there is: says how much, and what to do.
    """
    if matrix.shape[0] < DENSE_ORDER:
        return _dense(matrix)
    elimination = plan_elimination(matrix, nodes)
    _require_memory(elimination, matrix.shape[0])
    for attempt in (_cholmod, _pardiso):
        factors = attempt(matrix)
        if factors is not None:
            return factors
    try:
        return _Multifrontal(CholeskyFactors.of(matrix, elimination))
    except np.linalg.LinAlgError:
        raise _singular_error(matrix) from None


def is_positive_definite(matrix: Matrix, nodes: IntArray) -> bool:
    """Test whether a symmetric matrix is positive definite, by whether it has a Cholesky factor.

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
        factorize(matrix, nodes)
    except IllConditionedError:
        return False
    return True


def plan_elimination(matrix: Matrix, nodes: IntArray) -> Elimination:
    """Put the rows of a matrix in an order that keeps its factors sparse, and find how large these are.

    Parameters
    ----------
    matrix : (n, n) sparse array
        The matrix; both triangles.
    nodes : (n,) int array
        Node of each row.

    Returns
    -------
    Elimination
        The order, and the fronts of the factors.
    """
    order = matrix.shape[0]
    _, group = np.unique(nodes, return_inverse=True)
    members = sparse.csr_array((np.ones(order), (group, np.arange(order))))
    graph = sparse.csr_array(members @ abs(matrix).sign() @ members.T)
    graph = sparse.csr_array(graph + graph.T)  # METIS reads beyond its arrays where an edge lacks its way back
    graph.setdiag(0)
    graph.eliminate_zeros()
    pymetis = _import_optional("pymetis")
    if pymetis is None:
        permutation = _minimum_degree(graph)
    else:
        permutation = np.asarray(pymetis.nested_dissection(pymetis.CSRAdjacency(graph.indptr, graph.indices))[0])
    return Elimination.of(graph, group, permutation)


def _minimum_degree(graph: Matrix) -> IntArray:
    """Order nodes where METIS is missing (there is no wheel for Windows): SuperLU's own, of factors with no fill."""
    diagonal = sparse.diags_array(1.0 + np.asarray(graph.sum(axis=1)).ravel())
    dominant = sparse.csc_array(diagonal - graph)
    return np.argsort(sparse_linalg.spilu(dominant, drop_tol=1.0, fill_factor=1.0, permc_spec="MMD_AT_PLUS_A").perm_c)


def _require_memory(elimination: Elimination, order: int) -> None:
    free = free_memory_bytes()
    if free is not None and elimination.peak_bytes > free:
        raise InputError(
            f"the factors of {order} DOFs need {elimination.peak_bytes / GIGABYTE:.1f} GB, and "
            f"{free / GIGABYTE:.1f} GB of memory are free: close other programs, take a machine with more memory, "
            "or give a coarser mesh; the FE program can also condense the model (Guyan, Craig-Bampton) to some "
            "thousand DOFs"
        )


def _dense(matrix: Matrix) -> _Dense:
    try:
        return _Dense(linalg.cho_factor(matrix.toarray(), lower=True))
    except linalg.LinAlgError:
        raise _singular_error(matrix) from None


def _cholmod(matrix: Matrix) -> _Cholmod | None:
    """Factor by scikit-sparse of any version; None where there is none."""
    cholmod = _import_optional("sksparse.cholmod")
    if cholmod is None:
        return None
    columns = sparse.csc_matrix(matrix)
    made_by = f"CHOLMOD (scikit-sparse {_version('scikit-sparse')})"
    try:
        if hasattr(cholmod, "cho_factor"):  # since 0.5
            return _Cholmod(cholmod.cho_factor(columns).solve, made_by)
        factor = cholmod.cholesky(columns)
    except cholmod.CholmodNotPositiveDefiniteError:
        raise _singular_error(matrix) from None
    return _Cholmod(factor, made_by) if callable(factor) else None


def _pardiso(matrix: Matrix) -> _Pardiso | None:
    """Factor by pypardiso; None where there is none."""
    pardiso = _import_optional("pypardiso")
    if pardiso is None:
        return None
    solver = pardiso.PyPardisoSolver(mtype=POSITIVE_DEFINITE)
    triangle = sparse.csr_matrix(sparse.triu(matrix))
    factors = _Pardiso(solver, triangle, f"PARDISO (pypardiso {_version('pypardiso')})")
    weakref.finalize(factors, solver.free_memory, everything=True)  # MKL holds the factors until told to free them
    try:
        solver.factorize(triangle)
    except Exception as error:  # of a type that the package does not show
        if getattr(error, "value", None) != NOT_POSITIVE_DEFINITE:
            raise
        raise _singular_error(matrix) from None
    return factors


def _import_optional(name: str) -> Any:  # noqa: ANN401 - a module
    """Import an optional package; late, because it may be slow to load and is only for large models."""
    try:
        return import_module(name)
    except ImportError:
        return None


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # installed by other means than Python's
        return "of unknown version"


def _singular_error(matrix: Matrix) -> IllConditionedError:
    return IllConditionedError(
        f"a matrix of order {matrix.shape[0]} is singular or indefinite and cannot be solved with; "
        "check the model's mass and stiffness matrices"
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Dense:
    factor: tuple[FloatArray, bool]
    made_by: str = "LAPACK"

    def solve(self, loads: FloatArray) -> FloatArray:
        return np.asarray(linalg.cho_solve(self.factor, loads))


@dataclass(frozen=True, slots=True, eq=False)
class _Multifrontal:
    factors: CholeskyFactors
    made_by: str = "multifrontal factors of frf_ipz"

    def solve(self, loads: FloatArray) -> FloatArray:
        return self.factors.solve(loads)


@dataclass(frozen=True, slots=True, eq=False)
class _Cholmod:
    factor: Any
    made_by: str

    def solve(self, loads: FloatArray) -> FloatArray:
        return np.asarray(self.factor(loads))


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class _Pardiso:
    solver: Any
    triangle: Any
    made_by: str

    def solve(self, loads: FloatArray) -> FloatArray:
        return np.asarray(self.solver.solve(self.triangle, loads))
