"""Where a force may sit of which nothing is known, not even that it follows a law.

On each line of each blow any force at the place takes up one direction among the sensors: the one in which the place
reaches them. What is left across it is for the linear model's unknowns to explain, and tells the place, if two sensors
or more were there. The better the linear model is known, the less is left that several places have in common.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.nonlinear.fitting.motion import Clock
from frf_ipz.diagnosis.nonlinear.fitting.normal_equations import solve_even
from frf_ipz.diagnosis.nonlinear.fitting.refine import Start, motion_at
from frf_ipz.diagnosis.nonlinear.fitting.score_test import as_real, linear_motion
from frf_ipz.diagnosis.nonlinear.linear.modal_model import respond

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.diagnosis.nonlinear.fitting.score_test import LinearFit
    from frf_ipz.diagnosis.nonlinear.laws.law import Law
    from frf_ipz.diagnosis.nonlinear.linear.modal_model import ModalModel, ModalResponse
    from frf_ipz.diagnosis.nonlinear.recorded.segments import SegmentSet

TURNS, SETTLED = 16, 0.01  # the unknowns change how a place reaches the sensors; relative drop that is worth a turn
TRIALS, STIFFER, LEAST_DAMPING = 6, 4.0, 1e-4  # of a turn: shorter and shorter steps until one lowers the cost
TIE = 15.0  # of the cost: less tells no place from another
POSSIBLE, PART = 60.0, 0.1  # of the cost above the least, and part of it: what a place may leave that is possible
LEAST_SENSORS = 2
BESIDE = 3  # places beside a possible one that are fitted from its unknowns, where by themselves they leave more


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FreeForce:
    """The best force at a place, whatever its law.

    Parameters
    ----------
    place : int
        Index in `ModalModel.places`.
    cost : float
        Weighted sum of squares that is left, and of the unknowns.
    force : (n_blows, n_used) complex array
        Of the law against the structure, N s.
    unknowns : (n_unknowns,) array
        Of the linear model, in prior standard deviations.
    """

    place: int
    cost: float
    force: ComplexArray
    unknowns: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Whereabouts:
    """Where a force may sit.

    Parameters
    ----------
    possible, equal : tuple of int
        Indices in `ModalModel.places` that are worth a look, and those of them that nothing but a law tells apart.
    forces : tuple of FreeForce
        At the equal places, the best first; none where one sensor alone can tell no place from another.
    """

    possible: tuple[int, ...]
    equal: tuple[int, ...]
    forces: tuple[FreeForce, ...] = ()


def anywhere(modal_model: ModalModel) -> Whereabouts:
    """Leave all places of a structure possible."""
    every = tuple(range(len(modal_model.places)))
    return Whereabouts(possible=every, equal=every)


def free_force(stretches: SegmentSet, linear: LinearFit, place: int, unknowns: FloatArray | None = None) -> FreeForce:
    """Fit the linear model with any force at a place.

    Parameters
    ----------
    stretches : SegmentSet
        The data.
    linear : LinearFit
        The linear model.
    place : int
        Index in `ModalModel.places`.
    unknowns : (n_unknowns,) array, optional
        Where to start; with the linear model as it is stated otherwise.

    Returns
    -------
    FreeForce
        The best turn.
    """
    best = _across(stretches, linear, place, linear.as_stated if unknowns is None else unknowns)
    used, damping = stretches.used, 0.0
    for _ in range(TURNS):
        columns = linear.nuisance_prior.columns(stretches, best.response.on(used), best.along, place)
        rows = as_real(columns - best.reach * _along(best.reach, columns)[..., None, :])
        normal, slope = rows @ rows.T + np.eye(len(rows)), rows @ best.left - best.unknowns
        for _ in range(TRIALS):
            step = solve_even(normal + damping * np.diag(np.diag(normal)), slope)
            tried = _across(stretches, linear, place, best.unknowns + step)
            if tried.cost < best.cost:
                break
            damping = max(STIFFER * damping, LEAST_DAMPING)
        if not tried.cost <= (1 - SETTLED) * best.cost:  # nor where it is no number
            break
        best, damping = tried, damping / STIFFER
    best = min(best, tried, key=lambda one: one.cost)
    return FreeForce(place=place, cost=best.cost, force=-best.along, unknowns=best.unknowns)


def whereabouts(stretches: SegmentSet, linear: LinearFit) -> Whereabouts:
    """Say where a force may sit.

    Parameters
    ----------
    stretches : SegmentSet
        The data.
    linear : LinearFit
        The linear model.

    Returns
    -------
    Whereabouts
        Anywhere, where one sensor alone can tell no place from another.
    """
    every = anywhere(linear.nuisance_prior.modal_model)
    if np.isfinite(stretches.variance).any(2).sum(1).min() < LEAST_SENSORS:
        return every
    found = {place: free_force(stretches, linear, place) for place in every.possible}
    _spread(stretches, linear, found)
    best_first = sorted(found.values(), key=lambda one: one.cost)
    least = best_first[0].cost
    equal = tuple(one for one in best_first if one.cost < least + TIE)
    possible = tuple(one.place for one in best_first if _is_possible(one, least))
    return Whereabouts(possible=possible, equal=tuple(one.place for one in equal), forces=equal)


def _spread(stretches: SegmentSet, linear: LinearFit, found: dict[int, FreeForce]) -> None:
    """Fit places beside possible ones from what explains there: by themselves some end where little is explained."""
    modal_model, waiting = linear.nuisance_prior.modal_model, sorted(found, key=lambda place: found[place].cost)
    while waiting:
        here = found[waiting.pop(0)]
        if not _is_possible(here, min(one.cost for one in found.values())):
            continue
        start = linear.nuisance_prior.of_no_place(here.unknowns)
        for place in neighbours(modal_model, here.place, BESIDE):
            if found[place].cost < here.cost + TIE:
                continue
            again = free_force(stretches, linear, place, start)
            if again.cost < found[place].cost:
                found[place] = again
                waiting.append(place)


def _is_possible(free: FreeForce, least: float) -> bool:
    return free.cost < least + POSSIBLE + PART * least


def neighbours(modal_model: ModalModel, place: int, count: int) -> list[int]:
    """List the places whose mode shapes are most like those of a place, or most like their opposite.

    Parameters
    ----------
    modal_model : ModalModel
        The structure.
    place : int
        Index in `ModalModel.places`.
    count : int
        How many.

    Returns
    -------
    list of int
        The most alike first.
    """
    shapes = modal_model.at_places.shapes
    alike = shapes / np.maximum(np.linalg.norm(shapes, axis=1), 1e-300)[:, None]
    nearest = np.argsort(-np.abs(alike @ alike[place]), kind="stable")
    return [int(i) for i in nearest if i != place][:count]


def start_at(stretches: SegmentSet, linear: LinearFit, free: FreeForce, law: Law) -> Start:
    """Read the numbers of a law from a force that follows none yet.

    Parameters
    ----------
    stretches : SegmentSet
        The data.
    linear : LinearFit
        The linear model.
    free : FreeForce
        Fitted to these stretches.
    law : Law
        Which.

    Returns
    -------
    Start
        Strength 0 where the force is not of that law at all.
    """
    clock, used = Clock(stretches), stretches.used
    nothing = Start(law=law, place=free.place, strength=0.0, shape=0.0, unknowns=free.unknowns)
    force = np.zeros((stretches.n_records, len(stretches.s)), complex)
    force[:, used] = free.force
    response, w, v = motion_at(stretches, linear.nuisance_prior, nothing, clock, force)
    reach = np.abs(response.to_sensors(free.place)[:, used]) ** 2
    weight = np.sum(reach / stretches.variance[:, :, used], 1)
    best, most = nothing, 0.0
    for shape in law.shapes(float(np.abs(w).max()), float(np.abs(v).max())):
        unit = clock.at_lines(law.unit_force(w, v, float(shape)))[:, used]
        across, square = np.sum(weight * (unit.conj() * free.force).real), np.sum(weight * np.abs(unit) ** 2)
        drop = float(across**2 / max(square, np.finfo(float).tiny))
        if drop > most and (across > 0 or law.strength_can_be_negative):
            most = drop
            best = Start(
                law=law, place=free.place, strength=float(across / square), shape=float(shape), unknowns=free.unknowns
            )
    return best


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Across:
    """What any force at a place leaves, and which force it is.

    Parameters
    ----------
    response : ModalResponse
        Of the linear model with its unknowns.
    reach : (n_blows, n_sensors, n_used) complex array
        How the place reaches the sensors, weighted.
    along : (n_blows, n_used) complex array
        Force on the structure that takes up all it can, N s.
    left : (n_rows,) array
        What it leaves, weighted.
    unknowns : (n_unknowns,) array
        Of the linear model, in prior standard deviations.
    cost : float
        Sum of squares of what is left, and of the unknowns.
    """

    response: ModalResponse
    reach: ComplexArray
    along: ComplexArray
    left: FloatArray
    unknowns: FloatArray
    cost: float


def _across(stretches: SegmentSet, linear: LinearFit, place: int, unknowns: FloatArray) -> _Across:
    nuisance_prior, used = linear.nuisance_prior, stretches.used
    weight = 1 / np.sqrt(stretches.variance[:, :, used])
    response = respond(nuisance_prior.modal_model, stretches.s, nuisance_prior.deviations(unknowns, place))
    shown = linear_motion(stretches, nuisance_prior, response)
    shown[nuisance_prior.moving] += nuisance_prior.sensor_starts(unknowns, response)
    misfit = (stretches.motion - shown)[:, :, used] * weight
    reach = response.to_sensors(place)[:, used] * weight
    along = _along(reach, misfit)
    left = as_real(misfit - reach * along[:, None])
    cost = float(left @ left + unknowns @ unknowns)
    return _Across(response=response, reach=reach, along=along, left=left, unknowns=unknowns, cost=cost)


def _along(reach: ComplexArray, values: ComplexArray) -> ComplexArray:
    """(..., n_blows, n_used) part of weighted values (..., n_blows, n_sensors, n_used) along the reach of a force."""
    square = np.maximum(np.sum(np.abs(reach) ** 2, 1), np.finfo(float).tiny)
    return np.asarray(np.sum(reach.conj() * values, -2) / square)
