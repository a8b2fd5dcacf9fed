"""An error of the force that all FRFs of an excitation share is no mode, and modes stay modes beside it."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.identification.fit import fit_modes
from synthetic_frfs import accelerances, count, random_modes

LINES_HZ = np.arange(256, 4608) * 0.078125  # 20 to 360 Hz
SHARP = np.array([42.7, 136.8, 279.3])
SEED = 5
WINDOW_S = 0.03
SAID = "smooth over the lines"


def smooth_error(frequency_hz, *, rms, seed):
    """Give the spectrum of noise that is there for 30 ms."""
    rng = np.random.default_rng(seed)
    times = np.arange(0, WINDOW_S, 1 / 1280)
    amplitudes = rng.standard_normal(len(times)) * rms / np.sqrt(len(times))
    return np.exp(-2j * np.pi * frequency_hz[:, None] * times) @ amplitudes


def with_force_error(frfs, rms):
    factors = np.stack(
        [1 + smooth_error(frfs.frequency_hz, rms=rms, seed=label.input_dof.node) for label in frfs.labels], axis=1
    )
    return replace(frfs, values=frfs.values * factors)


def sharp_modes():
    return random_modes(SHARP, 0.002, n_outputs=5, n_inputs=2, seed=SEED)


def damped_modes(ratio):
    frequency_hz, damping = np.append(SHARP, 205.0), np.append(np.full(3, 0.002), ratio)
    return random_modes(frequency_hz, damping, n_outputs=5, n_inputs=2, seed=SEED)


def found(fit, truth):
    return count(fit.model.poles[: fit.n_modes], truth.poles, frequency=0.01)


@pytest.mark.parametrize("rms", [0.002, 0.02])
def test_error_of_the_force_is_no_mode(rms):
    truth = sharp_modes()
    fit = fit_modes(with_force_error(accelerances(truth, LINES_HZ, noise=1e-3, seed=SEED), rms))
    assert found(fit, truth) == (3, 0, 0)
    assert any(SAID in text for text in fit.warnings)


def test_no_error_is_said_without_one():
    truth = sharp_modes()
    fit = fit_modes(accelerances(truth, LINES_HZ, noise=1e-3, seed=SEED))
    assert found(fit, truth) == (3, 0, 0)
    assert not any(SAID in text for text in fit.warnings)


@pytest.mark.parametrize("rms", [0.0, 0.002])
@pytest.mark.parametrize("ratio", [0.05, 0.15])
def test_a_broad_mode_stays(ratio, rms):
    truth = damped_modes(ratio)
    frfs = accelerances(truth, LINES_HZ, noise=1e-3, seed=SEED)
    fit = fit_modes(with_force_error(frfs, rms) if rms else frfs)
    assert found(fit, truth) == (4, 0, 0)
