"""What an effect does to a structure, to its damping, to the measuring chain or to the equations of motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.set_up import SetUp
from frf_testbench.simulator.signals.laws import Law
from frf_testbench.simulator.signals.receptance import DynamicStiffness, Modes
from frf_testbench.simulator.specimens import Specimen
from frf_testbench.simulator.structures.reality import Reality
from frf_testbench.simulator.structures.structure import Motion, Point, Structure

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Gain = Callable[[ComplexArray], ComplexArray]

LEAST_VIBRATION_SHARE = (
    0.5  # of the motion at a nonlinear law: nobody puts a stop a hand's breadth from a hanging plate
)


def keep_reality(reality: Reality) -> Reality:
    """Leave a structure as it is."""
    return reality


@dataclass(frozen=True, slots=True, kw_only=True)
class Mount:
    """A dynamic stiffness between motions of the structure."""

    motions: tuple[Motion, ...]
    stiffness: DynamicStiffness


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """One thing the nominal model lacks.

    Parameters
    ----------
    name : str
        Of the contract's table, or ``unknown``.
    kind : str, optional
        Of an effect outside the table.
    location, parameters : mapping
        As in ``diagnosis.json``, parameters as plain numbers.
    change_reality : callable
        What it does to the structure.
    mounts : tuple of Mount
        What it attaches.
    damping_factor : float
        Of all modes.
    modulus : callable, optional
        Factor of the whole stiffness matrix.
    gains : mapping of str to callable
        Transfer functions of channels, besides their gain.
    crosstalk : tuple of (to, from, factor)
        Signals that leak into other channels.
    sensor_nodes : mapping of str to int
        Channels, and the node where the sensor really is.
    saturation : mapping of str to float
        Channels, and the fraction of their peak where an amplifier bends.
    law : Law, optional
        A nonlinear force, acting on `law_motion`.
    law_motion : Motion, optional
        First point minus second.
    drift : float
        Relative change of all frequencies from the first impact to the last.
    """

    name: str
    kind: str | None = None
    location: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)
    change_reality: Callable[[Reality], Reality] = keep_reality
    mounts: tuple[Mount, ...] = ()
    damping_factor: float = 1.0
    modulus: Gain | None = None
    gains: Mapping[str, Gain] = field(default_factory=dict)
    crosstalk: tuple[tuple[str, str, float], ...] = ()
    sensor_nodes: Mapping[str, int] = field(default_factory=dict)
    saturation: Mapping[str, float] = field(default_factory=dict)
    law: Law | None = None
    law_motion: Motion | None = None
    drift: float = 0.0

    @property
    def is_linear(self) -> bool:
        """Whether responses stay proportional to the force."""
        return self.law is None and not self.saturation


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EffectTarget:
    """The specimen that an effect is drawn for, in its test, still without the effect.

    Parameters
    ----------
    specimen, set_up
        What is tested, and how.
    structure, modes
        Without scatter.
    nodes : tuple of int
        Nodes that move well in some mode of the band.
    mass_kg : float
        Of all that moves.
    peak_motion : callable
        Largest displacement and velocity of a `Motion` over all records, m and m/s: scales of nonlinear effects.
    peak_vibration : callable
        Largest displacement of a `Motion` without that of a free structure as a whole, m.
    """

    specimen: Specimen
    set_up: SetUp
    structure: Structure
    modes: Modes
    nodes: tuple[int, ...]
    mass_kg: float
    peak_motion: Callable[[Motion], tuple[float, float]]
    peak_vibration: Callable[[Motion], float]

    @property
    def in_band(self) -> NDArray[np.bool_]:
        """Mask of the modes of the band."""
        low, high = self.set_up.band_hz
        return (self.modes.frequencies_hz >= low) & (self.modes.frequencies_hz <= high)

    @property
    def columns(self) -> tuple[str, ...]:
        """Channels, the force among them."""
        return ("force", *(sensor.column for sensor in self.set_up.sensors))

    def point(self, node: int) -> Point:
        """Return the translation of a node."""
        return Point(node, self.specimen.direction)

    def shapes(self, motion: Motion) -> FloatArray:
        """Return the (n_modes,) mass-normalised shapes of a motion."""
        return np.asarray(self.structure.motion_row(motion) @ self.modes.shapes)

    def is_mostly_vibration(self, motion: Motion) -> bool:
        """Whether a motion is mostly vibration, and not the drift of a free structure in its suspension."""
        return (
            not self.structure.n_rigid
            or self.peak_vibration(motion) > LEAST_VIBRATION_SHARE * self.peak_motion(motion)[0]
        )

    def stiffness(self, motion: Motion) -> float:
        """Return the stiffness against a motion by the modes of the band, N/m: a scale for springs."""
        shapes = self.shapes(motion)[self.in_band]
        return float(1 / np.sum(shapes**2 / self.modes.omega_rad_s[self.in_band] ** 2))

    def damping(self, motion: Motion) -> float:
        """Return the damper that doubles the damping of the mode it damps best, N s/m: a scale for dampers."""
        shapes, omega = self.shapes(motion)[self.in_band], self.modes.omega_rad_s[self.in_band]
        return float((2 * self.set_up.damping_ratio * omega / shapes**2).min())


Draw = Callable[[np.random.Generator, EffectTarget], Effect | None]


def draw_log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a positive number whose logarithm is uniform, with four digits."""
    return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.4g}")


def make_dynamic_stiffness(matrix: list[list[float]] | FloatArray, factor: Gain) -> DynamicStiffness:
    """Make a dynamic stiffness that is a constant matrix times a function of s."""
    constant = np.asarray(matrix, dtype=float)
    return lambda s: factor(s)[:, None, None] * constant
