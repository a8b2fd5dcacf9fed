"""A specimen as it really is, in its test: transfer functions from the excitation to what the channels show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.cases.scatter import Scatter
from frf_testbench.simulator.effects.effect import Effect
from frf_testbench.simulator.set_up import ORDERS, SetUp
from frf_testbench.simulator.signals.receptance import Attachment, ModalReceptance, Modes, make_receptance, solve_modes
from frf_testbench.simulator.specimens import Specimen
from frf_testbench.simulator.structures.reality import Reality
from frf_testbench.simulator.structures.structure import Point, Structure

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

HIGHEST_MODE = 4  # times the sampling rate; what is above enters by its static compliance


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrueSystem:
    """Everything that is true about a test of a specimen.

    Parameters
    ----------
    specimen, set_up, scatter, effects
        What it is made of.
    structure, modes
        As they really are, without attachments.
    receptance : ModalReceptance
        Between the rows of sensors, excited points, points of interest, nodes, and the motion of a law.
    nodes : tuple of int
        Nodes that have a row of their own: excited ones and points of interest, without offsets.
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
    def excited_rows(self) -> list[int]:
        """Rows of the points that are really excited."""
        start = len(self.set_up.sensors)
        return list(range(start, start + len(self.set_up.excited_points)))

    def node_row(self, node: int) -> int:
        """Row of a node without offset."""
        return len(self.set_up.sensors) + len(self.set_up.excited_points) + self.nodes.index(node)

    @property
    def law_row(self) -> int:
        """Row of the motion of the nonlinear law: the last one before those of attachments."""
        return len(self.set_up.sensors) + len(self.set_up.excited_points) + len(self.nodes)

    def channel_gain(self, column: str, s: ComplexArray) -> ComplexArray:
        """Return the (n_s,) transfer function of a channel."""
        gain = np.full(s.shape, self.scatter.gains[column], dtype=complex)
        for effect in self.effects:
            if column in effect.gains:
                gain = gain * effect.gains[column](s)
        return gain

    def motion(self, s: ComplexArray, receptance: ModalReceptance | None = None) -> ComplexArray:
        """Return the (n_s, n_sensors, n_excited) signed motions per force at the sensors, in their SI quantities."""
        model = receptance or self.receptance
        H = model(s, self.sensor_rows, self.excited_rows)
        signs = np.array([sensor.sign for sensor in self.set_up.sensors])
        force_signs = np.array([sign for _, sign in self.set_up.excited_points])
        orders = np.array([ORDERS[sensor.quantity] for sensor in self.set_up.sensors])
        return np.asarray(H * s[:, None, None] ** orders[:, None] * (signs[:, None] * force_signs))

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
        recorded = np.concatenate([force[:, None], signals], axis=1)
        for effect in self.effects:
            undisturbed = recorded.copy()
            for to, source, factor in effect.crosstalk:
                recorded[:, columns.index(to)] += factor * undisturbed[:, columns.index(source)]
        gains = np.stack([self.channel_gain(column, s) for column in columns], axis=1)
        return np.asarray(recorded * gains.reshape(gains.shape + (1,) * (recorded.ndim - 2)))

    def measured_frf(self, frequencies_hz: FloatArray) -> ComplexArray:
        """Return the (n, n_sensors, n_excited) FRF that the test gives without noise, of the linear part, SI."""
        s = np.asarray(2j * np.pi * frequencies_hz, np.complex128)
        motion = self.motion(s)
        recorded = self.record_chain(motion, np.ones((s.size, motion.shape[2]), dtype=complex), s)
        return recorded[:, 1:] / recorded[:, :1]

    def node_frf(self, frequencies_hz: FloatArray, output: int, source: int, order: int) -> ComplexArray:
        """Return the (n,) true FRF between two nodes; `order` 0 for receptance, 1 for mobility, 2 for accelerance."""
        s = np.asarray(2j * np.pi * frequencies_hz, np.complex128)
        return np.asarray(s**order * self.receptance(s, [self.node_row(output)], [self.node_row(source)])[:, 0, 0])


