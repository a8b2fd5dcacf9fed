"""The linear part of a structure with a force law: modes, what lies above, and the places a law could sit at.

Transfer functions join three kinds of points: struck ones, sensors, and places. Each is a sum over modes up to a few
times the band and the first two terms of the rest's series in s^2. What the model may be wrong by (`NuisanceValues`)
moves frequencies, damping and the shapes at sensors, blows and the place of a law.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.dofs import Dof
from frf_ipz.errors import InputError
from frf_ipz.fe.assembly import multiply
from frf_ipz.fe.eigen import ModalBasis, damping_ratios, solve_basis
from frf_ipz.fe.factorization import DENSE_ORDER

if TYPE_CHECKING:
    from frf_ipz.diagnosis.observations import Observations, Sensor
    from frf_ipz.structure import StructuralModel

BEYOND = 6.0  # times the top of the band: modes that are followed one by one; a stop or a friction stirs all of them
LEAST_MODES = 8
CORD_PART = 0.01  # of the first elastic frequency: how a free structure hangs, where nothing else is known
CORD_DAMPING = 0.03
TRANSLATIONS = ("x", "y", "z")
FARTHEST = 20.0  # of the logarithm of a frequency or damping ratio: a step that ran away must not overflow


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Place:
    """Where a law could sit.

    Parameters
    ----------
    location : mapping
        As in `diagnosis.json`.
    ends : tuple of Dof
        The DOF whose motion the law feels; for a spring the first and the second end, and it feels second minus first.
    """

    location: Mapping[str, object]
    ends: tuple[Dof, ...]

    @property
    def words(self) -> str:
        """The place for a sentence."""
        if len(self.ends) > 1:
            return f"spring {self.ends[0].node}-{self.ends[1].node}"
        return f"node {self.ends[0].node}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Points:
    """Mode shapes at points, and the static and quasi-static deflections of all DOFs under unit loads there.

    Parameters
    ----------
    shapes : (n_points, n_modes) array
        Mass-normalised.
    weights : (n_points, n_free) array
        How the point's motion follows from the free DOFs.
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
        The nominal model.
    omega_rad_s, damping_ratio : (n_modes,) array
        Of the modes that are followed; rigid-body modes hang in soft cords.
    n_rigid : int
        Rigid-body modes.
    sensors : tuple of Sensor
        Output channels, each channel and DOF once.
    inputs : tuple of Dof
        Struck DOFs.
    places : tuple of Place
        Candidates.
    at_sensors, at_inputs, at_places : Points
        Signs of sensors and blows are in the shapes.
    """

    model: StructuralModel
    omega_rad_s: FloatArray
    damping_ratio: FloatArray
    n_rigid: int
    sensors: tuple[Sensor, ...]
    inputs: tuple[Dof, ...]
    places: tuple[Place, ...]
    at_sensors: Points
    at_inputs: Points
    at_places: Points

    @property
    def n_modes(self) -> int:
        """Number of modes that are followed."""
        return len(self.omega_rad_s)

    def poles(self, deviations: NuisanceValues) -> tuple[FloatArray, FloatArray]:
        """Natural frequencies, rad/s, and damping ratios of the real structure, (n_modes,) each."""
        frequency, damping = (np.clip(one, -FARTHEST, FARTHEST) for one in (deviations.frequency, deviations.damping))
        return self.omega_rad_s * np.exp(frequency), self.damping_ratio * np.exp(damping)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NuisanceValues:
    """What the real structure differs by from the nominal model, all zero to begin with.

    Parameters
    ----------
    frequency, damping : (n_modes,) array
        Logarithms of real over nominal.
    sensors : (n_sensors, n_modes) array
        Added to the shapes at the sensors.
    inputs : (n_inputs, n_modes) array
        Added to the shapes at the blows.
    place : (n_modes,) array
        Added to the shapes at the one place that is looked at.
    """

    frequency: FloatArray
    damping: FloatArray
    sensors: FloatArray
    inputs: FloatArray
    place: FloatArray


def nominal_values(modal_model: ModalModel) -> NuisanceValues:
    """Take the nominal model as it is.

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
        place=np.zeros(n_modes),
    )


