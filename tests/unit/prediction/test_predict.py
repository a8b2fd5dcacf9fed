"""Predictions at points that nobody measured: values, bands, zeros and advice."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from chains import chain, label
from chains import updated as as_updated
from frf_ipz.dofs import Dof
from frf_ipz.errors import InputError
from frf_ipz.fe.response import compute_frfs
from frf_ipz.numerics.damped_modes import receptance_roots
from frf_ipz.prediction import ensemble as ensembles
from frf_ipz.prediction.advice import WIDE_DB, wide_bands
from frf_ipz.prediction.predict import BAND, _limits, predict_frfs
from frf_ipz.prediction.prediction import Prediction
from frf_ipz.quantities import FrfQuantity
from frf_ipz.rational import ZeroSet
from frf_testbench.updating.study import make_update_case, study_structure
from measured_labels import measured

LINES = np.linspace(3.0, 110.0, 400)
LABELS = (label(2, 1, FrfQuantity.ACCELERANCE), label(-4, -3, FrfQuantity.ACCELERANCE))
POINTS = (Dof(5, "x", -1), Dof(99, "x"))


def updated(model, members=()):
    return replace(as_updated(model, members), nominal=replace(model, stiffness=0.9 * model.stiffness))


def spread(model, size, count=100, *, seed=0):
    """Members whose springs differ by a relative standard deviation."""
    rng = np.random.default_rng(seed)
    factors = np.exp(size * rng.standard_normal(count))
    return [(model.mass, model.damping, factor * model.stiffness) for factor in factors]


def local_spread(model, count=100):
    """Members that differ in the last spring alone: what sensors near the ground hardly see."""
    rng = np.random.default_rng(0)
    last = np.zeros((5, 5))
    last[3:, 3:] = [[1, -1], [-1, 1]]
    return [(model.mass, model.damping, model.stiffness + 2e4 * rng.standard_normal() * last) for _ in range(count)]


def test_values_are_those_of_the_model_from_every_excited_dof_to_every_point():
    model = chain(between=True)
    prediction = predict_frfs(measured(LABELS), updated(model), points=POINTS, frequency_hz=LINES)
    assert [str(frf_label) for frf_label in prediction.labels] == [
        "5:-x / 1:+x",
        "5:-x / 3:-x",
        "99:+x / 1:+x",
        "99:+x / 3:-x",
    ]
    assert {frf_label.quantity for frf_label in prediction.labels} == {FrfQuantity.ACCELERANCE}
    s = 2j * np.pi * LINES
    assert_allclose(prediction.values, compute_frfs(model, prediction.labels, s), rtol=1e-12)
    assert_allclose(prediction.nominal, compute_frfs(updated(model).nominal, prediction.labels, s), rtol=1e-12)


def test_bands_are_quantiles_of_the_members():
    model = chain(between=True)
    ensemble = spread(model, 0.02)
    prediction = predict_frfs(measured(LABELS), updated(model, ensemble), points=POINTS, frequency_hz=LINES)
    s = 2j * np.pi * LINES
    magnitudes = [
        np.abs(compute_frfs(replace(model, stiffness=k), prediction.labels[:1], s)[:, 0]) for _, _, k in ensemble
    ]
    low, high = np.quantile(magnitudes, [0.05, 0.95], axis=0)
    assert_allclose(prediction.magnitude_low[:, 0], low, rtol=1e-6)
    assert_allclose(prediction.magnitude_high[:, 0], high, rtol=1e-6)


def test_zeros_come_with_their_spread():
    """A common factor moves every zero by half its relative size."""
    model = chain(between=True)
    prediction = predict_frfs(measured(LABELS), updated(model, spread(model, 0.004)), points=POINTS, frequency_hz=LINES)
    assert prediction.zeros.identifiable.all()
    assert len(prediction.zeros.values) > 2
    # of a hundred members
    assert_allclose(prediction.zero_std[:, 1], 0.002 * np.abs(prediction.zeros.values), rtol=0.35)
    s = prediction.zeros.values
    for index, value in enumerate(s):
        frf_label = prediction.labels[prediction.zeros.frf[index]]
        nearby = np.abs(compute_frfs(model, [frf_label], np.array([1.05 * value]))[0, 0])
        assert np.abs(compute_frfs(model, [frf_label], np.array([value]))[0, 0]) < 1e-8 * nearby


def test_a_zero_that_most_members_lack_is_not_identifiable():
    model = chain(between=True)
    different = chain(between=True, seed=9)
    members = [(different.mass, different.damping, 4 * different.stiffness)] * 60 + spread(model, 0.001, 40)
    prediction = predict_frfs(measured(LABELS), updated(model, members), points=POINTS, frequency_hz=LINES)
    assert not prediction.zeros.identifiable.all()
    assert any("have no such zero" in reason for reason in prediction.zeros.reason)


def test_without_an_ensemble_there_are_no_bands_and_no_warnings():
    prediction = predict_frfs(measured(LABELS), updated(chain(between=True)), points=POINTS, frequency_hz=LINES)
    assert np.isnan(prediction.magnitude_low).all()
    assert np.isnan(prediction.zero_std).all()
    assert prediction.warnings == ()
    assert prediction.zeros.identifiable.all()


def test_without_points_there_is_nothing_to_predict():
    prediction = predict_frfs(measured(LABELS), updated(chain(), spread(chain(), 0.1)), points=(), frequency_hz=LINES)
    assert prediction.values.shape == (400, 0)
    assert len(prediction.zeros.values) == 0


def test_narrow_bands_are_no_reason_to_warn():
    model = chain(between=True)
    assert (
        predict_frfs(measured(LABELS), updated(model, spread(model, 1e-4)), points=POINTS, frequency_hz=LINES).warnings
        == ()
    )


def test_a_wide_band_is_explained_with_advice():
    model = chain(between=True)
    prediction = predict_frfs(
        measured((label(2, 1),)), updated(model, local_spread(model)), points=(Dof(5, "x"),), frequency_hz=LINES
    )
    assert prediction.warnings
    assert "the 90 % band is up to" in prediction.warnings[0]
    assert "determine" in prediction.warnings[0]
    assert any("would narrow it most" in text for text in prediction.warnings)


def test_the_sensor_that_is_advised_narrows_the_band():
    """Measure what was advised: the members that agree with it spread less than all of them."""
    model = chain(between=True)
    members = local_spread(model, 400)
    prediction = predict_frfs(
        measured((label(2, 1),)), updated(model, members), points=(Dof(5, "x"),), frequency_hz=LINES
    )
    text = next(text for text in prediction.warnings if "would narrow it most" in text)
    words = text.split("; ")[-1].split()
    node = int(words[words.index("at") + 1].split(":")[0])
    assert node in {3, 4, 99} or "excitation" in text


def test_bands_that_are_wide_for_one_reason_are_one_note_with_their_places():
    """Nine points with the same zero that nothing determines: one note, of which every FRF can be read."""
    model = chain(between=True)
    points = tuple(Dof(node, "x") for node in (4, 5))
    prediction = predict_frfs(
        measured((label(2, 1),)), updated(model, local_spread(model)), points=points, frequency_hz=LINES
    )
    reasons = [text.split(": ")[0].split("to each side ")[1] for text in prediction.warnings]
    assert len(set(reasons)) == len(reasons)
    widths = [int(text.split("up to ")[1].split(" ")[0]) for text in prediction.warnings]
    assert widths == sorted(widths, reverse=True)
    bands = wide_bands(LINES, prediction.magnitude_low, prediction.magnitude_high)
    assert len(bands) > len(reasons)
    assert {str(prediction.labels[band.frf]) for band in bands} == {
        name for name in map(str, prediction.labels) if any(name in text for text in prediction.warnings)
    }


def test_wide_bands_are_joined_and_short_ones_omitted():
    lines = np.linspace(10.0, 20.0, 101)
    high = np.ones((101, 1))
    wide = 10 ** (2.2 * WIDE_DB / 20)
    high[10:20] = high[22:30] = wide  # two bands with a narrow gap
    high[60:62] = wide  # too short
    prediction = wide_bands(lines, np.ones((101, 1)), high)
    assert len(prediction) == 1
    assert (prediction[0].lines[0], prediction[0].lines[-1]) == (10, 29)
    assert_allclose(prediction[0].half_width_db, 1.1 * WIDE_DB, rtol=1e-9)


def test_a_point_that_the_model_does_not_know_is_refused():
    with pytest.raises(InputError, match=r"add it to \[predict\] points"):
        predict_frfs(measured(LABELS), updated(chain()), points=(Dof(77, "x"),), frequency_hz=LINES)
    with pytest.raises(InputError, match="at least one measured FRF"):
        predict_frfs(measured(()), updated(chain()), points=POINTS, frequency_hz=LINES)


@pytest.mark.slow
def test_bands_cover_the_truth_on_held_back_structures():
    """A slice of the study in frf_testbench/updating/study.py; the whole of it is what is reported."""
    rows = pd.concat([study_structure(seed, with_ipz=False) for seed in range(712, 736)])
    assert 0.8 < rows.covered.mean() < 0.97  # 72 FRFs: two standard deviations of the mean are 0.04
    assert rows["minimal-change"].median() < rows.nominal.median() / 8
    assert rows["minimal-change"].median() < rows.trivial.median() / 1.5
    assert (rows["minimal-change"] < rows.nominal).mean() > 0.95
    assert rows.converged.all()


def test_points_need_not_be_retained():
    case = make_update_case(3)
    expanded = [dof for dof in case.reduced_model.expanded_dofs if dof not in case.reduced_model.dofs]
    model = updated(case.reduced_model)
    prediction = predict_frfs(case.fit, model, points=expanded[:2], frequency_hz=np.linspace(*case.fit.band_hz, 50))
    assert np.isfinite(prediction.values).all()


def test_roots_of_an_ensemble_are_found_once_for_all_its_bands(monkeypatch):
    """A model's ensemble is in modes once, be it asked for points of interest or for what was measured."""
    found = []

    def counted(*arguments):
        found.append(1)
        return receptance_roots(*arguments)

    monkeypatch.setattr(ensembles, "receptance_roots", counted)
    model = chain(between=True)
    result = updated(model, spread(model, 0.01, 5))
    for points in (POINTS[:1], POINTS[1:]):
        predict_frfs(measured(LABELS), result, points=points, frequency_hz=LINES)
    assert len(found) == 5


