"""Least squares with columns in different units, and with a prior beside large derivatives."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import linalg

from frf_ipz.numerics.least_squares import cholesky_with_prior, scale_columns, solve_scaled_columns

SIZES = np.array([1.0, 1e-12, 1e9])
CUT = 1e-12


@pytest.mark.parametrize("factor", [1.0, 1.0 + 2.0j])
def test_columns_of_any_size_are_solved_for(factor):
    columns = factor * np.random.default_rng(0).standard_normal((20, 3)) * SIZES
    solution = np.array([2.0, -3.0, 0.5]) / SIZES
    assert_allclose(solve_scaled_columns(columns, columns @ solution, CUT), solution, rtol=1e-10)


def test_a_column_of_zeros_has_the_coefficient_zero():
    columns = np.array([[1.0, 0.0], [2.0, 0.0]])
    assert_allclose(solve_scaled_columns(columns, np.array([3.0, 6.0])), [3.0, 0.0])
    scaled, sizes = scale_columns(columns)
    assert_allclose(scaled * sizes, columns)


def test_the_factor_with_a_prior_is_the_cholesky_factor():
    rows = np.random.default_rng(0).standard_normal((4, 30))
    assert_allclose(
        cholesky_with_prior(rows), linalg.cholesky(rows @ rows.T + np.eye(4), lower=True), rtol=1e-10, atol=1e-10
    )


@pytest.mark.parametrize("size", [1e3, 1e9])
def test_large_equal_rows_leave_the_prior_of_their_difference(size):
    """Of two rows that are the same, the difference is known by the prior alone."""
    row = size * np.random.default_rng(1).standard_normal(30)
    lower = cholesky_with_prior(np.stack([row, row]))
    difference = linalg.solve_triangular(lower, np.array([1.0, -1.0]), lower=True)
    assert_allclose(difference @ difference, 2.0, rtol=1e-5)
