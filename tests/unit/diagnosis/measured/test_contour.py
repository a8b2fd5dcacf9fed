"""Peaks of what was measured, from line to line."""

import numpy as np
import pytest

from frf_ipz.diagnosis.measured.contour import find_resonances

OMEGA = np.linspace(10.0, 60.0, 501)
HALF_WIDTH = 0.8  # 1/s


def level(*peaks):
    return sum(1 / ((OMEGA - peak) ** 2 + HALF_WIDTH**2) for peak in peaks)


def test_peaks_and_their_widths():
    resonances = find_resonances(OMEGA, level(20.0, 45.0), 0.0)
    np.testing.assert_allclose(resonances.omega_rad_s, [20.0, 45.0], atol=0.1)
    np.testing.assert_allclose(resonances.decay_1_s, HALF_WIDTH, rtol=0.03)


@pytest.mark.parametrize("peak", [10.3, 59.7])
def test_a_peak_at_an_end_of_the_lines_counts_with_at_ends(peak):
    two_peaks = level(peak, 30.0)
    assert len(find_resonances(OMEGA, two_peaks, 0.0).omega_rad_s) == 1
    resonances = find_resonances(OMEGA, two_peaks, 0.0, at_ends=True)
    nearest = int(np.argmin(np.abs(resonances.omega_rad_s - peak)))
    assert len(resonances.omega_rad_s) == 2
    assert resonances.omega_rad_s[nearest] == pytest.approx(peak, abs=0.1)
    assert resonances.decay_1_s[nearest] == pytest.approx(HALF_WIDTH, rel=0.03)


def test_a_shoulder_is_no_peak_at_an_end_either():
    rising = level(30.0) + 2.0 * np.exp(-OMEGA)
    rising[3] *= 1.01
    assert len(find_resonances(OMEGA, rising, 0.0, at_ends=True).omega_rad_s) == 1
