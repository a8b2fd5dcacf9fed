"""What is concealed in a machine: linear effects of the contract's table, each drawn so that a machine shows it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from frf_testbench.machines.frames import DIRECTIONS, Drawing, FloatArray
from frf_testbench.simulator.signals.receptance import DynamicStiffness

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorChannel:
    """A channel as the owner describes it.

    Parameters
    ----------
    column : str
        Of the recordings.
    node : int
        Index of its node in the owner's model.
    direction : str
        ``x``, ``y`` or ``z``.
    sign : int
        1 or -1.
    """

    column: str
    node: int
    direction: str
    sign: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Concealed:
    """An effect.

    Parameters
    ----------
    name, location, parameters
        As in ``diagnosis.json``.
    stiffness_ratios : mapping of str to float
        Of groups.
    damping_factor : float
        Of all modes.
    attached : tuple of (motion, dynamic stiffness)
        Each on a motion: (node, direction), weight.
    gains : mapping of str to callable
        Of channels, by s.
    moved : mapping of str to (int, str)
        Channels, and the node and direction that they really show.
    """

    name: str
    location: Mapping[str, object] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    stiffness_ratios: Mapping[str, float] = field(default_factory=dict)
    damping_factor: float = 1.0
    attached: tuple[tuple[Mapping[tuple[int, str], float], DynamicStiffness], ...] = ()
    gains: Mapping[str, Callable[[ComplexArray], ComplexArray]] = field(default_factory=dict)
    moved: Mapping[str, tuple[int, str]] = field(default_factory=dict)


SOUND = Concealed(name="null")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Target:
    """What effects are drawn for.

    Parameters
    ----------
    drawing : Drawing
        The machine.
    sensors : tuple of SensorChannel
        All channels.
    mass_kg : float
        Of the machine.
    frequencies_hz : (m,) array
        Of the modes in the band.
    shapes : (n_nodes, 6, m) array
        Of these, mass-normalised, at the nodes of the owner's model.
    band_hz : pair of float
        Analysed.
    damping_ratio : float
        That the owner states.
    """

    drawing: Drawing
    sensors: tuple[SensorChannel, ...]
    mass_kg: float
    frequencies_hz: FloatArray
    shapes: FloatArray
    band_hz: tuple[float, float]
    damping_ratio: float

    def stiffness_against(self, motion: Mapping[tuple[int, str], float]) -> float:
        """Stiffness of the machine against a motion by its modes in the band, N/m."""
        shape = sum(weight * self.shapes[node, DIRECTIONS.index(axis)] for (node, axis), weight in motion.items())
        return float(1 / np.sum(shape**2 / (2 * np.pi * self.frequencies_hz) ** 2))

    def draw_node(self, rng: np.random.Generator) -> tuple[int, str]:
        """Draw a node and a direction of those that move more than most."""
        compliance = np.sum(self.shapes[:, :3] ** 2 / self.frequencies_hz**2, axis=2)
        node, axis = rng.choice(np.argwhere(compliance > np.median(compliance)))
        return int(node), DIRECTIONS[int(axis)]


Draw = Callable[[np.random.Generator, Target], Concealed]


def draw_concealed(rng: np.random.Generator, name: str, target: Target) -> Concealed:
    """Draw an effect for a machine.

    Parameters
    ----------
    rng : Generator
        Of the case.
    name : str
        One of `EFFECTS`, or ``null``.
    target : Target
        The machine.

    Returns
    -------
    Concealed
        The effect; an effect of which there are variants is drawn among them.
    """
    return EFFECTS[name](rng, target) if name in EFFECTS else SOUND


def _draw_ratio(rng: np.random.Generator, least: float, most: float) -> float:
    """Draw a ratio or its inverse."""
    return float(np.exp(rng.choice([-1, 1]) * rng.uniform(np.log(least), np.log(most))))


def _draw_mount(rng: np.random.Generator, target: Target) -> Concealed:
    return _change_group(rng, [name for name in target.drawing.groups if name.startswith("mount")])


def _draw_member(rng: np.random.Generator, target: Target) -> Concealed:
    return _change_group(rng, [name for name in target.drawing.groups if not name.startswith("mount")])


def _change_group(rng: np.random.Generator, names: list[str]) -> Concealed:
    name, ratio = str(rng.choice(names)), _draw_ratio(rng, 1.25, 2.5)
    return Concealed(
        name="local_stiffness",
        location={"groups": [name]},
        parameters={"stiffness_ratio": ratio},
        stiffness_ratios={name: ratio},
    )


def _draw_global_stiffness(rng: np.random.Generator, target: Target) -> Concealed:
    ratio = _draw_ratio(rng, 1.03, 1.15)
    return Concealed(
        name="global_stiffness",
        parameters={"stiffness_ratio": ratio},
        stiffness_ratios=dict.fromkeys(target.drawing.groups, ratio),
    )


def _draw_mass(rng: np.random.Generator, target: Target) -> Concealed:
    node, _ = target.draw_node(rng)
    mass = float(target.mass_kg * np.exp(rng.uniform(np.log(0.005), np.log(0.05))))

    def inertia(s: ComplexArray) -> ComplexArray:
        return mass * s**2

    return Concealed(
        name="added_mass",
        location={"nodes": [node + 1]},
        parameters={"mass_kg": mass},
        attached=tuple(({(node, axis): 1.0}, inertia) for axis in "xyz"),
    )


def _draw_grounded_spring(rng: np.random.Generator, target: Target) -> Concealed:
    node, axis = target.draw_node(rng)
    motion = {(node, axis): 1.0}
    stiffness = target.stiffness_against(motion) * float(rng.uniform(0.1, 1.0))
    return Concealed(
        name="grounded_spring",
        location={"nodes": [node + 1]},
        parameters={"stiffness_N_m": stiffness},
        attached=((motion, lambda s: np.full(s.shape, stiffness + 0j)),),
    )


def _draw_coupling_spring(rng: np.random.Generator, target: Target) -> Concealed:
    first, axis = target.draw_node(rng)
    second = first
    while second == first:
        second, _ = target.draw_node(rng)
    motion = {(first, axis): 1.0, (second, axis): -1.0}
    stiffness = target.stiffness_against(motion) * float(rng.uniform(0.1, 1.0))
    return Concealed(
        name="coupling_spring",
        location={"nodes": sorted([first + 1, second + 1])},
        parameters={"stiffness_N_m": stiffness},
        attached=((motion, lambda s: np.full(s.shape, stiffness + 0j)),),
    )


def _draw_damper(rng: np.random.Generator, target: Target) -> Concealed:
    node, axis = target.draw_node(rng)
    motion = {(node, axis): 1.0}
    middle = 2 * np.pi * np.sqrt(target.band_hz[0] * target.band_hz[1])
    damping = target.stiffness_against(motion) / middle * float(rng.uniform(0.1, 0.5))
    return Concealed(
        name="local_damper",
        location={"nodes": [node + 1]},
        parameters={"damping_Ns_m": damping},
        attached=((motion, lambda s: damping * s),),
    )


def _draw_resonator(rng: np.random.Generator, target: Target) -> Concealed:
    node, axis = target.draw_node(rng)
    mass = float(target.mass_kg * rng.uniform(0.005, 0.03))
    frequency = float(np.exp(rng.uniform(*np.log([2 * target.band_hz[0], 0.7 * target.band_hz[1]]))))
    ratio = float(rng.uniform(0.01, 0.05))
    omega = 2 * np.pi * frequency

    def stiffness(s: ComplexArray) -> ComplexArray:
        spring = omega**2 + 2 * ratio * omega * s
        return np.asarray(mass * s**2 * spring / (s**2 + spring))

    return Concealed(
        name="attached_resonator",
        location={"nodes": [node + 1]},
        parameters={"mass_kg": mass, "frequency_hz": frequency, "damping_ratio": ratio},
        attached=(({(node, axis): 1.0}, stiffness),),
    )


def _draw_damping(rng: np.random.Generator, target: Target) -> Concealed:
    factor = float(rng.uniform(1.8, 3.0))
    return Concealed(
        name="damping_level", parameters={"modal_ratio": factor * target.damping_ratio}, damping_factor=factor
    )


def _draw_delay(rng: np.random.Generator, target: Target) -> Concealed:
    column = str(rng.choice([sensor.column for sensor in target.sensors]))
    delay = float(rng.uniform(0.03, 0.15) / target.band_hz[1])
    return Concealed(
        name="time_delay",
        location={"channels": [column]},
        parameters={"delay_s": delay},
        gains={column: lambda s: np.exp(-delay * s)},
    )


def _draw_gain(rng: np.random.Generator, target: Target) -> Concealed:
    column = str(rng.choice([sensor.column for sensor in target.sensors]))
    ratio = -1.0 if rng.random() < 0.4 else _draw_ratio(rng, 1.08, 1.3)
    return Concealed(
        name="sensor_gain",
        location={"channels": [column]},
        parameters={"gain_ratio": ratio},
        gains={column: lambda s: np.full(s.shape, ratio + 0j)},
    )


def _draw_wrong_axis(rng: np.random.Generator, target: Target) -> Concealed:
    sensor = target.sensors[int(rng.integers(len(target.sensors)))]
    axis = str(rng.choice([axis for axis in "xyz" if axis != sensor.direction]))
    return Concealed(
        name="sensor_misplaced",
        location={"channels": [sensor.column], "nodes": [sensor.node + 1]},
        moved={sensor.column: (sensor.node, axis)},
    )


def _draw_misplaced(rng: np.random.Generator, target: Target) -> Concealed:
    sensor = target.sensors[int(rng.integers(len(target.sensors)))]
    node = int(rng.integers(len(target.shapes)))
    return Concealed(
        name="sensor_misplaced",
        location={"channels": [sensor.column], "nodes": [node + 1]},
        moved={sensor.column: (node, sensor.direction)},
    )


EFFECTS: dict[str, Draw] = {
    "mount": _draw_mount,
    "mass": _draw_mass,
    "wrong_axis": _draw_wrong_axis,
    "member": _draw_member,
    "delay": _draw_delay,
    "grounded_spring": _draw_grounded_spring,
    "misplaced": _draw_misplaced,
    "damping": _draw_damping,
    "gain": _draw_gain,
    "damper": _draw_damper,
    "resonator": _draw_resonator,
    "stiffness": _draw_global_stiffness,
    "coupling_spring": _draw_coupling_spring,
}
