"""Bands widen by what the updated model misses where it was measured, and hold the truth where it was not."""

from dataclasses import replace

import numpy as np
import pytest

import frf_ipz
from clamped_beam import BEAM
from frf_ipz.prediction import ensemble
from frf_ipz.updating.scale import MeasuredScale

LINES = np.arange(5.0, 700.0, 0.5)
OUTPUTS, INPUTS, POINT = ("9:+z", "16:+z", "21:+z"), ("12:+z",), "18:+z"
NOISE = 1e-3  # of the root mean square of an FRF


def labels(outputs):
    return [frf_ipz.FrfLabel(output, source, "accelerance") for output in outputs for source in INPUTS]


def predict(machine, *, seed=0):
    """Predict the point from FRFs of a machine, and give the truth."""
    values = frf_ipz.compute_frfs(machine, labels(OUTPUTS), 2j * np.pi * LINES)
    rng = np.random.default_rng(seed)
    std = NOISE * np.sqrt(np.mean(np.abs(values) ** 2, axis=0))
    noisy = values + std / np.sqrt(2) * (rng.normal(size=values.shape) + 1j * rng.normal(size=values.shape))
    frfs = frf_ipz.FrfSet.from_arrays(
        LINES,
        noisy[:, :, None],
        outputs=OUTPUTS,
        inputs=INPUTS,
        variance=np.broadcast_to(std**2, values.shape)[:, :, None],
    )
    fit = frf_ipz.fit_modes(frfs)
    model = frf_ipz.make_beam(**BEAM)
    reduced = frf_ipz.reduce_model(fit, model, points=[POINT])
    matrices = frf_ipz.UpdateOptions(expand=False)  # measured shapes meet measured points by construction
    updated = frf_ipz.update_model(fit, reduced, fe_model=model, options=matrices)
    prediction = frf_ipz.predict_frfs(fit, updated, points=[POINT])
    sure_of_mass = replace(updated, scale=replace(updated.scale, level=1.0))
    by_ensemble = frf_ipz.predict_frfs(frfs, sure_of_mass, points=[POINT], frequency_hz=prediction.frequency_hz)
    truth = frf_ipz.compute_frfs(machine, labels([POINT]), 2j * np.pi * prediction.frequency_hz)
    return prediction, by_ensemble, np.abs(truth)


def share_inside(prediction, truth):
    return np.mean((truth >= prediction.magnitude_low) & (truth <= prediction.magnitude_high))


def half_width_db(prediction):
    return np.median(10 * np.log10(prediction.magnitude_high / prediction.magnitude_low))


@pytest.fixture(scope="module")
def sound():
    return predict(frf_ipz.make_beam(**{**BEAM, "youngs_modulus_Pa": 71e9}))


@pytest.fixture(scope="module")
def lacking():
    """The machine carries 8 g that its model lacks."""
    extra = frf_ipz.BeamPointMass(node=14, mass_kg=0.008)
    return predict(frf_ipz.make_beam(**BEAM, point_mass=[extra]))


def test_a_model_that_can_express_the_measurement_keeps_a_narrow_band(sound):
    prediction, by_ensemble, truth = sound
    assert share_inside(prediction, truth) > 0.75
    assert half_width_db(prediction) < 0.12  # masses leave 0.7 % of an amplitude open at each point: 0.1 dB
    assert half_width_db(prediction) < 1.2 * half_width_db(by_ensemble)


def test_a_model_that_lacks_a_mass_has_a_band_that_holds_the_truth(lacking, sound):
    prediction, by_ensemble, truth = lacking
    assert share_inside(prediction, truth) > 0.9 > share_inside(by_ensemble, truth)
    assert half_width_db(prediction) > 1.2 * half_width_db(by_ensemble)
    assert half_width_db(prediction) > 3 * half_width_db(sound[0])


def test_a_band_is_wide_where_the_fit_misses_what_was_measured():
    """A mode between two lines that was not identified: the fit passes below it, and so does the prediction."""
    lines = np.arange(5.0, 200.0, 0.5)
    machine, model = frf_ipz.make_beam(**{**BEAM, "youngs_modulus_Pa": 71e9}), frf_ipz.make_beam(**BEAM)
    values = frf_ipz.compute_frfs(machine, labels(OUTPUTS), 2j * np.pi * lines)
    std = NOISE * np.sqrt(np.mean(np.abs(values) ** 2, axis=0))
    frfs = frf_ipz.FrfSet.from_arrays(
        lines,
        values[:, :, None],
        outputs=OUTPUTS,
        inputs=INPUTS,
        variance=np.broadcast_to(std**2, values.shape)[:, :, None],
    )
    fit = frf_ipz.fit_modes(frfs)
    assert not fit.missed.any()
    peak = 300
    seen = np.zeros_like(fit.missed)
    seen[peak] = 5 * np.abs(values[peak])
    updated = frf_ipz.update_model(fit, frf_ipz.reduce_model(fit, model, points=[POINT]), fe_model=model)
    as_fitted, as_seen = (
        frf_ipz.predict_frfs(each, updated, points=[POINT]) for each in (fit, replace(fit, missed=seen))
    )
    assert half_width_db(as_fitted) < 0.5
    widths = [10 * np.log10(each.magnitude_high / each.magnitude_low)[:, 0] for each in (as_fitted, as_seen)]
    assert widths[1][peak] > 5.0
    assert np.allclose(np.delete(widths[0], [peak]), np.delete(widths[1], [peak]), rtol=1e-9, atol=0)


def test_gains_are_drawn_no_more_often_where_lines_come_in_more_pieces(monkeypatch):
    drawn = []
    draw = MeasuredScale.drawn_about_level

    def noted(*given):
        drawn.append(given)
        return draw(*given)

    monkeypatch.setattr(MeasuredScale, "drawn_about_level", noted)
    counts, bands = [], []
    for values_at_once in (ensemble.VALUES_AT_ONCE, 512):
        monkeypatch.setattr(ensemble, "VALUES_AT_ONCE", values_at_once)
        drawn.clear()
        prediction, _, _ = predict(frf_ipz.make_beam(**{**BEAM, "youngs_modulus_Pa": 71e9}))
        counts.append(len(drawn))
        bands.append(prediction.magnitude_high)
    assert counts[0] == counts[1]
    np.testing.assert_allclose(bands[1], bands[0], rtol=1e-9)
