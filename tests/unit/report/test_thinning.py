"""Thinning keeps every peak and notch that a screen can show."""

import numpy as np
import pytest

from frf_ipz.report.thinning import BINS, POINTS, bins_for, thin

N_BINS = 300


def lines_with_extremes(rng):
    frequency = np.linspace(0.5, 5000.0, 50_000)
    curve = 0.1 * rng.standard_normal(len(frequency))
    peaks, notches = rng.choice(len(frequency), (2, 20), replace=False)
    curve[peaks] += 10.0 + np.arange(20)
    curve[notches] -= 10.0 + np.arange(20)
    return frequency, curve, peaks, notches


@pytest.mark.parametrize("seed", range(5))
def test_every_peak_and_notch_that_is_the_largest_in_its_neighbourhood_is_kept(seed):
    frequency, curve, peaks, notches = lines_with_extremes(np.random.default_rng(seed))
    lines = thin(frequency, [curve], N_BINS)
    widest = 2 * len(frequency) // N_BINS  # lines of the widest bin: the others are spread over the logarithm
    for sign, extremes in ((1, peaks), (-1, notches)):
        for line in extremes:
            window = (sign * curve)[max(line - widest, 0) : line + widest + 1]
            assert line in lines or window.max() > sign * curve[line]


def test_few_points_are_left_and_they_ascend():
    frequency, curve, *_ = lines_with_extremes(np.random.default_rng(2))
    lines = thin(frequency, [curve], N_BINS)
    assert N_BINS < len(lines) <= 2 * N_BINS + 2
    assert np.all(np.diff(lines) > 0)


def test_both_ends_are_kept():
    frequency = np.linspace(1, 2, 10_000)
    lines = thin(frequency, [np.random.default_rng(3).standard_normal(10_000)], N_BINS)
    assert lines[0] == 0
    assert lines[-1] == 9_999


def test_low_frequencies_keep_lines_for_a_logarithmic_axis():
    frequency = np.linspace(0.1, 10_000.0, 100_000)
    lines = thin(frequency, [np.sin(frequency)], N_BINS)
    assert np.count_nonzero(frequency[lines] < 10) > 0.05 * len(lines)


def test_values_that_are_not_known_count_as_none():
    frequency = np.linspace(1, 2, 10_000)
    curve = np.full(10_000, np.nan)
    curve[5_000] = 1.0
    assert 5_000 in thin(frequency, [curve], N_BINS)


def test_short_curves_stay_whole():
    assert len(thin(np.arange(1.0, 400.0), [np.zeros(399)], N_BINS)) == 399


@pytest.mark.parametrize("n_curves", [1, 30, 60, 140])
def test_a_page_has_a_bounded_number_of_points(n_curves):
    assert 2 * bins_for(n_curves) * n_curves <= POINTS
    assert BINS[0] <= bins_for(n_curves) <= BINS[1]
