"""Sums over lines by intervals are those line by line."""

import numpy as np
import pytest

from frf_ipz.numerics.line_sums import LineSums
from frf_ipz.numerics.partial_fractions import pair_columns, pair_error_growth, pair_products, stacked

ROUNDING = 1e-13  # of the length of a column times that of a row: 3000 terms, and nodes that leave 2e-14
DECAY_1_S = 0.3  # real part of the lines, under an exponential window
POLES_HZ = np.array([12.0, 88.0, 88.1, 311.0, 640.0, 955.0, 1010.0])
HALF_WIDTHS_HZ = np.array([0.2, 0.5, 0.6, 3.0, 12.0, 1.0, 2.0])


def lines_of(frequency_hz):
    return DECAY_1_S + 2j * np.pi * np.asarray(frequency_hz)


def poles_of(half_widths_hz=HALF_WIDTHS_HZ):
    return 2 * np.pi * (-half_widths_hz + 1j * POLES_HZ)


def columns_of(s, poles):
    return np.concatenate([pair_columns(s, poles), pair_columns(s, poles, power=2)], axis=1)


def rows_of(s, count=3):
    rng = np.random.default_rng(4)
    return rng.standard_normal((len(s), count)) + 1j * rng.standard_normal((len(s), count))


@pytest.mark.parametrize(
    "frequency_hz",
    [np.arange(1, 3000) * 0.33, np.geomspace(5.0, 990.0, 1500), np.delete(np.arange(1, 3000) * 0.33, slice(250, 1400))],
    ids=["even", "logarithmic", "with a gap"],
)
def test_products_are_those_line_by_line(frequency_hz):
    s, poles = lines_of(frequency_hz), poles_of()
    rows = rows_of(s)
    sums = LineSums.of_lines(s, rows)
    assert len(sums.levels) > 3
    columns = columns_of(s, poles)
    expected = (columns.T @ stacked(rows)).reshape(4, len(poles), -1)
    size = np.linalg.norm(columns, axis=0).reshape(4, -1, 1) * np.linalg.norm(rows, axis=0)
    assert np.max(np.abs(sums.products(poles) - expected) / size) < ROUNDING


def test_few_lines_are_not_divided():
    s, poles = lines_of(np.arange(1, 100) * 10.0), poles_of()
    sums = LineSums.of_lines(s, rows_of(s))
    assert sums.levels == ()
    expected = columns_of(s, poles).T @ stacked(rows_of(s))
    np.testing.assert_allclose(sums.products(poles).reshape(expected.shape), expected, rtol=1e-10, atol=0)


def test_nodes_stand_for_far_lines():
    s, poles = lines_of(np.arange(1, 3000) * 0.33), poles_of()[1:3]
    weights = np.abs(s) ** 2
    places, rows = LineSums.of_lines(s, weights[:, None].astype(complex)).seen_from(poles)
    assert len(places) < len(s) / 3
    columns = columns_of(s, poles)
    expected = (columns.T * np.tile(weights, 2)) @ columns
    seen = columns_of(places, poles)
    given = (seen.T * np.tile(rows[:, 0, 0], 2)) @ seen
    size = np.sqrt(np.diag(expected))
    assert np.max(np.abs(given - expected) / size / size[:, None]) < ROUNDING


def fractions(s, weights, poles):
    both = np.concatenate([poles, poles.conj()])
    return [np.sum(weights[:, None] / (s[:, None] - both) ** power, axis=0) for power in (1, 2)]


def test_products_of_poles_follow_from_sums_of_each():
    s, poles = lines_of(np.arange(1, 3000) * 0.33), poles_of()
    weights = np.ones(len(s))
    values, slopes = fractions(s, weights, poles)
    columns = columns_of(s, poles)
    expected = columns.T @ columns
    size = np.sqrt(np.diag(expected))
    given = pair_products(poles, values, slopes, DECAY_1_S)
    growth = pair_error_growth(poles, values, slopes, DECAY_1_S)
    assert np.max(np.abs(given - expected) / size / size[:, None]) < np.finfo(float).eps * 10 * growth.max()


@pytest.mark.parametrize(("half_width_hz", "power"), [(1e-5, 0), (0.5, 8)], ids=["narrow", "of small weight"])
def test_lost_digits_are_told(half_width_hz, power):
    s, poles = 2j * np.pi * np.arange(1, 3000) * 0.33, poles_of(np.append(half_width_hz, HALF_WIDTHS_HZ[1:]))
    values, slopes = fractions(s, np.abs(s / s[-1]) ** power, poles)
    growth = pair_error_growth(poles, values, slopes, 0.0)
    assert growth[0] > 1e4
    assert growth[-3] < 1e3


def test_where_all_lines_are_far_nodes_stand_for_all():
    s, poles = lines_of(np.arange(1000, 3000) * 0.33), poles_of()[:1]
    places, rows = LineSums.of_lines(s, rows_of(s)).seen_from(poles)
    assert len(places) == len(rows) < len(s) / 10
