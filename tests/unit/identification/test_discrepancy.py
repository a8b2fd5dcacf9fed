"""What the noise of a single impact does not show makes no modes, and is in the standard deviations."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.identification.fit import fit_modes
from frf_ipz.identification.options import FitOptions
from frf_ipz.ingest.campaign import Recording, VibrationTest
from frf_ipz.ingest.estimate import estimate_frfs
from synthetic_frfs import accelerances, count, normalised_errors, random_modes

LINES_HZ = np.arange(1, 1601) * 0.5
SPREAD = np.array([90.0, 170.0, 260.0, 370.0, 480.0, 600.0, 720.0])
DAMPING = 0.02
SCATTER = 0.02  # of an impact, relative
COMMON_HZ = 8.0  # over which it is common: about the half width of a mode
SEEDS = 6


def one_impact(seed):
    """Give an FRF with little noise, and a scatter that is common to the lines of a peak."""
    truth = random_modes(SPREAD, DAMPING, n_outputs=1, n_inputs=1, seed=seed)
    truth = replace(truth, outputs=np.sign(truth.outputs), inputs=np.sign(truth.inputs))
    frfs = accelerances(truth, LINES_HZ, noise=3e-3, seed=seed)
    rng = np.random.default_rng(seed + 100)
    white = rng.standard_normal((2, len(LINES_HZ) + 200)).T @ [1, 1j]
    window = np.hanning(int(2 * COMMON_HZ / 0.5) + 1)
    scatter = np.convolve(white, window / np.linalg.norm(window), "same")[100:-100, None] * SCATTER / np.sqrt(2)
    return truth, replace(frfs, values=frfs.values * (1 + scatter), averages=np.ones(1, int))


def rms_error(fit, truth):
    assert count(fit.model.poles[: fit.n_modes], truth.poles) == (len(SPREAD), 0, 0)
    return np.sqrt(np.mean(normalised_errors(fit, truth.poles) ** 2))


@pytest.mark.slow
def test_scatter_that_one_impact_does_not_show_is_in_the_standard_deviations():
    truth, frfs = one_impact(3)
    fit = fit_modes(frfs, options=FitOptions())
    assert rms_error(fit, truth) < 1.5
    assert "one impact" in fit.warnings[0]
    as_if_seen = fit_modes(replace(frfs, averages=np.zeros(1, int)), options=FitOptions())
    assert rms_error(as_if_seen, truth) > 2


@pytest.mark.slow
def test_standard_deviations_are_true_over_many_impacts():
    errors = []
    for seed in range(10, 10 + SEEDS):
        truth, frfs = one_impact(seed)
        errors.append(rms_error(fit_modes(frfs, options=FitOptions()), truth))
    assert 0.7 < np.sqrt(np.mean(np.square(errors))) < 1.4


def test_the_band_ends_where_a_force_without_noise_does():
    rate_hz, n_samples = 4096.0, 8192
    time = np.arange(n_samples) / rate_hz
    force = np.zeros(n_samples)
    force[40:72] = np.hanning(34)[1:-1]  # no energy beyond some 400 Hz
    decay = np.exp(-20 * time) * np.sin(2 * np.pi * 120 * time)
    response = np.convolve(force, np.gradient(np.gradient(decay, 1 / rate_hz), 1 / rate_hz))[:n_samples] / rate_hz
    response += 1e-3 * np.abs(response).max() * np.random.default_rng(0).standard_normal(n_samples)
    impact = Recording(force=force, responses=response, sample_rate_hz=rate_hz, input_dof="1:+z", output_dofs=["1:+z"])
    frfs = estimate_frfs(VibrationTest.from_recordings([impact])).frfs
    highest = frfs.frequency_hz[np.isfinite(frfs.variance[:, 0])].max()
    power = np.abs(np.fft.rfft(force)) ** 2
    assert power[frfs.frequency_hz == highest].item() > 0.9e-5 * power.max()
    assert highest < 500.0
