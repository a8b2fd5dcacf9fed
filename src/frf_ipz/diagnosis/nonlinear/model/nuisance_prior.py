"""Nuisance parameters of the linear model: its errors, which are fitted beside a law, each with its prior.

All are in units of their prior standard deviation: frequencies and damping ratios of the modes of the band, the shapes
at sensors and inputs (positions, gains, uneven stiffness) and at the location of a law (uneven stiffness), and the
state at the start of a segment.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.diagnosis.model.nuisance import UNIFORM_STD
from frf_ipz.diagnosis.nonlinear.model.modal_model import (
    ModalModel,
    ModalResponse,
    NuisanceValues,
    nominal_values,
    remaining_motion,
    respond,
)
from frf_ipz.dofs import Dof

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.segments import SegmentSet
    from frf_ipz.diagnosis.options import DiagnoseOptions
    from frf_ipz.dofs import AnyDof

FREE_TO = 2.0  # times the top of the band: modes whose parameters are free

SUSPENSION_STD = 0.7  # of the logarithm of frequency and damping on a soft suspension: a factor of two
UNEVEN = 2.0  # times the stiffness tolerance: change of shapes by uneven stiffness
DIFFERENCE = 1e-5  # of a frequency or damping ratio: step of a derivative
NEIGHBOURS = 4  # nodes that show the slope of a shape
UNKNOWN_STATE = 30.0  # times the size of a mode's response: standard deviation of an unknown initial state
RIGID_STATE = 3.0  # the same of a rigid-body mode, at whose frequency nothing drives it
REMAINING_STATE = 2.0  # times the motion by the strongest impact that remains at the next


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NuisancePrior:
    """Nuisance parameters of the linear model and their prior standard deviations.

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
        Of shapes at inputs.
    locations : (n_locations, n_free) array
        Of shapes at locations; one of them is fitted at a time.
    initial_states : (n_moving, n_free) array
        Of the modal velocity at the start of segments, and of displacement times omega, m/s kg^1/2.
    moving : (n_moving,) int array
        Segments that start in motion.
    """

    modal_model: ModalModel
    modes: IntArray
    frequency: FloatArray
    damping: FloatArray
    sensors: FloatArray
    inputs: FloatArray
    locations: FloatArray
    initial_states: FloatArray
    moving: IntArray

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of parameters: frequencies, damping, sensors, inputs, location, initial motions and velocities."""
        return (
            *(self.frequency.size, self.damping.size, self.sensors.size, self.inputs.size, len(self.modes)),
            *(self.initial_states.size, self.initial_states.size),
        )

    @property
    def n_nuisance(self) -> int:
        """Number of all parameters."""
        return sum(self.sizes)

    @property
    def n_structural(self) -> int:
        """Number of parameters of the structure; those of initial states follow."""
        return sum(self.sizes[:5])

    def without_location(self, nuisance: FloatArray) -> FloatArray:
        """Set the parameters of the location of a law to zero, for another location."""
        parts = self._split(nuisance)
        parts[4] = np.zeros_like(parts[4])
        return np.concatenate(parts)

    def to_values(self, nuisance: FloatArray, at: int | None = None) -> NuisanceValues:
        """Convert nuisance parameters to differences from the nominal model.

        Parameters
        ----------
        nuisance : (n_nuisance,) array
            In prior standard deviations.
        at : int, optional
            Location of a law, an index in `ModalModel.locations`.

        Returns
        -------
        NuisanceValues
            Zero for modes that are not free.
        """
        values = nominal_values(self.modal_model)
        frequency, damping, sensors, inputs, location = self._split(nuisance)[:5]
        values.frequency[self.modes] = frequency * self.frequency
        values.damping[self.modes] = damping * self.damping
        values.sensors[:, self.modes] = sensors.reshape(self.sensors.shape) * self.sensors
        values.inputs[:, self.modes] = inputs.reshape(self.inputs.shape) * self.inputs
        if at is not None:
            values.location[self.modes] = location * self.locations[at]
        return values

    def location_free_vibration(self, nuisance: FloatArray, response: ModalResponse, location: int) -> ComplexArray:
        """Compute the motion of a location by the initial states of segments.

        Parameters
        ----------
        nuisance : (n_nuisance,) array
            In prior standard deviations.
        response : ModalResponse
            On the requested lines.
        location : int
            Index in `ModalModel.locations`.

        Returns
        -------
        (n_moving, n_lines) complex array
            m s.
        """
        free = _free_vibration(response, self.modes, 0) * response.location_shapes(location)[self.modes, None]
        return np.asarray(np.einsum("cbm,cml->bl", self.initial_states_of(nuisance), free))

    def sensor_free_vibration(self, nuisance: FloatArray, response: ModalResponse) -> ComplexArray:
        """Compute the motion of the sensors by the initial states of segments.

        Parameters
        ----------
        nuisance : (n_nuisance,) array
            In prior standard deviations.
        response : ModalResponse
            On the requested lines.

        Returns
        -------
        (n_moving, n_sensors, n_lines) complex array
            As `SegmentSet.motion`.
        """
        states, shapes = self.initial_states_of(nuisance), response.sensor_shapes[:, self.modes]
        motions = [
            np.einsum(
                "cbm,cml->bl", states, _free_vibration(response, self.modes, sensor.quantity.power) * shape[:, None]
            )
            for sensor, shape in zip(self.modal_model.sensors, shapes, strict=True)
        ]
        return np.stack(motions, 1)

    def initial_states_of(self, nuisance: FloatArray) -> FloatArray:
        """(2, n_moving, n_free) displacement times omega, and velocity, of modes at the start of segments."""
        parts = self._split(nuisance)[5:]
        return np.array([part.reshape(self.initial_states.shape) * self.initial_states for part in parts])

    def jacobian(
        self,
        segments: SegmentSet,
        response: ModalResponse,
        location_force: ComplexArray,
        location: int | None,
        nuisance: FloatArray | None = None,
    ) -> ComplexArray:
        """Derive the weighted responses by each nuisance parameter.

        Parameters
        ----------
        segments : SegmentSet
            The data; `response` is on their used lines.
        response : ModalResponse
            The structure with its present nuisance values.
        location_force : (n_segments, n_used) complex array
            Force of the law on the structure, N s.
        location : int, optional
            Of the law, an index in `ModalModel.locations`; None without a law.
        nuisance : (n_nuisance,) array, optional
            Present values: free vibrations by initial states change with frequencies and damping.

        Returns
        -------
        (n_nuisance, n_segments, n_sensors, n_used) complex array
            Per prior standard deviation, over the standard deviation of the data.
        """
        structural = self.structural_jacobian(segments, response, location_force, location, nuisance)
        if not len(self.moving):
            return structural
        of_states = self.state_jacobian(segments, response)
        dense = np.zeros((*of_states.shape[:3], *structural.shape[1:]), complex)
        for number, segment in enumerate(self.moving):
            dense[:, number, :, segment] = of_states[:, number]
        return np.concatenate([structural, dense.reshape(-1, *structural.shape[1:])])

    def state_jacobian(self, segments: SegmentSet, response: ModalResponse) -> ComplexArray:
        """Derive the weighted responses of each segment that starts in motion by its own initial state.

        Parameters
        ----------
        segments : SegmentSet
            The data; `response` is on their used lines.
        response : ModalResponse
            The structure with its present nuisance values.

        Returns
        -------
        (2, n_moving, n_free, n_sensors, n_used) complex array
            By displacements times omega, and by velocities; per prior standard deviation, over that of the data.
        """
        weight = 1 / np.sqrt(segments.variance[self.moving][:, :, segments.used])
        columns = np.empty((2, *self.initial_states.shape, *weight.shape[1:]), complex)
        for row, (sensor, shape) in enumerate(zip(self.modal_model.sensors, response.sensor_shapes, strict=True)):
            free = _free_vibration(response, self.modes, sensor.quantity.power) * shape[self.modes, None]
            columns[..., row, :] = free[:, None] * self.initial_states[..., None] * weight[:, None, row]
        return columns

    def structural_jacobian(
        self,
        segments: SegmentSet,
        response: ModalResponse,
        location_force: ComplexArray,
        location: int | None,
        nuisance: FloatArray | None = None,
    ) -> ComplexArray:
        """Derive the weighted responses by the parameters of the structure: the first `n_structural` of `jacobian`.

        Parameters
        ----------
        segments, response, location_force, location, nuisance
            As for `jacobian`.

        Returns
        -------
        (n_structural, n_segments, n_sensors, n_used) complex array
            Per prior standard deviation, over the standard deviation of the data.
        """
        modes = self.modes
        receptance = response.modes[modes]
        force = segments.force[:, segments.used]
        motion = response.input_shapes[segments.input_of][:, modes, None] * force[:, None] * receptance
        if location is not None:  # (segment, mode, line)
            motion = motion + response.location_shapes(location)[modes, None] * location_force[:, None] * receptance
        omega, ratio = (part[modes] for part in self.modal_model.poles(response.nuisance_values))
        by_damping = -receptance * (2 * ratio * omega)[:, None] * response.s * self.damping[:, None]
        by_frequency = -receptance * ((2 * omega**2)[:, None] + (2 * ratio * omega)[:, None] * response.s)
        weight = 1 / np.sqrt(segments.variance[:, :, segments.used])
        shapes = response.sensor_shapes[:, modes].T  # mode, sensor

        def at_sensors(modal: ComplexArray) -> ComplexArray:
            """(n_free, n_segments, n_sensors, n_used) from modal motion (n_segments, n_free, n_used)."""
            by_mode = np.ascontiguousarray(modal.swapaxes(0, 1))  # else the product has an order that is slow to read
            return np.asarray(by_mode[:, :, None] * shapes[:, None, :, None] * weight)

        parts = [at_sensors(motion * by_frequency * self.frequency[:, None]), at_sensors(motion * by_damping)]
        parts.append(_derive_by_sensor_shapes(motion.swapaxes(0, 1), self.sensors, weight))
        for number in range(len(self.modal_model.inputs)):
            of_input = (segments.input_of == number)[:, None, None]
            by_shape = np.where(of_input, force[:, None] * receptance, 0.0) * self.inputs[number][:, None]
            parts.append(at_sensors(by_shape))
        spread = np.zeros(len(modes)) if location is None else self.locations[location]
        parts.append(at_sensors(location_force[:, None] * receptance * spread[:, None]))
        columns = np.concatenate(parts)
        if nuisance is not None and len(self.moving):
            by_pole = self._derive_free_vibration_by_poles(nuisance, response)
            columns[: 2 * len(modes), self.moving] += by_pole * weight[self.moving]
            first = 2 * len(modes)
            for row, sensor in enumerate(self.modal_model.sensors):
                free = _free_vibration(response, modes, sensor.quantity.power)
                by_sensor_shape = (
                    np.einsum("cbm,cml->mbl", self.initial_states_of(nuisance), free) * self.sensors[row][:, None, None]
                )
                columns[first : first + len(modes), self.moving, row] += by_sensor_shape * weight[self.moving, row]
                first += len(modes)
        return columns

    def _derive_free_vibration_by_poles(self, nuisance: FloatArray, response: ModalResponse) -> ComplexArray:
        """(2 n_free, n_moving, n_sensors, n_lines) change of the free vibration by frequencies and damping ratios."""
        states, shapes = self.initial_states_of(nuisance), response.sensor_shapes[:, self.modes]
        derivatives = []
        for name, sizes in (("frequency", self.frequency), ("damping", self.damping)):
            ends = []
            for step in (DIFFERENCE, -DIFFERENCE):
                values = response.nuisance_values
                changed = replace(values, **{name: getattr(values, name) + step})
                ends.append(respond(self.modal_model, response.s, changed))
            rows = []
            for sensor, shape in zip(self.modal_model.sensors, shapes, strict=True):
                up, down = (_free_vibration(end, self.modes, sensor.quantity.power) for end in ends)
                scaled = (up - down) * (shape * sizes / (2 * DIFFERENCE))[:, None]
                rows.append(np.einsum("cbm,cml->mbl", states, scaled))
            derivatives.append(np.stack(rows, 2))
        return np.concatenate(derivatives)

    def keep_initial_states(self, nuisance: FloatArray) -> FloatArray:
        """Set all nuisance parameters to zero but the initial states of elastic modes.

        Hardly anything but a law shows the initial state of rigid-body modes; a linear model uses it for what it
        lacks elsewhere.
        """
        is_elastic = np.tile(self.modes >= self.modal_model.n_rigid, 2 * len(self.moving))
        return np.asarray(nuisance * np.concatenate([np.zeros(self.n_structural), is_elastic]))

    def without_initial_states(self, nuisance: FloatArray) -> tuple[NuisancePrior, FloatArray]:
        """Leave out the initial states, for segments that start at rest."""
        at_rest = replace(self, initial_states=self.initial_states[:0], moving=self.moving[:0])
        return at_rest, nuisance[: at_rest.n_nuisance]

    def _split(self, nuisance: FloatArray) -> list[FloatArray]:
        return np.split(nuisance, np.cumsum(self.sizes)[:-1])


