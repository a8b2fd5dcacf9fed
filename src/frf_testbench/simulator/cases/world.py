"""A specimen as it really is, on its test bench: transfer functions and responses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.cases.scatter import Scatter
from frf_testbench.simulator.cases.set_up import ORDERS, SetUp
from frf_testbench.simulator.cases.specimens import Specimen
from frf_testbench.simulator.effects.effect import Effect, Pair
from frf_testbench.simulator.signals.receptance import Attachment, ModalReceptance, Modes, modal_receptance, solve_modes
from frf_testbench.simulator.structures.points import Point, Structure
from frf_testbench.simulator.structures.reality import Reality

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

HIGHEST_MODE = 4  # times the sampling rate; what is above enters by its static compliance


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class World:
    """Everything that is true about a test.

    Parameters
    ----------
    specimen, set_up, scatter, effects
        What it is made of.
    structure, modes
        As they really are, without attachments.
    receptance : ModalReceptance
        Between the rows of sensors, struck points, points of interest, nodes, and the motion of a law.
    nodes : tuple of int
        Nodes that have a row of their own: struck ones and points of interest, without offsets.
    """

    specimen: Specimen
    set_up: SetUp
    scatter: Scatter
    effects: tuple[Effect, ...]
    structure: Structure
    modes: Modes
    receptance: ModalReceptance
    nodes: tuple[int, ...]

    @property
    def sensor_rows(self) -> list[int]:
        """Rows of the sensors, where they really are."""
        return list(range(len(self.set_up.sensors)))

    @property
    def struck_rows(self) -> list[int]:
        """Rows of the points that are really struck."""
        start = len(self.set_up.sensors)
        return list(range(start, start + len(self.set_up.struck)))

    def node_row(self, node: int) -> int:
        """Row of a node without offset."""
        return len(self.set_up.sensors) + len(self.set_up.struck) + self.nodes.index(node)

    @property
    def law_row(self) -> int:
        """Row of the motion of the nonlinear law: the last one before those of attachments."""
        return len(self.set_up.sensors) + len(self.set_up.struck) + len(self.nodes)

    def chain(self, column: str, s: ComplexArray) -> ComplexArray:
        """(n_s,) transfer function of a channel."""
        gain = np.full(s.shape, self.scatter.gains[column], dtype=complex)
        for effect in self.effects:
            if column in effect.gains:
                gain = gain * effect.gains[column](s)
        return gain

    def motion(self, s: ComplexArray, receptance: ModalReceptance | None = None) -> ComplexArray:
        """(n_s, n_sensors, n_struck) signed motion per force, in the sensors' SI quantities, before the chain."""
        model = receptance or self.receptance
        H = model(s, self.sensor_rows, self.struck_rows)
        signs = np.array([sensor.sign for sensor in self.set_up.sensors])
        blows = np.array([sign for _, sign in self.set_up.struck])
        orders = np.array([ORDERS[sensor.quantity] for sensor in self.set_up.sensors])
        return H * s[:, None, None] ** orders[:, None] * (signs[:, None] * blows)

    def record_chain(self, signals: ComplexArray, force: ComplexArray, s: ComplexArray) -> ComplexArray:
        """Pass spectra through the channels.

        Parameters
        ----------
        signals : (n_s, n_sensors, ...) array
            True motions.
        force : (n_s, ...) array
            True force.
        s : (n_s,) array
            Lines.

        Returns
        -------
        (n_s, 1 + n_sensors, ...) array
            What the channels show, the force first, SI.
        """
        columns = ("force", *(sensor.column for sensor in self.set_up.sensors))
        shown = np.concatenate([force[:, None], signals], axis=1)
        for effect in self.effects:
            true = shown.copy()
            for to, source, factor in effect.crosstalk:
                shown[:, columns.index(to)] += factor * true[:, columns.index(source)]
        gains = np.stack([self.chain(column, s) for column in columns], axis=1)
        return shown * gains.reshape(gains.shape + (1,) * (shown.ndim - 2))

    def measured_frf(self, frequencies_hz: FloatArray) -> ComplexArray:
        """(n, n_sensors, n_struck) FRF that the test gives without noise, of the linear part, SI."""
        s = 2j * np.pi * frequencies_hz
        motion = self.motion(s)
        shown = self.record_chain(motion, np.ones((s.size, motion.shape[2]), dtype=complex), s)
        return shown[:, 1:] / shown[:, :1]

    def node_frf(self, frequencies_hz: FloatArray, output: int, source: int, order: int) -> ComplexArray:
        """(n,) true FRF between two nodes; `order` 0 for receptance, 1 for mobility, 2 for accelerance."""
        s = 2j * np.pi * frequencies_hz
        return s**order * self.receptance(s, [self.node_row(output)], [self.node_row(source)])[:, 0, 0]


