"""What the fitter finds, misses and invents on cases that are hard in one way each."""

import re
from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.errors import InputError, NoModesError
from frf_ipz.identification.fit import fit_modes, fit_residues
from frf_ipz.identification.likelihood.smooth_terms import smooth_terms_of_band
from frf_ipz.identification.measured_lines import measured_lines
from frf_ipz.identification.options import FitOptions, PinnedPole, RejectedPole
from frf_ipz.identification.search.delays import common_delay
from frf_ipz.quantities import FrfQuantity
from synthetic_frfs import Modes, accelerances, count, frf_set, labels_of, normalised_errors, random_modes, with_noise

LINES_HZ = np.arange(1, 4097) * 0.25
TO_400_HZ = LINES_HZ[3:1600:4]
SPREAD = np.array([60.0, 135.0, 210.0, 340.0, 430.0, 520.0, 655.0, 790.0, 910.0])
CALIBRATED = 0.5  # 3 standard deviations of the rms of 18 normalised errors
SEED = 77


def poles_of(fit):
    return fit.model.poles[: fit.n_modes]


def assert_complete(fit, truth):
    assert count(poles_of(fit), truth.poles) == (len(truth.poles), 0, 0)


def assert_calibrated(fit, truth):
    assert np.sqrt(np.mean(normalised_errors(fit, truth.poles) ** 2)) == pytest.approx(1.0, abs=CALIBRATED)


def exact(truth, s):
    return truth.receptance(s) * s[:, None] ** 2


@pytest.mark.parametrize(
    ("frequency_hz", "damping"),
    [
        (np.insert(SPREAD, 4, 340.34), 0.002),  # a pair 0.1 % apart
        (SPREAD, 0.05),
        (SPREAD, 0.0003),  # narrower than a line
        (np.array([500.0]), 0.01),
    ],
    ids=["close", "damped", "narrow", "single"],
)
def test_kinds_of_modes(frequency_hz, damping):
    truth = random_modes(frequency_hz, damping, seed=SEED)
    fit = fit_modes(accelerances(truth, LINES_HZ, seed=SEED), options=FitOptions())
    assert_complete(fit, truth)


def test_three_decades_of_residue():
    truth = random_modes(SPREAD, 0.005, seed=SEED)
    small = np.where(np.isin(np.arange(len(SPREAD)), [2, 5]), 10**-1.5, 1.0)
    truth = replace(truth, outputs=truth.outputs * small, inputs=truth.inputs * small)
    fit = fit_modes(accelerances(truth, LINES_HZ, noise=1e-3, seed=SEED), options=FitOptions())
    assert_complete(fit, truth)
    assert_calibrated(fit, truth)


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_weak_modes_are_found_where_the_noise_lets_them(seed):
    truth = random_modes(SPREAD, 0.005, seed=seed)
    small = np.where(np.isin(np.arange(len(SPREAD)), [2, 5]), 10**-1.5, 1.0)
    truth = replace(truth, outputs=truth.outputs * small, inputs=truth.inputs * small)
    frfs = accelerances(truth, LINES_HZ, noise=0.01, seed=seed)
    error = np.abs(np.abs(poles_of(fit_modes(frfs, options=FitOptions())))[:, None] / np.abs(truth.poles) - 1).min(
        axis=0
    )
    s = frfs.s[:, None]
    for weak in (2, 5):
        alone = truth.residues()[weak] / (s - truth.poles[weak]) + truth.residues()[weak].conj() / (
            s - truth.poles[weak].conj()
        )
        energy = np.sum(2 * np.abs(alone * s**2) ** 2 / frfs.variance, axis=0)
        best = np.cumsum(np.sort(energy)[::-1])
        count_of_frfs = np.arange(1, len(best) + 1)
        demanded = (2 * count_of_frfs + 2) * np.log(2 * len(LINES_HZ))
        demanded += 2 * count_of_frfs * np.log(len(best) / count_of_frfs)
        assert (error[weak] < 1e-3) == (np.max(best / demanded) > 1)  # what the BIC asks of a mode