def _free_vibration(response: ModalResponse, modes: IntArray, power: int) -> ComplexArray:
    """Transform free vibrations, (2, n_free, n_lines), s / omega and s^2 / omega, as displacements.

    They start with a modal displacement of 1 / omega, or with a velocity of 1. What is measured as velocity or
    acceleration and divided by s or s^2 lacks the polynomial in t that integration from rest leaves out.
    """
    s, receptance = response.s, response.modes[modes]
    omega = (response.modal_model.omega_rad_s[modes] * np.exp(response.nuisance_values.frequency[modes]))[:, None]
    ratio = (response.modal_model.damping_ratio[modes] * np.exp(response.nuisance_values.damping[modes]))[:, None]
    loss = 2 * ratio * omega
    displaced, moving = (
        ((s + loss) / omega, np.ones_like(receptance)),
        (-omega / s * np.ones_like(receptance), np.ones_like(receptance)),
        (-omega / s * np.ones_like(receptance), -(s * loss + omega**2) / s**2),
    )[power]
    return np.stack([displaced * receptance, moving * receptance])


def _derive_by_sensor_shapes(motion: ComplexArray, sizes: FloatArray, weight: FloatArray) -> ComplexArray:
    """Columns that change one mode at one sensor: (n_sensors n_free, n_segments, n_sensors, n_lines)."""
    n_sensors, n_free = sizes.shape
    columns = np.zeros((n_sensors, n_free, *weight.shape), complex)
    for sensor in range(n_sensors):
        columns[sensor, :, :, sensor] = motion * sizes[sensor][:, None, None] * weight[:, sensor]
    return columns.reshape(-1, *weight.shape)


