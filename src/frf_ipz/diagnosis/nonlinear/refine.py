"""One law at one place, fitted in turns: its force from the motion, then strength, shape and the linear model.

Each turn estimates the place's motion with what is known so far, puts the law's force on the structure, and takes one
damped Gauss-Newton step in all unknowns together. The best turn counts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.nonlinear.motion import Clock, place_motion
from frf_ipz.diagnosis.nonlinear.plant import PlantResponse, respond
from frf_ipz.diagnosis.nonlinear.screen import as_real, linear_motion

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.freedom import Freedom
    from frf_ipz.diagnosis.nonlinear.laws.law import Law
    from frf_ipz.diagnosis.nonlinear.stretches import Stretches

SETTLED = 1e-3  # relative change of the cost between turns
DIFFERENCE = 1e-4  # of the shape: its derivative; kinks average out over many samples
RIDGE = 1e-8  # of a column's own square: strength and shape may be one and the same where nothing is touched
LARGEST_STEP = 0.3  # of the shape, a turn


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LawFit:
    """A law at a place, fitted.

    Parameters
    ----------
    law : Law
        Which.
    place : int
        Index in `Plant.places`.
    strength, shape : float
        Of the law.
    unknowns : (n_unknowns,) array
        Of the linear model, in prior standard deviations.
    cost : float
        Weighted sum of squared misfits, and of squared unknowns.
    n_rows : int
        Number of real data.
    covariance : (2, 2) array
        Of strength and shape, all other unknowns free, for data whose variance is right.
    motion, velocity : (n_blows, n_times) array
        Of the place, m and m/s.
    force : (n_blows, n_lines) complex array
        Of the law against the structure, N s.
    misfit : (n_rows,) array
        Weighted, what is left.
    """

    law: Law
    place: int
    strength: float
    shape: float
    unknowns: FloatArray
    cost: float
    n_rows: int
    covariance: FloatArray
    motion: FloatArray
    velocity: FloatArray
    force: ComplexArray
    misfit: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Start:
    """Where a fit starts.

    Parameters
    ----------
    law : Law
        Which.
    place : int
        Index in `Plant.places`.
    strength, shape : float
        Of the law.
    unknowns : (n_unknowns,) array
        Of the linear model.
    """

    law: Law
    place: int
    strength: float
    shape: float
    unknowns: FloatArray


def refine(stretches: Stretches, freedom: Freedom, start: Start, *, n_turns: int = 4, known: bool = True) -> LawFit:
    """Fit a law at a place.

    Parameters
    ----------
    stretches : Stretches
        The data.
    freedom : Freedom
        Unknowns of the linear model.
    start : Start
        Law, place, and first values.
    n_turns : int
        At most.
    known : bool
        The start's strength is good enough to correct the motion with from the first turn.

    Returns
    -------
    LawFit
        The turn with the smallest cost.
    """
    clock = Clock(stretches)
    best, force = None, None
    if known:
        force = _first_force(stretches, freedom, start, clock)
    for _ in range(n_turns):
        fit, start, force = _turn(stretches, freedom, start, clock, force)
        if best is not None and fit.cost > (1 - SETTLED) * best.cost:
            return best if best.cost <= fit.cost else fit
        best = fit
    if best is None:
        raise ValueError("a fit needs at least one turn")
    return best


def _first_force(stretches: Stretches, freedom: Freedom, start: Start, clock: Clock) -> ComplexArray:
    """Force of the law in the motion that follows without knowing it."""
    _, w, v = _motion(stretches, freedom, start, clock, None)
    return clock.at_lines(start.strength * start.law.unit_force(w, v, start.shape))


def _motion(
    stretches: Stretches, freedom: Freedom, start: Start, clock: Clock, force: ComplexArray | None
) -> tuple[PlantResponse, FloatArray, FloatArray]:
    plant = freedom.plant
    response = respond(plant, stretches.s, freedom.deviations(start.unknowns))
    beyond = stretches.motion - linear_motion(stretches, freedom, response)
    beyond[freedom.moving] -= freedom.sensor_starts(start.unknowns, response)
    own, driven = response.at_place(start.place)
    linear = driven[stretches.input_of] * stretches.force
    linear[freedom.moving] += freedom.place_starts(start.unknowns, response, start.place)
    ratio = response.to_sensors(start.place) / own
    w = clock.at_times(place_motion(stretches, beyond, linear, ratio, None if force is None else -own * force))
    return response, w, clock.velocity(w)


def _turn(
    stretches: Stretches, freedom: Freedom, start: Start, clock: Clock, force: ComplexArray | None
) -> tuple[LawFit, Start, ComplexArray]:
    used, law = stretches.used, start.law
    response, w, v = _motion(stretches, freedom, start, clock, force)
    unit = clock.at_lines(law.unit_force(w, v, start.shape))
    on_used = PlantResponse(
        plant=freedom.plant, s=stretches.s[used], deviations=response.deviations, modes=response.modes[:, used]
    )
    weight = 1 / np.sqrt(stretches.variance[:, :, used])
    to_sensors = response.to_sensors(start.place)[:, used]

    def seen(lines: ComplexArray) -> FloatArray:
        return as_real(-to_sensors * lines[:, None, used] * weight)

    linear = linear_motion(stretches, freedom, response)
    linear[freedom.moving] += freedom.sensor_starts(start.unknowns, response)
    misfit = as_real((stretches.motion - linear)[:, :, used] * weight)
    shapes = freedom.plant.at_places.shapes[start.place]
    columns = [as_real(freedom.columns(stretches, on_used, -start.strength * unit[:, used], shapes))]
    columns.append(seen(unit)[None])
    way = DIFFERENCE * start.shape
    if law.shape_name:
        bent = clock.at_lines(law.unit_force(w, v, start.shape + way) - law.unit_force(w, v, start.shape - way))
        columns.append(seen(start.strength * bent / (2 * way))[None])
    rows = np.concatenate(columns)
    n = freedom.n_unknowns
    sizes = np.ones(len(rows))
    sizes[n:] = np.maximum(np.linalg.norm(rows[n:], axis=1), 1e-300)
    rows /= sizes[:, None]
    prior = np.zeros(len(rows))
    prior[:n] = 1.0
    prior[n:] = RIDGE
    normal = rows @ rows.T + np.diag(prior)
    # the law's force is in `rows` as a whole, not as a change: only the unknowns are counted from where they are
    right = rows @ misfit
    right[:n] -= start.unknowns
    factor = linalg.cho_factor(normal, lower=True)
    step = linalg.cho_solve(factor, right)
    left = misfit - step @ rows
    unknowns = start.unknowns + step[:n]
    strength = float(step[n] / sizes[n])
    if not law.strength_can_be_negative:
        strength = max(strength, 0.0)
    shape = start.shape
    if law.shape_name:
        shape *= 1 + float(np.clip(step[n + 1] / sizes[n + 1] / shape, -LARGEST_STEP, LARGEST_STEP))
    covariance = np.zeros((2, 2))
    count = len(rows) - n
    inverse = linalg.cho_solve(factor, np.eye(len(rows))[:, n:])[n:]
    covariance[:count, :count] = inverse / np.outer(sizes[n:], sizes[n:])
    following = replace(start, strength=strength, shape=shape, unknowns=unknowns)
    force = strength * clock.at_lines(law.unit_force(w, v, shape))
    fit = LawFit(
        law=law,
        place=start.place,
        strength=strength,
        shape=shape,
        unknowns=unknowns,
        cost=float(left @ left + unknowns @ unknowns),
        n_rows=len(left),
        covariance=covariance,
        motion=w,
        velocity=v,
        force=force,
        misfit=left,
    )
    return fit, following, force
