"""Lumped models: masses, springs, dampers and the ground."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fe_models import LUMPED_TEXT, read_text_model
from frf_ipz.dofs import Dof
from frf_ipz.errors import InputError
from frf_ipz.fe.eigen import solve_modes

ROUNDING = 1e-12  # a few products


def test_matrices_are_those_of_the_textbook(tmp_path):
    model = read_text_model(tmp_path, LUMPED_TEXT)
    assert model.dofs == (Dof(1, "x"), Dof(2, "x"))
    assert_allclose(model.mass.toarray(), np.diag([2.0, 3.0]), rtol=ROUNDING)
    assert_allclose(model.stiffness.toarray(), [[5e5, -1e5], [-1e5, 1e5]], rtol=ROUNDING)
    assert_allclose(model.damping.toarray(), [[3.0, 0.0], [0.0, 0.0]], rtol=ROUNDING)


def test_two_masses_swing_as_they_should(tmp_path):
    text = LUMPED_TEXT.replace("mass_kg = 3.0", "mass_kg = 2.0").replace("1e5", "4e5")
    frequency = solve_modes(read_text_model(tmp_path, text)).natural_frequency_hz
    golden = np.array([(3 - np.sqrt(5)) / 2, (3 + np.sqrt(5)) / 2])  # m = 2, k = 4e5 twice: k/m times these
    assert_allclose(frequency, np.sqrt(golden * 4e5 / 2) / (2 * np.pi), rtol=ROUNDING)


def test_the_ground_is_a_dof_that_is_held(tmp_path):
    model = read_text_model(tmp_path, LUMPED_TEXT)
    assert model.all_dofs[0] == Dof(0, "x")
    assert model.fixed.tolist() == [True, False, False]
    assert model.geometry.supports == {0: "ground"}
    with pytest.raises(InputError, match="held"):
        model.index(Dof(0, "x"))


def test_without_ground_the_first_mode_is_a_rigid_body(tmp_path):
    model = read_text_model(tmp_path, LUMPED_TEXT.replace("[0, 1]", "[2, 1]"))
    modes = solve_modes(model)
    assert modes.natural_frequency_hz[0] == 0
    assert_allclose(modes.shapes[:, 0].real, 1 / np.sqrt(5.0), rtol=ROUNDING)
    assert Dof(0, "x") not in model.all_dofs


def test_springs_and_masses_are_parts(tmp_path):
    model = read_text_model(tmp_path, LUMPED_TEXT)
    parts = {(part.kind, part.name): part for part in model.parts}
    assert set(parts) == {("point", "mass at node 1"), ("point", "mass at node 2"), ("spring", "k1"), ("spring", "k2")}
    assert parts["spring", "k1"].nodes == (0, 1)
    assert_allclose(parts["spring", "k2"].stiffness, 1e5 * np.array([[1, -1], [-1, 1]]), rtol=ROUNDING)
    assert [model.all_dofs[row].node for row in parts["spring", "k2"].indices] == [1, 2]


def test_masses_stand_in_a_row_and_springs_are_lines(tmp_path):
    geometry = read_text_model(
        tmp_path, LUMPED_TEXT.replace("node = 2", "node = 9").replace("[1, 2]", "[1, 9]")
    ).geometry
    assert geometry.nodes.tolist() == [0, 1, 9]
    assert geometry.coordinates_m[:, 0].tolist() == [0.0, 1.0, 2.0]
    assert geometry.lines.tolist() == [[0, 1], [1, 9]]
    assert geometry.is_schematic


def test_rayleigh_damping_adds_to_the_dampers(tmp_path):
    text = LUMPED_TEXT.replace("[lumped]", "[damping]\nrayleigh = { alpha_1_s = 0.5, beta_s = 1e-5 }\n[lumped]", 1)
    model = read_text_model(tmp_path, text)
    assert_allclose(model.damping.toarray(), [[1 + 5 + 3, -1.0], [-1.0, 1.5 + 1]], rtol=ROUNDING)
    assert model.modal_damping.size == 0
