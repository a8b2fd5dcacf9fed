"""Masses at nodes that an update finds, and what it says of them."""

from types import SimpleNamespace

import numpy as np
import pytest

import frf_ipz
from clamped_beam import BEAM
from frf_ipz.updating.local_masses import find_local_masses, local_mass_notes
from frf_ipz.updating.methods import minimal_change
from frf_ipz.updating.parameters import make_structural_basis

LINES = np.arange(5.0, 2000.0, 2.0)
OUTPUTS, FORCE, POINT = ("9:+z", "16:+z", "21:+z"), "12:+z", "18:+z"
NOISE = 2e-4  # of the root mean square of an FRF


def labels(outputs):
    return [frf_ipz.FrfLabel(output, FORCE, "accelerance") for output in outputs]


@pytest.fixture(scope="module")
def beam():
    return frf_ipz.make_beam(**BEAM)


def updated_to(model, machine):
    """Update a model to a machine, and give the errors of a point beside node 17 in dB with its band."""
    values = frf_ipz.compute_frfs(machine, labels(OUTPUTS), 2j * np.pi * LINES)
    rng = np.random.default_rng(3)
    std = NOISE * np.sqrt(np.mean(np.abs(values) ** 2, axis=0))
    noisy = values + std / np.sqrt(2) * (rng.normal(size=values.shape) + 1j * rng.normal(size=values.shape))
    variance = np.broadcast_to(std**2, values.shape)[:, :, None]
    frfs = frf_ipz.FrfSet.from_arrays(LINES, noisy[:, :, None], outputs=OUTPUTS, inputs=[FORCE], variance=variance)
    fit = frf_ipz.fit_modes(frfs)
    reduced = frf_ipz.reduce_model(fit, model, points=[POINT])
    options = frf_ipz.UpdateOptions(expand=False)
    updated = frf_ipz.update_model(fit, reduced, fe_model=model, options=options)
    prediction = frf_ipz.predict_frfs(fit, updated, points=[POINT])
    truth = np.abs(frf_ipz.compute_frfs(machine, labels([POINT]), 2j * np.pi * prediction.frequency_hz))
    return updated, prediction, truth


@pytest.fixture(scope="module")
def loaded(beam):
    clamp = frf_ipz.BeamPointMass(node=17, mass_kg=0.002)
    return updated_to(beam, frf_ipz.make_beam(**BEAM, point_mass=[clamp]))


def test_a_mass_at_a_node_that_is_not_measured_is_found(loaded):
    updated, _, _ = loaded
    row = updated.nominal.row(frf_ipz.Dof(17, "z"))
    added = row @ np.linalg.inv(updated.nominal.mass)
    change = added @ (updated.model.mass - updated.nominal.mass) @ added / (added @ row) ** 2
    assert change == pytest.approx(0.002, rel=0.4)


def test_a_mass_that_is_found_is_said(loaded):
    updated, _, _ = loaded
    (said,) = [text for text in updated.warnings if "that the model lacks" in text]
    assert "at node 17" in said


def test_the_band_of_a_point_beside_a_mass_holds_the_truth(loaded):
    _, prediction, truth = loaded
    inside = (truth >= prediction.magnitude_low) & (truth <= prediction.magnitude_high)
    assert inside.mean() > 0.85
    off_db = 20 * np.log10(np.abs(prediction.values) / truth)
    assert np.median(np.abs(off_db)) < 0.25


def test_a_sound_model_names_no_mass(beam):
    updated, prediction, _ = updated_to(beam, frf_ipz.make_beam(**{**BEAM, "youngs_modulus_Pa": 71e9}))
    assert not [text for text in updated.warnings if "that the model lacks" in text]
    assert np.abs(updated.model.mass - updated.nominal.mass).max() < 1e-2 * np.abs(updated.nominal.mass).max()
    assert np.median(10 * np.log10(prediction.magnitude_high / prediction.magnitude_low)) < 0.15


