"""Elements of the random structures against closed formulas, and what a seed stands for."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from frf_testbench.updating.random_structures import (
    LARGEST_ERROR,
    bending_element,
    draw_structure,
    frame_element,
    plate_element,
)

ROUNDING = 1e-9  # relative: a few products in double precision


def test_a_bending_element_has_the_compliance_of_a_cantilever():
    stiffness, _ = bending_element(50.0, 0.3, 0.4)
    deflection, rotation = np.linalg.solve(stiffness[2:, 2:], [1.0, 0.0])
    assert_allclose(deflection, 0.4**3 / (3 * 50.0), rtol=ROUNDING)
    assert_allclose(rotation, -(0.4**2) / (2 * 50.0), rtol=ROUNDING)  # ry = -dw/dx


def rigid_motions(corners):
    """Translation and both tilts of a plate as DOFs z, rx = dw/dy, ry = -dw/dx of its nodes."""
    return np.array([[value for x, y in corners for value in motion(x, y)] for motion in (lift, tilt_x, tilt_y)])


def lift(_x, _y):
    return 1.0, 0.0, 0.0


def tilt_x(_x, y):
    return y, 1.0, 0.0


def tilt_y(x, _y):
    return x, 0.0, -1.0


def test_a_plate_element_moves_as_a_rigid_body_without_strain_and_with_its_mass():
    a, b, area_density = 0.3, 0.2, 7.0
    stiffness, mass = plate_element(100.0, area_density, a, b)
    motions = rigid_motions([(0, 0), (a, 0), (a, b), (0, b)])
    assert_allclose(motions @ stiffness, 0, atol=ROUNDING * np.abs(stiffness).max())
    moments = np.array([[1, b / 2, a / 2], [b / 2, b**2 / 3, a * b / 4], [a / 2, a * b / 4, a**2 / 3]])
    assert_allclose(motions @ mass @ motions.T, area_density * a * b * moments, rtol=ROUNDING)


@pytest.mark.parametrize("angle", [0.0, 0.7, np.pi / 2])
def test_a_frame_element_stretches_by_its_axial_stiffness_whatever_its_direction(angle):
    step = 0.5 * np.array([np.cos(angle), np.sin(angle)])
    stiffness, mass = frame_element(2e11, 7800.0, 0.03, 0.01, step)
    pull = np.array([0, 0, 0, *(step / 0.5), 0])
    assert_allclose(pull @ stiffness @ pull, 2e11 * 0.03 * 0.01 / 0.5, rtol=ROUNDING)
    rotation = np.array([0, 0, 1.0, step[1], -step[0], 1.0])  # about the first node: x' = z ry, z' = -x ry
    assert_allclose(stiffness @ rotation, 0, atol=ROUNDING * np.abs(stiffness).max())
    shift = np.array([1.0, 0, 0, 1.0, 0, 0])
    assert_allclose(shift @ mass @ shift, 7800.0 * 0.03 * 0.01 * 0.5, rtol=ROUNDING)


def test_a_seed_stands_for_one_structure_whose_stiffness_is_off_and_whose_mass_is_right():
    kinds = set()
    for seed in range(30):
        structure, again = draw_structure(seed), draw_structure(seed)
        assert structure.name == again.name
        assert (structure.true_model.stiffness != again.true_model.stiffness).nnz == 0
        assert (structure.true_model.mass != structure.nominal_model.mass).nnz == 0
        pairs = zip(structure.true_model.parts, structure.nominal_model.parts, strict=True)
        factors = np.array([true.stiffness[0, 0] / nominal.stiffness[0, 0] for true, nominal in pairs])
        assert np.abs(factors - 1).max() > 0
        assert np.all(factors < (1 + LARGEST_ERROR) ** 4)
        assert not set(structure.points) & set(structure.sensors)
        kinds.add(structure.nominal_model.name)
    assert kinds == {"beam", "frame", "plate"}