@pytest.mark.slow
def test_noise_that_all_frfs_share():
    truth = random_modes(SPREAD, 0.005, seed=SEED)
    values = exact(truth, 2j * np.pi * LINES_HZ)
    errors = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        shared = 0.01 * (rng.standard_normal(len(LINES_HZ)) + 1j * rng.standard_normal(len(LINES_HZ)))
        independent = 1e-3 * np.sqrt(np.mean(np.abs(values) ** 2)) * rng.standard_normal(values.shape)
        fit = fit_modes(
            frf_set(LINES_HZ, values * (1 + shared[:, None]) + independent, labels_of(6, 2)), options=FitOptions()
        )
        assert_complete(fit, truth)
        errors.append(normalised_errors(fit, truth.poles))
    assert 0.6 < np.sqrt(np.mean(np.square(errors))) < 1.4  # 2.7 if FRFs were taken for independent


def test_pink_noise():
    truth = random_modes(SPREAD, 0.005, seed=SEED)
    values = exact(truth, 2j * np.pi * LINES_HZ)
    std = 0.01 * np.sqrt(np.mean(np.abs(values) ** 2, axis=0)) * np.sqrt(50 / LINES_HZ)[:, None]
    fit = fit_modes(
        with_noise(LINES_HZ, values, labels_of(6, 2), std, np.random.default_rng(SEED)), options=FitOptions()
    )
    assert_complete(fit, truth)
    assert_calibrated(fit, truth)


@pytest.fixture(name="holed")
def holed_frfs():
    """FRFs with hum and two bands of noise, and where these are."""
    truth = random_modes(SPREAD, 0.005, seed=SEED)
    frfs = accelerances(truth, LINES_HZ, seed=SEED)
    bands = [(300.0, 330.0), (600.0, 612.0), *((hum - 1.1, hum + 1.1) for hum in np.arange(50.0, 1024.0, 50.0))]
    hole = np.any([(low <= LINES_HZ) & (high >= LINES_HZ) for low, high in bands], axis=0)
    rng = np.random.default_rng(SEED)
    size = 0.5 * np.sqrt(np.mean(np.abs(frfs.values) ** 2, axis=0))
    noise = size * (rng.standard_normal(frfs.values.shape) + 1j * rng.standard_normal(frfs.values.shape))
    return truth, replace(frfs, values=frfs.values + hole[:, None] * noise), hole, tuple(bands)


def test_lines_of_low_coherence_are_left_out(holed):
    truth, frfs, hole, _ = holed
    coherence = np.where(hole[:, None], 0.1, 0.999) * np.ones(frfs.values.shape)
    fit = fit_modes(replace(frfs, coherence=coherence), options=FitOptions())
    assert_complete(fit, truth)
    assert_calibrated(fit, truth)
    assert not fit.used_lines[hole].any()


def test_bands_that_the_user_leaves_out(holed):
    truth, frfs, hole, bands = holed
    fit = fit_modes(frfs, options=FitOptions(exclude_hz=bands))
    assert_complete(fit, truth)
    assert_calibrated(fit, truth)
    assert not fit.used_lines[hole].any()
    omega = fit.zeros.values.imag / 2 / np.pi
    inside = [any(low + 1 < hz < high - 1 for low, high in bands[:2]) for hz in omega]
    assert not fit.zeros.identifiable[np.array(inside) & (np.abs(fit.zeros.values.real) < 10)].any()


