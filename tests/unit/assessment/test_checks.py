"""Each check sees what it is there for, says where, and leaves a sound run alone."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import eigh

import frf_ipz
from clamped_beam import BEAM
from frf_ipz.assessment.assess import assess
from frf_ipz.assessment.checks import agreement, counterparts, prediction, quality
from frf_ipz.assessment.evidence import Evidence
from frf_ipz.pairing.pairs import PairVerdict
from frf_ipz.runs.summary import assessment_lines

OUTPUTS, INPUTS, POINT = ("9:+z", "16:+z", "21:+z"), ("12:+z",), "18:+z"
LINES = np.arange(5.0, 700.0, 0.5)
NOISE = 1e-3  # of the root mean square of an FRF
USABLE, WITH_CARE, NOT_USABLE = frf_ipz.Verdict


def labels(outputs):
    return [frf_ipz.FrfLabel(output, source, "accelerance") for output in outputs for source in INPUTS]


@pytest.fixture(scope="module")
def evidence():
    """A sound run: the machine is 2 % stiffer than its model."""
    return run_of(frf_ipz.make_beam(**{**BEAM, "youngs_modulus_Pa": 71.4e9}))


def run_of(machine):
    """Measure a machine, and update the model of the clamped beam to it."""
    values = frf_ipz.compute_frfs(machine, labels(OUTPUTS), 2j * np.pi * LINES)
    std = NOISE * np.sqrt(np.mean(np.abs(values) ** 2, axis=0))
    rng = np.random.default_rng(0)
    noisy = values + std / np.sqrt(2) * (rng.normal(size=values.shape) + 1j * rng.normal(size=values.shape))
    variance = np.broadcast_to(std**2, values.shape)[:, :, None]
    frfs = frf_ipz.FrfSet.from_arrays(LINES, noisy[:, :, None], outputs=OUTPUTS, inputs=INPUTS, variance=variance)
    fit = frf_ipz.fit_modes(frfs)
    model = frf_ipz.make_beam(**BEAM)
    reduced = frf_ipz.reduce_model(fit, model, points=[POINT])
    pairs = frf_ipz.pair_roots(fit, reduced)
    updated = frf_ipz.update_model(fit, reduced, fe_model=model)
    predicted = frf_ipz.predict_frfs(fit, updated, points=[POINT])
    return Evidence(frfs=frfs, fit=fit, fe_model=model, pairs=pairs, updated_model=updated, prediction=predicted)


def the(ask, evidence):
    (check,) = ask(evidence)
    return check


def with_frf(evidence, column, factor, **changed):
    """The run with one FRF measured otherwise."""
    factors = np.where(np.arange(len(OUTPUTS)) == column, factor, 1.0)
    frfs = replace(evidence.frfs, values=evidence.frfs.values * factors, variance=evidence.frfs.variance, **changed)
    return replace(evidence, frfs=frfs)


def reference(evidence, factor):
    values = evidence.prediction.values * factor
    frequency_hz = evidence.prediction.frequency_hz
    return frf_ipz.FrfSet.from_arrays(frequency_hz, values[:, :, None], outputs=[POINT], inputs=INPUTS)


def test_a_sound_run_is_usable(evidence):
    found = assess(evidence)
    assert found.verdict is USABLE
    assert found.costly == ()
    assert found.likely_cause is None


@pytest.mark.parametrize(
    ("factor", "verdict", "decibels"), [(1.05, USABLE, 0.42), (1.2, WITH_CARE, 1.58), (2.0, NOT_USABLE, 6.02)]
)
def test_an_amplitude_that_is_off_is_seen_at_its_frf(evidence, factor, verdict, decibels):
    check = the(agreement.amplitude, with_frf(evidence, 1, factor))
    assert check.verdict is verdict
    assert check.figure == pytest.approx(decibels, abs=0.02)
    assert check.where == "16:+z / 12:+z" or verdict is USABLE


@pytest.mark.parametrize(
    ("degrees", "verdict", "is_reversed"), [(3.0, USABLE, False), (10.0, WITH_CARE, False), (180.0, NOT_USABLE, True)]
)
def test_a_phase_that_is_off_is_seen_at_its_frf(evidence, degrees, verdict, is_reversed):
    check = the(agreement.phase, with_frf(evidence, 2, np.exp(1j * np.radians(degrees))))
    assert check.verdict is verdict
    assert check.figure == pytest.approx(degrees, abs=0.3)
    assert ("its sign is reversed" in check.says) == ("turn the sign" in check.advice) == is_reversed


@pytest.mark.parametrize("delay_s", [2e-3, -1e-3])
def test_a_delay_is_no_reversed_sign(evidence, delay_s):
    """Over a band of 700 Hz 2 ms are 500 degrees: half of the lines look reversed."""
    late = np.exp(-2j * np.pi * LINES * delay_s)[:, None]
    check = the(agreement.phase, replace(evidence, frfs=replace(evidence.frfs, values=evidence.frfs.values * late)))
    assert check.verdict is NOT_USABLE
    assert f"a delay of {1e3 * delay_s:.2g} ms that all FRFs have in common" in check.says
    assert "[fit] delay" in check.advice
    assert "reversed" not in check.says


def test_a_delay_that_was_fitted_is_no_error_of_phase(evidence):
    late = np.exp(-2j * np.pi * LINES * 2e-3)[:, None]
    fitted = replace(evidence.fit, model=replace(evidence.fit.model, delay_s=np.full(len(OUTPUTS), 2e-3)))
    frfs = replace(evidence.frfs, values=evidence.frfs.values * late)
    assert the(agreement.phase, replace(evidence, frfs=frfs, fit=fitted)).verdict is USABLE


def test_an_update_that_made_it_worse_is_seen(evidence):
    assert the(agreement.improvement, evidence).verdict is USABLE
    updated = evidence.updated_model
    worse = replace(updated, model=replace(updated.nominal, stiffness=1.3 * updated.nominal.stiffness))
    check = the(agreement.improvement, replace(evidence, updated_model=worse))
    assert check.verdict is WITH_CARE
    assert check.figure > check.limit


def test_an_frf_that_the_update_made_worse_beyond_its_band_is_said_though_all_together_are_better(evidence):
    """One of three FRFs is what the nominal model says, the others are what the updated one says."""
    values = evidence.frfs.values.copy()
    nominal = evidence.updated_model.compute_frfs(evidence.frfs.labels, evidence.frfs.s, nominal=True)
    values[:, 1] = nominal[:, 1]
    changed = replace(evidence, frfs=replace(evidence.frfs, values=values))
    check = the(agreement.improvement, changed)
    assert check.verdict is USABLE
    assert f"{evidence.frfs.labels[1]} is worse after updating than before (" in check.says
    assert "of its lines: the update has moved it" in check.says
    assert ("look at", f"{check.says}: {check.advice}") in assessment_lines(frf_ipz.Assessment.of_checks([check]))
    sound = the(agreement.improvement, evidence)
    assert "worse after" not in sound.says
    assert not sound.advice


@pytest.mark.parametrize(("factor", "verdict"), [(1.0, USABLE), (3.0, WITH_CARE), (1 / 3, WITH_CARE)])
def test_a_band_that_does_not_hold_what_was_measured_is_seen(evidence, factor, verdict):
    check = the(agreement.own_band, with_frf(evidence, 0, factor))
    assert check.verdict is verdict
    assert check.figure == pytest.approx(1.0 if factor == 1.0 else 2 / 3, abs=0.1)
    assert check.where == "9:+z / 12:+z" or verdict is USABLE


@pytest.mark.parametrize(("factor", "verdict"), [(1.09, USABLE), (1.2, NOT_USABLE)])
def test_what_no_controller_feels_is_not_held_against_the_band(evidence, factor, verdict):
    """All FRFs are outside a narrow band, by 0.75 dB and by 1.6 dB: a sixth of a gain margin is 1 dB."""
    values, variance = evidence.frfs.values * factor, evidence.frfs.variance
    check = the(agreement.own_band, replace(evidence, frfs=replace(evidence.frfs, values=values, variance=variance)))
    assert check.figure < 0.75
    assert check.verdict is verdict
    assert ("nothing to a controller" in check.says) == (verdict is USABLE)


def test_an_frf_that_is_nothing_but_noise_is_not_held_against_the_model(evidence):
    """As of a force that moves no sensor: a third of its lines stand above their standard deviation."""
    variance = np.broadcast_to(evidence.frfs.variance, evidence.frfs.values.shape).copy()
    noise = np.random.default_rng(3).normal(size=(len(variance), 2)) @ [1, 1j] / np.sqrt(2)
    values = evidence.frfs.values.copy()
    values[:, 0] = noise * np.sqrt(variance[:, 0])
    check = the(agreement.amplitude, replace(evidence, frfs=replace(evidence.frfs, values=values, variance=variance)))
    assert check.verdict is USABLE
    assert check.where != str(evidence.frfs.labels[0])


def without_counterpart(evidence, kind, count):
    """The run with the first rows of a kind missing in the model."""
    rows, left = [], count
    for row in evidence.pairs.rows:
        is_lacking = left > 0 and row.kind == kind and row.verdict is PairVerdict.PAIRED
        rows.append(replace(row, verdict=PairVerdict.MISSING_IN_MODEL) if is_lacking else row)
        left -= is_lacking
    return replace(evidence, pairs=replace(evidence.pairs, rows=tuple(rows)))


def with_modes_elsewhere(evidence, count):
    """The run with a model whose first modes are three times as high as they should be."""
    updated = evidence.updated_model
    squares, shapes = eigh(updated.model.stiffness, updated.model.mass)
    squares[:count] *= 9
    sides = updated.model.mass @ shapes
    model = replace(updated.model, stiffness=(sides * squares) @ sides.T)
    return replace(without_counterpart(evidence, "pole", count), updated_model=replace(updated, model=model))


@pytest.mark.parametrize(("count", "verdict"), [(0, USABLE), (1, WITH_CARE), (3, NOT_USABLE)])
def test_modes_that_the_model_lacks_are_seen(evidence, count, verdict):
    assert evidence.fit.n_modes == 4
    check = the(counterparts.modes, with_modes_elsewhere(evidence, count))
    assert check.verdict is verdict
    assert check.figure == pytest.approx(1 - count / 4)
    assert check.where.count("Hz") == (count > 0)


@pytest.mark.parametrize("count", [1, 3])
def test_a_mode_without_counterpart_is_harmless_where_the_model_meets_the_frfs(evidence, count):
    """A false mode of the fit costs nothing: the model has no such mode, and is right."""
    check = the(counterparts.modes, without_counterpart(evidence, "pole", count))
    assert check.verdict is USABLE
    assert check.advice == ""
    assert check.figure == pytest.approx(1 - count / 4)
    assert "all the same" in check.says


def test_zeros_that_the_model_lacks_are_seen(evidence):
    assert the(counterparts.zeros, evidence).verdict is USABLE
    check = the(counterparts.zeros, without_counterpart(with_modes_elsewhere(evidence, 3), "zero", 100))
    assert check.verdict is WITH_CARE
    assert check.advice


def test_zeros_without_counterpart_are_harmless_where_the_model_meets_their_frfs(evidence):
    """As zeros far from the imaginary axis, which depend on the smallest changes and hardly show."""
    check = the(counterparts.zeros, without_counterpart(evidence, "zero", 100))
    assert check.verdict is USABLE
    assert check.advice == ""
    assert check.figure == 0.0
    assert "all the same" in check.says


@pytest.mark.parametrize(("factor", "verdict"), [(1.0, USABLE), (1.05, WITH_CARE), (1.2, WITH_CARE), (2.0, NOT_USABLE)])
def test_a_reference_is_believed(evidence, factor, verdict):
    check = the(prediction.reference, replace(evidence, reference=reference(evidence, factor)))
    assert check.verdict is verdict  # 5 % is near enough, but far outside of the band
    assert check.figure == pytest.approx(20 * np.log10(factor), abs=1e-6)
    assert list(prediction.reference(evidence)) == []


@pytest.mark.parametrize(("half_width_db", "verdict"), [(0.5, USABLE), (2.0, WITH_CARE), (4.0, NOT_USABLE)])
def test_a_wide_band_is_seen(evidence, half_width_db, verdict):
    values, factor = np.abs(evidence.prediction.values), 10 ** (half_width_db / 20)
    wide = replace(evidence.prediction, magnitude_low=values / factor, magnitude_high=values * factor)
    check = the(prediction.band_width, replace(evidence, prediction=wide))
    assert (check.verdict, check.figure) == (verdict, pytest.approx(half_width_db))
    nothing = np.full(values.shape, np.nan)
    unknown = replace(evidence.prediction, magnitude_low=nothing, magnitude_high=nothing)
    assert the(prediction.band_width, replace(evidence, prediction=unknown)).verdict is WITH_CARE


@pytest.mark.parametrize(("share", "verdict"), [(0.05, USABLE), (0.2, WITH_CARE)])
def test_a_misfit_far_above_the_noise_is_seen_where_it_is_more_than_a_controller_bears(evidence, share, verdict):
    assert the(quality.fit, evidence).verdict is USABLE
    misfit = evidence.fit.misfit.copy()
    last = misfit.index[-1]
    lines_hz = evidence.frfs.frequency_hz[evidence.lines]
    shown = evidence.measured[lines_hz >= misfit.loc[last, "band_low_hz"], misfit.loc[last, "frf"]]
    misfit.loc[last, ["ratio", "misfit"]] = 20.0, share * np.sqrt(np.mean(np.abs(shown) ** 2))
    check = the(quality.fit, replace(evidence, fit=replace(evidence.fit, misfit=misfit)))
    assert (check.verdict, check.figure) == (verdict, 20.0)
    assert f"{20 * np.log10(1 + share):.2g} dB" in check.says


@pytest.mark.parametrize(("ratio", "verdict"), [(0.6, USABLE), (0.4, WITH_CARE), (2.5, WITH_CARE)])
def test_changes_that_no_tolerance_explains_are_seen(evidence, ratio, verdict):
    parts = pd.DataFrame({"kind": ["element"] * 2, "name": ["1", "2"], "stiffness_ratio": [1.0, ratio]})
    changed = replace(evidence, updated_model=replace(evidence.updated_model, parts=parts))
    check = the(quality.parameters, changed)
    assert (check.verdict, check.where) == (verdict, "2")


def test_an_update_without_targets_is_no_use(evidence):
    assert list(quality.targets(evidence)) == []
    nothing = replace(evidence.updated_model, before=np.zeros(0, complex), after=np.zeros(0, complex))
    assert the(quality.targets, replace(evidence, updated_model=nothing)).verdict is NOT_USABLE


def test_the_sign_of_another_structure_is_not_told(evidence):
    """Below its modes a structure moves against the force, above with it: no sensor stands the other way round."""
    nothing = replace(evidence.updated_model, before=np.zeros(0, complex), after=np.zeros(0, complex))
    check = the(agreement.phase, with_frf(replace(evidence, updated_model=nothing), 2, -1.0))
    assert check.verdict is NOT_USABLE
    assert "reversed" not in check.says
    assert check.advice == ""


def relative_run(evidence, kind, factors):
    """The run of a test that does not know its scale, with its FRFs times some factors."""
    frfs = replace(
        evidence.frfs,
        values=evidence.frfs.values * factors,
        variance=evidence.frfs.variance * np.square(factors),
        unknown_scale=kind,
    )
    fit = frf_ipz.fit_modes(frfs)
    reduced = frf_ipz.reduce_model(fit, evidence.fe_model, points=[POINT])
    updated = frf_ipz.update_model(fit, reduced, fe_model=evidence.fe_model)
    predicted = frf_ipz.predict_frfs(fit, updated, points=[POINT])
    return replace(evidence, frfs=frfs, fit=fit, updated_model=updated, prediction=predicted)


@pytest.mark.parametrize(("factor", "called"), [(1 / 1.12, "11 % lighter"), (1.12, "12 % heavier")])
def test_a_mass_that_is_in_doubt_is_said(evidence, factor, called):
    scale = replace(evidence.updated_model.scale, level=factor)
    check = the(quality.level, replace(evidence, updated_model=replace(evidence.updated_model, scale=scale)))
    assert check.verdict is WITH_CARE
    assert f"either the model is {called} than the machine (90 %: " in check.says


def test_a_model_that_is_too_heavy_is_said_by_frequencies_and_amplitudes():
    """6 % is within what masses of models may be off, but two measurements agree on it."""
    run = run_of(frf_ipz.make_beam(**{**BEAM, "density_kg_m3": BEAM["density_kg_m3"] / 1.06}))
    check = the(quality.level, run)
    assert check.verdict is WITH_CARE
    assert "the model is 6 % heavier than the machine (90 %: 4." in check.says
    assert "as frequencies tell too, which are all 3 % higher" in check.says
    scale = run.updated_model.scale
    assert scale.probability_of_mass > 0.6
    assert scale.level == pytest.approx(1.06, rel=0.01)


def test_a_mass_that_is_as_good_as_others_is_not_in_doubt(evidence):
    assert list(quality.level(evidence)) == []
    scale = replace(evidence.updated_model.scale, level=1.01)
    assert list(quality.level(replace(evidence, updated_model=replace(evidence.updated_model, scale=scale)))) == []


@pytest.mark.parametrize(("factor", "called"), [(0.965, "3.5 % lighter"), (1.04, "4 % heavier")])
def test_a_mass_that_is_off_by_no_more_than_others_is_said_and_costs_nothing(evidence, factor, called):
    scale = replace(evidence.updated_model.scale, level=factor)
    check = the(quality.level, replace(evidence, updated_model=replace(evidence.updated_model, scale=scale)))
    assert check.verdict is USABLE
    assert f"either the model is {called} than the machine (90 %: " in check.says
    assert "bands reach from one to the other" in check.says
    assert check.advice


@pytest.fixture(scope="module")
def per_channel(evidence):
    return relative_run(evidence, "per_channel", [1.0, -7.0, 3.0])


def test_gains_of_channels_are_fitted_and_the_level_at_the_point_is_open(per_channel, evidence):
    check = the(quality.scale, per_channel)
    assert (check.verdict, check.unit) == (WITH_CARE, "dB")
    assert "shape" in check.says
    for ask in (agreement.amplitude, agreement.phase, agreement.own_band):
        assert the(ask, per_channel).verdict is USABLE
    assert list(quality.scale(evidence)) == []


def test_a_reference_is_compared_in_shape_where_the_level_is_open(per_channel):
    check = the(prediction.reference, replace(per_channel, reference=reference(per_channel, -40.0)))
    assert check.figure < 1e-9
    assert "in shape" in check.says


def test_a_common_gain_leaves_predictions_usable_in_the_unit_of_the_measurement(evidence):
    run = relative_run(evidence, "common", [-7.0] * len(OUTPUTS))
    assert the(quality.scale, run).verdict is USABLE
    assert the(agreement.amplitude, run).verdict is USABLE
    check = the(prediction.reference, replace(run, reference=reference(run, 2.0)))
    assert check.figure == pytest.approx(20 * np.log10(2.0))


MASS = frf_ipz.Finding(effect="added_mass", probability=0.98)


@pytest.mark.parametrize(
    ("is_explained", "findings", "is_corrected", "verdict", "says"),
    [
        (True, (), False, USABLE, "nothing significant"),  # damping as measured is nothing missing
        (True, (MASS,), True, USABLE, "was found: added mass (probability 0.98); it was put into it"),
        (True, (MASS,), False, WITH_CARE, "was found: added mass (probability 0.98); the prediction is made without"),
        (False, (MASS,), False, WITH_CARE, "no known effect explains"),
    ],
)
def test_what_a_diagnosis_found_is_said(evidence, is_explained, findings, is_corrected, verdict, says):
    found = SimpleNamespace(is_explained=is_explained, findings=findings, has_seen_all=True)
    check = the(quality.diagnosis, replace(evidence, is_corrected=is_corrected, diagnosis=found))
    assert check.verdict is verdict
    assert says in check.says


def test_a_diagnosis_that_had_no_time_does_not_say_that_nothing_explains(evidence):
    found = SimpleNamespace(is_explained=False, findings=(), has_seen_all=False)
    check = the(quality.diagnosis, replace(evidence, diagnosis=found))
    assert check.verdict is WITH_CARE
    assert "the time was over" in check.says
    assert "no known effect" not in check.says


def test_a_diagnosis_that_was_not_made_is_said(evidence):
    check = the(quality.diagnosis, evidence)
    assert (check.verdict, check.says) == (USABLE, "not looked for")
    assert (check.outcome, the(quality.fit, evidence).outcome) == ("no answer", "usable")


def test_an_update_that_is_worse_at_the_point_of_interest_is_no_better_than_before(evidence):
    """Though it is better at the measured points: the figures are those that the first screen shows."""
    off = reference(evidence, 1.0)
    predicted = evidence.prediction
    beyond = predicted.nominal * (predicted.nominal / predicted.values) ** 1.5  # further from the updated model
    nominal = replace(off, values=beyond, variance=off.variance)
    check = the(agreement.improvement, replace(evidence, reference=nominal))
    point = replace(evidence, reference=nominal).point_deviation
    assert point.updated_db > 1.0 > point.nominal_db  # dB, of a controller's sixth of the margin
    assert (check.verdict, check.figure, check.limit) == (WITH_CARE, point.updated_db, point.nominal_db)
    assert (check.where, point.figures in check.says) == (point.frf, True)
    sound = the(agreement.improvement, replace(evidence, reference=off))
    assert (sound.verdict, sound.where) == (USABLE, "all measured FRFs")


def test_the_worst_check_stands_first():
    checks = [frf_ipz.Check(name=verdict.value, verdict=verdict) for verdict in (USABLE, NOT_USABLE, WITH_CARE)]
    found = frf_ipz.Assessment.of_checks(checks)
    assert [check.name for check in found.checks] == ["not usable", "with care", "usable"]
    assert found.verdict is NOT_USABLE
    cause = frf_ipz.LikelyCause(says="it is in g", file="test.toml", line_or_key="unit", probability=0.9)
    assert frf_ipz.Assessment.of_checks(checks[:1], cause).verdict is WITH_CARE


@pytest.mark.parametrize(
    ("number", "is_unlike", "called"),
    [
        (2, True, "the hardest impact at 12:+z, hit_2 (150 N)"),
        (1, True, "the softest impact"),
        (0, True, ""),
        (2, False, ""),
    ],
)
def test_an_impact_at_another_level_that_contradicts_the_others_takes_care(evidence, number, is_unlike, called):
    peaks, there = np.array([100.0, -60.0, 150.0, 80.0]), np.arange(4) == number
    records = pd.DataFrame(
        {
            "record": [f"hit_{place}" for place in range(4)],
            "input_dof": "12:+z",
            "peak_force_N": peaks,
            "used": ~there,
            "unlike_others": there & is_unlike,
        }
    )
    checks = list(quality.impacts(replace(evidence, records=records)))
    assert [check.verdict for check in checks] == ([WITH_CARE] if called else [])
    assert all(check.says.startswith(called) for check in checks)
    assert not list(quality.impacts(evidence))
