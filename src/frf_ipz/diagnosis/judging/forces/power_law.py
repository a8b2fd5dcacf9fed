"""A force that rises with some power of frequency.

Springs, dampers and masses are the powers 0, 1 and 2; materials that relax over many time constants lie between
[Bagley1983]. What imitates such a force in the catalogue explains less than the power law itself.

[Bagley1983] R. L. Bagley, P. J. Torvik, A theoretical basis for the application of fractional calculus to
viscoelasticity, Journal of Rheology 27 (1983) 201-210.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.catalogue.effect import Parameter
from frf_ipz.diagnosis.judging.forces.local_force import LocalForce

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray

ORDERS = 0.05, 1.95


class PowerLaw(LocalForce):
    """k (s / s_0)^order between a place and the ground."""

    name = "power_law"
    tried = (0.25, 0.5, 0.75, 1.5)

    def second_parameter(self) -> Parameter:
        """Order."""
        return Parameter(name="order", low=ORDERS[0], high=ORDERS[1], is_log=False)

    def per_stiffness(self, s: ComplexArray, second: float) -> ComplexArray:
        """Take a power."""
        return np.asarray(s**second)

    def words(self, where: str, second: float) -> str:
        """Say which power."""
        return (
            f"a force at {where} that grows with the power {second:.2g} of frequency explains the measurement "
            "better than springs, dampers and masses do"
        )
