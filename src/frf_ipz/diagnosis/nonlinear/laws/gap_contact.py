"""A stop on one side: nothing until the gap is closed, then a spring."""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.nonlinear.laws.law import Law, StepCompliance

PARTS = np.array([0.02, 0.06, 0.11, 0.17, 0.24, 0.32, 0.41, 0.51, 0.62, 0.74, 0.87])  # of the largest motion


class GapContact(Law):
    """Force k (w - gap) for w > gap."""

    name = "gap_contact"
    strength_name = "contact_stiffness_N_m"
    shape_name = "gap_m"
    phrase = "a stop behind a gap of {1} m, with a contact stiffness of {0} N/m,"

    def unit_force(self, w: FloatArray, v: FloatArray, shape: float) -> FloatArray:
        """Compute the motion beyond the gap."""
        del v
        return np.maximum(w - shape, 0.0)

    def shapes(self, largest_w: float, largest_v: float) -> FloatArray:
        """Gaps, as parts of the largest motion."""
        del largest_v
        return PARTS * largest_w

    def solve(self, w: FloatArray, v: FloatArray, step: StepCompliance) -> FloatArray:
        """In closed form."""
        del v
        return np.asarray(np.maximum(w - step.shape, 0.0) * (step.strength / (1 + step.motion * step.strength)))