@pytest.mark.parametrize(("mass_kg", "n_updates"), [(0.0, 1), (0.002, 2)])
def test_an_update_with_masses_is_made_only_where_the_one_without_them_promises_one(
    beam, monkeypatch, mass_kg, n_updates
):
    made, drawn = [], []
    solve, draw = minimal_change._solve_with_masses, minimal_change.draw_whitened

    def counted(problem, *further):
        made.append(len(problem.basis.at_nodes))
        return solve(problem, *further)

    def noted(*given):
        drawn.append(given)
        return draw(*given)

    monkeypatch.setattr(minimal_change, "_solve_with_masses", counted)
    monkeypatch.setattr(minimal_change, "draw_whitened", noted)
    masses = [frf_ipz.BeamPointMass(node=17, mass_kg=mass_kg)] if mass_kg else []
    updated_to(beam, frf_ipz.make_beam(**{**BEAM, "youngs_modulus_Pa": 71e9}, point_mass=masses))
    assert [bool(count) for count in made] == [False, True][:n_updates]
    assert len(drawn) == n_updates - 1  # without masses at nodes there is none to be named


def test_parameters_are_left_out_without_copies_of_matrices(beam):
    """Masses of sensors come after those at nodes: none of the two changes the stiffness."""
    frfs = frf_ipz.FrfSet.from_arrays(LINES, np.ones((len(LINES), 3, 1)), outputs=OUTPUTS, inputs=[FORCE])
    basis = make_structural_basis(beam, frf_ipz.reduce_model(frfs, beam), sensors=OUTPUTS)
    for left_out in (list(basis.at_nodes), list(basis.attached[:1]), [*basis.at_nodes, basis.attached[1]]):
        fewer = basis.without(left_out)
        stays = np.delete(np.arange(len(basis.names)), left_out)
        assert np.shares_memory(fewer.stiffness, basis.stiffness)
        for name in ("mass", "damping", "stiffness"):
            assert np.array_equal(getattr(fewer, name), getattr(basis, name)[stays])


def test_one_of_many_masses_of_nothing_is_hardly_ever_named(beam):
    reduced = frf_ipz.reduce_model(
        frf_ipz.FrfSet.from_arrays(LINES, np.ones((len(LINES), 3, 1)), outputs=OUTPUTS, inputs=[FORCE]), beam
    )
    basis = make_structural_basis(beam, reduced)
    without = basis.without(list(basis.at_nodes))
    assert not any("mass at node" in name for name in without.names)
    assert np.shares_memory(without.stiffness, basis.stiffness)  # matrices of hundreds of parameters are large
    rng = np.random.default_rng(5)
    draws = rng.standard_normal((400, 200, len(basis.names))) + rng.standard_normal((400, 1, len(basis.names)))
    named = np.mean([len(find_local_masses(basis, of_one)) > 0 for of_one in draws])
    assert 0.01 < named < 0.12
    found = find_local_masses(basis, draws[0] + 9.0)
    assert len(found)
    assert (found.mass_kg_low < found.mass_kg).all()
    assert (found.mass_kg < found.mass_kg_high).all()
    assert not len(find_local_masses(basis, draws[0][:0]))
    (said,) = local_mass_notes(found, n_without_counterpart=2)
    assert "2 measured poles have no counterpart, so that they may stand for something else that is missing" in said


@pytest.mark.parametrize(
    ("unloaded", "loaded", "is_taken"), [(True, True, True), (True, False, False), (False, False, True)]
)
def test_masses_of_an_update_that_has_not_converged_are_not_taken_for_one_that_has(
    monkeypatch, unloaded, loaded, is_taken
):
    """Without masses, then with them: the evidence of the second is larger, as far as its last step tells."""
    names = {"local_masses": [1], "problem": None}
    updates = [
        SimpleNamespace(has_converged=converged, log_evidence=evidence, **names)
        for converged, evidence in ((unloaded, 1.0), (loaded, 2.0))
    ]
    monkeypatch.setattr(minimal_change, "_solve_with_masses", lambda *_: updates.pop(0))
    monkeypatch.setattr(minimal_change, "_promises_masses", lambda *_: True)
    monkeypatch.setattr(minimal_change, "replace", lambda problem, **_: problem)
    basis = SimpleNamespace(at_nodes={0: 7}, without=lambda _: None)
    with_masses = updates[1]
    taken = minimal_change._likelier(SimpleNamespace(basis=basis), None, None, None)
    assert (taken is with_masses) == is_taken
