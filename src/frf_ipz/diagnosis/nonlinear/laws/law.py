"""The interface of a force law.

A law is one module with one class that derives from `Law`: the force for motion and velocity at its location,
proportional to one parameter (its strength), and perhaps shaped by a second one (its shape). Search, fit, simulation
and verdict follow from that. A class in a user's own file does the same::

    from frf_ipz.diagnosis.nonlinear.laws.law import Law

    class SquareDrag(Law):
        name = "square_drag"
        strength_name = "drag_Ns2_m2"

        def unit_force(self, w, v, shape):
            return v * abs(v)
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from frf_ipz.arrays import FloatArray

NEWTON_STEPS = 4  # from a force of zero
DIFFERENCE = 1e-6  # of the motion: step of a derivative, half the digits of double precision
LEAST_MOTION = 1e-30  # m: keeps a derivative at rest finite


class Law(ABC):
    """A force between a location and the ground, or across a spring, against its motion w and velocity v.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> class SquareDrag(frf_ipz.Law):
    ...     name = "square_drag"
    ...     strength_name = "drag_Ns2_m2"
    ...     def unit_force(self, w, v, shape):
    ...         return v * np.abs(v)
    >>> SquareDrag().unit_force(np.zeros(2), np.array([-2.0, 3.0]), 0.0)
    array([-4.,  9.])
    """

    name: ClassVar[str]
    """As in `diagnosis.json`."""
    strength_name: ClassVar[str]
    """The parameter that the force is proportional to."""
    shape_name: ClassVar[str] = ""
    """The parameter that shapes the law; empty for a law without, or for one whose shape is no parameter."""
    strength_can_be_negative: ClassVar[bool] = False
    holds: ClassVar[bool] = False
    """It can hold its location still: in a simulation its force is then constant within a time step."""
    degree: ClassVar[float] = 2.0
    """Power of the motion that the work of the force grows with."""
    phrase: ClassVar[str] = ""
    """The law in words: ``{}`` is the strength, or ``{0}`` the strength and ``{1}`` the shape."""

    @abstractmethod
    def unit_force(self, w: FloatArray, v: FloatArray, shape: float) -> FloatArray:
        """Force for a strength of 1, N; `w` in m and `v` in m/s have any common shape."""

    def shapes(self, largest_w: float, largest_v: float) -> FloatArray:
        """Shapes to start from, for the largest motion and velocity of the location; one zero where there is none."""
        del largest_w, largest_v
        return np.zeros(1)

    def solve(self, w: FloatArray, v: FloatArray, step: StepCompliance) -> FloatArray:
        """Force at the end of a time step; w and v are those without it, and it changes them by its compliance.

        The default is Newton's method on the force itself; a law with a kink or a jump is better off in closed form.
        """
        force = np.zeros_like(w)
        for _ in range(NEWTON_STEPS):
            by_law = step.strength * self.unit_force(w - step.motion * force, v - step.velocity * force, step.shape)
            increment = DIFFERENCE * np.maximum(np.abs(w), LEAST_MOTION) / max(step.motion, LEAST_MOTION)
            changed = step.strength * self.unit_force(
                w - step.motion * (force + increment), v - step.velocity * (force + increment), step.shape
            )
            force = force - (force - by_law) / (1 - (changed - by_law) / increment)
        return force


@dataclass(frozen=True, slots=True, eq=False)
class StepCompliance:
    """Effect of a force at the end of a time step on its own location, and the law's parameters.

    Parameters
    ----------
    motion, velocity : float
        Motion and velocity that a unit force subtracts, m/N and m/s/N.
    strength, shape : float
        Of the law.
    """

    motion: float
    velocity: float
    strength: float
    shape: float
