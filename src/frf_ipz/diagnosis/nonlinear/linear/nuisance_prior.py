"""What the linear model may be wrong by: unknowns that are fitted besides a law, each with its prior.

All are counted in units of their prior standard deviation: frequencies and damping ratios of the modes of the band, the
shapes at sensors and blows (positions, gains, uneven stiffness) and at the place of a law (uneven stiffness), and the
motion at the start of a stretch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.diagnosis.model.nuisance import UNIFORM_STD
from frf_ipz.diagnosis.nonlinear.linear.modal_model import (
    ModalModel,
    ModalResponse,
    NuisanceValues,
    nominal_values,
    respond,
)
from frf_ipz.diagnosis.nonlinear.recorded.segments import decayed

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.recorded.segments import SegmentSet
    from frf_ipz.diagnosis.options import DiagnoseOptions
    from frf_ipz.dofs import Dof

BEYOND = 2.0  # times the top of the band: modes whose parameters are free

CORD_SPREAD = 0.7  # of the logarithm of frequency and damping on soft cords: a factor of two
UNEVEN = 2.0  # times the stiffness tolerance: what uneven stiffness does to shapes
DIFFERENCE = 1e-5  # of a frequency or damping ratio: step of a derivative
NEAREST = 4  # nodes that tell the slope of a shape
START_SPREAD = 30.0  # times the size of a mode's response: a start that is not known at all
RIGID_SPREAD = 3.0  # the same of a rigid-body mode, at whose frequency nothing drives it
LEFT_SPREAD = 2.0  # times what the strongest blow can have left when the next comes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NuisancePrior:
    """Unknowns of the linear model and how far they may go.

    Parameters
    ----------
    modal_model : ModalModel
        The structure.
    modes : (n_free,) int array
        Modes whose parameters are free.
    frequency, damping : (n_free,) array
        Prior standard deviations of logarithms.
    sensors : (n_sensors, n_free) array
        Of shapes at sensors.
    inputs : (n_inputs, n_free) array
        Of shapes at blows.
    places : (n_places, n_free) array
        Of shapes at places; one place is looked at at a time.
    starts : (n_moving, n_free) array
        Of the modal velocity at the start of stretches, and of displacement times omega, m/s kg^1/2.
    moving : (n_moving,) int array
        SegmentSet that start in motion.
    """

    modal_model: ModalModel
    modes: IntArray
    frequency: FloatArray
    damping: FloatArray
    sensors: FloatArray
    inputs: FloatArray
    places: FloatArray
    starts: FloatArray
    moving: IntArray

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of unknowns: frequencies, damping, sensors, inputs, place, starting motions and velocities."""
        return (
            *(self.frequency.size, self.damping.size, self.sensors.size, self.inputs.size, len(self.modes)),
            *(self.starts.size, self.starts.size),
        )

    @property
    def n_unknowns(self) -> int:
        """Number of all unknowns."""
        return sum(self.sizes)

    @property
    def n_lasting(self) -> int:
        """Number of unknowns of the structure; those of how stretches start follow."""
        return sum(self.sizes[:5])

    def of_no_place(self, unknowns: FloatArray) -> FloatArray:
        """Forget what unknowns say of the place of a law, for another place."""
        parts = self._split(unknowns)
        parts[4] = np.zeros_like(parts[4])
        return np.concatenate(parts)

    def deviations(self, unknowns: FloatArray, at: int | None = None) -> NuisanceValues:
        """Turn unknowns into deviations of the plant.

        Parameters
        ----------
        unknowns : (n_unknowns,) array
            In prior standard deviations.
        at : int, optional
            Place of a law, an index in `ModalModel.places`.

        Returns
        -------
        NuisanceValues
            Zero for modes that are not free.
        """
        found = nominal_values(self.modal_model)
        frequency, damping, sensors, inputs, place = self._split(unknowns)[:5]
        found.frequency[self.modes] = frequency * self.frequency
        found.damping[self.modes] = damping * self.damping
        found.sensors[:, self.modes] = sensors.reshape(self.sensors.shape) * self.sensors
        found.inputs[:, self.modes] = inputs.reshape(self.inputs.shape) * self.inputs
        if at is not None:
            found.place[self.modes] = place * self.places[at]
        return found

    def place_starts(self, unknowns: FloatArray, response: ModalResponse, place: int) -> ComplexArray:
        """Motion of a place that stems from how stretches start.

        Parameters
        ----------
        unknowns : (n_unknowns,) array
            In prior standard deviations.
        response : ModalResponse
            On the lines wanted.
        place : int
            Index in `ModalModel.places`.

        Returns
        -------
        (n_moving, n_lines) complex array
            m s.
        """
        free = _free_motion(response, self.modes, 0) * response.place_shapes(place)[self.modes, None]
        return np.asarray(np.einsum("cbm,cml->bl", self.starts_of(unknowns), free))

    def sensor_starts(self, unknowns: FloatArray, response: ModalResponse) -> ComplexArray:
        """Give what sensors show of how stretches start.

        Parameters
        ----------
        unknowns : (n_unknowns,) array
            In prior standard deviations.
        response : ModalResponse
            On the lines wanted.

        Returns
        -------
        (n_moving, n_sensors, n_lines) complex array
            As `SegmentSet.motion`.
        """
        starts, shapes = self.starts_of(unknowns), response.sensor_shapes[:, self.modes]
        seen = [
            np.einsum("cbm,cml->bl", starts, _free_motion(response, self.modes, sensor.quantity.power) * shape[:, None])
            for sensor, shape in zip(self.modal_model.sensors, shapes, strict=True)
        ]
        return np.stack(seen, 1)

    def starts_of(self, unknowns: FloatArray) -> FloatArray:
        """(2, n_moving, n_free) displacement times omega, and velocity, of modes at the start of stretches."""
        parts = self._split(unknowns)[5:]
        return np.array([part.reshape(self.starts.shape) * self.starts for part in parts])

    def columns(
        self,
        stretches: SegmentSet,
        response: ModalResponse,
        place_force: ComplexArray,
        place: int | None,
        unknowns: FloatArray | None = None,
    ) -> ComplexArray:
        """Change of the weighted responses by each unknown.

        Parameters
        ----------
        stretches : SegmentSet
            The data; `response` is on their used lines.
        response : ModalResponse
            The structure as it is thought to be.
        place_force : (n_blows, n_used) complex array
            Force of the law on the structure, N s.
        place : int, optional
            Of the law, an index in `ModalModel.places`; None without a law.
        unknowns : (n_unknowns,) array, optional
            Where the linear model is: how stretches start changes with frequencies and damping.

        Returns
        -------
        (n_unknowns, n_blows, n_sensors, n_used) complex array
            Per prior standard deviation, over the standard deviation of the data.
        """
        modes = self.modes
        own = response.modes[modes]
        force = stretches.force[:, stretches.used]
        motion = response.input_shapes[stretches.input_of][:, modes, None] * force[:, None] * own  # blow, mode, line
        if place is not None:
            motion = motion + response.place_shapes(place)[modes, None] * place_force[:, None] * own
        omega, ratio = (part[modes] for part in self.modal_model.poles(response.deviations))
        by_damping = -own * (2 * ratio * omega)[:, None] * response.s * self.damping[:, None]
        by_frequency = -own * ((2 * omega**2)[:, None] + (2 * ratio * omega)[:, None] * response.s)
        weight = 1 / np.sqrt(stretches.variance[:, :, stretches.used])
        shapes = response.sensor_shapes[:, modes].T  # mode, sensor

        def seen(modal: ComplexArray) -> ComplexArray:
            """(n_free, n_blows, n_sensors, n_used) from modal motion (n_blows, n_free, n_used)."""
            return np.asarray(modal.swapaxes(0, 1)[:, :, None] * shapes[:, None, :, None] * weight)

        parts = [seen(motion * by_frequency * self.frequency[:, None]), seen(motion * by_damping)]
        parts.append(_one_by_one(motion.swapaxes(0, 1), self.sensors, weight))
        for number in range(len(self.modal_model.inputs)):
            mine = (stretches.input_of == number)[:, None, None]
            parts.append(seen(np.where(mine, force[:, None] * own, 0.0) * self.inputs[number][:, None]))
        spread = np.zeros(len(modes)) if place is None else self.places[place]
        parts.append(seen(place_force[:, None] * own * spread[:, None]))
        parts += self._start_columns(response, weight)
        columns = np.concatenate(parts)
        if unknowns is not None and len(self.moving):
            columns[: 2 * len(modes), self.moving] += self._starts_by_pole(unknowns, response) * weight[self.moving]
            first = 2 * len(modes)
            for row, sensor in enumerate(self.modal_model.sensors):
                free = _free_motion(response, modes, sensor.quantity.power)
                seen_starts = (
                    np.einsum("cbm,cml->mbl", self.starts_of(unknowns), free) * self.sensors[row][:, None, None]
                )
                columns[first : first + len(modes), self.moving, row] += seen_starts * weight[self.moving, row]
                first += len(modes)
        return columns

    def _starts_by_pole(self, unknowns: FloatArray, response: ModalResponse) -> ComplexArray:
        """(2 n_free, n_moving, n_sensors, n_lines) change of what sensors show of starts, by poles."""
        starts, shapes = self.starts_of(unknowns), response.sensor_shapes[:, self.modes]
        found = []
        for name, sizes in (("frequency", self.frequency), ("damping", self.damping)):
            ends = []
            for way in (DIFFERENCE, -DIFFERENCE):
                there = replace(response.deviations, **{name: getattr(response.deviations, name) + way})
                ends.append(respond(self.modal_model, response.s, there))
            rows = []
            for sensor, shape in zip(self.modal_model.sensors, shapes, strict=True):
                up, down = (_free_motion(end, self.modes, sensor.quantity.power) for end in ends)
                scaled = (up - down) * (shape * sizes / (2 * DIFFERENCE))[:, None]
                rows.append(np.einsum("cbm,cml->mbl", starts, scaled))
            found.append(np.stack(rows, 2))
        return np.concatenate(found)

    def _start_columns(self, response: ModalResponse, weight: FloatArray) -> list[ComplexArray]:
        columns = np.zeros((2, *self.starts.shape, *weight.shape), complex)
        for row, (sensor, shape) in enumerate(zip(self.modal_model.sensors, response.sensor_shapes, strict=True)):
            free = _free_motion(response, self.modes, sensor.quantity.power) * shape[self.modes, None]
            for number, record in enumerate(self.moving):
                columns[:, number, :, record, row] = free * self.starts[number][:, None] * weight[record, row]
        return list(columns.reshape(-1, self.starts.shape[1], *weight.shape)) if len(self.moving) else []

    def as_stated(self, unknowns: FloatArray) -> FloatArray:
        """Keep of unknowns how stretches start, but for rigid-body modes.

        Hardly anything but a law shows how these start; what a linear model says of it is what it lacks elsewhere.
        """
        starts = np.tile(self.modes >= self.modal_model.n_rigid, 2 * len(self.moving))
        return np.asarray(unknowns * np.concatenate([np.zeros(self.n_lasting), starts]))

    def without_starts(self, unknowns: FloatArray) -> tuple[NuisancePrior, FloatArray]:
        """Leave out how stretches start, for others that start at rest."""
        none = replace(self, starts=self.starts[:0], moving=self.moving[:0])
        return none, unknowns[: none.n_unknowns]

    def _split(self, unknowns: FloatArray) -> list[FloatArray]:
        return np.split(unknowns, np.cumsum(self.sizes)[:-1])


