"""Smooth functions from their values at Chebyshev nodes."""

import numpy as np
import pytest

from frf_ipz.numerics.chebyshev import chebyshev_nodes, interpolation, nodes_for_waves

ROUNDING = 1e-13  # of a polynomial of degree 11, whose terms are of order one
PLACES = np.linspace(-1, 1, 101)


def test_polynomials_are_followed():
    coefficients = np.random.default_rng(1).standard_normal(12)
    values = np.polynomial.chebyshev.chebval(chebyshev_nodes(12), coefficients)
    expected = np.polynomial.chebyshev.chebval(PLACES, coefficients)
    np.testing.assert_allclose(interpolation(PLACES, 12) @ values, expected, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("phase", [0.1, 1.0, 4.0, 4 * np.pi, 50.0])
@pytest.mark.parametrize("error", [1e-3, 1e-10])
def test_waves_are_followed_to_the_error_that_was_asked_for(phase, error):
    n_nodes = nodes_for_waves(phase, error)
    followed = interpolation(PLACES, n_nodes) @ np.exp(1j * phase * chebyshev_nodes(n_nodes))
    assert np.max(np.abs(followed - np.exp(1j * phase * PLACES))) < 2 * error  # the estimate is for one term