def make_modal_model(model: StructuralModel, observations: Observations) -> ModalModel:
    """Bring a model into modal form for a test.

    Parameters
    ----------
    model : StructuralModel
        The nominal model, with its damping.
    observations : Observations
        Where it was struck and measured.

    Returns
    -------
    ModalModel
        With every node and spring as a place.

    Raises
    ------
    InputError
        If the model lacks a DOF of the test, or holds it.
    """
    sensors = tuple({(s.channel, s.dof): s for record in observations.records for s in record.sensors}.values())
    inputs = observations.input_dofs
    places = find_places(model, {dof.direction for dof in (*inputs, *(s.dof for s in sensors))})
    top_hz = BEYOND * observations.band_hz[1]
    basis = solve_basis(model) if np.count_nonzero(~model.fixed) < DENSE_ORDER else solve_basis(model, up_to_hz=top_hz)
    n_modes = int(np.count_nonzero(basis.natural_frequency_hz <= top_hz))
    n_modes = min(max(n_modes, LEAST_MODES), len(basis.eigenvalues))
    low = basis.first(n_modes)
    omega, damping = _hung(model, low)
    rows = [_weights(model, ((1, dof),)) for dof in (*(s.dof for s in sensors), *inputs)]
    rows += [_weights(model, tuple(zip((1,) if len(p.ends) == 1 else (-1, 1), p.ends, strict=True))) for p in places]
    points = _points(low, basis, np.array(rows))
    first, second = len(sensors), len(sensors) + len(inputs)
    return ModalModel(
        model=model,
        omega_rad_s=omega,
        damping_ratio=damping,
        n_rigid=low.n_rigid,
        sensors=sensors,
        inputs=inputs,
        places=places,
        at_sensors=_some(points, slice(0, first)),
        at_inputs=_some(points, slice(first, second)),
        at_places=_some(points, slice(second, None)),
    )