def test_a_record_that_is_cut_off():
    truth = replace(random_modes(SPREAD, 0.001, seed=SEED))
    s, record = 2j * np.pi * LINES_HZ, 4.0
    remaining_amplitude = np.exp(truth.poles.real * record)
    assert remaining_amplitude.max() > 0.2
    half = (1 - np.exp((truth.poles - s[:, None]) * record)) / (s[:, None] - truth.poles) @ truth.residues()
    conjugate_half = (1 - np.exp((truth.poles.conj() - s[:, None]) * record)) / (s[:, None] - truth.poles.conj())
    values = (half + conjugate_half @ truth.residues().conj()) * s[:, None] ** 2
    std = 0.01 * np.sqrt(np.mean(np.abs(values) ** 2, axis=0))
    fit = fit_modes(
        with_noise(LINES_HZ, values, labels_of(6, 2), std, np.random.default_rng(SEED)), options=FitOptions()
    )
    assert_complete(fit, truth)


@pytest.mark.parametrize("noise_known", [True, False])
def test_a_dead_channel(noise_known):
    truth = random_modes(SPREAD, 0.005, seed=SEED)
    frfs = accelerances(truth, LINES_HZ, seed=SEED)
    rng = np.random.default_rng(SEED)
    noise = np.sqrt(frfs.variance / 2) * (
        rng.standard_normal(frfs.values.shape) + 1j * rng.standard_normal(frfs.values.shape)
    )
    dead = np.isin(np.arange(frfs.n_frfs), [2, 3])
    frfs = replace(frfs, values=np.where(dead, noise, frfs.values))
    fit = fit_modes(frfs if noise_known else frf_set(LINES_HZ, frfs.values, frfs.labels), options=FitOptions())
    assert_complete(fit, truth)
    assert not fit.zeros.identifiable[np.isin(fit.zeros.frf, [2, 3])].any()


def test_a_channel_of_zeros_has_no_zeros():
    truth = random_modes(SPREAD, 0.005, seed=SEED)
    frfs = accelerances(truth, LINES_HZ, seed=SEED)
    values = np.where(np.arange(frfs.n_frfs) == 2, 0.0, frfs.values)
    fit = fit_modes(frf_set(LINES_HZ, values, frfs.labels), options=FitOptions())
    assert_complete(fit, truth)
    assert 2 not in fit.zeros.frf


def test_noise_that_was_not_measured():
    truth = random_modes(SPREAD, 0.005, seed=SEED)
    frfs = accelerances(truth, LINES_HZ, seed=SEED)
    fit = fit_modes(frf_set(LINES_HZ, frfs.values, frfs.labels), options=FitOptions())
    assert_complete(fit, truth)
    assert_calibrated(fit, truth)
    assert fit.noise_from == "misfit"


def test_a_weak_mode_under_the_peak_of_a_strong_one_is_a_mode_where_nothing_is_left():
    """An error of the strong one, whose noise was not measured either, would leave something."""
    hertz = np.array([120.0, 188.0, 316.23, 318.16, 473.0, 557.0, 712.0, 769.0, 894.0, 1444.0])
    shapes = np.array(
        [
            [0.65, 0.09, 1.31, 0.23, 2.33, 0.35, 0.10, 0.90, 1.49, 0.43],
            [0.07, -4.0, -0.75, 1.43, 0.53, -0.42, -0.53, 2.69, -2.11, 1.99],
            [3.27, 0.62, -1.84, 1.84, -1.77, 0.02, -1.59, 0.51, 2.73, 1.93],
        ]
    )
    frfs = accelerances(Modes(hertz, 0.006 + 0 * hertz, shapes, shapes[:1]), np.arange(20.0, 900.0), noise=1e-3)
    fit = fit_modes(frf_set(frfs.frequency_hz, frfs.values, frfs.labels), options=FitOptions())
    np.testing.assert_allclose(fit.modes["frequency_hz"], hertz[:-1], rtol=1e-4)


