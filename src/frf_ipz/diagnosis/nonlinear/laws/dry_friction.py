"""Coulomb friction with sticking: a joint or a guide that slides under a constant force."""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.nonlinear.laws.law import Law, StepCompliance

PARTS = np.array([3e-4, 1e-3, 3e-3, 1e-2])  # of the largest velocity: below, the force grows with it


class DryFriction(Law):
    """Force F_c against the velocity; at standstill the force that holds, up to F_c.

    In the fit the jump at standstill is a steep slope, tanh(v / v_s), since velocities that come from measurements are
    never quite zero; v_s is chosen by the data and is no parameter of the law. The simulation has the jump itself.
    """

    name = "dry_friction"
    strength_name = "friction_N"
    holds = True
    degree = 1.0
    phrase = "dry friction of {} N"

    def unit_force(self, w: FloatArray, v: FloatArray, shape: float) -> FloatArray:
        """Give the direction of the velocity."""
        del w
        return np.asarray(np.tanh(v / shape)) if shape > 0 else np.sign(v)

    def shapes(self, largest_w: float, largest_v: float) -> FloatArray:
        """Velocities below which the slope begins."""
        del largest_w
        return PARTS * largest_v

    def solve(self, w: FloatArray, v: FloatArray, step: StepCompliance) -> FloatArray:
        """Stop the motion, or slow it by F_c where that is not enough."""
        del w
        return np.clip(v / step.velocity, -step.strength, step.strength)
