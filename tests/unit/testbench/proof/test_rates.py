"""Rates, intervals and calibration against published numbers and by hand."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import binom

from frf_testbench.proof.rates import Rate, calibration, calibration_error

ROOT_FINDING = 1e-6  # relative: quantiles of the beta distribution in double precision


@pytest.mark.parametrize(("hits", "count"), [(2, 100), (50, 50), (0, 50), (191, 200), (1, 1)])
def test_the_interval_is_where_the_binomial_tails_are_a_fortieth(hits, count):
    low, high = Rate(hits=hits, count=count).interval
    if hits:
        assert_allclose(binom.sf(hits - 1, count, low), 0.025, rtol=ROOT_FINDING)
    else:
        assert low == 0
    if hits < count:
        assert_allclose(binom.cdf(hits, count, high), 0.025, rtol=ROOT_FINDING)
    else:
        assert high == 1


def test_no_alarm_in_a_hundred_nulls_leaves_less_than_four_percent():
    assert_allclose(Rate(hits=0, count=100).interval[1], 1 - 0.025 ** (1 / 100), rtol=ROOT_FINDING)


def test_a_rate_counts_what_holds():
    rate = Rate.of([True, False, True, np.bool_(True)])
    assert (rate.hits, rate.count, rate.value) == (3, 4, 0.75)
    assert math.isnan(Rate.of([]).value)


def test_calibration_compares_what_is_claimed_with_what_is_reached():
    bins = calibration([0.95, 0.91, 0.97, 0.93, 0.35, 1.0], [True, True, True, False, True, True])
    assert [one.count for one in bins] == [1, 5]
    assert_allclose([one.claimed for one in bins], [0.35, 0.952], rtol=ROOT_FINDING)
    assert_allclose([one.reached for one in bins], [1.0, 0.8], rtol=ROOT_FINDING)
    assert_allclose(calibration_error(bins), (0.65 + 5 * 0.152) / 6, rtol=ROOT_FINDING)
    assert math.isnan(calibration_error([]))
