"""Factors of large matrices, by every means that may be installed."""

import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import linalg, sparse
from scipy.sparse import linalg as linalg_sparse

from fe_models import structural_model
from frf_ipz.dofs import Dof
from frf_ipz.errors import IllConditionedError
from frf_ipz.fe.eigen import solve_basis
from frf_ipz.numerics import factorization
from frf_ipz.numerics.factorization import DENSE_ORDER, factorize, is_positive_definite

SOLVED = 1e-10  # relative error of a solution: condition numbers here are below 1e4
NODES_ACROSS, NODES_ALONG, PER_NODE = 15, 30, 2


def grid(shift=0.1):
    """Stiffness of a grid of springs, with two DOFs a node that are coupled a little."""
    across, along = (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1) for n in (NODES_ACROSS, NODES_ALONG))
    plane = sparse.kron(along, np.eye(NODES_ACROSS)) + sparse.kron(np.eye(NODES_ALONG), across)
    stiffness = sparse.kron(plane + shift * sparse.eye_array(plane.shape[0]), [[1.0, 0.2], [0.2, 1.5]])
    return sparse.csr_array(stiffness)


def nodes():
    return np.repeat(np.arange(NODES_ACROSS * NODES_ALONG), PER_NODE)


@pytest.fixture
def only(monkeypatch):
    """Let only some of the optional packages be found."""

    def allow(**packages):
        monkeypatch.setattr(factorization, "_import_optional", lambda name: packages.get(name.replace(".", "_")))

    return allow


def require_solves(matrix=None, names=None):
    matrix = grid() if matrix is None else matrix
    assert matrix.shape[0] > DENSE_ORDER
    loads = np.random.default_rng(3).standard_normal((matrix.shape[0], 4))
    factor = factorize(matrix, nodes() if names is None else names)
    expected = linalg.solve(matrix.toarray(), loads)
    assert_allclose(factor.solve(loads), expected, rtol=0, atol=SOLVED * np.abs(expected).max())
    assert_allclose(factor.solve(loads[:, 0]), expected[:, 0], rtol=0, atol=SOLVED * np.abs(expected).max())
    return factor


def test_metis_keeps_the_factor_sparse(only):
    only(pymetis=pytest.importorskip("pymetis"))
    ordered = require_solves().factor.nnz
    shuffled = np.random.default_rng(5).permutation(grid().shape[0])
    matrix = sparse.csc_array(grid()[shuffled][:, shuffled])
    unordered = linalg_sparse.splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0).nnz
    assert ordered < 0.2 * unordered


def test_without_metis_the_ordering_of_superlu_does(monkeypatch):
    # there is no wheel for Windows
    for package in ("pymetis", "sksparse.cholmod", "pypardiso"):
        monkeypatch.setitem(sys.modules, package, None)
    shuffled = np.random.default_rng(5).permutation(grid().shape[0])
    matrix = sparse.csc_array(grid()[shuffled][:, shuffled])
    factor = require_solves(matrix, nodes()[shuffled]).factor
    unordered = linalg_sparse.splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0)
    assert factor.nnz < 0.2 * unordered.nnz
    assert is_positive_definite(matrix, nodes()[shuffled])


def test_one_node_need_not_be_in_one_piece(only):
    # rows of a node may lie apart, and numbers of nodes may have gaps
    only(pymetis=pytest.importorskip("pymetis"))
    shuffled = np.random.default_rng(4).permutation(grid().shape[0])
    matrix, names = grid()[shuffled][:, shuffled], 10 * nodes()[shuffled] + 3
    load = np.ones(matrix.shape[0])
    assert_allclose(matrix @ factorize(matrix, names).solve(load), load, rtol=SOLVED)


def test_cholmod_is_used_where_it_is_installed(only):
    formats = []

    class Cholmod:
        @staticmethod
        def cholesky(matrix):
            formats.append(matrix.format)
            lower = linalg.cho_factor(matrix.toarray(), lower=True)
            return lambda loads: linalg.cho_solve(lower, loads)

    only(sksparse_cholmod=Cholmod)
    require_solves()
    assert formats == ["csc"]


def test_another_interface_of_cholmod_is_not_used(only):
    class Newer:
        @staticmethod
        def cholesky(matrix):
            return matrix.toarray(), None

    only(sksparse_cholmod=Newer)
    require_solves()


def test_pardiso_is_used_where_it_is_installed_and_gives_back_its_memory(only):
    log = []

    class Solver:
        def __init__(self, mtype):
            log.append(mtype)

        def factorize(self, matrix):
            self.matrix = matrix.toarray()
            log.append("upper" if not np.tril(self.matrix, -1).any() else "full")

        def solve(self, matrix, loads):
            full = matrix.toarray()
            return linalg.solve(full + np.triu(full, 1).T, loads)

        def free_memory(self, *, everything):
            log.append(f"freed {everything}")

    class Pardiso:
        PyPardisoSolver = Solver

    only(pypardiso=Pardiso)
    factor = require_solves()
    del factor
    assert log == [2, "upper", "freed True"]


def test_real_pardiso_solves():
    pytest.importorskip("pypardiso", reason="pypardiso is an extra with a licence of its own")
    require_solves()


def test_small_matrices_are_solved_in_full():
    matrix = grid()[:40][:, :40]
    assert_allclose(factorize(matrix, nodes()[:40]).solve(np.ones(40)), linalg.solve(matrix.toarray(), np.ones(40)))


@pytest.mark.parametrize("order", [40, DENSE_ORDER + 100])
def test_a_singular_matrix_is_refused(order, only):
    only()
    matrix = grid()[:order][:, :order].tolil()
    matrix[:, 5] = 0
    matrix[5, :] = 0
    with pytest.raises(IllConditionedError, match=f"order {order} is singular"):
        factorize(sparse.csr_array(matrix), nodes()[:order])


@pytest.mark.parametrize(("shift", "answer"), [(0.1, True), (-0.1, False), (-5.0, False)])
def test_definiteness_follows_from_the_pivots(shift, answer):
    assert is_positive_definite(grid(shift), nodes()) is answer


def test_a_matrix_with_zeros_on_the_diagonal_is_not_positive_definite():
    matrix = sparse.csr_array(sparse.kron(np.eye(400), [[0.0, 1.0], [1.0, 0.0]]))
    assert not is_positive_definite(matrix, np.arange(800))


@pytest.mark.parametrize("has_metis", [True, False])
def test_large_and_small_take_the_same_modes(monkeypatch, has_metis):
    if not has_metis:
        monkeypatch.setitem(sys.modules, "pymetis", None)
    dofs = [Dof(int(node) + 1, "xy"[place % 2]) for place, node in enumerate(nodes())]
    model = structural_model(sparse.eye_array(len(dofs)), grid(), dofs)
    large = solve_basis(model, n_modes=5)
    monkeypatch.setattr("frf_ipz.fe.eigen.DENSE_ORDER", len(dofs) + 1)
    small = solve_basis(model, n_modes=5)
    assert_allclose(large.eigenvalues, small.eigenvalues, rtol=SOLVED)
