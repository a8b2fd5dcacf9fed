"""Where a force may act of which nothing is known, not even that it follows a law.

On each line of each segment any force at a location explains one direction among the sensors: that of the receptances
from the location to them. What is across it is left for the nuisance parameters of the linear model, and determines the
location, if there are two sensors or more. The better the linear model is known, the fewer locations explain the rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.model.coarse_places import PLACES_PER_MODE, spread_places
from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawStart, estimate_location_motion
from frf_ipz.diagnosis.nonlinear.fitting.linear_fit import as_real_rows, linear_sensor_motion
from frf_ipz.diagnosis.nonlinear.fitting.location_motion import NumericalLaplace
from frf_ipz.diagnosis.nonlinear.fitting.normal_equations import ROUNDING, assemble
from frf_ipz.diagnosis.nonlinear.model.modal_model import respond
from frf_ipz.numerics.levenberg_marquardt import AcceptedStep, LevenbergMarquardt, NormalEquations, minimise

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.diagnosis.nonlinear.fitting.linear_fit import LinearFit
    from frf_ipz.diagnosis.nonlinear.laws.law import Law
    from frf_ipz.diagnosis.nonlinear.model.modal_model import ModalModel, ModalResponse
    from frf_ipz.diagnosis.nonlinear.segments import SegmentSet

SETTINGS = LevenbergMarquardt(  # steps are damped only where a whole one does not lower the cost
    steps=16,
    trials_per_step=6,
    initial_damping=ROUNDING,
    min_damping=ROUNDING,
    damping_decrease=0.25,
    damping_increase=4.0,
    min_rejected_damping=1e-4,
    relative_decrease=0.01,
)
INDISTINGUISHABLE = 15.0  # difference of the cost: with less, two locations explain equally well
POSSIBLE, POSSIBLE_PART = 60.0, 0.1  # of the cost above the least, and part of it, at a possible location
MIN_SENSORS = 2
NEIGHBOURS = 3  # locations beside a possible one that are fitted from its nuisance parameters


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FreeForce:
    """The best force at a location, whatever its law.

    Parameters
    ----------
    location : int
        Index in `ModalModel.locations`.
    cost : float
        Weighted sum of squared misfits, and of squared nuisance parameters.
    force : (n_segments, n_used) complex array
        Of the law against the structure, N s.
    nuisance : (n_nuisance,) array
        Of the linear model, in prior standard deviations.
    """

    location: int
    cost: float
    force: ComplexArray
    nuisance: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ForceLocalisation:
    """Where a force may act.

    Parameters
    ----------
    possible, equivalent : tuple of int
        Indices in `ModalModel.locations` that have to be tested, and those of them that only a law distinguishes.
    forces : tuple of FreeForce
        At the equivalent locations, the best first; none where a single sensor distinguishes no locations.
    """

    possible: tuple[int, ...]
    equivalent: tuple[int, ...]
    forces: tuple[FreeForce, ...] = ()


def all_locations(modal_model: ModalModel) -> ForceLocalisation:
    """Take all locations of a structure as possible."""
    indices = tuple(range(len(modal_model.locations)))
    return ForceLocalisation(possible=indices, equivalent=indices)


def fit_free_force(
    segments: SegmentSet,
    linear: LinearFit,
    location: int,
    nuisance: FloatArray | None = None,
    *,
    cost_limit: float = np.inf,
) -> FreeForce:
    """Fit the linear model with any force at a location.

    Parameters
    ----------
    segments : SegmentSet
        The data.
    linear : LinearFit
        The linear model.
    location : int
        Index in `ModalModel.locations`.
    nuisance : (n_nuisance,) array, optional
        Start values; the nominal model otherwise.
    cost_limit : float
        Below which a fit is of use: one that is unlikely to get there is stopped early.

    Returns
    -------
    FreeForce
        The best step.
    """
    problem = _FreeForceProblem(segments=segments, linear=linear, location=location)
    start = _project(segments, linear, location, linear.start_nuisance if nuisance is None else nuisance)

    def is_of_no_use(step: AcceptedStep[_Projection]) -> bool:
        return not step.can_reach(cost_limit, step.after.cost, patience=1)

    best = minimise(problem, start, SETTINGS, stop=is_of_no_use).point
    return FreeForce(location=location, cost=best.cost, force=-best.force, nuisance=best.nuisance)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _FreeForceProblem:
    """What is minimised: what no force at the location explains, and nuisance parameters."""

    segments: SegmentSet
    linear: LinearFit
    location: int

    def cost(self, projection: _Projection) -> float:
        """Give the cost."""
        return projection.cost

    def linearise(self, projection: _Projection) -> NormalEquations:
        """Derive by the nuisance parameters, without the part that a force can follow."""
        on_used = projection.response.on(self.segments.used)
        nuisance_prior, to_sensors = self.linear.nuisance_prior, projection.to_sensors
        structural = nuisance_prior.structural_jacobian(self.segments, on_used, projection.force, self.location)
        of_states = nuisance_prior.state_jacobian(self.segments, on_used).swapaxes(1, 2)
        matrix, right = assemble(
            _across_force(to_sensors, structural),
            _across_force(to_sensors[nuisance_prior.moving], of_states).swapaxes(1, 2),
            projection.misfit.view(complex).reshape(to_sensors.shape),
            nuisance_prior.moving,
        )
        return NormalEquations(matrix=matrix + np.eye(len(matrix)), right=right - projection.nuisance)

    def move(self, projection: _Projection, _equations: NormalEquations, step: FloatArray) -> _Projection:
        """Find the best force with other nuisance parameters."""
        return _project(self.segments, self.linear, self.location, projection.nuisance + step)


def localise_force(segments: SegmentSet, linear: LinearFit) -> ForceLocalisation:
    """Find where a force may act.

    Parameters
    ----------
    segments : SegmentSet
        The data.
    linear : LinearFit
        The linear model.

    Returns
    -------
    ForceLocalisation
        All locations, where a single sensor distinguishes none.
    """
    everywhere = all_locations(linear.nuisance_prior.modal_model)
    if np.isfinite(segments.variance).any(2).sum(1).min() < MIN_SENSORS:
        return everywhere
    forces = _fit_possible(segments, linear)
    _refit_neighbours(segments, linear, forces)
    best_first = sorted(forces.values(), key=lambda free: free.cost)
    least, cost_limit = best_first[0].cost, _possible_cost(forces.values())
    equivalent = tuple(free for free in best_first if free.cost < least + INDISTINGUISHABLE)
    possible = tuple(free.location for free in best_first if free.cost < cost_limit)
    return ForceLocalisation(
        possible=possible, equivalent=tuple(free.location for free in equivalent), forces=equivalent
    )


def _fit_possible(segments: SegmentSet, linear: LinearFit) -> dict[int, FreeForce]:
    """Fit a force at a coarse set of locations, and around each of them where it is possible."""
    modal_model = linear.nuisance_prior.modal_model
    groups, separate = _group_by_direction(modal_model)
    n_coarse = PLACES_PER_MODE * len(linear.nuisance_prior.modes)
    spread = [spread_places(positions, min(n_coarse, len(positions))) for _, positions in groups]
    new = [*separate, *(rows[index] for (rows, _), (coarse, _) in zip(groups, spread, strict=True) for index in coarse)]
    forces: dict[int, FreeForce] = {}
    while new:
        _fit_at(segments, linear, new, forces)
        cost_limit = _possible_cost(forces.values())
        new = []
        for (rows, positions), (_, reach) in zip(groups, spread, strict=True):
            is_fitted = np.array([row in forces for row in rows])
            is_possible = [row in forces and forces[row].cost < cost_limit for row in rows]
            distance = np.linalg.norm(positions[:, None] - positions[is_possible], axis=2)
            is_near = distance.min(1, initial=np.inf) <= reach
            new += [rows[index] for index in np.flatnonzero(is_near & ~is_fitted)]
    return forces


def _group_by_direction(modal_model: ModalModel) -> tuple[list[tuple[list[int], FloatArray]], list[int]]:
    """Group the nodes by the direction of their motion, each group with its positions; and give all other locations."""
    geometry = modal_model.model.geometry
    positions = dict(zip(geometry.nodes.tolist(), geometry.coordinates_m, strict=True))
    alike: dict[str, list[int]] = {}
    separate = []
    for row, (end, *further) in enumerate(modal_model.ends):
        if further or geometry.is_schematic or end.node not in positions:
            separate.append(row)
        else:
            alike.setdefault(end.direction, []).append(row)
    groups = [(rows, np.array([positions[modal_model.ends[row][0].node] for row in rows])) for rows in alike.values()]
    return groups, separate


def _fit_at(segments: SegmentSet, linear: LinearFit, locations: Sequence[int], forces: dict[int, FreeForce]) -> None:
    """Fit a force at each of some locations, those first where it explains most beside the nominal model.

    The better the best of them explains, the sooner it shows of another one that no force can act there. From the
    nuisance parameters of the best one, most are a single step away.
    """

    def unfitted_cost(location: int, nuisance: FloatArray) -> float:
        return _project(segments, linear, location, nuisance).cost

    nominal = best = linear.start_nuisance
    if forces:
        best = linear.nuisance_prior.without_location(min(forces.values(), key=lambda free: free.cost).nuisance)
    for location in sorted(locations, key=lambda location: unfitted_cost(location, nominal)):
        start = min((nominal, best), key=lambda nuisance: unfitted_cost(location, nuisance))
        cost_limit = _possible_cost(forces.values())
        forces[location] = fit_free_force(segments, linear, location, start, cost_limit=cost_limit)
        best = linear.nuisance_prior.without_location(min(forces.values(), key=lambda free: free.cost).nuisance)


def _refit_neighbours(segments: SegmentSet, linear: LinearFit, forces: dict[int, FreeForce]) -> None:
    """Fit neighbours of possible locations from the fit there: from the nominal model, some end in a local minimum.

    What was fitted from a better one already is not fitted again.
    """
    modal_model = linear.nuisance_prior.modal_model
    waiting = sorted(forces, key=lambda location: forces[location].cost)
    best_start: dict[int, float] = {}
    while waiting:
        free = forces[waiting.pop(0)]
        cost_limit = _possible_cost(forces.values())
        if free.cost >= cost_limit:
            continue
        start = linear.nuisance_prior.without_location(free.nuisance)
        for location in neighbours(modal_model, free.location, NEIGHBOURS):
            least = forces[location].cost if location in forces else np.inf
            if free.cost > min(least - INDISTINGUISHABLE, best_start.get(location, np.inf)):
                continue
            best_start[location] = free.cost
            refitted = fit_free_force(segments, linear, location, start, cost_limit=cost_limit)
            if refitted.cost < least:
                forces[location] = refitted
                waiting.append(location)


def _possible_cost(forces: Iterable[FreeForce]) -> float:
    """Cost below which a force is possible beside the best of those that are known."""
    least = min((free.cost for free in forces), default=np.inf)
    return least + POSSIBLE + POSSIBLE_PART * least


def neighbours(modal_model: ModalModel, location: int, count: int) -> list[int]:
    """List the locations whose mode shapes are most like those of a location, or most like their opposite.

    Parameters
    ----------
    modal_model : ModalModel
        The structure.
    location : int
        Index in `ModalModel.locations`.
    count : int
        How many.

    Returns
    -------
    list of int
        The most similar first.
    """
    shapes = modal_model.at_locations.shapes
    directions = shapes / np.maximum(np.linalg.norm(shapes, axis=1), 1e-300)[:, None]
    nearest = np.argsort(-np.abs(directions @ directions[location]), kind="stable")
    return [int(i) for i in nearest if i != location][:count]


def start_from_force(segments: SegmentSet, linear: LinearFit, free: FreeForce, law: Law) -> LawStart:
    """Read the parameters of a law from a force that follows none yet.

    Parameters
    ----------
    segments : SegmentSet
        The data.
    linear : LinearFit
        The linear model.
    free : FreeForce
        Fitted to these segments.
    law : Law
        Which.

    Returns
    -------
    LawStart
        Strength 0 where the force is not of that law at all.
    """
    laplace, used = NumericalLaplace(segments), segments.used
    best = LawStart(law=law, location=free.location, strength=0.0, shape=0.0, nuisance=free.nuisance)
    force = np.zeros((segments.n_segments, len(segments.s)), complex)
    force[:, used] = free.force
    response, w, v = estimate_location_motion(segments, linear.nuisance_prior, best, laplace, force)
    reach = np.abs(response.to_sensors(free.location)[:, used]) ** 2
    weight = np.sum(reach / segments.variance[:, :, used], 1)
    largest_drop = 0.0
    for shape in law.shapes(float(np.abs(w).max()), float(np.abs(v).max())):
        unit = laplace.at_lines(law.unit_force(w, v, float(shape)))[:, used]
        product, square = np.sum(weight * (unit.conj() * free.force).real), np.sum(weight * np.abs(unit) ** 2)
        drop = float(product**2 / max(square, np.finfo(float).tiny))
        if drop > largest_drop and (product > 0 or law.strength_can_be_negative):
            largest_drop = drop
            best = LawStart(
                law=law,
                location=free.location,
                strength=float(product / square),
                shape=float(shape),
                nuisance=free.nuisance,
            )
    return best


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Projection:
    """The data, projected on any force at a location and on what is across it.

    Parameters
    ----------
    response : ModalResponse
        Of the linear model with its nuisance parameters.
    to_sensors : (n_segments, n_sensors, n_used) complex array
        Receptances from the location, weighted.
    force : (n_segments, n_used) complex array
        Force on the structure that explains most, N s.
    misfit : (n_rows,) array
        What is across, weighted.
    nuisance : (n_nuisance,) array
        Of the linear model, in prior standard deviations.
    cost : float
        Sum of squared misfits and nuisance parameters.
    """

    response: ModalResponse
    to_sensors: ComplexArray
    force: ComplexArray
    misfit: FloatArray
    nuisance: FloatArray
    cost: float


def _project(segments: SegmentSet, linear: LinearFit, location: int, nuisance: FloatArray) -> _Projection:
    nuisance_prior, used = linear.nuisance_prior, segments.used
    weight = 1 / np.sqrt(segments.variance[:, :, used])
    response = respond(nuisance_prior.modal_model, segments.s, nuisance_prior.to_values(nuisance, location))
    motion = linear_sensor_motion(segments, nuisance_prior, response)
    motion[nuisance_prior.moving] += nuisance_prior.sensor_free_vibration(nuisance, response)
    linear_misfit = (segments.motion - motion)[:, :, used] * weight
    to_sensors = response.to_sensors(location)[:, used] * weight
    force = _force_along(to_sensors, linear_misfit)
    misfit = as_real_rows(linear_misfit - to_sensors * force[:, None])
    cost = float(misfit @ misfit + nuisance @ nuisance)
    return _Projection(
        response=response, to_sensors=to_sensors, force=force, misfit=misfit, nuisance=nuisance, cost=cost
    )


def _across_force(to_sensors: ComplexArray, values: ComplexArray) -> ComplexArray:
    """Leave out of weighted values (..., n_segments, n_sensors, n_used) what a force at the location can follow."""
    return np.asarray(values - to_sensors * _force_along(to_sensors, values)[..., None, :])


def _force_along(to_sensors: ComplexArray, values: ComplexArray) -> ComplexArray:
    """(..., n_segments, n_used) force that explains most of weighted values (..., n_segments, n_sensors, n_used)."""
    square = np.maximum(np.sum(np.abs(to_sensors) ** 2, 1), np.finfo(float).tiny)
    return np.asarray(np.sum(to_sensors.conj() * values, -2) / square)