def _free_motion(response: ModalResponse, modes: IntArray, power: int) -> ComplexArray:
    """Transform free vibrations, (2, n_free, n_lines), s / omega and s^2 / omega, as displacements.

    They start with a modal displacement of 1 / omega, or with a velocity of 1. What is measured as velocity or
    acceleration and divided by s or s^2 lacks the polynomial in t that integration from rest leaves out.
    """
    s, own = response.s, response.modes[modes]
    omega = (response.modal_model.omega_rad_s[modes] * np.exp(response.deviations.frequency[modes]))[:, None]
    ratio = (response.modal_model.damping_ratio[modes] * np.exp(response.deviations.damping[modes]))[:, None]
    loss = 2 * ratio * omega
    displaced, moving = (
        ((s + loss) / omega, np.ones_like(own)),
        (-omega / s * np.ones_like(own), np.ones_like(own)),
        (-omega / s * np.ones_like(own), -(s * loss + omega**2) / s**2),
    )[power]
    return np.stack([displaced * own, moving * own])


def _one_by_one(motion: ComplexArray, sizes: FloatArray, weight: FloatArray) -> ComplexArray:
    """Columns that change one mode at one sensor: (n_sensors n_free, n_blows, n_sensors, n_lines)."""
    n_sensors, n_free = sizes.shape
    columns = np.zeros((n_sensors, n_free, *weight.shape), complex)
    for sensor in range(n_sensors):
        columns[sensor, :, :, sensor] = motion * sizes[sensor][:, None, None] * weight[:, sensor]
    return columns.reshape(-1, *weight.shape)