@pytest.mark.parametrize("law", ["even", "in proportion"])
def test_less_noise_than_a_part_in_a_thousand_that_was_not_measured(law):
    """The fit itself shows it, and deviations follow."""
    truth = random_modes(SPREAD[:4], 0.01, n_outputs=3, n_inputs=1, seed=SEED)
    exact = accelerances(truth, TO_400_HZ, noise=0.0).values
    size = np.abs(exact) if law == "in proportion" else np.sqrt(np.mean(np.abs(exact) ** 2, axis=0))
    errors = []
    for seed in range(2):
        rng = np.random.default_rng(seed)
        noisy = with_noise(TO_400_HZ, exact, labels_of(3, 1), 2e-4 * size, rng)
        fit = fit_modes(frf_set(noisy.frequency_hz, noisy.values, noisy.labels))
        assert_complete(fit, truth)
        errors.append(normalised_errors(fit, truth.poles))
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(1.0, abs=CALIBRATED)


def test_an_error_that_neighbouring_lines_share_is_no_noise():
    """Half a part in a thousand, but alike over a peak: deviations do not fall below a part in a thousand a line."""
    truth = random_modes(SPREAD[:4], 0.01, n_outputs=3, n_inputs=1, seed=SEED)
    clean = accelerances(truth, TO_400_HZ, noise=1e-5)
    wave = np.sin(2 * np.pi * TO_400_HZ[:, None] / 31.0)
    deviations = [
        np.sqrt(fit_modes(frf_set(clean.frequency_hz, values, clean.labels)).covariance[1, 1])
        for values in (clean.values, clean.values * (1 + 5e-4 * wave))
    ]
    assert deviations[1] > 4 * deviations[0]


def test_a_band_that_does_not_start_at_zero():
    truth = random_modes(SPREAD, 0.005, seed=SEED)
    fit = fit_modes(accelerances(truth, LINES_HZ, seed=SEED), options=FitOptions(band_hz=(300.0, 860.0)))
    inside = replace(truth, frequency_hz=SPREAD[3:8], damping_ratio=truth.damping_ratio[3:8])
    assert_complete(fit, inside)
    assert fit.band_hz == (300.0, 860.0)


@pytest.mark.parametrize("quantity", list(FrfQuantity))
def test_the_model_is_in_the_unit_that_was_measured(quantity):
    truth = random_modes(SPREAD, 0.005, seed=SEED)
    s = 2j * np.pi * LINES_HZ
    values = truth.receptance(s) * s[:, None] ** quantity.power
    std = 1e-5 * np.sqrt(np.mean(np.abs(values) ** 2, axis=0))
    frfs = with_noise(LINES_HZ, values, labels_of(6, 2, quantity), std, np.random.default_rng(SEED))
    fit = fit_modes(frfs, options=FitOptions(band_hz=(20.0, 1000.0)))
    used = fit.used_lines
    np.testing.assert_allclose(fit.model(s[used]), values[used], rtol=0, atol=10 * std.max())
    residues = truth.residues() * truth.poles[:, None] ** quantity.power
    error = np.abs(fit.model.residues[: len(SPREAD)] - residues)
    allowed = np.sqrt(np.trace(fit.residue_covariance, axis1=2, axis2=3))
    assert np.sqrt(np.mean((error / allowed) ** 2)) == pytest.approx(1.0, abs=0.2)  # of 108 complex numbers


def test_an_exponential_window_is_compensated():
    truth = random_modes(SPREAD, 0.002, seed=SEED)
    s = 3.0 + 2j * np.pi * LINES_HZ
    values = exact(truth, s)
    std = 0.01 * np.sqrt(np.mean(np.abs(values) ** 2, axis=0))
    frfs = with_noise(LINES_HZ, values, labels_of(6, 2), std, np.random.default_rng(SEED))
    fit = fit_modes(replace(frfs, window_decay_1_s=3.0), options=FitOptions())
    assert_complete(fit, truth)
    assert_calibrated(fit, truth)


