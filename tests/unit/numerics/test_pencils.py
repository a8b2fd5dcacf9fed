"""Poles and zeros of matrix pencils: against the determinant they are roots of, and their derivatives."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from chains import random_matrices
from frf_ipz.errors import NumericalError
from frf_ipz.numerics.pencils import (
    complement,
    damped_poles,
    damped_sensitivity,
    damped_zeros,
    undamped_poles,
    undamped_sensitivity,
    undamped_zeros,
)

ORDER = 5
VANISHES = 1e-10  # of the FRF's size beside the zero: rounding of QZ times the condition of the pencil
STEP = 1e-6  # of the norm of a matrix: the difference quotient is off by the square of it and by rounding over it
SLOPES = 1e-6  # relative, of central differences with that step


@pytest.fixture(params=[True, False], ids=["symmetric", "not symmetric"])
def matrices(request):
    return random_matrices(np.random.default_rng(3), ORDER, symmetric=request.param)


@pytest.fixture
def rows():
    rng = np.random.default_rng(4)
    return rng.standard_normal(ORDER), rng.standard_normal(ORDER)


def dynamic(matrices, s):
    mass, damping, stiffness = matrices
    return s**2 * mass + s * damping + stiffness


def receptance(matrices, rows, s):
    return rows[0] @ np.linalg.solve(dynamic(matrices, s), rows[1])


def test_poles_make_the_dynamic_stiffness_singular(matrices):
    roots = damped_poles(*matrices)
    assert len(roots.values) == 2 * ORDER
    for value in roots.values:
        singular = np.linalg.svd(dynamic(matrices, value), compute_uv=False)
        assert singular[-1] < VANISHES * singular[0]


def test_vectors_belong_to_their_poles_from_both_sides(matrices):
    roots = damped_poles(*matrices)
    for value, right, left, slope in zip(
        roots.values, roots.right_vectors.T, roots.left_vectors.T, roots.slope, strict=True
    ):
        whole = dynamic(matrices, value)
        assert np.linalg.norm(whole @ right) < VANISHES * np.linalg.norm(whole) * np.linalg.norm(right)
        assert np.linalg.norm(left @ whole) < VANISHES * np.linalg.norm(whole) * np.linalg.norm(left)
        assert_allclose(slope, left @ (2 * value * matrices[0] + matrices[1]) @ right, rtol=1e-9)


def test_the_frf_vanishes_at_its_zeros_and_nowhere_else(matrices, rows):
    zeros = damped_zeros(*matrices, *rows).values
    assert len(zeros) == 2 * ORDER - 2
    for zero in zeros:
        nearby = abs(receptance(matrices, rows, zero * 1.1))
        assert abs(receptance(matrices, rows, zero)) < VANISHES * nearby
    s = 0.3 + 2j
    gain = receptance(matrices, rows, s) * np.prod(s - damped_poles(*matrices).values) / np.prod(s - zeros)
    test_s = -1 + 9j
    expected = gain * np.prod(test_s - zeros) / np.prod(test_s - damped_poles(*matrices).values)
    assert_allclose(receptance(matrices, rows, test_s), expected, rtol=1e-9)


def test_zeros_at_infinity_are_omitted():
    mass, damping, stiffness = np.diag([1.0, 2.0, 3.0]), np.zeros((3, 3)), np.diag([3.0, 4.0, 2.0])
    stiffness[[0, 1, 1, 2], [1, 0, 2, 1]] = -1.0
    # from one end of a chain of three to the other nothing cancels: the FRF is 1 over a polynomial
    assert len(damped_zeros(mass, damping, stiffness, np.eye(3)[0], np.eye(3)[2]).values) == 0


def test_undamped_roots_are_the_squares_of_damped_ones_without_damping(rows):
    mass, _, stiffness = random_matrices(np.random.default_rng(5), ORDER)
    none = np.zeros_like(mass)
    squares = undamped_poles(mass, stiffness).values
    poles = damped_poles(mass, none, stiffness).values
    assert_allclose(np.sort(poles.imag[poles.imag > 0] ** 2), np.sort(squares.real), rtol=1e-9)
    zeros = undamped_zeros(mass, stiffness, *rows).values
    damped = np.sort_complex(-(damped_zeros(mass, none, stiffness, *rows).values ** 2))
    assert_allclose(damped.real, np.sort_complex(np.repeat(zeros, 2)).real, rtol=1e-6)  # pairs of equal squares


def test_undamped_shapes_are_mass_normalised():
    mass, _, stiffness = random_matrices(np.random.default_rng(6), ORDER)
    shapes = undamped_poles(mass, stiffness).right_vectors.real
    assert_allclose(shapes.T @ mass @ shapes, np.eye(ORDER), rtol=0, atol=1e-12)


def moved(compute, matrices, directions, part):
    """Central difference of the roots when one matrix moves in one direction."""
    step = STEP * np.linalg.norm(matrices[part])
    ends = []
    for sign in (1, -1):
        changed = list(matrices)
        changed[part] = matrices[part] + sign * step * directions[0]
        ends.append(compute(changed).values)
    nominal = compute(list(matrices)).values
    forward, back = (end[np.argmin(np.abs(end[:, None] - nominal), axis=0)] for end in ends)
    return (forward - back) / (2 * step)


@pytest.mark.parametrize("part", [0, 1, 2], ids=["mass", "damping", "stiffness"])
@pytest.mark.parametrize("what", ["poles", "zeros"])
def test_damped_sensitivities_against_differences(matrices, rows, part, what):
    compute = {"poles": lambda m: damped_poles(*m), "zeros": lambda m: damped_zeros(*m, *rows)}[what]
    direction = np.random.default_rng(7).standard_normal((1, ORDER, ORDER))
    keyword = ("mass", "damping", "stiffness")[part]
    sensitivity = damped_sensitivity(compute(list(matrices)), **{keyword: direction})[:, 0]
    expected = moved(compute, matrices, direction, part)
    assert np.abs(sensitivity - expected).max() < SLOPES * np.abs(expected).max()


@pytest.mark.parametrize("part", [0, 2], ids=["mass", "stiffness"])
@pytest.mark.parametrize("what", ["poles", "zeros"])
def test_undamped_sensitivities_against_differences(rows, part, what):
    matrices = random_matrices(np.random.default_rng(8), ORDER)
    compute = {
        "poles": lambda m: undamped_poles(m[0], m[2]),
        "zeros": lambda m: undamped_zeros(m[0], m[2], *rows),
    }[what]
    direction = np.random.default_rng(9).standard_normal((1, ORDER, ORDER))
    direction = direction + direction.transpose(0, 2, 1)
    nothing = np.zeros_like(direction)
    derivatives = (nothing, direction) if part == 0 else (direction, None)
    sensitivity = undamped_sensitivity(compute(list(matrices)), *derivatives)[:, 0]
    expected = moved(compute, matrices, direction, part)
    assert np.abs(sensitivity - expected).max() < SLOPES * np.abs(expected).max()


def test_the_complement_is_orthonormal_and_orthogonal_to_the_row(rows):
    basis = complement(rows[0])
    assert basis.shape == (ORDER, ORDER - 1)
    assert_allclose(basis.T @ basis, np.eye(ORDER - 1), rtol=0, atol=1e-14)
    assert np.abs(rows[0] @ basis).max() < 1e-14 * np.linalg.norm(rows[0])


def test_roots_scale_with_the_unit_of_time(matrices):
    mass, damping, stiffness = matrices
    faster = damped_poles(mass, 1e4 * damping, 1e8 * stiffness).values
    slower = damped_poles(mass, damping, stiffness).values
    upper = [np.sort_complex(1j * values[values.imag > 0]) for values in (faster, slower)]
    assert_allclose(upper[0], 1e4 * upper[1], rtol=1e-9)


def test_a_mass_that_is_not_positive_is_refused():
    with pytest.raises(NumericalError, match="not positive definite"):
        undamped_poles(np.diag([1.0, -1.0]), np.eye(2))


def test_a_single_mass_has_no_zeros():
    one = np.array([[2.0]])
    for roots in (damped_zeros(one, one, one, one[0], one[0]), undamped_zeros(one, one, one[0], one[0])):
        assert len(roots.values) == 0
        assert roots.right_vectors.shape == (1, 0)
        assert damped_sensitivity(roots, mass=one[None]).shape == (0, 1)


def test_between_two_masses_only_the_damper_makes_a_zero():
    mass, stiffness, damping = (
        np.diag([2.0, 3.0]),
        np.array([[5.0, -4.0], [-4.0, 6.0]]),
        np.array([[1.0, -0.5], [-0.5, 1.0]]),
    )
    first, second = np.eye(2)
    assert_allclose(damped_zeros(mass, damping, stiffness, first, second).values, [-8.0])  # k + s c = 0
    assert len(damped_zeros(mass, 0.0 * damping, stiffness, first, second).values) == 0
