"""Factors of large matrices, by every means that may be installed."""

import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import linalg, sparse
from scipy.sparse import linalg as linalg_sparse

from fe_models import structural_model
from frf_ipz.dofs import Dof
from frf_ipz.errors import IllConditionedError, InputError
from frf_ipz.fe.eigen import solve_basis
from frf_ipz.numerics import factorization, multifrontal
from frf_ipz.numerics.factorization import DENSE_ORDER, factorize, is_positive_definite, plan_elimination

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


def shuffled_grid():
    shuffled = np.random.default_rng(5).permutation(grid().shape[0])
    return sparse.csc_array(grid()[shuffled][:, shuffled]), nodes()[shuffled]


@pytest.mark.parametrize("has_metis", [True, False])
def test_an_order_of_nodes_keeps_factors_sparse(monkeypatch, has_metis):
    monkeypatch.setattr(multifrontal, "FRONT_OVERHEAD", 0.0)
    if not has_metis:  # there is no wheel for Windows
        monkeypatch.setitem(sys.modules, "pymetis", None)
    for package in ("sksparse.cholmod", "pypardiso"):
        monkeypatch.setitem(sys.modules, package, None)
    matrix, names = shuffled_grid()
    ordered = require_solves(matrix, names).factors.elimination.factor_bytes / np.dtype(float).itemsize
    unordered = linalg_sparse.splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0).L.nnz
    assert ordered < 0.3 * unordered
    assert is_positive_definite(matrix, names)


def test_few_large_fronts_take_the_place_of_many_small_ones(monkeypatch):
    matrix, names = shuffled_grid()
    few = plan_elimination(matrix, names)
    monkeypatch.setattr(multifrontal, "FRONT_OVERHEAD", 0.0)
    assert len(few.fronts) < 0.3 * len(plan_elimination(matrix, names).fronts)


def test_bodies_that_are_not_joined_are_solved_together():
    pair = sparse.csr_array(sparse.block_diag([grid(), 3.0 * grid(), sparse.eye_array(2)]))
    names = np.concatenate([nodes(), nodes() + 1000, [5000, 5001]])
    require_solves(pair, names)


def test_factors_that_do_not_fit_are_refused_before_they_are_computed(monkeypatch):
    monkeypatch.setattr(factorization, "free_memory_bytes", lambda: 1000)
    monkeypatch.setattr(factorization.CholeskyFactors, "of", None)  # is not called
    with pytest.raises(InputError, match=r"factors of 900 DOFs need 0\.0 GB, .* coarser mesh"):
        factorize(grid(), nodes())


def test_what_is_planned_is_what_is_taken():
    elimination = plan_elimination(grid(), nodes())
    factors = multifrontal.CholeskyFactors.of(grid(), elimination)
    assert sum(part.nbytes for part in (*factors.triangles, *factors.rest)) == elimination.factor_bytes
    assert elimination.factor_bytes < elimination.peak_bytes < 3 * elimination.factor_bytes


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
        CholmodNotPositiveDefiniteError = ArithmeticError

        @staticmethod
        def cholesky(matrix):
            formats.append(matrix.format)
            lower = linalg.cho_factor(matrix.toarray(), lower=True)
            return lambda loads: linalg.cho_solve(lower, loads)

    only(sksparse_cholmod=Cholmod)
    require_solves()
    assert formats == ["csc"]


def test_the_present_interface_of_cholmod_is_used(only):
    class Factor:
        def __init__(self, matrix):
            self.lower = linalg.cho_factor(matrix.toarray(), lower=True)

        def solve(self, loads):
            return linalg.cho_solve(self.lower, loads)

    class Newer:
        CholmodNotPositiveDefiniteError = ArithmeticError
        cho_factor = Factor

        @staticmethod
        def cholesky(matrix):
            return matrix, None

    only(sksparse_cholmod=Newer)
    assert require_solves().made_by.startswith("CHOLMOD (scikit-sparse")


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
    assert require_solves().made_by.startswith("PARDISO (pypardiso 0.")
    with pytest.raises(IllConditionedError, match="singular or indefinite"):
        factorize(grid(-0.5), nodes())


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
