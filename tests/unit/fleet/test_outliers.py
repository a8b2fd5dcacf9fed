"""Outliers: the false alarms are those that are stated, several faulty machines do not hide each other."""

import numpy as np
import pytest

from frf_ipz.fleet.drift import find_drifts, position
from frf_ipz.fleet.outliers import FEWEST, find_outliers

TRIALS = 400
THREE_SIGMA = 3.0  # of a number of false alarms


@pytest.mark.parametrize("count", [5, 8, 12, 20, 60])
def test_false_alarms_are_at_most_those_that_are_stated(count):
    level = 0.05
    rng = np.random.default_rng(count)
    found = sum(
        find_outliers(rng.normal(size=count), np.zeros(count), level=level).is_outlier.any() for _ in range(TRIALS)
    )
    assert found <= TRIALS * level + THREE_SIGMA * np.sqrt(TRIALS * level)
    assert found > 0  # a test that never marks anything tells nothing


@pytest.mark.parametrize(("count", "faulty"), [(12, 1), (20, 3), (60, 3), (60, 8)])
def test_faulty_machines_are_found_and_no_others(count, faulty):
    rng = np.random.default_rng(7)
    right = 0
    for _ in range(50):
        values = rng.normal(size=count)
        values[:faulty] += 12.0
        is_outlier = find_outliers(values, np.zeros(count), level=0.005).is_outlier
        right += is_outlier[:faulty].all() and not is_outlier[faulty:].any()
    assert right >= 47


def test_a_machine_that_was_measured_badly_is_no_outlier():
    values = np.array([0.0, 0.1, -0.1, 0.05, -0.05, 0.02, 3.0])
    std = np.zeros(7)
    assert find_outliers(values, std, level=0.05).is_outlier.tolist() == [False] * 6 + [True]
    std[6] = 2.0
    found = find_outliers(values, std, level=0.05)
    assert not found.is_outlier.any()
    assert abs(found.sigma[6]) < 2


def test_sigma_is_the_distance_from_the_others():
    values = np.array([-1.0, 0.0, 1.0, 0.0, 0.0, 4.0])
    others = values[:5]
    expected = (4.0 - others.mean()) / np.sqrt(others.var(ddof=1) * (1 + 1 / 5))
    assert find_outliers(values, np.zeros(6), level=1e-6).sigma[5] == pytest.approx(expected, rel=1e-12)


def test_too_few_machines_and_equal_numbers_tell_nothing():
    for values in (np.arange(FEWEST - 1.0), np.ones(8)):
        found = find_outliers(values, np.zeros(len(values)), level=0.05)
        assert np.isnan(found.sigma).all()
        assert not found.is_outlier.any()


def test_a_drift_is_found_along_the_serial_number_and_chance_is_not():
    rng = np.random.default_rng(3)
    serial = np.arange(30.0)
    noise = 1e-3 * rng.normal(size=(2, 30))
    modes = {
        1: (list(range(30)), 100 * (1 + noise[0] + 4e-4 * serial)),
        2: (list(range(30)), 200 * (1 + noise[1])),
    }
    drifts = find_drifts(modes, {"serial_number": serial, "date": np.full(30, np.nan)}, level=0.05)
    assert [(drift.mode, drift.is_significant) for drift in drifts] == [(1, True), (2, False)]
    assert drifts[0].percent_in_all == pytest.approx(1.16, abs=0.2)


@pytest.mark.parametrize(
    ("along", "text", "expected"),
    [
        ("serial_number", "AX7-0012", 12.0),
        ("serial_number", "none", np.nan),
        ("date", "0001-01-03 10:00", 3.0),
        ("date", "in May", np.nan),
        ("date", "", np.nan),
    ],
)
def test_where_a_machine_stands(along, text, expected):
    np.testing.assert_equal(position(along, {along: text}), expected)
