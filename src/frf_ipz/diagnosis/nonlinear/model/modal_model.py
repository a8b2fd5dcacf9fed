"""The linear part of a structure with a force law: its modes, residual terms, and the locations where a law could act.

Transfer functions connect three kinds of points: inputs, sensors, and locations. Each is a sum over modes up to a few
times the band and the first two terms of the other modes' series in s^2. The errors of the model (`NuisanceValues`)
change frequencies, damping and the mode shapes at sensors, inputs and the location of a law.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.modes import SUSPENSION_RATIO
from frf_ipz.dofs import TRANSLATIONS, AnyDof, Dof
from frf_ipz.errors import InputError
from frf_ipz.fe.assembly import multiply
from frf_ipz.fe.eigen import ModalBasis, damping_ratios, solve_basis
from frf_ipz.numerics.factorization import DENSE_ORDER

if TYPE_CHECKING:
    from frf_ipz.diagnosis.observations import Observations, Sensor
    from frf_ipz.structure import StructuralModel

MODES_TO = 6.0  # times the top of the band: modes that are kept; a stop or friction excites all of them
MIN_MODES = 8
SUSPENSION_PART = 0.01  # of the first elastic frequency: that of a suspension of which nothing is known
MAX_LOG_CHANGE = 20.0  # of a frequency or damping ratio: a step that diverged must not overflow
LEAST_DAMPING_PART = 0.5  # of the stated damping: with less, more motion remains at the next impact


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Points:
    """Mode shapes at points, and the residual terms of all DOFs under unit loads there.

    Parameters
    ----------
    shapes : (n_points, n_modes) array
        Mass-normalised.
    weights : (n_points, n_free) array
        Of the free DOFs in the point's motion.
    static, inertial : (n_free, n_points) array
        Deflection of the modes left out under a unit load: sum of phi phi^T / omega^2, and of phi phi^T / omega^4.
    """

    shapes: FloatArray
    weights: FloatArray
    static: FloatArray
    inertial: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModalModel:
    """A structure in modal form.

    Parameters
    ----------
    model : StructuralModel
        The nominal FE model.
    omega_rad_s, damping_ratio : (n_modes,) array
        Of the modes that are kept; rigid-body modes are those of a soft suspension.
    n_rigid : int
        Rigid-body modes.
    sensors : tuple of Sensor
        Output channels, each channel and DOF once.
    inputs : tuple of Dof
        Excited DOFs.
    locations : tuple of Location
        Candidates.
    ends : tuple of tuple of Dof
        Of each: the DOF whose motion drives a law there; for a spring its two ends: second minus first drives it.
    at_sensors, at_inputs, at_locations : Points
        Signs of sensors and inputs are in the shapes.
    """

    model: StructuralModel
    omega_rad_s: FloatArray
    damping_ratio: FloatArray
    n_rigid: int
    sensors: tuple[Sensor, ...]
    inputs: tuple[AnyDof, ...]
    locations: tuple[Location, ...]
    ends: tuple[tuple[Dof, ...], ...]
    at_sensors: Points
    at_inputs: Points
    at_locations: Points

    @property
    def n_modes(self) -> int:
        """Number of modes that are kept."""
        return len(self.omega_rad_s)

    def describe_location(self, index: int) -> str:
        """Name a location for a sentence."""
        nodes = [end.node for end in self.ends[index]]
        return f"spring {nodes[0]}-{nodes[1]}" if len(nodes) > 1 else f"node {nodes[0]}"

    def poles(self, nuisance_values: NuisanceValues) -> tuple[FloatArray, FloatArray]:
        """Natural frequencies, rad/s, and damping ratios of the real structure, (n_modes,) each."""
        frequency, damping = (
            np.clip(change, -MAX_LOG_CHANGE, MAX_LOG_CHANGE)
            for change in (nuisance_values.frequency, nuisance_values.damping)
        )
        return self.omega_rad_s * np.exp(frequency), self.damping_ratio * np.exp(damping)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NuisanceValues:
    """Differences of the real structure from the nominal model.

    Parameters
    ----------
    frequency, damping : (n_modes,) array
        Logarithms of real over nominal.
    sensors : (n_sensors, n_modes) array
        Added to the shapes at the sensors.
    inputs : (n_inputs, n_modes) array
        Added to the shapes at the inputs.
    location : (n_modes,) array
        Added to the shapes at the one location in question.
    """

    frequency: FloatArray
    damping: FloatArray
    sensors: FloatArray
    inputs: FloatArray
    location: FloatArray


def nominal_values(modal_model: ModalModel) -> NuisanceValues:
    """Give the nuisance values of the nominal model.

    Parameters
    ----------
    modal_model : ModalModel
        The structure.

    Returns
    -------
    NuisanceValues
        Zeros.
    """
    n_modes = modal_model.n_modes
    return NuisanceValues(
        frequency=np.zeros(n_modes),
        damping=np.zeros(n_modes),
        sensors=np.zeros((len(modal_model.sensors), n_modes)),
        inputs=np.zeros((len(modal_model.inputs), n_modes)),
        location=np.zeros(n_modes),
    )


def make_modal_model(model: StructuralModel, observations: Observations) -> ModalModel:
    """Bring an FE model into modal form for a test.

    Parameters
    ----------
    model : StructuralModel
        The nominal FE model, with its damping.
    observations : Observations
        Their excited points and sensors.

    Returns
    -------
    ModalModel
        With every node and spring as a location.

    Raises
    ------
    InputError
        If the model lacks a DOF of the test, or holds it.
    """
    sensors = tuple({(s.channel, s.dof): s for record in observations.records for s in record.sensors}.values())
    inputs = observations.input_dofs
    measured = (*(sensor.dof for sensor in sensors), *inputs)
    locations = find_locations(model, {dof.direction for dof in model.dofs_in(measured)})
    top_hz = MODES_TO * observations.band_hz[1]
    basis = solve_basis(model) if np.count_nonzero(~model.fixed) < DENSE_ORDER else solve_basis(model, up_to_hz=top_hz)
    n_modes = int(np.count_nonzero(basis.natural_frequency_hz <= top_hz))
    n_modes = min(max(n_modes, MIN_MODES), len(basis.eigenvalues))
    low = basis.first(n_modes)
    omega, damping = _suspended_poles(model, low)
    rows = list(model.rows(measured).toarray())
    rows += [
        _dof_weights(model, tuple(zip((1,) if len(ends) == 1 else (-1, 1), ends, strict=True)))
        for ends in locations.values()
    ]
    points = _make_points(low, basis, np.array(rows))
    first, second = len(sensors), len(sensors) + len(inputs)
    return ModalModel(
        model=model,
        omega_rad_s=omega,
        damping_ratio=damping,
        n_rigid=low.n_rigid,
        sensors=sensors,
        inputs=inputs,
        locations=tuple(locations),
        ends=tuple(locations.values()),
        at_sensors=_select_points(points, slice(0, first)),
        at_inputs=_select_points(points, slice(first, second)),
        at_locations=_select_points(points, slice(second, None)),
    )


def find_locations(model: StructuralModel, directions: set[str]) -> dict[Location, tuple[Dof, ...]]:
    """List where a law could act: free translations in the directions of the test, and springs between two nodes.

    Parameters
    ----------
    model : StructuralModel
        The FE model.
    directions : set of str
        Directions of sensors and inputs.

    Returns
    -------
    dict of Location to tuple of Dof
        With their ends, nodes first. A spring from the ground is its node, and named besides: a law at either acts
        alike.

    Raises
    ------
    InputError
        If nothing moves in these directions.
    """
    free = {dof for dof, fixed in zip(model.all_dofs, model.fixed, strict=True) if not fixed}
    moving = sorted(dof for dof in free if dof.direction in directions & set(TRANSLATIONS))
    if not moving:
        raise InputError(f"no node of the model '{model.name}' moves in {', '.join(sorted(directions))}")
    grounded = {
        part.nodes[1]: part.name for part in model.parts if part.kind == "spring" and tuple(part.nodes[:1]) == (0,)
    }
    locations: dict[Location, tuple[Dof, ...]] = {
        Location(
            nodes=(dof.node,),
            springs=(grounded[dof.node],) if dof.node in grounded else (),
            directions=(dof.direction,),
        ): (dof,)
        for dof in moving
    }
    for part in model.parts:
        if part.kind == "spring" and len(part.nodes) == 2 and 0 not in part.nodes:
            for direction in sorted(directions):
                ends = tuple(Dof(node, direction) for node in part.nodes)
                if free.issuperset(ends):
                    locations[Location(springs=(part.name,), directions=(direction,))] = ends
    return locations


def _suspended_poles(model: StructuralModel, basis: ModalBasis) -> tuple[FloatArray, FloatArray]:
    """Frequencies and damping ratios; rigid-body modes get those of a soft suspension."""
    omega, ratio = basis.omega_rad_s, damping_ratios(model, basis)
    rigid = basis.n_rigid
    if rigid:
        omega[:rigid] = SUSPENSION_PART * (omega[rigid] if len(omega) > rigid else 1.0)
        ratio[:rigid] = SUSPENSION_RATIO
    return omega, ratio


def _dof_weights(model: StructuralModel, ends: tuple[tuple[int, Dof], ...]) -> FloatArray:
    weights = np.zeros(int(np.count_nonzero(~model.fixed)))
    for factor, dof in ends:
        weights[model.index(dof)] += factor * dof.sign
    return weights


def _make_points(low: ModalBasis, basis: ModalBasis, weights: FloatArray) -> Points:
    """Shapes at points, and residual terms: by the other modes if they are known, or by static solutions."""
    if len(basis.eigenvalues) == len(basis.shapes):
        high = basis.shapes[:, len(low.eigenvalues) :]
        values = basis.eigenvalues[len(low.eigenvalues) :]
        loaded = high.T @ weights.T
        static, inertial = high @ (loaded / values[:, None]), high @ (loaded / values[:, None] ** 2)
    else:
        static = low.residual_flexibility(weights.T)
        inertial = low.residual_flexibility(multiply(low.mass, static))
    return Points(shapes=weights @ low.shapes, weights=weights, static=static, inertial=inertial)


def _select_points(points: Points, rows: slice) -> Points:
    return Points(
        shapes=points.shapes[rows],
        weights=points.weights[rows],
        static=points.static[:, rows],
        inertial=points.inertial[:, rows],
    )


def remaining_motion(modal_model: ModalModel, pause_s: FloatArray) -> FloatArray:
    """Give the part of each mode's motion that remains after a pause, at most: damping may be less than stated.

    Parameters
    ----------
    modal_model : ModalModel
        The structure.
    pause_s : (n,) array
        s.

    Returns
    -------
    (n, n_modes) array
        0 to 1.
    """
    decay = modal_model.damping_ratio * modal_model.omega_rad_s
    return np.asarray(np.exp(-LEAST_DAMPING_PART * np.outer(pause_s, decay)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModalResponse:
    """Receptances on lines, for one set of nuisance values.

    Parameters
    ----------
    modal_model : ModalModel
        The structure.
    s : (n_lines,) complex array
        rad/s.
    nuisance_values : NuisanceValues
        Of the real structure.
    modes : (n_modes, n_lines) complex array
        1 / (s^2 + 2 zeta omega s + omega^2).
    """

    modal_model: ModalModel
    s: ComplexArray
    nuisance_values: NuisanceValues
    modes: ComplexArray

    @property
    def sensor_shapes(self) -> FloatArray:
        """(n_sensors, n_modes) shapes of the real structure at the sensors."""
        return self.modal_model.at_sensors.shapes + self.nuisance_values.sensors

    @property
    def input_shapes(self) -> FloatArray:
        """(n_inputs, n_modes) shapes of the real structure at the inputs."""
        return self.modal_model.at_inputs.shapes + self.nuisance_values.inputs

    def on(self, lines: IntArray) -> ModalResponse:
        """Select lines."""
        return replace(self, s=self.s[lines], modes=self.modes[:, lines])

    def from_inputs(self, first_mode: int = 0) -> ComplexArray:
        """(n_inputs, n_sensors, n_lines) receptance from inputs to sensors, of the modes from one on."""
        shapes = self.input_shapes[:, None, first_mode:] * self.sensor_shapes[None, :, first_mode:]
        residual = self._residual_terms(self.modal_model.at_inputs, self.modal_model.at_sensors)
        return np.asarray(shapes @ self.modes[first_mode:] + residual)

    def location_shapes(self, location: int) -> FloatArray:
        """(n_modes,) shapes of the real structure at a location."""
        return np.asarray(self.modal_model.at_locations.shapes[location] + self.nuisance_values.location)

    def to_sensors(self, location: int) -> ComplexArray:
        """(n_sensors, n_lines) receptance from a location to the sensors."""
        point = _select_points(self.modal_model.at_locations, slice(location, location + 1))
        shapes = self.sensor_shapes * self.location_shapes(location)
        return np.asarray(shapes @ self.modes + self._residual_terms(point, self.modal_model.at_sensors)[0])

    def at_location(self, location: int) -> tuple[ComplexArray, ComplexArray]:
        """Driving-point receptance of a location, (n_lines,), and from the inputs to it, (n_inputs, n_lines)."""
        point = _select_points(self.modal_model.at_locations, slice(location, location + 1))
        shapes = self.location_shapes(location)
        driving_point = shapes**2 @ self.modes + self._residual_terms(point, point)[0, 0]
        transfer = (self.input_shapes * shapes) @ self.modes
        transfer = transfer + self._residual_terms(point, self.modal_model.at_inputs)[0]
        return np.asarray(driving_point), np.asarray(transfer)

    def _residual_terms(self, loaded: Points, read: Points) -> ComplexArray:
        """(n_loaded, n_read, n_lines) contribution of the modes left out."""
        static, inertial = (read.weights @ part for part in (loaded.static, loaded.inertial))
        return np.asarray(static.T[:, :, None] - inertial.T[:, :, None] * self.s**2)


def respond(modal_model: ModalModel, s: ComplexArray, nuisance_values: NuisanceValues) -> ModalResponse:
    """Evaluate the modes on lines.

    Parameters
    ----------
    modal_model : ModalModel
        The structure.
    s : (n_lines,) complex array
        rad/s.
    nuisance_values : NuisanceValues
        Of the real structure.

    Returns
    -------
    ModalResponse
        Receptances between all points.
    """
    omega, ratio = modal_model.poles(nuisance_values)
    modes = 1 / (s**2 + (2 * ratio * omega)[:, None] * s + (omega**2)[:, None])
    return ModalResponse(modal_model=modal_model, s=s, nuisance_values=nuisance_values, modes=modes)