def make_world(specimen: Specimen, set_up: SetUp, scatter: Scatter, effects: Sequence[Effect]) -> World:
    """Put a test together.

    Parameters
    ----------
    specimen, set_up, scatter
        What is tested, how, and what nobody knows about it.
    effects : sequence of Effect
        What the nominal model lacks.

    Returns
    -------
    World
        At most one of the effects has a nonlinear law, and then none has attachments.
    """
    structure = specimen.build(_reality(set_up, scatter, effects))
    modes = solve_modes(structure)
    rigid = structure.n_rigid
    omega = modes.omega_rad_s.copy()
    omega[rigid : rigid + scatter.frequency.size] *= scatter.frequency[: omega.size - rigid]
    modes = Modes(omega_rad_s=omega, shapes=modes.shapes)
    nodes = tuple(
        dict.fromkeys([*(node for node, _ in set_up.struck), *set_up.points, *_sensor_nodes(set_up, effects)])
    )
    rows = _rows(specimen, set_up, scatter, effects, structure, nodes)
    mounts = [mount for effect in effects for mount in effect.mounts]
    extra = np.array([_row(structure, motion) for mount in mounts for motion in mount.motions])
    everything = np.vstack([rows, extra]) if mounts else rows
    ratio = set_up.damping_ratio * np.prod([effect.damping_factor for effect in effects]) * scatter.damping
    model = modal_receptance(
        modes,
        everything,
        np.concatenate([np.full(rigid, scatter.cords_damping), ratio]),
        HIGHEST_MODE * set_up.rate_hz,
        modulus=next((effect.modulus for effect in effects if effect.modulus), None),
    )
    attachments, start = [], len(rows)
    for mount in mounts:
        stop = start + len(mount.motions)
        attachments.append(Attachment(rows=np.eye(len(everything))[start:stop], stiffness=mount.stiffness))
        start = stop
    return World(
        specimen=specimen,
        set_up=set_up,
        scatter=scatter,
        effects=tuple(effects),
        structure=structure,
        modes=modes,
        receptance=replace(model, attachments=tuple(attachments)),
        nodes=nodes,
    )


def _sensor_nodes(set_up: SetUp, effects: Sequence[Effect]) -> list[int]:
    """Nodes where the sensors really are."""
    moved = {column: node for effect in effects for column, node in effect.moved.items()}
    return [moved.get(sensor.column, sensor.node) for sensor in set_up.sensors]


def _reality(set_up: SetUp, scatter: Scatter, effects: Sequence[Effect]) -> Reality:
    motions = [motion for effect in effects for mount in effect.mounts for motion in mount.motions]
    motions += [effect.law_motion for effect in effects if effect.law_motion is not None]
    nodes = {point.node for motion in motions for point in motion if point is not None}
    nodes |= {node for node, _ in set_up.struck} | set(set_up.points) | set(_sensor_nodes(set_up, effects))
    reality = Reality(
        stiffness=scatter.stiffness, density=scatter.density, stations=tuple(sorted(nodes)), cords_hz=scatter.cords_hz
    )
    for effect in effects:
        reality = effect.change(reality)
    return reality


def _row(structure: Structure, motion: Pair) -> FloatArray:
    return structure.row(motion[0]) - (0 if motion[1] is None else structure.row(motion[1]))


def _rows(
    specimen: Specimen,
    set_up: SetUp,
    scatter: Scatter,
    effects: Sequence[Effect],
    structure: Structure,
    nodes: tuple[int, ...],
) -> FloatArray:
    """Rows of sensors, struck points, nodes, and of the law where there is one."""
    direction = specimen.direction

    def placed(node: int, key: str) -> Point:
        return Point(node, direction, _inside(specimen, structure, node, scatter.offsets[key]))

    points = [
        placed(node, sensor.column) for node, sensor in zip(_sensor_nodes(set_up, effects), set_up.sensors, strict=True)
    ]
    points += [placed(node, f"hit {node}") for node, _ in set_up.struck]
    points += [Point(node, direction) for node in nodes]
    rows = [structure.row(point) for point in points]
    rows += [_row(structure, effect.law_motion) for effect in effects if effect.law_motion is not None]
    return np.array(rows)


def _inside(specimen: Specimen, structure: Structure, node: int, offset: tuple[float, float]) -> tuple[float, float]:
    """Turn an offset that would leave the structure round."""
    place, size = structure.nodes[node], specimen.length_m
    return tuple(d if 0 <= x + d <= s or s == 0 else -d for x, d, s in zip(place[:2], offset, size, strict=True))
