"""The transients at both ends of a record of a running test, fitted and removed."""

import numpy as np
import pytest

from frf_ipz.ingest.signals.transients import transform_without_transients
from synthetic_campaign import Structure, respond

STEP_S = 1 / 1024
LIGHT = Structure(damping_ratio=(0.001, 0.001, 0.001))


def running(n_samples, seed=3):
    """A record from the middle of a test: force and responses."""
    spectrum = np.fft.rfft(np.random.default_rng(seed).standard_normal(n_samples + 8192))
    frequency = np.fft.rfftfreq(n_samples + 8192, STEP_S)
    force = np.fft.irfft(spectrum * np.exp(-((frequency / 280.0) ** 8)), n_samples + 8192)
    return force[8192:], respond(LIGHT, force, STEP_S)[:, 8192:]


@pytest.mark.parametrize("n_samples", [3000, 3001])
@pytest.mark.parametrize("between", [0.0, 0.25, 0.5])
def test_the_frf_remains_on_lines_and_between_them(n_samples, between):
    force, responses = running(n_samples)
    lines = np.arange(30, 730)
    F, X = transform_without_transients(force, responses, lines, between=between)
    truth = LIGHT.accelerance(2j * np.pi * (lines + between) / (n_samples * STEP_S)).T
    error = np.abs(X - truth * F) / np.abs(truth * F).max(axis=1, keepdims=True)
    assert error.max() < 3e-3
    turned = force * np.exp(-2j * np.pi * between * np.arange(n_samples) / n_samples)
    np.testing.assert_allclose(F, np.fft.fft(turned)[lines], rtol=1e-9)


def test_the_frf_is_wrong_where_they_are_not_removed():
    force, responses = running(3000)
    F, X = (np.fft.rfft(signals)[..., 30:730] for signals in (force, responses))
    truth = LIGHT.accelerance(2j * np.pi * np.arange(30, 730) / (3000 * STEP_S)).T
    assert (np.abs(X - truth * F) / np.abs(truth * F).max(axis=1, keepdims=True)).max() > 0.1


def test_all_lines_are_transformed_where_none_are_named():
    force, responses = running(3000)
    F, X = transform_without_transients(force, responses)
    assert F.shape == (1501,)
    F_part, X_part = transform_without_transients(force, responses, np.arange(100, 200))
    np.testing.assert_allclose(F[100:200], F_part, rtol=1e-12)
    np.testing.assert_allclose(X[:, 100:200], X_part, rtol=1e-9, atol=1e-9 * np.abs(X_part).max())


def test_a_force_that_is_zero_gives_zeros():
    F, X = transform_without_transients(np.zeros(512), np.zeros((2, 512)))
    assert not F.any()
    assert not X.any()


def test_too_few_samples_are_transformed_as_they_are():
    force, responses = np.random.default_rng(1).standard_normal(16), np.ones((1, 16))
    F, X = transform_without_transients(force, responses)
    np.testing.assert_allclose(F, np.fft.rfft(force), atol=1e-12)
    np.testing.assert_allclose(X, np.fft.rfft(responses), atol=1e-12)
