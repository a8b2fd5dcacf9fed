"""A spring whose force is the cube of its motion: a clamp that stretches, a plate that stiffens."""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.nonlinear.laws.law import Law, StepCompliance

NEWTON_STEPS = 3  # the time steps are short: the first one is nearly exact


class CubicStiffness(Law):
    """Force k3 w^3."""

    name = "cubic_stiffness"
    strength_name = "cubic_N_m3"
    strength_can_be_negative = True
    degree = 4.0
    phrase = "a cubic spring of {} N/m^3"

    def unit_force(self, w: FloatArray, v: FloatArray, shape: float) -> FloatArray:
        """Cube the motion."""
        del v, shape
        return np.asarray(w * w * w)

    def solve(self, w: FloatArray, v: FloatArray, step: StepCompliance) -> FloatArray:
        """Solve u + beta k u^3 = w: in closed form, but by Newton's method for a spring that softens."""
        del v
        u, scale = w, step.motion * step.strength
        if scale > 0:
            root = np.sqrt(3 * scale)
            u = 2 / root * np.sinh(np.arcsinh(1.5 * root * w) / 3)
            return np.asarray(step.strength * u * u * u)
        for _ in range(NEWTON_STEPS):
            square = scale * (u * u)
            u = (2 * square * u + w) / (1 + 3 * square)
        return np.asarray(step.strength * u * u * u)
