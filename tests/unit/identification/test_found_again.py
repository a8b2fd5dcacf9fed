"""The probability to be found again: against fits of measurements with half as many lines."""

import numpy as np
import pytest

import frf_ipz

FREQUENCY_HZ = np.arange(20.0, 120.0, 0.1)
STRONG, WEAK = 50.0, 85.0  # Hz
RATIO, NOISE = 0.004, 1.0


def measurement(rng, weak, frequency_hz):
    """One accelerance with a mode beyond doubt and one of a size at the noise."""
    s = 2j * np.pi * frequency_hz
    values = np.zeros(len(s), complex)
    for hertz, size in ((STRONG, 200.0), (WEAK, weak)):
        pole = 2 * np.pi * hertz * complex(-RATIO, 1.0)
        values = values + size * -pole.real * s**2 / abs(pole) ** 2 * (1 / (s - pole) - 1 / (s - np.conj(pole))) * 1j
    noise = rng.standard_normal((2, len(s))).T @ [1, 1j] * NOISE / np.sqrt(2)
    return frf_ipz.FrfSet.from_arrays(
        frequency_hz,
        (values + noise)[:, None, None],
        outputs=["1:+x"],
        inputs=["1:+x"],
        variance=np.full((len(s), 1, 1), NOISE**2),
    )


def mode_near(fit, hertz):
    near = np.abs(fit.modes["frequency_hz"] / hertz - 1) < 0.01
    return fit.modes[near]


def fitted(rng, weak, frequency_hz):
    return frf_ipz.fit_modes(measurement(rng, weak, frequency_hz))


def test_a_mode_beyond_doubt_is_found_again():
    fit = fitted(np.random.default_rng(1), 200.0, FREQUENCY_HZ)
    assert fit.modes["found_again"].to_numpy() == pytest.approx(1.0, abs=1e-6)


def test_a_mode_at_the_edge_of_the_noise_may_be_lost():
    fit = fitted(np.random.default_rng(3), 2.0, FREQUENCY_HZ)
    assert mode_near(fit, STRONG)["found_again"].to_numpy() == pytest.approx(1.0, abs=1e-6)
    (edge,) = mode_near(fit, WEAK)["found_again"]
    assert 0.02 < edge < 0.98


@pytest.mark.slow
def test_it_is_the_share_of_new_measurements_that_have_the_mode():
    rng = np.random.default_rng(7)
    stated, found = [], []
    for weak in np.tile([1.6, 1.8, 2.0, 2.2, 2.4, 2.6], 30):
        modes = mode_near(fitted(rng, weak, FREQUENCY_HZ), WEAK)
        if len(modes):
            stated.append(float(modes["found_again"].iloc[0]))
            found.append(len(mode_near(fitted(rng, weak, FREQUENCY_HZ[::2]), WEAK)) > 0)
    stated, found = np.array(stated), np.array(found)
    for low, high in ((0.0, 0.4), (0.4, 0.7), (0.7, 1.01)):
        inside = (stated >= low) & (stated < high)
        deviation = np.sqrt(found[inside].mean() * (1 - found[inside].mean()) / inside.sum())
        assert inside.sum() > 15
        assert abs(stated[inside].mean() - found[inside].mean()) < 0.1 + 2 * deviation
