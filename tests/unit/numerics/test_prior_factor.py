import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import linalg

from frf_ipz.numerics.regularised_cholesky import factor_with_prior


def test_it_is_the_cholesky_factor():
    rows = np.random.default_rng(0).standard_normal((4, 30))
    assert_allclose(
        factor_with_prior(rows), linalg.cholesky(rows @ rows.T + np.eye(4), lower=True), rtol=1e-10, atol=1e-10
    )


@pytest.mark.parametrize("size", [1e3, 1e9])
def test_large_rows_that_are_alike_leave_the_prior(size):
    """Of two rows that are the same, the difference is known by the prior alone."""
    row = size * np.random.default_rng(1).standard_normal(30)
    lower = factor_with_prior(np.stack([row, row]))
    apart = linalg.solve_triangular(lower, np.array([1.0, -1.0]), lower=True)
    assert_allclose(apart @ apart, 2.0, rtol=1e-5)