def make_nuisance_prior(
    modal_model: ModalModel, segments: SegmentSet, top_hz: float, options: DiagnoseOptions
) -> NuisancePrior:
    """Derive the prior from the tolerances of the user.

    Parameters
    ----------
    modal_model : ModalModel
        The structure.
    segments : SegmentSet
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
    modes = np.arange(np.searchsorted(modal_model.omega_rad_s, 2 * np.pi * FREE_TO * top_hz))
    rigid = modes < modal_model.n_rigid
    frequency = np.hypot(options.frequency_tolerance, options.stiffness_tolerance / 2) * UNIFORM_STD
    moving = np.flatnonzero(segments.moving)
    initial_states = np.zeros((len(moving), len(modes)))
    if len(moving):
        response = np.abs(modal_model.at_inputs.shapes[segments.input_of[moving]][:, modes]).max(1, keepdims=True)
        impulse = np.sqrt(np.mean(np.abs(segments.force[:, segments.used]) ** 2, 1))
        unknown = np.where(rigid, RIGID_STATE, UNKNOWN_STATE) * response * impulse[moving, None]
        pause = segments.pause_s[moving]
        remaining = REMAINING_STATE * response * impulse.max() * remaining_motion(modal_model, pause)[:, modes]
        initial_states = np.where(pause[:, None] > 0, remaining, unknown)
    return NuisancePrior(
        modal_model=modal_model,
        modes=modes,
        frequency=np.where(rigid, SUSPENSION_STD, frequency),
        damping=np.where(rigid, SUSPENSION_STD, options.damping_tolerance * UNIFORM_STD),
        sensors=_point_shape_stds(modal_model, tuple(s.dof for s in modal_model.sensors), modes, options),
        inputs=_point_shape_stds(modal_model, modal_model.inputs, modes, options),
        locations=_location_shape_stds(modal_model, modes, options),
        initial_states=initial_states,
        moving=moving,
    )


def _location_shape_stds(modal_model: ModalModel, modes: IntArray, options: DiagnoseOptions) -> FloatArray:
    """Change of shapes at locations by uneven stiffness, as a part of the largest of all nodes, or of all springs."""
    shapes = np.abs(modal_model.at_locations.shapes[:, modes])
    across = np.array([len(ends) > 1 for ends in modal_model.ends])[:, None]
    largest = [np.where(across == kind, shapes, 0.0).max(0) for kind in (False, True)]
    return np.asarray(UNEVEN * options.stiffness_tolerance * np.where(across, largest[1], largest[0]))


def _point_shape_stds(
    modal_model: ModalModel, dofs: tuple[AnyDof, ...], modes: IntArray, options: DiagnoseOptions
) -> FloatArray:
    """Give stds of shapes at points by gains, uneven stiffness and, by their slope, the exact position."""
    largest = np.abs(modal_model.at_locations.shapes[:, modes]).max(0)
    points = np.vstack([modal_model.at_sensors.shapes, modal_model.at_inputs.shapes])[:, modes]
    shape_of = {
        dof.unsigned: dof.sign * row
        for dof, row in zip((*(s.dof for s in modal_model.sensors), *modal_model.inputs), points, strict=True)
    }
    spread = []
    for dof in dofs:
        slope = _largest_slope(modal_model, dof, shape_of[dof.unsigned], modes)
        size = np.abs(shape_of[dof.unsigned])
        parts = (
            options.gain_tolerance * UNIFORM_STD * size,
            UNEVEN * options.stiffness_tolerance * largest,
            options.position_tolerance_m_per_m * UNIFORM_STD * slope,
        )
        spread.append(np.sqrt(np.sum(np.square(parts), 0)))
    return np.array(spread)


def _largest_slope(modal_model: ModalModel, dof: AnyDof, shape: FloatArray, modes: IntArray) -> FloatArray:
    """Largest change of shapes towards neighbours, per length of the structure."""
    if modal_model.model.kind == "lumped" or not isinstance(dof, Dof):
        return np.zeros(len(modes))
    geometry = modal_model.model.geometry
    position = dict(zip(geometry.nodes.tolist(), geometry.coordinates_m, strict=True))
    extent = float(np.ptp(geometry.coordinates_m, axis=0).max())
    distances = [
        (float(np.linalg.norm(position[ends[0].node] - position[dof.node])), row)
        for row, ends in enumerate(modal_model.ends)
        if len(ends) == 1 and ends[0].direction == dof.direction and ends[0].node != dof.node
    ]
    nearest = sorted(pair for pair in distances if pair[0] > 0)[:NEIGHBOURS]
    slopes = [np.abs(modal_model.at_locations.shapes[row, modes] - shape) / distance for distance, row in nearest]
    return extent * np.max(slopes, axis=0) if slopes else np.zeros(len(modes))
