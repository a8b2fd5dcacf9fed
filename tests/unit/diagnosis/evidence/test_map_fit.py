"""A curvature that rounding has left without a Cholesky factor still gives one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import linalg

from frf_ipz.diagnosis.evidence.map_fit import ROUNDING, _cholesky


def test_a_curvature_that_is_not_definite_by_rounding_has_a_factor():
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((4, 6)) * np.geomspace(1.0, 1e6, 6)
    curvature = rows.T @ rows - 1e-12 * np.diag(np.diag(rows.T @ rows))
    with pytest.raises(linalg.LinAlgError):
        linalg.cholesky(curvature, lower=True)
    lower = _cholesky(curvature)
    size = np.sqrt(np.diag(curvature))
    assert_allclose(lower @ lower.T / np.outer(size, size), curvature / np.outer(size, size), atol=10 * ROUNDING)


def test_a_definite_curvature_is_left_as_it_is():
    lower = np.tril(np.arange(1.0, 10.0).reshape(3, 3))
    assert_allclose(_cholesky(lower @ lower.T), lower, rtol=1e-12)