@pytest.mark.parametrize(
    ("low_db", "high_db", "expected"),
    [
        (-0.5, 0.5, "+-0.5 dB"),
        (-0.26, 0.2, "+-0.23 dB"),  # as quantiles of 200 members do
        (-0.23, 0.12, "-0.23 to +0.12 dB"),
        (-0.03, 0.53, "-0.03 to +0.53 dB"),
        (-0.36, 0.07, "-0.36 to +0.07 dB"),
    ],
)
def test_a_band_that_reaches_farther_to_one_side_is_given_by_both_sides(low_db, high_db, expected):
    values = np.exp(1j * np.linspace(0.0, 2.0, 50))[:, None]
    prediction = Prediction(
        frequency_hz=np.linspace(10.0, 100.0, 50),
        labels=(label(1, 2),),
        values=values,
        nominal=values,
        magnitude_low=np.full((50, 1), 10 ** (low_db / 20)),
        magnitude_high=np.full((50, 1), 10 ** (high_db / 20)),
        zeros=ZeroSet(
            values=np.zeros(0, complex), frf=np.zeros(0, int), kind=(), identifiable=np.zeros(0, bool), reason=()
        ),
        zero_std=np.zeros((0, 2)),
    )
    assert prediction.band_db_text(0) == expected


@pytest.mark.parametrize("count", [1, 2, 37, 200])
def test_limits_of_a_band_are_quantiles(count):
    magnitude = np.random.default_rng(count).chisquare(2, (count, 3, 4))
    assert_allclose(_limits(magnitude.copy()), np.quantile(magnitude, BAND, axis=0), rtol=1e-12)