def test_delays_of_channels():
    truth = random_modes(SPREAD, 0.005, seed=SEED)
    frfs = accelerances(truth, LINES_HZ, seed=SEED)
    delay_s = np.where([label.output_dof.node % 2 for label in frfs.labels], 7.3e-4, -1e-4)
    late = replace(frfs, values=frfs.values * np.exp(-frfs.s[:, None] * delay_s))
    fit = fit_modes(late, options=FitOptions(delay=True))
    assert_complete(fit, truth)
    np.testing.assert_allclose(fit.model.delay_s, delay_s, rtol=0, atol=5e-7)  # 0.05 % of the shortest period
    assert np.sqrt(np.mean(fit.misfit["ratio"] ** 2)) < 1.1


@pytest.mark.parametrize(
    "samples", [*(pytest.param(late, marks=pytest.mark.slow) for late in (3.4, -5.3, 9.0)), 0.4, -1.7]
)
def test_a_delay_that_all_responses_share_is_found(samples):
    truth = random_modes(SPREAD, 0.005, n_outputs=2, n_inputs=1, seed=SEED)
    frfs = accelerances(truth, LINES_HZ, noise=1e-3, seed=SEED)
    delay_s = samples / 2048
    late = replace(frfs, values=frfs.values * np.exp(-frfs.s[:, None] * delay_s))
    fit = fit_modes(late, options=FitOptions())
    assert_complete(fit, truth)
    np.testing.assert_allclose(fit.model.delay_s, delay_s, rtol=0, atol=5e-7)  # 0.05 % of the shortest period
    (warning,) = [text for text in fit.warnings if "ms" in text]
    assert float(re.search(r"all by ([0-9.]+) ms", warning)[1]) == pytest.approx(1e3 * abs(delay_s), rel=1e-3)
    assert ("responses come later" in warning) == (samples > 0)
    assert not fit_modes(late, options=FitOptions(delay=False)).model.delay_s.any()


@pytest.mark.parametrize(("samples", "seed"), [(40.0, 2), (9.0, 0)], ids=["poles that describe it", "beating modes"])
def test_a_delay_of_many_samples_is_no_modes(samples, seed):
    """So many poles fit late responses to the noise that the fit once believed them; where modes beat, a later rise."""
    truth = random_modes(SPREAD, 0.005, n_outputs=2, n_inputs=1, seed=seed)
    frfs = accelerances(truth, LINES_HZ, noise=1e-3, seed=seed)
    late = replace(frfs, values=frfs.values * np.exp(-frfs.s[:, None] * samples / 2048))
    fit = fit_modes(late)
    assert_complete(fit, truth)
    np.testing.assert_allclose(fit.model.delay_s, samples / 2048, rtol=0, atol=5e-7)


@pytest.mark.slow
def test_one_channel_that_is_late_is_named():
    truth = random_modes(SPREAD, 0.005, n_outputs=2, n_inputs=1, seed=SEED)
    frfs = accelerances(truth, LINES_HZ, noise=1e-3, seed=SEED)
    delay_s = np.array([4 / 2048, 0.0])
    fit = fit_modes(replace(frfs, values=frfs.values * np.exp(-frfs.s[:, None] * delay_s)))
    assert_complete(fit, truth)
    np.testing.assert_allclose(fit.model.delay_s, delay_s, rtol=0, atol=5e-7)  # 0.05 % of the shortest period
    assert any(f"{frfs.labels[0].output_dof} +1.953 ms" in text for text in fit.warnings), fit.warnings


@pytest.mark.parametrize("noise", [0.02, 1e-4])
def test_the_deviation_of_a_common_delay_is_true(noise):
    truth = random_modes(SPREAD, 0.005, n_outputs=2, n_inputs=1, seed=SEED)
    errors = []
    for seed in range(12):
        frfs = accelerances(truth, LINES_HZ[3::4], noise=noise, seed=seed)
        late = replace(frfs, values=frfs.values * np.exp(-frfs.s[:, None] * 1e-3))
        lines = measured_lines(late, FitOptions())
        terms = smooth_terms_of_band(lines.band_hz, lines.line_hz).first(3)
        delay = common_delay(lines, truth.poles, terms, lambda _: truth.poles)
        errors.append((delay.delay_s - 1e-3) / delay.std_s)
    assert 0.5 < np.sqrt(np.mean(np.square(errors))) < 1.5  # 12 numbers: three standard deviations


