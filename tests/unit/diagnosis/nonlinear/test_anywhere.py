"""What a sum of simple laws bends into."""

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.fitting.simple_laws import simple_forces

LEFT = 0.015  # of the force; springs that slip at once, whose bend is not smooth, leave 0.12


def gradual_slip(x, limit):
    """Give the stretch of a spring whose slope falls to nothing as it is loaded, z' = x' (1 - |z| / limit)."""
    found, stretch = np.zeros_like(x), 0.0
    for k, step in enumerate(np.diff(x, prepend=0.0)):
        stretch += step * (1 - abs(stretch) / limit if step * stretch > 0 else 1.0)
        found[k] = stretch
    return found


@pytest.mark.parametrize("limit", [0.05, 0.07, 0.15, 0.3, 0.4])
def test_a_joint_that_slips_gradually_is_a_sum_of_simple_forces(limit):
    t = np.linspace(0, 1, 4000)
    x = np.exp(-3 * t) * (np.sin(60 * t) + 0.3 * np.sin(210 * t))
    x /= np.abs(x).max()
    v = np.gradient(x, t)
    kinds, force = simple_forces(x[None], v[None])[:, 0], gradual_slip(x, limit)
    strengths = np.linalg.lstsq(kinds.T, force, rcond=None)[0]
    assert np.linalg.norm(force - strengths @ kinds) < LEFT * np.linalg.norm(force)
