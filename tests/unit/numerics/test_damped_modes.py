"""Poles and shapes of a damped model in undamped modes, against the eigenvalue problem of twice the order."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from frf_ipz.numerics import damped_modes as module
from frf_ipz.numerics.damped_modes import damped_modes

ORDER = 40


def model(*, coupling, closest=1.0, seed=0):
    rng = np.random.default_rng(seed)
    omega = 100.0 * np.arange(1, ORDER + 1)
    omega[11] = omega[10] * (1 + 0.1 * closest)
    shared = rng.standard_normal((ORDER, ORDER))
    return omega**2, np.diag(0.01 * omega) + coupling * (shared + shared.T)


def residual(squares, rates, poles, vectors):
    forces = poles**2 * vectors + poles * (rates @ vectors) + squares[:, None] * vectors
    return np.abs(forces).max(axis=0) / np.abs(squares[:, None] * vectors).max(axis=0)


def assert_receptance(squares, rates, poles, vectors, left_vectors):
    for s in (50j, 650j, 3000j):
        exact = np.linalg.inv(s**2 * np.eye(len(squares)) + s * rates + np.diag(squares))
        found = (vectors / (s - poles)) @ left_vectors.T + (vectors.conj() / (s - poles.conj())) @ left_vectors.conj().T
        assert_allclose(found, exact, rtol=0, atol=1e-9 * np.abs(exact).max())


@pytest.mark.parametrize(("coupling", "closest"), [(0.0, 1.0), (0.3, 1.0), (0.3, 1e-3), (0.3, 0.0), (30.0, 1.0)])
def test_poles_are_those_of_the_eigenvalue_problem(coupling, closest):
    squares, rates = model(coupling=coupling, closest=closest)
    poles, vectors, _ = damped_modes(squares, rates)
    expected, _, _ = module._by_eigenvalues(squares, rates)
    assert_allclose(np.sort_complex(poles), np.sort_complex(expected), rtol=1e-10)
    assert residual(squares, rates, poles, vectors).max() < 1e-10


def test_lightly_coupled_modes_need_no_eigenvalue_problem(monkeypatch):
    squares, rates = model(coupling=0.3)
    monkeypatch.setattr(module, "_by_eigenvalues", None)
    assert len(damped_modes(squares, rates)[0]) == ORDER


def test_a_mode_that_is_found_twice_is_refused():
    squares, rates = model(coupling=0.3)
    poles, vectors, _ = damped_modes(squares, rates)
    assert module._are_different(poles, vectors, rates).all()
    twice = [0, 1, 0]
    is_alone = module._are_different(poles[twice], np.ascontiguousarray(vectors[:, twice]), rates)
    assert is_alone.tolist() == [False, True, False]


def test_an_overdamped_mode_has_two_real_poles():
    squares, rates = model(coupling=0.0)
    rates[0, 0] = 4 * np.sqrt(squares[0])
    poles, _, _ = damped_modes(squares, rates)
    assert len(poles) == ORDER + 1
    assert np.count_nonzero(poles.imag == 0) == 2


@pytest.mark.parametrize("coupling", [0.0, 0.3])
@pytest.mark.parametrize("order", [12, ORDER])
def test_roots_that_repeat_and_modes_without_damping_give_the_receptance(coupling, order):
    """A floating body has six modes alike, which damping leaves alone; a square plate has pairs."""
    squares, rates = (part[..., :order] for part in model(coupling=coupling))
    rates = rates[:order].copy()
    squares[:6], rates[:6], rates[:, :6] = 1.0, 1e-14, 1e-14
    squares[7], rates[7] = squares[6], rates[6]
    rates[:, 7] = rates[7]
    rates[7, 7] = rates[6, 6] = max(rates[6, 6], rates[6, 7])
    poles, vectors, left_vectors = damped_modes(squares, rates)
    left_vectors = left_vectors * np.where(poles.imag > 0, 1.0, 0.5)
    assert_receptance(squares, rates, poles, vectors, left_vectors)


def test_modes_that_are_found_by_iteration_give_the_receptance(monkeypatch):
    squares, rates = model(coupling=0.3)
    monkeypatch.setattr(module, "_by_eigenvalues", None)
    poles, vectors, left_vectors = damped_modes(squares, rates)
    assert_receptance(squares, rates, poles, vectors, left_vectors)


@pytest.mark.parametrize("case", ["mixed by damping", "overdamped"])
def test_modes_that_the_iteration_does_not_find_follow_from_what_is_orthogonal_to_the_others(case, monkeypatch):
    squares, rates = model(coupling=0.3, closest=1e-3 if case == "mixed by damping" else 1.0)
    if case == "overdamped":
        rates[0, 0] = 4 * np.sqrt(squares[0])
    expected, _, _ = module._by_eigenvalues(squares, rates)
    found = module._from_undamped(squares, rates)[0]
    assert 0 < len(found) < ORDER
    monkeypatch.setattr(module, "_by_eigenvalues", None)
    poles, vectors, left_vectors = damped_modes(squares, rates)
    assert_allclose(np.sort_complex(poles), np.sort_complex(expected), rtol=1e-10)
    assert residual(squares, rates, poles, vectors).max() < 1e-10
    left_vectors = left_vectors * np.where(poles.imag > 0, 1.0, 0.5)
    assert_receptance(squares, rates, poles, vectors, left_vectors)