def make_nuisance_prior(
    modal_model: ModalModel, stretches: SegmentSet, top_hz: float, options: DiagnoseOptions
) -> NuisancePrior:
    """Say what may deviate, from the tolerances of the user.

    Parameters
    ----------
    modal_model : ModalModel
        The structure.
    stretches : SegmentSet
        Which of them start in motion.
    top_hz : float
        Top of the band.
    options : DiagnoseOptions
        Tolerances.

    Returns
    -------
    NuisancePrior
        For the modes of the band and the first ones above it.
    """
    modes = np.arange(np.searchsorted(modal_model.omega_rad_s, 2 * np.pi * BEYOND * top_hz))
    rigid = modes < modal_model.n_rigid
    frequency = np.hypot(options.frequency_tolerance, options.stiffness_tolerance / 2) * UNIFORM_STD
    moving = np.flatnonzero(stretches.moving)
    starts = np.zeros((len(moving), len(modes)))
    if len(moving):
        response = np.abs(modal_model.at_inputs.shapes[stretches.input_of[moving]][:, modes]).max(1, keepdims=True)
        impulse = np.sqrt(np.mean(np.abs(stretches.force[:, stretches.used]) ** 2, 1))
        unknown = np.where(rigid, RIGID_SPREAD, START_SPREAD) * response * impulse[moving, None]
        pause = stretches.pause_s[moving]
        left = LEFT_SPREAD * response * impulse.max() * decayed(modal_model, pause)[:, modes]
        starts = np.where(pause[:, None] > 0, left, unknown)
    return NuisancePrior(
        modal_model=modal_model,
        modes=modes,
        frequency=np.where(rigid, CORD_SPREAD, frequency),
        damping=np.where(rigid, CORD_SPREAD, options.damping_tolerance * UNIFORM_STD),
        sensors=_shape_spread(modal_model, tuple(s.dof for s in modal_model.sensors), modes, options),
        inputs=_shape_spread(modal_model, modal_model.inputs, modes, options),
        places=_uneven(modal_model, modes, options),
        starts=starts,
        moving=moving,
    )