def fit_of_complex_modes(turned_by, *, sizes=1.0):
    """Fit modes whose residues in three FRFs are turned by angles, (n_modes, 3); give the truth too."""
    rng = np.random.default_rng(SEED)
    truth = random_modes(SPREAD, 0.005, n_outputs=3, n_inputs=1, seed=SEED)
    phases = sizes * np.exp(1j * turned_by(rng))
    s = 2j * np.pi * LINES_HZ
    residues = truth.residues() * phases
    values = (1 / (s[:, None] - truth.poles)) @ residues + (1 / (s[:, None] - truth.poles.conj())) @ residues.conj()
    values *= s[:, None] ** 2
    std = 1e-3 * np.sqrt(np.mean(np.abs(values) ** 2, axis=0))
    return fit_modes(with_noise(LINES_HZ, values, labels_of(3, 1), std, rng), options=FitOptions()), truth


def test_complex_modes_are_no_delay():
    fit, truth = fit_of_complex_modes(lambda rng: 0.2 * rng.standard_normal((len(SPREAD), 3)))
    assert_complete(fit, truth)
    assert not fit.model.delay_s.any()
    assert fit.warnings == ()


def test_one_complex_mode_is_no_delay_however_much_of_the_misfit_it_makes():
    strongest = np.arange(len(SPREAD)) == 4
    fit, truth = fit_of_complex_modes(
        lambda _: 0.3 * strongest[:, None] * np.ones(3), sizes=np.where(strongest, 100.0, 1.0)[:, None]
    )
    assert_complete(fit, truth)
    assert not fit.model.delay_s.any()


def test_pinned_and_rejected_poles():
    truth = random_modes(SPREAD, 0.005, seed=SEED)
    frfs = accelerances(truth, LINES_HZ, seed=SEED)
    options = FitOptions(strike=(RejectedPole(hz=430.0, why="the shaker's own resonance"),))
    fit = fit_modes(frfs, options=options)
    rest = np.delete(SPREAD, 4)
    assert np.abs(np.abs(poles_of(fit)) / 2 / np.pi - 430.0).min() > 8.0
    assert all(np.abs(np.abs(poles_of(fit)) / 2 / np.pi - hz).min() < 1.0 for hz in rest)
    assert "the shaker's own resonance" in set(fit.decisions["reason"])
    without_pole = fit_modes(frfs, options=FitOptions(strike=(RejectedPole(hz=250.0, why="a lamp"),)))
    assert list(without_pole.decisions.loc[without_pole.decisions["action"] == "rejected", "reason"]) == ["a lamp"]
    pinned = fit_modes(frfs, options=FitOptions(pin_hz=(715.0, PinnedPole(hz=430.0, why="seen by eye"))))
    is_pinned = pinned.decisions["action"] == "pinned"
    assert list(pinned.decisions.loc[is_pinned, "reason"]) == ["the user says that a mode is here", "seen by eye"]
    assert count(poles_of(pinned), truth.poles)[0] == len(SPREAD)


def test_residues_of_a_single_frf_with_poles_held():
    truth = random_modes(SPREAD, 0.002, seed=SEED)
    frfs = accelerances(truth, LINES_HZ, seed=SEED)
    drifted = replace(truth, frequency_hz=SPREAD * (1 + 2e-4))
    last = accelerances(drifted, LINES_HZ, seed=SEED + 1).select_frfs([5])
    fit = fit_residues(last, poles=truth.poles, options=FitOptions())
    np.testing.assert_array_equal(poles_of(fit), truth.poles)
    assert len(fit.warnings) == 1
    assert "off the given poles" in fit.warnings[0]
    assert float(fit.warnings[0].split(";")[0].split()[-1]) == pytest.approx(200, rel=0.05)
    assert np.sqrt(np.mean(fit.misfit["ratio"] ** 2)) < 1.05
    steady = fit_residues(frfs.select_frfs([5]), poles=truth.poles, options=FitOptions())
    assert steady.warnings == ()
    assert np.sqrt(np.mean(steady.misfit["ratio"] ** 2)) < 1.05


