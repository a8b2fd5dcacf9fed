"""An update that makes the agreement with the measured FRFs worse is not kept."""

from dataclasses import replace

import numpy as np
import pytest

import frf_ipz
from frf_ipz.updating.fall_back import keep_if_better

LINES_HZ = np.arange(5, 400.0, 1.0)
TIP, MIDDLE = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
POINT = "9:+z"


@pytest.fixture(scope="module")
def case():
    beam = frf_ipz.make_beam(
        length_m=0.5,
        width_m=0.02,
        thickness_m=0.005,
        youngs_modulus_Pa=70e9,
        density_kg_m3=2700,
        elements=10,
        left="clamped",
        modal_ratio=0.01,
    )
    labels = [frf_ipz.FrfLabel(output, TIP, frf_ipz.FrfQuantity.ACCELERANCE) for output in (MIDDLE, TIP)]
    values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * LINES_HZ)[:, :, None]
    frfs = frf_ipz.FrfSet.from_arrays(
        LINES_HZ, values, outputs=[MIDDLE, TIP], inputs=[TIP], variance=np.full(values.shape, 1e-4)
    )
    fit = frf_ipz.fit_modes(frfs)
    reduced = frf_ipz.reduce_model(fit, beam, points=[POINT])
    return fit, frf_ipz.update_model(fit, reduced, fe_model=beam)


def stiffer(model, factor):
    return replace(model, stiffness=factor * model.stiffness)


def test_the_nominal_model_is_taken_where_the_update_is_farther_off(case):
    fit, updated = case
    model = stiffer(updated.nominal, 1.1)
    shift = np.stack([0 * model.mass, 0 * model.mass, model.stiffness - updated.model.stiffness])
    worse = replace(updated, model=model, ensemble=updated.ensemble + shift)
    kept = keep_if_better(worse, fit)
    assert kept.status is frf_ipz.UpdateStatus.NO_BETTER
    assert kept.model is updated.nominal
    np.testing.assert_array_equal(kept.after, updated.before)
    (text,) = set(kept.warnings) - set(updated.warnings)
    assert "dB off the measured FRFs (median), without it" in text
    prediction = frf_ipz.predict_frfs(fit, kept, points=[POINT])
    inside = (abs(prediction.values) >= prediction.magnitude_low) & (
        abs(prediction.values) <= prediction.magnitude_high
    )
    assert inside.mean() > 0.9  # the ensemble lies around the nominal model, not around what was discarded
    assert np.linalg.eigvalsh(kept.ensemble[:, 0]).min() > 0


def test_an_update_that_is_nearer_is_kept(case):
    fit, updated = case
    better = replace(updated, nominal=stiffer(updated.nominal, 1.1))
    assert keep_if_better(better, fit) is better


def test_what_the_noise_hides_is_no_reason(case):
    fit, updated = case
    noisy = replace(fit, value_std=np.abs(fit.model(2j * np.pi * fit.frequency_hz)) * 0.5)
    slightly = replace(updated, model=stiffer(updated.nominal, 1.01))
    assert keep_if_better(slightly, fit) is not slightly
    assert keep_if_better(slightly, noisy) is slightly


def heavier(model, factor):
    return replace(model, mass=factor * model.mass, damping=factor * model.damping, stiffness=factor * model.stiffness)


def test_an_update_that_moves_the_level_of_frfs_that_were_right_is_not_kept(case):
    fit, updated = case
    bent = replace(updated, model=heavier(updated.nominal, 1.08), scale=replace(updated.scale, level=1.08))
    kept = keep_if_better(bent, fit)
    assert kept.model is updated.nominal
    assert "dB off the measured FRFs (median), without it" in kept.warnings[-1]


def test_a_level_that_both_have_wrong_is_no_work_of_the_update(case):
    fit, updated = case
    louder = replace(fit, model=replace(fit.model, residues=1.5 * fit.model.residues))
    scale = replace(updated.scale, level=1.5)
    better = replace(updated, nominal=stiffer(updated.nominal, 1.1), scale=scale, nominal_scale=scale)
    assert keep_if_better(better, louder) is better
    heavy = replace(updated, nominal=heavier(updated.nominal, 1.08), nominal_scale=replace(scale, level=1.08))
    assert keep_if_better(heavy, fit) is heavy
