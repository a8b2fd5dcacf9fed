"""Hum is no mode, and a mode that lines hardly resolve is no hum."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.identification.fit import fit_modes
from frf_ipz.identification.options import FitOptions
from synthetic_frfs import accelerances, count, frf_set, labels_of, random_modes, with_noise

SPREAD = np.array([60.0, 135.0, 210.0, 340.0, 430.0, 520.0])
LINES_HZ = np.arange(1, 1201) * 0.5
MAINS_HZ = (50, 100, 150, 250, 300)
TONE = 0.3  # of the root mean square of an FRF: as high as many a peak
SEED = 3_901


def without_variance(frfs):
    return frf_set(frfs.frequency_hz, frfs.values, frfs.labels)


def poles_of(frfs, **options):
    fit = fit_modes(frfs, options=FitOptions(**options))
    return fit.model.poles[: fit.n_modes]


def assert_complete(frfs, truth):
    assert count(poles_of(frfs), truth.poles) == (len(truth.poles), 0, 0)


def tones(kind, values, rng):
    """Steady tones of any phase in the first two FRFs, as spectra show them."""
    amplitude = TONE * np.sqrt(np.mean(np.abs(values) ** 2, axis=0)) * (np.arange(values.shape[1]) < 2)
    added = np.zeros_like(values)
    for hz in MAINS_HZ:
        phased = amplitude * np.exp(2j * np.pi * rng.random(values.shape[1]))
        nearest = np.argmin(np.abs(LINES_HZ - hz))
        if kind == "line":
            added[nearest] += phased
        elif kind == "window":  # the lobe of a Hann window
            added[nearest - 1 : nearest + 2] += np.array([-0.5, 1.0, -0.5])[:, None] * phased
        else:  # a record that cuts it off: tails, as those of a pole without damping
            added += phased / (1j * ((LINES_HZ - hz) / 0.5 + 0.3)[:, None]) * TONE
    return added


@pytest.mark.parametrize("kind", ["line", "window", "cut off"])
@pytest.mark.parametrize("noise_known", [True, False])
def test_tones_are_no_modes(kind, noise_known):
    truth = random_modes(SPREAD, 0.005, n_outputs=4, n_inputs=1, seed=SEED)
    frfs = accelerances(truth, LINES_HZ, noise=1e-3, seed=SEED)
    values = frfs.values + tones(kind, frfs.values, np.random.default_rng(SEED))
    assert_complete(frf_set(LINES_HZ, values, frfs.labels, frfs.variance if noise_known else None), truth)


def test_why_a_tone_is_none_is_said():
    truth = random_modes(SPREAD, 0.005, n_outputs=4, n_inputs=1, seed=SEED)
    frfs = accelerances(truth, LINES_HZ, noise=1e-3, seed=SEED)
    for kind, why in (("line", "has no tails"), ("cut off", "nor the force's phase")):
        values = frfs.values + tones(kind, frfs.values, np.random.default_rng(SEED))
        decisions = fit_modes(frf_set(LINES_HZ, values, frfs.labels, frfs.variance), options=FitOptions()).decisions
        hum = decisions[decisions["reason"].str.contains("hum")]
        assert hum["reason"].str.contains(why).any()
        assert all(np.abs(np.array(MAINS_HZ) - hz).min() < 0.6 for hz in hum["frequency_hz"])


def test_a_mode_wider_than_a_tone_under_the_flank_of_another_is_no_hum():
    """Its half width is 1.4 lines; beside the other's model error its tails tell nothing."""
    truth = random_modes(np.array([39.73, 40.15]), np.array([0.0045, 0.0028]), n_outputs=6, n_inputs=1, seed=1)
    truth = replace(truth, outputs=truth.outputs * np.array([0.25, 1.0]))
    frfs = accelerances(truth, np.arange(240, 400) * 0.125, noise=1e-3, seed=1)
    real, imag = np.random.default_rng(1).standard_normal((2, *frfs.values.shape)) * 0.1
    fit = fit_modes(frf_set(frfs.frequency_hz, frfs.values * (1 + real + 1j * imag), frfs.labels))
    assert np.abs(fit.modes["frequency_hz"] - 39.73).min() < 0.15
    assert not fit.decisions.query("frequency_hz < 39.9")["reason"].str.contains("hum").any()