def test_drift_between_frfs_is_reported():
    truth = random_modes(SPREAD, 0.001, seed=SEED)
    drift = np.linspace(-1e-4, 1e-4, 12)
    columns = [
        accelerances(replace(truth, frequency_hz=SPREAD * (1 + change)), LINES_HZ, seed=SEED + k)
        .select_frfs([k])
        .values
        for k, change in enumerate(drift)
    ]
    frfs = accelerances(truth, LINES_HZ, seed=SEED)
    fit = fit_modes(replace(frfs, values=np.hstack(columns)), options=FitOptions())
    assert_complete(fit, truth)
    assert "drifted" in fit.warnings[-1]
    assert float(fit.warnings[-1].split(" by ")[1].split(" ppm")[0]) == pytest.approx(200, rel=0.05)


def test_averages_over_a_drift_are_no_further_modes():
    """Impacts of one FRF waver as FRFs do: its peak is that of no single pole, to one part in 100 000."""
    lines, rng, natural_hz = np.arange(5400, 5800) * 0.02, np.random.default_rng(9), np.array([110.5, 113.5])
    truth = random_modes(natural_hz, 1.2e-4, n_outputs=6, n_inputs=1, seed=9)
    columns = []
    for frf in range(6):
        drift = 4e-5 * rng.standard_normal()
        moved = [replace(truth, frequency_hz=natural_hz * (1 + drift + 2e-5 * rng.standard_normal())) for _ in range(4)]
        impacts = [accelerances(one, lines, noise=1e-5, seed=6) for one in moved]
        columns.append(np.mean([frfs.select_frfs([frf]).values for frfs in impacts], axis=0))
    values = np.hstack(columns)
    fit = fit_modes(replace(impacts[0], values=values, variance=np.full(values.shape, np.nan)))
    assert_complete(fit, truth)  # five modes where splits stand for what the drift leaves
    assert "drifted" in fit.warnings[-1]
    assert fit.decisions["reason"].str.contains("nearer to it than the structure drifts").any()


def test_frequencies_that_drift_are_those_of_the_mean_and_known_as_well_as_it_is():
    """FRFs of little noise do not decide which temperature the poles belong to."""
    truth = random_modes(SPREAD, 0.001, seed=SEED)
    drift = 1e-4 * np.array([-1, 1, 0.5, -0.3, 0.8, -0.6, 0.2, 0.9, -0.9, 0.4, -0.7, -0.3])
    columns = [
        accelerances(
            replace(truth, frequency_hz=SPREAD * (1 + change)),
            LINES_HZ,
            noise=3e-3 if k == 1 else 1e-2,
            seed=SEED + k,
        ).select_frfs([k])
        for k, change in enumerate(drift)
    ]
    parts = {name: np.hstack([getattr(one, name) for one in columns]) for name in ("values", "variance")}
    frfs = replace(accelerances(truth, LINES_HZ, seed=SEED), **parts)
    fit = fit_modes(frfs, options=FitOptions())
    poles = fit.model.poles[: fit.n_modes]
    off = np.abs(poles) / (2 * np.pi * SPREAD * (1 + drift.mean())) - 1
    np.testing.assert_allclose(off, 0.0, rtol=0, atol=5e-6)  # 5e-5 where the second FRF decides
    std = np.sqrt(np.diag(fit.covariance)[1 : 2 * fit.n_modes : 2]) / np.abs(poles)
    np.testing.assert_allclose(std, np.std(drift, ddof=1) / np.sqrt(12), rtol=0.2, atol=0)
    correlation = fit.covariance[1, 3] / np.sqrt(fit.covariance[1, 1] * fit.covariance[3, 3])
    assert correlation > 0.9  # one temperature moves all


