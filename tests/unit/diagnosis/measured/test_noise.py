"""Noise of a channel from energies of lines whose records differ by orders of magnitude."""

import numpy as np
from numpy.testing import assert_allclose

from frf_ipz.diagnosis.measured.noise import fit_noise


def test_noise_is_that_of_all_records_where_a_recorder_chooses_its_range():
    """Of four struck points one shakes the sensor so much that its range has ten thousand times the noise power."""
    drawn, frequency_hz = np.random.default_rng(1), np.tile(np.linspace(5.0, 200.0, 800), 4)
    gain = np.repeat([5.7, 0.04, 0.0012, 0.0042], 800)
    energy = 3e-6 * gain * (1 + 2 / frequency_hz) * drawn.exponential(size=len(gain))
    noise = fit_noise(frequency_hz, energy, gain, np.zeros(len(gain)))
    assert_allclose(noise.density(np.array([20.0, 100.0])), 3e-6 * (1 + 2 / np.array([20.0, 100.0])), rtol=0.25)