def _uneven(modal_model: ModalModel, modes: IntArray, options: DiagnoseOptions) -> FloatArray:
    """How far uneven stiffness moves shapes at places, as a part of the largest of all nodes, or of all springs."""
    shapes = np.abs(modal_model.at_places.shapes[:, modes])
    across = np.array([len(place.ends) > 1 for place in modal_model.places])[:, None]
    largest = [np.where(across == kind, shapes, 0.0).max(0) for kind in (False, True)]
    return np.asarray(UNEVEN * options.stiffness_tolerance * np.where(across, largest[1], largest[0]))


def _shape_spread(
    modal_model: ModalModel, dofs: tuple[Dof, ...], modes: IntArray, options: DiagnoseOptions
) -> FloatArray:
    """How far shapes at points may be off: by gains, uneven stiffness and, off the exact place, by their slope."""
    largest = np.abs(modal_model.at_places.shapes[:, modes]).max(0)
    points = np.vstack([modal_model.at_sensors.shapes, modal_model.at_inputs.shapes])[:, modes]
    known = {
        dof.unsigned: dof.sign * row
        for dof, row in zip((*(s.dof for s in modal_model.sensors), *modal_model.inputs), points, strict=True)
    }
    spread = []
    for dof in dofs:
        slope = _slope(modal_model, dof, known[dof.unsigned], modes)
        size = np.abs(known[dof.unsigned])
        parts = (
            options.gain_tolerance * UNIFORM_STD * size,
            UNEVEN * options.stiffness_tolerance * largest,
            options.position_tolerance_m_per_m * UNIFORM_STD * slope,
        )
        spread.append(np.sqrt(np.sum(np.square(parts), 0)))
    return np.array(spread)


def _slope(modal_model: ModalModel, dof: Dof, shape: FloatArray, modes: IntArray) -> FloatArray:
    """Largest change of shapes towards neighbours, per length of the structure."""
    if modal_model.model.kind == "lumped":
        return np.zeros(len(modes))
    geometry = modal_model.model.geometry
    where = dict(zip(geometry.nodes.tolist(), geometry.coordinates_m, strict=True))
    extent = float(np.ptp(geometry.coordinates_m, axis=0).max())
    others = [
        (float(np.linalg.norm(where[place.ends[0].node] - where[dof.node])), row)
        for row, place in enumerate(modal_model.places)
        if len(place.ends) == 1 and place.ends[0].direction == dof.direction and place.ends[0].node != dof.node
    ]
    near = sorted(other for other in others if other[0] > 0)[:NEAREST]
    slopes = [np.abs(modal_model.at_places.shapes[row, modes] - shape) / way for way, row in near]
    return extent * np.max(slopes, axis=0) if slopes else np.zeros(len(modes))
