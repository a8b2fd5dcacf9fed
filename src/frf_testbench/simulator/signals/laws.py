"""Force laws of nonlinear springs, gaps, friction and hysteresis.

A law is asked once a step for its force at the end of the step. Motion and velocity at its location, without the law's
own force of this step, are ``w`` and ``v``; its force f moves the location by ``-beta f`` and changes the velocity by
``-gamma f``. So every law solves its own small equation, and stiff contact and sticking need no iteration over the
structure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

NEWTON_STEPS = 3  # from a guess that is exact to first order in a small beta


class Law(Protocol):
    """A force law between a point and the ground, or across a spring.

    A law that can hold its location still keeps its force constant within a step: with a linear one it would ring.
    """

    @property
    def is_constant_within_step(self) -> bool:
        """Whether the force is constant within a step."""
        ...

    def force(self, w: FloatArray, v: FloatArray, beta: float, gamma: float) -> FloatArray:
        """Return the (n_records,) restoring force at the end of a step, N; called once a step, in order."""
        ...

    def restart(self, n_records: int) -> None:
        """Forget the past, before `n_records` records are computed side by side."""
        ...


@dataclass(kw_only=True)
class PowerSpring:
    """Force ``stiffness w^power``; odd powers keep the sign, an even one pushes one way."""

    stiffness: float
    power: int
    is_constant_within_step: ClassVar[bool] = False

    def restart(self, n_records: int) -> None:
        """Nothing to forget."""

    def force(self, w: FloatArray, v: FloatArray, beta: float, gamma: float) -> FloatArray:
        """Newton's method for u + beta k u^p = w."""
        del v, gamma
        u = w
        for _ in range(NEWTON_STEPS):
            power = self.stiffness * u ** (self.power - 1)
            u = u - (u + beta * power * u - w) / (1 + beta * self.power * power)
        return self.stiffness * u**self.power


@dataclass(kw_only=True)
class Gap:
    """One-sided contact: ``stiffness (w - gap)`` for w > gap."""

    stiffness: float
    gap: float
    is_constant_within_step: ClassVar[bool] = False

    def restart(self, n_records: int) -> None:
        """Nothing to forget."""

    def force(self, w: FloatArray, v: FloatArray, beta: float, gamma: float) -> FloatArray:
        """Solve in closed form."""
        del v, gamma
        return np.maximum(w - self.gap, 0.0) * (self.stiffness / (1 + beta * self.stiffness))


@dataclass(kw_only=True)
class TwoSided:
    """Extra stiffness (or, if negative, less) beyond a distance on both sides."""

    stiffness: float
    gap: float
    is_constant_within_step: ClassVar[bool] = False

    def restart(self, n_records: int) -> None:
        """Nothing to forget."""

    def force(self, w: FloatArray, v: FloatArray, beta: float, gamma: float) -> FloatArray:
        """Solve in closed form."""
        del v, gamma
        overlap = w - np.clip(w, -self.gap, self.gap)
        return overlap * (self.stiffness / (1 + beta * self.stiffness))


@dataclass(kw_only=True)
class Coulomb:
    """Dry friction with sticking."""

    friction: float
    is_constant_within_step: ClassVar[bool] = True

    def restart(self, n_records: int) -> None:
        """Nothing to forget."""

    def force(self, w: FloatArray, v: FloatArray, beta: float, gamma: float) -> FloatArray:
        """Force that stops the motion, or the friction force where that is not enough."""
        del w, beta
        return np.clip(v / gamma, -self.friction, self.friction)


@dataclass(kw_only=True)
class SquareDrag:
    """Force ``drag v |v|``."""

    drag: float
    is_constant_within_step: ClassVar[bool] = False

    def restart(self, n_records: int) -> None:
        """Nothing to forget."""

    def force(self, w: FloatArray, v: FloatArray, beta: float, gamma: float) -> FloatArray:
        """Solve in closed form."""
        del w, beta
        strength = gamma * self.drag
        speed = (np.sqrt(1 + 4 * strength * np.abs(v)) - 1) / (2 * strength)
        return self.drag * np.sign(v) * speed**2


@dataclass(kw_only=True)
class BoucWen:
    """Hysteretic force ``stiffness z`` with dz = dw (1 - |z| / z_max (1 + sign(dw z)) / 2)."""

    stiffness: float
    yield_m: float
    is_constant_within_step: ClassVar[bool] = False

    def restart(self, n_records: int) -> None:
        """Start without history."""
        self._z = np.zeros(n_records)
        self._w = np.zeros(n_records)

    def force(self, w: FloatArray, v: FloatArray, beta: float, gamma: float) -> FloatArray:
        """Explicit in the slope of the hysteresis, implicit in the force."""
        del v, gamma
        guess = w - beta * self.stiffness * self._z
        loading = np.sign(guess - self._w) * np.sign(self._z) > 0
        slope = np.where(loading, 1 - np.minimum(np.abs(self._z) / self.yield_m, 1), 1.0)
        stiff = self.stiffness * slope
        # u - w_old = (w - beta k z) - w_old with z = z_old + slope (u - w_old)
        increment = (w - beta * self.stiffness * self._z - self._w) / (1 + beta * stiff)
        self._z = self._z + slope * increment
        self._w = self._w + increment
        return self.stiffness * self._z