@pytest.mark.parametrize("width_hz", [0.02, 0.06, 0.12])
def test_a_mode_between_lines_is_found(width_hz):
    lines_hz = np.arange(80, 1440) * 0.125
    frequency_hz = np.array([18.8125, 40.18, 87.7, 97.5, 120.3])
    damping = np.array([width_hz / 2 / 18.8125, 0.004, 0.004, 0.004, 0.004])
    truth = random_modes(frequency_hz, damping, n_outputs=3, n_inputs=1, seed=SEED)
    assert_complete(without_variance(accelerances(truth, lines_hz, noise=3e-3, seed=SEED)), truth)


@pytest.mark.parametrize(("line_hz", "damping"), [(4.0, 0.005), (2.0, 0.004), (1.0, 0.0005)])
def test_lines_coarser_than_modes(line_hz, damping):
    lines_hz = np.arange(1, int(800 / line_hz)) * line_hz
    truth = random_modes(SPREAD, damping, n_outputs=2, n_inputs=1, seed=SEED)
    assert_complete(without_variance(accelerances(truth, lines_hz, noise=1e-3, seed=SEED)), truth)


@pytest.mark.parametrize("noise", [1e-4, 1e-6])
def test_a_record_shorter_than_the_decay(noise):
    truth = random_modes(SPREAD, 0.004, n_outputs=2, n_inputs=1, seed=SEED)
    record_s, decay_1_s = 0.25, 16.0
    lines_hz = np.arange(256) / record_s
    s = decay_1_s + 2j * np.pi * lines_hz
    exact = truth.receptance(s) * s[:, None] ** 2
    std = noise * np.sqrt(np.mean(np.abs(exact) ** 2, axis=0))
    frfs = with_noise(lines_hz, exact, labels_of(2, 1), std, np.random.default_rng(SEED))
    windowed = frf_set(lines_hz, frfs.values, frfs.labels, window_decay_1_s=decay_1_s)
    assert_complete(windowed, truth)


def test_the_line_at_0_hz_is_not_fitted_under_an_exponential_window():
    truth = random_modes(SPREAD, 0.004, n_outputs=2, n_inputs=1, seed=SEED)
    decay_1_s, lines_hz = 16.0, np.arange(256) * 4.0
    s = decay_1_s + 2j * np.pi * lines_hz
    values = truth.receptance(s) * s[:, None] ** 2
    values[0] += 0.5 * np.abs(values).max()  # the offset of a sensor
    frfs = with_noise(lines_hz, values, labels_of(2, 1), 1e-4 * np.abs(values).max(), np.random.default_rng(SEED))
    fit = fit_modes(
        frf_set(lines_hz, frfs.values, frfs.labels, frfs.variance, window_decay_1_s=decay_1_s), options=FitOptions()
    )
    assert not fit.used_lines[0]
    assert count(fit.model.poles[: fit.n_modes], truth.poles) == (len(SPREAD), 0, 0)


@pytest.mark.parametrize("noise_hz", [None, 50.0])
def test_frfs_that_hold_noise_only_say_nothing_of_the_band(noise_hz):
    truth = random_modes(SPREAD, 0.005, n_outputs=4, n_inputs=1, seed=SEED)
    frfs = accelerances(truth, LINES_HZ, noise=1e-3, seed=SEED)
    rng = np.random.default_rng(SEED)
    noise = 1e-3 * (rng.standard_normal((len(LINES_HZ), 3)) + 1j * rng.standard_normal((len(LINES_HZ), 3)))
    colour = np.ones(len(LINES_HZ)) if noise_hz is None else noise_hz / LINES_HZ
    values = np.column_stack([frfs.values[:, 0], noise * colour[:, None]])
    assert_complete(frf_set(LINES_HZ, values, frfs.labels), truth)


@pytest.mark.parametrize("seed", [1, 2])
def test_light_modes_are_no_hum_where_a_window_makes_their_width(seed):
    """A short record: lines that are independent lie three half widths of its exponential window apart."""
    lines_hz, decay = np.arange(100, 1000) * 6.0, 12.0
    truth = random_modes(np.geomspace(700.0, 5500.0, 14), 2e-4, n_outputs=1, n_inputs=1, seed=seed)
    weak = np.where(np.arange(14) % 2, 0.1, 1.0)
    truth = replace(truth, outputs=truth.outputs * weak)
    s = decay + 2j * np.pi * lines_hz
    values = truth.receptance(s) * s[:, None] ** 2
    rng = np.random.default_rng(SEED + seed)
    frfs = with_noise(lines_hz, values, labels_of(1, 1), 0.02 * np.abs(values), rng)  # in proportion, as of impacts
    assert_complete(replace(without_variance(frfs), window_decay_1_s=decay), truth)
