"""Beam elements: rigid-body motion, exact statics, mass, and the limit of slender beams."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from frf_ipz.fe.beam_elements import (
    BeamElements,
    deflection_polynomials,
    geometric_stiffness_matrices,
    mass_matrices,
    rotation_polynomials,
    shear_coefficient,
    stiffness_matrices,
)

ROUNDING = 1e-12  # products of a few numbers of order one
LENGTH = np.array([0.3, 1.7])
PHI = np.array([0.0, 2.5])
ELEMENTS = BeamElements(
    length=LENGTH,
    bending_stiffness=np.array([3.0, 5.0]),
    shear_parameter=PHI,
    mass_per_length=np.array([2.0, 4.0]),
    rotary_inertia_per_length=np.array([0.0, 0.7]),
)
UP = np.array([1.0, 0.0, 1.0, 0.0])


def turned(length):
    """Rotation of the element about its left end by 1 rad of dw/dx: ry is -1."""
    return np.array([0.0, -1.0, length, -1.0])


def test_rigid_body_motion_strains_nothing():
    for matrix, length in zip(stiffness_matrices(ELEMENTS), LENGTH, strict=True):
        for motion in (UP, turned(length)):
            assert np.abs(matrix @ motion).max() <= ROUNDING * np.abs(matrix).max()


def test_a_unit_motion_of_a_dof_is_one_there_and_zero_at_the_other_dofs():
    deflection, rotation = deflection_polynomials(LENGTH, PHI), rotation_polynomials(LENGTH, PHI)
    for place in range(2):
        at_ends = np.stack(
            [deflection[place][:, 0], rotation[place][:, 0], deflection[place].sum(1), rotation[place].sum(1)]
        )
        # the rotation of the section is -ry, and shear turns it against the slope of the deflection
        assert_allclose(at_ends, np.diag([1.0, -1.0, 1.0, -1.0]), rtol=0, atol=ROUNDING)


def test_shapes_are_in_equilibrium_without_load():
    # E I theta'' + kappa G A (w' - theta) = 0 with Phi = 12 E I / (kappa G A L^2), and a constant shear angle
    deflection, rotation = deflection_polynomials(LENGTH, PHI), rotation_polynomials(LENGTH, PHI)
    for place in range(2):
        slope = deflection[place][:, 1:] * [1, 2, 3] / LENGTH[place]
        angle = slope - rotation[place]
        curvature_slope = 2 * rotation[place][:, 2] / LENGTH[place] ** 2
        assert_allclose(angle[:, 1:], 0, rtol=0, atol=ROUNDING / LENGTH[place])
        assert_allclose(
            angle[:, 0], -PHI[place] * LENGTH[place] ** 2 / 12 * curvature_slope, rtol=0, atol=10 * ROUNDING
        )


@pytest.mark.parametrize("phi", [0.0, 0.3, 40.0])
def test_tip_deflection_of_one_cantilevered_element_is_exact(phi):
    length, bending, force = 0.8, 6.0, 2.0
    element = BeamElements(
        length=np.array([length]),
        bending_stiffness=np.array([bending]),
        shear_parameter=np.array([phi]),
        mass_per_length=np.ones(1),
        rotary_inertia_per_length=np.zeros(1),
    )
    free = stiffness_matrices(element)[0][2:, 2:]
    tip, rotation = np.linalg.solve(free, [force, 0.0])
    by_bending = force * length**3 / (3 * bending)
    by_shear = force * length * phi * length**2 / (12 * bending)
    assert_allclose(tip, by_bending + by_shear, rtol=ROUNDING)
    assert_allclose(rotation, -force * length**2 / (2 * bending), rtol=ROUNDING)


def test_mass_of_rigid_motions_is_that_of_a_rigid_bar():
    for matrix, length, mass, inertia in zip(
        mass_matrices(ELEMENTS),
        LENGTH,
        ELEMENTS.mass_per_length,
        ELEMENTS.rotary_inertia_per_length,
        strict=True,
    ):
        assert_allclose(UP @ matrix @ UP, mass * length, rtol=ROUNDING)
        about_the_end = mass * length**3 / 3 + inertia * length
        assert_allclose(turned(length) @ matrix @ turned(length), about_the_end, rtol=ROUNDING)
        assert np.linalg.eigvalsh(matrix).min() > 0


def test_matrices_are_symmetric_to_the_last_bit():
    for matrices in (stiffness_matrices(ELEMENTS), mass_matrices(ELEMENTS), geometric_stiffness_matrices(ELEMENTS)):
        assert (matrices == np.swapaxes(matrices, 1, 2)).all()


def test_mass_matrix_of_euler_bernoulli_is_the_textbook_one():
    length, mass = LENGTH[0], ELEMENTS.mass_per_length[0]
    l2 = length**2
    textbook = np.array(
        [
            [156, 22 * length, 54, -13 * length],
            [22 * length, 4 * l2, 13 * length, -3 * l2],
            [54, 13 * length, 156, -22 * length],
            [-13 * length, -3 * l2, -22 * length, 4 * l2],
        ]
    )
    signs = np.array([1, -1, 1, -1])
    expected = mass * length / 420 * textbook * np.outer(signs, signs)
    assert_allclose(mass_matrices(ELEMENTS)[0], expected, rtol=ROUNDING)


def test_geometric_stiffness_holds_the_energy_of_a_straight_line():
    # an axial force does work on the shortening of the beam, half the integral of the slope squared
    for matrix, length in zip(geometric_stiffness_matrices(ELEMENTS), LENGTH, strict=True):
        assert_allclose(turned(length) @ matrix @ turned(length), length, rtol=ROUNDING)
        assert np.abs(matrix @ UP).max() <= ROUNDING * np.abs(matrix).max()


def test_geometric_stiffness_of_euler_bernoulli_is_the_textbook_one():
    length = LENGTH[0]
    l2 = length**2
    textbook = np.array(
        [
            [36, 3 * length, -36, 3 * length],
            [3 * length, 4 * l2, -3 * length, -l2],
            [-36, -3 * length, 36, -3 * length],
            [3 * length, -l2, -3 * length, 4 * l2],
        ]
    )
    signs = np.array([1, -1, 1, -1])
    expected = textbook / (30 * length) * np.outer(signs, signs)
    assert_allclose(geometric_stiffness_matrices(ELEMENTS)[0], expected, rtol=1e3 * ROUNDING)


def test_shear_coefficient_of_a_rectangle():
    assert_allclose(shear_coefficient(0.0), 10 / 12, rtol=ROUNDING)
    assert_allclose(shear_coefficient(0.3), 13 / 15.3, rtol=ROUNDING)


@pytest.mark.parametrize("thickness", [0.01, 0.3, 1.0, 4.0, 30.0])
@pytest.mark.parametrize("poisson_ratio", [0.0, 0.3, 0.5])
def test_mass_of_isotropic_beams_is_positive_however_thick(thickness, poisson_ratio):
    """Thickness over the length of the element; E, rho and the width are 1."""
    ratio = 2 * (1 + poisson_ratio) / shear_coefficient(poisson_ratio)
    element = BeamElements(
        length=np.ones(1),
        bending_stiffness=np.array([thickness**3 / 12]),
        shear_parameter=np.array([ratio * thickness**2]),
        mass_per_length=np.array([thickness]),
        rotary_inertia_per_length=np.array([thickness**3 / 12]),
    )
    assert np.linalg.eigvalsh(mass_matrices(element)[0]).min() > 0
