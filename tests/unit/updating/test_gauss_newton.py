"""The iteration of a minimal change on one number that follows one parameter along a curve."""

import numpy as np
import pytest

from frf_ipz.updating.minimal_change.gauss_newton import iterate
from frf_ipz.updating.parameters import PriorTerm
from frf_ipz.updating.target_noise import noise_of

TARGET, NOISE = 0.2, 1e-9


class Curve:
    """A number that is the parameter and a share of its square; its roots are the parameter itself."""

    terms = (PriorTerm(name="parameter", root=np.eye(1), std=1.0, scale_uncertainty=0.0),)
    noise = noise_of(np.array([[NOISE**2]]))
    slack = np.array([NOISE])

    def __init__(self, curvature):
        self.curvature = curvature

    def roots(self, theta, _reference):
        return theta

    def errors(self, tracked):
        return TARGET - tracked - self.curvature * tracked**2

    def slopes(self, theta, _tracked):
        return np.array([1 + 2 * self.curvature * theta])

    def history_columns(self, _theta):
        return {}

    def max_step_fraction(self, _theta, _proposed):
        return 1.0


@pytest.mark.parametrize("curvature", [0.0, 0.01, 0.5])
def test_it_ends_where_the_target_is_met_however_little_a_step_is_known_to_be_right(curvature):
    """What the first step leaves is small beside the curvature that it might have met, and large beside the noise."""
    result = iterate(Curve(curvature), np.zeros(1))
    assert result.converged
    assert abs(result.error[0]) < 3 * NOISE
