"""How predictions of what was left out are judged."""

import numpy as np
import pytest

import frf_ipz
from frf_testbench.studies.left_out import share_in_band

N_LINES = 4000
NORMAL_90 = 1.6449  # standard deviations on either side that hold 90 %


@pytest.mark.parametrize("noise", [0.0, 0.5, 5.0])
@pytest.mark.parametrize("is_stated", [True, False])
def test_a_band_and_noise_hold_their_share_of_lines(noise, is_stated):
    """Of magnitudes that are off by what the band says and by noise beside it, whether it is stated or not."""
    rng = np.random.default_rng(5)
    truth = np.full((N_LINES, 1), 100.0)
    predicted = truth + rng.standard_normal(truth.shape)
    variance = np.full(truth.shape, 2 * noise**2)
    parts = rng.standard_normal((2, *truth.shape)) * noise
    measured = frf_ipz.FrfSet(
        coherence=np.full(truth.shape, np.nan),
        averages=np.ones(1, int),
        frequency_hz=np.arange(1.0, N_LINES + 1),
        values=truth + parts[0] + 1j * parts[1],
        labels=[frf_ipz.FrfLabel("1:+z", "2:+z", "receptance")],
        variance=variance if is_stated else np.full(truth.shape, np.nan),
    )
    share = share_in_band(measured, predicted, predicted - NORMAL_90, predicted + NORMAL_90)
    assert share == pytest.approx(0.9, abs=0.02)
