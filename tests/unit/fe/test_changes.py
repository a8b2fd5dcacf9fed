"""Models with masses, springs, scaled parts and released supports."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fe_models import LUMPED_TEXT, beam, read_text_model, structural_model
from frf_ipz.dofs import Dof
from frf_ipz.errors import InputError
from frf_ipz.fe.changes import (
    part_matrices,
    support_blocks,
    with_default_damping,
    with_point_masses,
    with_released_supports,
    with_scaled_parts,
    with_springs,
)
from frf_ipz.fe.eigen import solve_basis

ROUNDING = 1e-12  # a few sums and products


def test_a_mass_moves_in_every_translation_of_its_node():
    dofs = [Dof(1, "x"), Dof(1, "z"), Dof(1, "rz"), Dof(2, "x")]
    model = with_point_masses(structural_model(np.eye(4), np.eye(4), dofs), {1: 0.25})
    assert_allclose(model.mass.toarray(), np.diag([1.25, 1.25, 1.0, 1.0]), rtol=ROUNDING)
    assert (model.parts[-1].kind, model.parts[-1].nodes) == ("point", (1,))


def test_a_mass_changes_nothing_else():
    plain = beam(left="clamped", modal_ratio=0.01)
    loaded = with_point_masses(plain, {21: 0.004, 7: 0.002})
    assert_allclose((loaded.mass_all - plain.mass_all).sum(), 0.006, rtol=ROUNDING)
    assert (loaded.stiffness_all != plain.stiffness_all).nnz == 0
    assert loaded.parts[:-2] == plain.parts
    assert loaded.source is plain.source
    assert loaded.modal_damping is plain.modal_damping
    assert with_point_masses(plain, {}).mass_all.sum() == plain.mass_all.sum()


def test_a_mass_at_a_held_node_changes_nothing_that_moves():
    model = with_point_masses(beam(left="clamped"), {1: 3.0})
    assert_allclose(model.mass.toarray(), beam(left="clamped").mass.toarray(), rtol=ROUNDING)


@pytest.mark.parametrize(
    ("masses", "message"), [({99: 1.0}, "node 99.*1 to 21"), ({3: -1.0}, "node 3 is -1 kg; give 0 or more")]
)
def test_a_mass_that_cannot_be(masses, message):
    with pytest.raises(InputError, match=message):
        with_point_masses(beam(), masses)


def test_default_damping_is_taken_only_where_the_model_states_none(tmp_path):
    assert with_default_damping(beam(), 0.02).modal_damping.tolist() == [0.02]
    assert with_default_damping(beam(modal_ratio=0.01), 0.02).modal_damping.tolist() == [0.01]
    assert with_default_damping(beam(), None).modal_damping.size == 0
    dashpots = read_text_model(tmp_path, LUMPED_TEXT)
    assert with_default_damping(dashpots, 0.02) is dashpots
    with pytest.raises(InputError, match=r"1\.2 is no damping ratio"):
        with_default_damping(beam(), 1.2)


def test_springs_stand_on_the_diagonal():
    plain = beam()
    model = with_springs(plain, {Dof(3, "z"): 100.0, Dof(5, "ry"): 7.0})
    difference = (model.stiffness_all - plain.stiffness_all).toarray()
    assert_allclose(difference[[4, 9], [4, 9]], [100.0, 7.0], rtol=1e-6)  # of entries of 1e9
    assert np.count_nonzero(np.abs(difference) > 1e-3) == 2


def test_a_released_support_is_the_other_support():
    pinned = with_released_supports(beam(left="clamped"), {Dof(1, "ry"): 0.0})
    assert pinned.fixed.tolist() == beam(left="pinned").fixed.tolist()
    elastic = solve_basis(pinned, n_modes=4).eigenvalues[1:]
    assert_allclose(elastic, solve_basis(beam(left="pinned"), n_modes=4).eigenvalues[1:], rtol=1e-9)


def test_a_very_stiff_spring_acts_like_the_support():
    plain = beam(left="clamped")
    held = with_released_supports(plain, {Dof(1, "ry"): 1e9})
    assert_allclose(solve_basis(held, n_modes=3).eigenvalues, solve_basis(plain, n_modes=3).eigenvalues, rtol=1e-6)


def test_support_blocks_release_as_a_change_of_low_rank():
    # free part of the inverse of the released model's dynamic stiffness = that of the held one, corrected
    model, stiffness, s = beam(left="clamped", elements=6), 30.0, 2j * np.pi * 40.0
    dofs = [Dof(1, "ry")]
    blocks = support_blocks(model, dofs)
    across = blocks.stiffness_across + s**2 * blocks.mass_across
    of_support = blocks.stiffness_held + s**2 * blocks.mass_held + stiffness * np.eye(1)
    held = (s**2 * model.mass + model.stiffness).toarray()
    corrected = np.linalg.inv(held - across @ np.linalg.solve(of_support, across.T))
    soft = with_released_supports(model, {dofs[0]: stiffness})
    whole = np.linalg.inv((s**2 * soft.mass + soft.stiffness).toarray())
    rows = [soft.index(dof) for dof in model.dofs]
    assert_allclose(corrected, whole[np.ix_(rows, rows)], rtol=0, atol=1e-8 * np.abs(whole).max())


def test_only_what_is_held_can_be_released():
    with pytest.raises(InputError, match="2:z of the model 'beam' is not held"):
        with_released_supports(beam(left="clamped"), {Dof(2, "z"): 1.0})
    with pytest.raises(InputError, match="no node 40"):
        support_blocks(beam(left="clamped"), [Dof(40, "z")])


def test_parts_add_up_to_the_model():
    model = beam(left="clamped")
    mass, stiffness = part_matrices(model, "element", [str(number) for number in range(1, 21)])
    assert_allclose(mass.toarray(), model.mass_all.toarray(), rtol=0, atol=ROUNDING * model.mass_all.max())
    assert_allclose(stiffness.toarray(), model.stiffness_all.toarray(), rtol=0, atol=ROUNDING * stiffness.max())


def test_all_elements_twice_as_stiff_are_the_modulus_twice():
    elements = [str(number) for number in range(1, 21)]
    stiffer = with_scaled_parts(beam(left="clamped"), "element", elements, stiffness_ratio=2.0)
    modulus = beam(left="clamped", youngs_modulus_Pa=2 * 69e9)
    assert_allclose(
        stiffer.stiffness.toarray(), modulus.stiffness.toarray(), rtol=0, atol=1e-9 * modulus.stiffness.max()
    )
    assert_allclose(stiffer.mass.toarray(), modulus.mass.toarray(), rtol=0, atol=ROUNDING * modulus.mass.max())
    assert_allclose(stiffer.parts[3].stiffness, modulus.parts[3].stiffness, rtol=1e-9)


def test_a_scaled_part_is_scaled_in_mass_and_in_place():
    model = beam()
    heavier = with_scaled_parts(model, "element", ["4"], mass_ratio=3.0)
    difference = (heavier.mass_all - model.mass_all).toarray()
    assert_allclose(difference[6:10, 6:10], 2 * model.parts[3].mass, rtol=1e-9)
    assert np.count_nonzero(difference) <= 16
    assert (heavier.stiffness_all - model.stiffness_all).count_nonzero() == 0


def test_an_unknown_part_is_refused(tmp_path):
    with pytest.raises(InputError, match="no spring 'k3'; known are k1, k2"):
        part_matrices(read_text_model(tmp_path, LUMPED_TEXT), "spring", ["k3"])
    with pytest.raises(InputError, match="no group 'a'; known are none"):
        with_scaled_parts(beam(), "group", ["a"])
