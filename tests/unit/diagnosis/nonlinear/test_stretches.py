"""Stretches of recordings as they are looked at."""

from dataclasses import replace

import numpy as np

from frf_ipz.diagnosis.nonlinear.linear.plant import make_plant
from frf_ipz.diagnosis.nonlinear.recorded.noise import read_noise
from frf_ipz.diagnosis.nonlinear.recorded.stretches import Window, transform


def test_lines_that_are_left_out_are_not_fitted(chain, strike):
    observations = replace(strike(), exclude_hz=((30.0, 40.0),))
    window = Window(duration_s=1.0)
    stretches = transform(observations, make_plant(chain.model, observations), read_noise(observations), window)
    used_hz = stretches.s.imag[stretches.used] / (2 * np.pi)
    width_hz = stretches.sigma_1_s / (2 * np.pi)
    assert used_hz.min() < 10.0
    assert used_hz.max() > 70.0
    assert not np.any((used_hz > 30.0 - width_hz) & (used_hz < 40.0 + width_hz))