def test_model_error_is_reported():
    truth = random_modes(SPREAD, 0.005, seed=SEED)
    frfs = accelerances(truth, LINES_HZ, seed=SEED)
    fit = fit_modes(replace(frfs, variance=frfs.variance / 4), options=FitOptions())
    assert fit.noise_from == "misfit"
    assert "2 times the noise" in fit.warnings[0]
    assert fit.misfit["ratio"].median() == pytest.approx(2.0, rel=0.05)  # over the noise as it was stated
    assert_calibrated(fit, truth)


def test_noise_alone_has_no_modes():
    rng = np.random.default_rng(SEED)
    values = np.zeros((len(LINES_HZ), 4), complex)
    frfs = with_noise(LINES_HZ, values, labels_of(4, 1), 1e-3, rng)
    with pytest.raises(InputError, match="no frequency line carries a signal"):
        fit_modes(frfs, options=FitOptions())
    with pytest.raises(NoModesError, match="no mode stands out of the noise"):
        fit_modes(frfs, options=FitOptions(band_hz=(10.0, 900.0)))


def test_noise_that_exceeds_its_level_on_a_line_is_told_from_lines_too_few():
    values = np.zeros((len(LINES_HZ), 4), complex)
    values[300] = 1.0
    frfs = with_noise(LINES_HZ, values, labels_of(4, 1), 1e-3, np.random.default_rng(SEED))
    with pytest.raises(InputError, match=r"only 1 of \d+ frequency lines carry a signal above the noise"):
        fit_modes(frfs, options=FitOptions())


def test_too_few_lines():
    frfs = accelerances(random_modes(SPREAD, 0.005), LINES_HZ)
    with pytest.raises(InputError, match="usable frequency lines"):
        fit_modes(frfs, options=FitOptions(band_hz=(100.0, 102.0)))


def test_tables_of_a_clean_fit():
    truth = random_modes(SPREAD, 0.005, seed=SEED)
    fit = fit_modes(accelerances(truth, LINES_HZ, seed=SEED), options=FitOptions())
    assert list(fit.modes["quality"]) == ["good"] * len(SPREAD)
    assert (fit.modes["mpc"] > 0.99).all()
    assert len(fit.misfit) == 12 * 8
    assert np.sqrt(np.mean(fit.misfit["ratio"] ** 2)) == pytest.approx(1.0, abs=0.02)
    assert fit.stabilization["stable_frequency"].any()
    assert set(fit.stabilization) >= {"order", "frequency_hz", "damping_ratio", "stable_shape", "taken"}


@pytest.mark.parametrize("lines_hz", [np.linspace(25.0, 800.0, 32), np.geomspace(10.0, 800.0, 32)], ids=["even", "log"])
def test_lines_farther_apart_than_peaks_are_wide(lines_hz):
    truth = random_modes([31.0, 118.0, 247.0, 405.0, 620.0], 0.005, n_outputs=3, n_inputs=1, seed=SEED + 1)
    frfs = accelerances(truth, lines_hz, noise=1e-4, seed=SEED + 1)
    assert_complete(fit_modes(frf_set(lines_hz, frfs.values, frfs.labels), options=FitOptions()), truth)


def test_noise_that_is_even_in_what_was_measured_is_no_model_error():
    truth = random_modes([31.0, 118.0, 247.0, 405.0, 620.0], 0.005, n_outputs=2, n_inputs=1, seed=SEED + 1)
    lines_hz = np.arange(5.0, 801.0)
    frfs = accelerances(truth, lines_hz, noise=1e-4, seed=SEED + 1)
    fit = fit_modes(frf_set(lines_hz, frfs.values, frfs.labels), options=FitOptions())
    assert_complete(fit, truth)
    assert fit.warnings == ()