def build_system(specimen: Specimen, set_up: SetUp, scatter: Scatter, effects: Sequence[Effect]) -> TrueSystem:
    """Put a test together.

    Parameters
    ----------
    specimen, set_up, scatter
        What is tested, how, and what nobody knows about it.
    effects : sequence of Effect
        What the nominal model lacks.

    Returns
    -------
    TrueSystem
        At most one of the effects has a nonlinear law, and then none has attachments.
    """
    structure = specimen.build(_collect_reality(set_up, scatter, effects))
    modes = solve_modes(structure)
    rigid = structure.n_rigid
    omega = modes.omega_rad_s.copy()
    omega[rigid : rigid + scatter.frequency.size] *= scatter.frequency[: omega.size - rigid]
    modes = Modes(omega_rad_s=omega, shapes=modes.shapes)
    nodes = tuple(
        dict.fromkeys(
            [*(node for node, _ in set_up.excited_points), *set_up.points, *_true_sensor_nodes(set_up, effects)]
        )
    )
    rows = _list_rows(specimen, set_up, scatter, effects, structure, nodes)
    mounts = [mount for effect in effects for mount in effect.mounts]
    mount_rows = np.array([structure.motion_row(motion) for mount in mounts for motion in mount.motions])
    all_rows = np.vstack([rows, mount_rows]) if mounts else rows
    ratio = set_up.damping_ratio * np.prod([effect.damping_factor for effect in effects]) * scatter.damping
    model = make_receptance(
        modes,
        all_rows,
        np.concatenate([np.full(rigid, scatter.suspension_damping), ratio]),
        HIGHEST_MODE * set_up.rate_hz,
        modulus=next((effect.modulus for effect in effects if effect.modulus), None),
    )
    attachments, start = [], len(rows)
    for mount in mounts:
        stop = start + len(mount.motions)
        attachments.append(Attachment(rows=np.eye(len(all_rows))[start:stop], stiffness=mount.stiffness))
        start = stop
    return TrueSystem(
        specimen=specimen,
        set_up=set_up,
        scatter=scatter,
        effects=tuple(effects),
        structure=structure,
        modes=modes,
        receptance=replace(model, attachments=tuple(attachments)),
        nodes=nodes,
    )


def _true_sensor_nodes(set_up: SetUp, effects: Sequence[Effect]) -> list[int]:
    """List the nodes where the sensors really are."""
    true_nodes = {column: node for effect in effects for column, node in effect.sensor_nodes.items()}
    return [true_nodes.get(sensor.column, sensor.node) for sensor in set_up.sensors]


def _collect_reality(set_up: SetUp, scatter: Scatter, effects: Sequence[Effect]) -> Reality:
    motions = [motion for effect in effects for mount in effect.mounts for motion in mount.motions]
    motions += [effect.law_motion for effect in effects if effect.law_motion is not None]
    nodes = {point.node for motion in motions for point in motion if point is not None}
    nodes |= {node for node, _ in set_up.excited_points} | set(set_up.points) | set(_true_sensor_nodes(set_up, effects))
    reality = Reality(
        stiffness=scatter.stiffness,
        density=scatter.density,
        stations=tuple(sorted(nodes)),
        suspension_hz=scatter.suspension_hz,
    )
    for effect in effects:
        reality = effect.change_reality(reality)
    return reality


def _list_rows(
    specimen: Specimen,
    set_up: SetUp,
    scatter: Scatter,
    effects: Sequence[Effect],
    structure: Structure,
    nodes: tuple[int, ...],
) -> FloatArray:
    """List the rows of sensors, excited points, nodes, and of the law where there is one."""
    direction = specimen.direction

    def point_beside(node: int, key: str) -> Point:
        return Point(node, direction, _turn_inside(specimen, structure, node, scatter.offsets[key]))

    points = [
        point_beside(node, sensor.column)
        for node, sensor in zip(_true_sensor_nodes(set_up, effects), set_up.sensors, strict=True)
    ]
    points += [point_beside(node, f"hit {node}") for node, _ in set_up.excited_points]
    points += [Point(node, direction) for node in nodes]
    rows = [structure.row(point) for point in points]
    rows += [structure.motion_row(effect.law_motion) for effect in effects if effect.law_motion is not None]
    return np.array(rows)


def _turn_inside(
    specimen: Specimen, structure: Structure, node: int, offset: tuple[float, float]
) -> tuple[float, float]:
    """Turn an offset that would leave the structure round."""
    position, size = structure.nodes[node][:2], specimen.length_m
    along_x, along_y = (d if 0 <= x + d <= s or s == 0 else -d for x, d, s in zip(position, offset, size, strict=True))
    return along_x, along_y
