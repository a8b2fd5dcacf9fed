"""Zeros from the poles of a model, against the eigenvalue problem of each FRF."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from frf_ipz.numerics import pole_forms
from frf_ipz.numerics.pencils import damped_zeros, undamped_zeros
from frf_ipz.numerics.pole_forms import damped_form, every_damped_zero, every_undamped_zero, undamped_form

ORDER = 12
FROM = 1e-4  # relative distance of the start from a zero


def matrices(seed=0, *, rigid=False, dashpot=0.0):
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((ORDER, ORDER))
    mass = root @ root.T / ORDER + np.eye(ORDER)
    springs = rng.standard_normal((ORDER - 1 if rigid else ORDER + 3, ORDER))
    if rigid:
        springs -= springs.mean(axis=1, keepdims=True)  # a motion of all DOFs alike strains none
    stiffness = 1e5 * springs.T @ springs
    damper = rng.standard_normal(ORDER)
    return mass, 2e-6 * stiffness + dashpot * np.outer(damper, damper), stiffness


@pytest.fixture
def rows():
    return np.random.default_rng(9).standard_normal((2, ORDER))


def upper_of(values):
    return np.sort_complex(values[values.imag > 0])


def forms(damped, model):
    mass, damping, stiffness = model
    return damped_form(mass, damping, stiffness) if damped else undamped_form(mass, stiffness)


@pytest.mark.parametrize("rigid", [False, True])
@pytest.mark.parametrize("damped", [False, True])
def test_zeros_with_their_vectors_are_those_of_the_pencil(rows, damped, rigid):
    model = matrices(rigid=rigid)
    pencil = damped_zeros(*model, *rows) if damped else undamped_zeros(model[0], model[2], *rows)
    form = forms(damped, model)
    outputs, inputs = (np.tile(row, (len(pencil.values), 1)) for row in rows)
    values, found = form.zeros(outputs, inputs, pencil.values * (1 + FROM))
    roots, exact = form.roots(outputs, inputs, values)
    assert found.all()
    assert exact.all()
    assert_allclose(values, pencil.values, rtol=1e-8)
    moved = roots.left_vectors * roots.right_vectors / roots.slope  # whatever the vectors are normalised to
    expected = pencil.left_vectors * pencil.right_vectors / pencil.slope
    assert np.abs(moved - expected).max() < 1e-6 * np.abs(expected).max()


@pytest.mark.parametrize("end", ["sensor", "force", "both", "node"])
@pytest.mark.parametrize("damped", [False, True])
def test_a_zero_next_to_a_pole_keeps_its_vectors(rows, damped, end):
    """One end sits all but on a node of a mode: zero and pole agree to 12 digits, their difference to none."""
    model = matrices()
    mode = undamped_form(model[0], model[2]).shapes[:, 5]
    moved_to_node = rows - np.outer(rows @ mode, mode @ model[0])
    left_over = np.array({"sensor": [1e-12, 1], "force": [1, 1e-12], "both": [1e-6, 1e-7], "node": [0, 1]}[end])
    rows = moved_to_node + left_over[:, None] * (rows - moved_to_node)
    pencil = damped_zeros(*model, *rows) if damped else undamped_zeros(model[0], model[2], *rows)
    form = forms(damped, model)
    outputs, inputs = (np.tile(row, (len(pencil.values), 1)) for row in rows)
    values, found = form.zeros(outputs, inputs, pencil.values)
    roots, exact = form.roots(outputs, inputs, values)
    assert (found & exact).all()
    moved = roots.left_vectors * roots.right_vectors / roots.slope
    expected = pencil.left_vectors * pencil.right_vectors / pencil.slope
    assert np.abs(moved - expected).max() < 1e-8 * np.abs(expected).max()


def test_the_vectors_of_a_zero_between_two_poles_that_are_one_are_left_to_the_pencil():
    mass, stiffness = np.eye(3), np.diag([1.0, 1.0 + 1e-13, 4.0])
    form = undamped_form(mass, stiffness)
    row = np.ones((1, 3))
    _, exact = form.roots(row, row, np.array([1.0 + 0.5e-13], complex))
    assert not exact.any()


@pytest.mark.parametrize("dashpot", [0.0, 3.0, 300.0, 3e4])
@pytest.mark.parametrize("rigid", [False, True])
def test_every_zero_is_found(rows, rigid, dashpot):
    model = matrices(3, rigid=rigid, dashpot=dashpot)
    for output, force in (rows, (rows[0], rows[0]), np.eye(ORDER)[[0, 5]]):
        (found,) = every_damped_zero(*model, output[None], force[None])
        expected = upper_of(damped_zeros(*model, output, force).values)
        assert_allclose(upper_of(found.values), expected, rtol=1e-7)


@pytest.mark.parametrize("rigid", [False, True])
def test_every_zero_without_damping_is_found_with_its_vectors(rows, rigid):
    """Some are complex, the others are computed in real numbers."""
    mass, _, stiffness = matrices(3, rigid=rigid)
    form = undamped_form(mass, stiffness)
    for output, force in (rows, (rows[0], rows[0]), np.eye(ORDER)[[0, 5]]):
        found, pencil = every_undamped_zero(form, output, force), undamped_zeros(mass, stiffness, output, force)
        found = found.take(np.abs(found.values - pencil.values[:, None]).argmin(axis=1))
        assert_allclose(found.values, pencil.values, rtol=1e-7)
        moved = found.left_vectors * found.right_vectors / found.slope
        expected = pencil.left_vectors * pencil.right_vectors / pencil.slope
        assert np.abs(moved - expected).max() < 1e-6 * np.abs(expected).max()


def test_zeros_of_two_modes_that_are_one_are_left_to_the_pencil(rows):
    mass, stiffness = np.eye(3), np.diag([1.0, 1.0, 4.0])
    found = every_undamped_zero(undamped_form(mass, stiffness), rows[0, :3], rows[1, :3])
    assert_allclose(
        np.sort_complex(found.values), np.sort_complex(undamped_zeros(mass, stiffness, *rows[:, :3]).values), rtol=1e-9
    )


def test_zeros_that_damping_moves_far_are_found_and_mostly_without_the_pencil(rows, monkeypatch):
    """Zeros far from the axis meet and part again: each repels the others on its way."""
    by_pencil, calls = pole_forms._by_pencil, []
    monkeypatch.setattr(pole_forms, "_by_pencil", lambda *args: calls.append(args) or by_pencil(*args))
    for seed in range(12):
        model = matrices(seed, dashpot=3e3)
        (found,) = every_damped_zero(*model, rows[:1], rows[1:])
        assert_allclose(upper_of(found.values), upper_of(damped_zeros(*model, *rows).values), rtol=1e-7)
    assert len(calls) <= 6  # where two meet, rounding decides how they part


@pytest.mark.parametrize("part", [0.2, 0.5, 3.0])
@pytest.mark.parametrize("rigid", [False, True])
def test_zeros_up_to_a_limit_are_those_of_the_pencil_with_their_slopes(rigid, part):
    """A spectrum so wide that a few poles stand for the highest ones."""
    rng = np.random.default_rng(2)
    order = 40
    shapes = rng.standard_normal((order, order)) / np.sqrt(order) + np.eye(order)
    inverse = np.linalg.inv(shapes)
    omega = 100.0 * np.arange(0 if rigid else 1, order + (0 if rigid else 1)) ** 1.5
    mass, damping, stiffness = (
        inverse.T @ np.diag(diagonal) @ inverse for diagonal in (np.ones(order), 0.01 * omega, omega**2)
    )
    mass, damping, stiffness = ((matrix + matrix.T) / 2 for matrix in (mass, damping, stiffness))
    outputs, inputs = rng.standard_normal((2, 5, order))
    inputs[4] = outputs[4]
    model = pole_forms.DampedModel.of(mass, damping, stiffness)
    limit = part * omega[20]
    found = model.zeros_up_to(outputs, inputs, limit)
    for zeros, output, force in zip(found, outputs, inputs, strict=True):
        expected = upper_of(damped_zeros(mass, damping, stiffness, output, force).values)
        assert_allclose(upper_of(zeros), upper_of(expected[np.abs(expected) <= limit]), rtol=1e-6)
        step = 1e-6 * np.abs(zeros)
        values = [
            np.array([output @ np.linalg.solve(s**2 * mass + s * damping + stiffness, force) for s in zeros + side])
            for side in (-step, step)
        ]
        assert_allclose(model.slopes(output, force, zeros), (values[1] - values[0]) / (2 * step), rtol=1e-3)


def test_zeros_that_are_not_all_are_told_from_all(rows):
    mass, damping, stiffness = matrices(dashpot=3e4)
    numerator = pole_forms._Numerator.of(damped_form(mass, damping, stiffness), *rows)
    every = damped_zeros(mass, damping, stiffness, *rows).values
    assert numerator.has_all(every)
    assert not numerator.has_all(every[1:])
    assert not numerator.has_all(np.append(every[1:], every[1] * 1.01))


def test_matrices_that_are_not_symmetric_are_taken_too(rows):
    mass, damping, stiffness = matrices(4)
    stiffness = stiffness + 1e-2 * np.triu(stiffness, 1)
    (found,) = every_damped_zero(mass, damping, stiffness, rows[:1], rows[1:])
    assert_allclose(upper_of(found.values), upper_of(damped_zeros(mass, damping, stiffness, *rows).values), rtol=1e-9)
