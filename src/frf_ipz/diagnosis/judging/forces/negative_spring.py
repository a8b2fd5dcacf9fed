"""A force that pushes on in the direction of the motion, with losses: magnets, buckled springs, control that is late.

A late force -k exp(-s tau) is -k + k tau s as long as the delay tau is short: it takes stiffness away and damps.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.catalogue.effect import Parameter
from frf_ipz.diagnosis.judging.forces.local_force import LocalForce

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray

LOSSES = 1e-3, 30.0  # in the middle of the band; with more it is a damper


class NegativeSpring(LocalForce):
    """k (-1 + loss s / s_0) between a place and the ground."""

    name = "negative_spring"
    tried = (0.01, 0.1, 1.0, 5.0)
    rivals_several = True

    def second_parameter(self) -> Parameter:
        """Loss in the middle of the band."""
        return Parameter(name="loss", low=LOSSES[0], high=LOSSES[1])

    def per_stiffness(self, s: ComplexArray, second: float) -> ComplexArray:
        """Sum a negative spring and a damper."""
        return np.asarray(second * s - 1)

    def words(self, where: str, second: float) -> str:
        """Say how lossy."""
        return (
            f"a force at {where} that takes stiffness away, with a loss factor of {second:.2g} in the middle of the "
            "band, explains the measurement better than the effects of the catalogue do"
        )