def find_places(model: StructuralModel, directions: set[str]) -> tuple[Place, ...]:
    """List where a law could sit: free translations in the directions of the test, and springs between two nodes.

    Parameters
    ----------
    model : StructuralModel
        The model.
    directions : set of str
        Directions of sensors and blows.

    Returns
    -------
    tuple of Place
        Nodes first. A spring from the ground is its node, and named besides: what sits on either acts alike.

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
    places = [
        Place(
            location={"nodes": [dof.node]} | ({"springs": [grounded[dof.node]]} if dof.node in grounded else {}),
            ends=(dof,),
        )
        for dof in moving
    ]
    for part in model.parts:
        if part.kind == "spring" and len(part.nodes) == 2 and 0 not in part.nodes:
            for direction in sorted(directions):
                ends = tuple(Dof(node, direction) for node in part.nodes)
                if free.issuperset(ends):
                    places.append(Place(location={"springs": [part.name]}, ends=ends))
    return tuple(places)


def _hung(model: StructuralModel, basis: ModalBasis) -> tuple[FloatArray, FloatArray]:
    """Frequencies and damping; rigid-body modes get those of soft cords."""
    omega, ratio = np.sqrt(basis.eigenvalues), damping_ratios(model, basis)
    rigid = basis.n_rigid
    if rigid:
        omega[:rigid] = CORD_PART * (omega[rigid] if len(omega) > rigid else 1.0)
        ratio[:rigid] = CORD_DAMPING
    return omega, ratio


def _weights(model: StructuralModel, ends: tuple[tuple[int, Dof], ...]) -> FloatArray:
    weights = np.zeros(int(np.count_nonzero(~model.fixed)))
    for factor, dof in ends:
        weights[model.index(dof)] += factor * dof.sign
    return weights


def _points(low: ModalBasis, basis: ModalBasis, weights: FloatArray) -> Points:
    """Shapes at points, and what the other modes add: from those that are known, or by static solutions."""
    if len(basis.eigenvalues) == len(basis.shapes):
        rest = basis.shapes[:, len(low.eigenvalues) :]
        values = basis.eigenvalues[len(low.eigenvalues) :]
        loaded = rest.T @ weights.T
        static, inertial = rest @ (loaded / values[:, None]), rest @ (loaded / values[:, None] ** 2)
    else:
        static = low.residual_flexibility(weights.T)
        inertial = low.residual_flexibility(multiply(low.mass, static))
    return Points(shapes=weights @ low.shapes, weights=weights, static=static, inertial=inertial)


def _some(points: Points, rows: slice) -> Points:
    return Points(
        shapes=points.shapes[rows],
        weights=points.weights[rows],
        static=points.static[:, rows],
        inertial=points.inertial[:, rows],
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModalResponse:
    """Receptances on lines, for one set of deviations.

    Parameters
    ----------
    modal_model : ModalModel
        The structure.
    s : (n_lines,) complex array
        rad/s.
    deviations : NuisanceValues
        Of the real structure.
    modes : (n_modes, n_lines) complex array
        1 / (s^2 + 2 zeta omega s + omega^2).
    """

    modal_model: ModalModel
    s: ComplexArray
    deviations: NuisanceValues
    modes: ComplexArray

    @property
    def sensor_shapes(self) -> FloatArray:
        """(n_sensors, n_modes) shapes at the sensors as they are."""
        return self.modal_model.at_sensors.shapes + self.deviations.sensors

    @property
    def input_shapes(self) -> FloatArray:
        """(n_inputs, n_modes) shapes at the blows as they are."""
        return self.modal_model.at_inputs.shapes + self.deviations.inputs

    def on(self, lines: IntArray) -> ModalResponse:
        """Keep some of the lines."""
        return replace(self, s=self.s[lines], modes=self.modes[:, lines])

    def from_inputs(self, first_mode: int = 0) -> ComplexArray:
        """(n_inputs, n_sensors, n_lines) receptance from blows to sensors, of the modes from one on."""
        shapes = self.input_shapes[:, None, first_mode:] * self.sensor_shapes[None, :, first_mode:]
        return np.asarray(
            shapes @ self.modes[first_mode:] + self._rest(self.modal_model.at_inputs, self.modal_model.at_sensors)
        )

    def place_shapes(self, place: int) -> FloatArray:
        """(n_modes,) shapes at a place as it is."""
        return np.asarray(self.modal_model.at_places.shapes[place] + self.deviations.place)

    def to_sensors(self, place: int) -> ComplexArray:
        """(n_sensors, n_lines) receptance from a place to the sensors."""
        there = _some(self.modal_model.at_places, slice(place, place + 1))
        shapes = self.sensor_shapes * self.place_shapes(place)
        return np.asarray(shapes @ self.modes + self._rest(there, self.modal_model.at_sensors)[0])

    def at_place(self, place: int) -> tuple[ComplexArray, ComplexArray]:
        """Receptance of a place to itself, (n_lines,), and from the blows to it, (n_inputs, n_lines)."""
        there, shapes = _some(self.modal_model.at_places, slice(place, place + 1)), self.place_shapes(place)
        own = shapes**2 @ self.modes + self._rest(there, there)[0, 0]
        driven = (self.input_shapes * shapes) @ self.modes + self._rest(there, self.modal_model.at_inputs)[0]
        return np.asarray(own), np.asarray(driven)

    def _rest(self, loaded: Points, read: Points) -> ComplexArray:
        """(n_loaded, n_read, n_lines) contribution of the modes left out."""
        static, inertial = (read.weights @ part for part in (loaded.static, loaded.inertial))
        return np.asarray(static.T[:, :, None] - inertial.T[:, :, None] * self.s**2)


def respond(modal_model: ModalModel, s: ComplexArray, deviations: NuisanceValues) -> ModalResponse:
    """Evaluate the modes of a plant on lines.

    Parameters
    ----------
    modal_model : ModalModel
        The structure.
    s : (n_lines,) complex array
        rad/s.
    deviations : NuisanceValues
        Of the real structure.

    Returns
    -------
    ModalResponse
        Receptances between all points.
    """
    omega, ratio = modal_model.poles(deviations)
    modes = 1 / (s**2 + (2 * ratio * omega)[:, None] * s + (omega**2)[:, None])
    return ModalResponse(modal_model=modal_model, s=s, deviations=deviations, modes=modes)
