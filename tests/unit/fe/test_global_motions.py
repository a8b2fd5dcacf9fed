"""Motions of the whole structure: rigid bodies strain nothing, slow bending tells the first frequency."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from brick_plate import plate_matrices
from fe_models import beam, structural_model
from frf_ipz.dofs import Dof
from frf_ipz.fe.eigen import _first_shift_hz, _System, solve_modes
from frf_ipz.fe.global_motions import bending_motions, rigid_body_motions

UNSTRAINED = 1e-12  # of the sum of the terms' sizes: rounding
AXES = ("x", "y", "z", "rx", "ry", "rz")


def plate(counts=(9, 7, 2)):
    stiffness, mass, corners = plate_matrices(counts, (0.18, 0.14, 0.01))
    dofs = [Dof(node + 1, axis) for node in range(len(corners)) for axis in "xyz"]
    return structural_model(mass, stiffness, dofs, coordinates_m=corners + np.array([3.0, -2.0, 1.0]))


@pytest.mark.parametrize("model", [plate(), beam(elements=9)], ids=["plate", "beam"])
def test_rigid_bodies_strain_nothing(model):
    motions = rigid_body_motions(model.dofs, model.geometry)
    forces = np.abs(model.stiffness @ motions)
    assert (forces <= UNSTRAINED * (abs(model.stiffness) @ np.abs(motions)).max()).all()
    assert np.linalg.matrix_rank(motions) == (6 if model.kind == "matrices" else 2)


def test_a_rotation_turns_what_has_rotations():
    model = structural_model(
        np.eye(12), np.eye(12), [Dof(node, axis) for node in (1, 2) for axis in AXES], coordinates_m=TWO_NODES
    )
    about_z = rigid_body_motions(model.dofs, model.geometry)[:, 5]
    assert_allclose(about_z[6:], [-1.0, 0.5, 0.0, 0.0, 0.0, 1.0])  # e_z x (0.5, 1, 0), and the turn itself


TWO_NODES = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 0.0]])


def test_bending_turns_the_sections_with_the_slope():
    model = beam(elements=4)
    along_z = bending_motions(model.dofs, model.geometry)[:, 20:]
    x = model.geometry.coordinates_m[:, 0]
    at = x - x.mean()
    bent = [column for column in along_z.T if np.ptp(column[::2]) > 0]
    for column in bent:
        slope = np.polynomial.Polynomial.fit(at, column[::2], 2).deriv()(at)
        assert_allclose(column[1::2], -slope, rtol=0, atol=1e-9 * np.abs(slope).max())
    assert len(bent) == 2  # x and x^2; the others vanish on a line


@pytest.mark.parametrize("model", [plate(), beam(elements=30), beam(elements=30, formulation="euler-bernoulli")])
def test_the_first_frequency_is_guessed_to_a_factor_of_two(model):
    frequency = solve_modes(model, n_modes=8).natural_frequency_hz
    first = frequency[frequency > 0][0]
    guessed = _first_shift_hz(_System.of(model), None) / 0.4
    assert first <= guessed <= 2 * first
