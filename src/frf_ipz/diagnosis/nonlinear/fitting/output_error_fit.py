"""Fits a law at its place through a simulation of every blow.

Unlike `refine`, no motion is estimated from the data: the law's force follows from the blows alone, and so does its
change by each unknown. Steps are damped as long as the simulation gets worse (Levenberg and Marquardt).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.nonlinear.fitting.motion import Clock
from frf_ipz.diagnosis.nonlinear.fitting.normal_equations import solve_even
from frf_ipz.diagnosis.nonlinear.fitting.refine import LawFit, Start
from frf_ipz.diagnosis.nonlinear.fitting.score_test import as_real, linear_motion
from frf_ipz.diagnosis.nonlinear.fitting.time_stepping import AHEAD, TimeSteps, Yielding, step_in_time, step_tangent
from frf_ipz.diagnosis.nonlinear.linear.modal_model import ModalResponse, respond
from frf_ipz.diagnosis.nonlinear.linear.place_in_time import PlaceInTime
from frf_ipz.diagnosis.nonlinear.recorded.segments import FINER

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.linear.nuisance_prior import NuisancePrior
    from frf_ipz.diagnosis.nonlinear.recorded.segments import SegmentSet

FIRST_DAMPING, MOST_DAMPING = 1e-3, 1e4
FASTER, SLOWER = 0.1, 10.0  # what damping is multiplied with after a good and a bad step
SETTLED = 3e-3  # relative drop of the cost
TAMER = 0.1  # what the strength of a law is multiplied with as long as its motion runs away
RUNAWAY = 1e100  # standard deviations: a change as large runs away, and is taken for none
LONGEST = 0.5  # relative change of a law's number in one step
Kinds = Callable[[FloatArray, FloatArray], FloatArray]
WEAK_PRIOR = 1e-6  # on relative changes of strength and shape: they may be one and the same where nothing is touched


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Shot:
    """A simulation of all stretches."""

    start: Start
    response: ModalResponse
    place: PlaceInTime
    yielding: Yielding
    done: TimeSteps
    force: ComplexArray
    misfit: FloatArray

    @property
    def cost(self) -> float:
        with np.errstate(all="ignore"):  # of a motion that runs away
            cost = float(self.misfit @ self.misfit + self.start.unknowns @ self.start.unknowns)
        return cost if np.isfinite(cost) else np.inf


def fit_output_error(
    stretches: SegmentSet, nuisance_prior: NuisancePrior, start: Start, *, iterations: int = 6
) -> LawFit:
    """Fit a law at a place.

    Parameters
    ----------
    stretches : SegmentSet
        The data.
    nuisance_prior : NuisancePrior
        Unknowns of the linear model.
    start : Start
        Law, place, and first values; the strength is not zero.
    iterations : int
        Steps at most; with 0 the start is only simulated.

    Returns
    -------
    LawFit
        The best simulation.
    """
    shot, damping = _fire(stretches, nuisance_prior, start), FIRST_DAMPING
    while not np.isfinite(shot.cost):  # a softening spring that is too strong runs away
        shot = _fire(stretches, nuisance_prior, replace(shot.start, strength=TAMER * shot.start.strength))
    rows, settled = _slopes(stretches, nuisance_prior, shot), False
    for _ in range(iterations):
        before = shot.cost
        while damping < MOST_DAMPING:
            trial = _fire(stretches, nuisance_prior, _step(shot, rows, damping))
            if trial.cost < shot.cost:
                break
            damping *= SLOWER
        else:
            settled = True
            break
        shot, damping = trial, damping * FASTER
        rows = _slopes(stretches, nuisance_prior, shot)
        settled = bool(shot.cost > (1 - SETTLED) * before)
        if settled:
            break
    return _finish(shot, rows, settled=settled)


def gain_of_further(stretches: SegmentSet, nuisance_prior: NuisancePrior, start: Start, kinds: Kinds) -> float:
    """Say how far forces of other kinds at a law's place, free in all their strengths, would lower the cost.

    Parameters
    ----------
    stretches : SegmentSet
        The data.
    nuisance_prior : NuisancePrior
        Unknowns of the linear model.
    start : Start
        The law as it was fitted.
    kinds : callable
        Gives the forces, (n_kinds, n_blows, n_times), for motion and velocity.

    Returns
    -------
    float
        Drop of the weighted sum of squares, as far as small strengths tell.
    """
    shot = _fire(stretches, nuisance_prior, start)
    forces = kinds(shot.done.motion, shot.done.velocity)
    rows = _slopes(stretches, nuisance_prior, shot, forces)
    n_plain = len(rows) - len(forces)
    sizes = np.linalg.norm(rows[n_plain:], axis=1)
    rows[n_plain:] /= np.maximum(sizes, 1e-300)[:, None]
    normal, right = _normal(shot, rows)
    drops = [right[:n] @ solve_even(normal[:n, :n], right[:n]) for n in (n_plain, len(rows))]
    return float(drops[1] - drops[0])


def _fire(stretches: SegmentSet, nuisance_prior: NuisancePrior, start: Start) -> _Shot:
    place = PlaceInTime(stretches=stretches, nuisance_prior=nuisance_prior, unknowns=start.unknowns, place=start.place)
    yielding = place.yielding(constant=start.law.holds)
    response = respond(nuisance_prior.modal_model, stretches.s, nuisance_prior.deviations(start.unknowns, start.place))
    used = stretches.used
    with np.errstate(all="ignore"):  # a step too far may run away: its cost is infinite
        done = step_in_time(start.law, (start.strength, start.shape), yielding, *place.without_law())
        force = _lines(stretches, done.force, holds=start.law.holds)
        shown = linear_motion(stretches, nuisance_prior, response) - response.to_sensors(start.place) * force[:, None]
        shown[nuisance_prior.moving] += nuisance_prior.sensor_starts(start.unknowns, response)
        misfit = as_real((stretches.motion - shown)[:, :, used] / np.sqrt(stretches.variance[:, :, used]))
    return _Shot(start=start, response=response, place=place, yielding=yielding, done=done, force=force, misfit=misfit)


def _lines(stretches: SegmentSet, force: FloatArray, *, holds: bool) -> ComplexArray:
    """Transform a law's force; one that is constant for a step acts around its time as `make_modes` has it."""
    clock = Clock(stretches, oversampling=FINER, fades=False)
    lines = clock.at_lines(np.where(np.isfinite(force), force, 0.0))
    lines[~np.isfinite(force).all(-1)] = np.inf
    way = stretches.s * clock.step_s
    return lines * (np.expm1(AHEAD * way) - np.expm1((AHEAD - 1) * way)) / way if holds else lines


def _slopes(
    stretches: SegmentSet, nuisance_prior: NuisancePrior, shot: _Shot, added: FloatArray | None = None
) -> FloatArray:
    """Derive the weighted responses by unknowns, strength and shape (times their size), and further forces."""
    start, used, n_free = shot.start, stretches.used, len(nuisance_prior.modes)
    changes = shot.place.changes(shot.done.force)
    with np.errstate(all="ignore"):  # changes that run away are taken for none below
        by_force = step_tangent(start.law, shot.yielding, shot.done, changes, added)
    to_sensors = shot.response.to_sensors(start.place)[:, used]
    weight = 1 / np.sqrt(stretches.variance[:, :, used])
    lines = _lines(stretches, by_force, holds=start.law.holds)[..., used]
    with np.errstate(all="ignore"):
        seen = -to_sensors * lines[:, :, None] * weight
    on_used = shot.response.on(used)
    rows = nuisance_prior.columns(stretches, on_used, -shot.force[:, used], start.place, start.unknowns)
    rows[: 2 * n_free] += seen[: 2 * n_free]
    first = 2 * n_free + nuisance_prior.sensors.size
    for number in range(len(nuisance_prior.inputs)):
        mine = stretches.input_of == number
        rows[first + number * n_free : first + (number + 1) * n_free, mine] += seen[2 * n_free : 3 * n_free, mine]
    first += nuisance_prior.inputs.size
    rows[first : first + n_free] += seen[3 * n_free : 4 * n_free]
    first += n_free
    for which in range(2 if len(nuisance_prior.moving) else 0):
        for record in nuisance_prior.moving:
            rows[first : first + n_free, record] += seen[(4 + which) * n_free : (5 + which) * n_free, record]
            first += n_free
    found = np.nan_to_num(as_real(np.concatenate([rows, seen[len(changes) :]])), posinf=0.0, neginf=0.0)
    return np.where(np.abs(found).max(axis=1, keepdims=True) < RUNAWAY, found, 0.0)


def _normal(shot: _Shot, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    n = len(shot.start.unknowns)
    prior = np.full(len(rows), WEAK_PRIOR)
    prior[:n] = 1.0
    right = rows @ shot.misfit
    right[:n] -= shot.start.unknowns
    return rows @ rows.T + np.diag(prior), right


def _step(shot: _Shot, rows: FloatArray, damping: float) -> Start:
    start, n = shot.start, len(shot.start.unknowns)
    normal, right = _normal(shot, rows)
    damped = normal + damping * np.diag(np.diag(normal))
    step = solve_even(damped, right)
    step *= min(1.0, LONGEST / max(float(np.abs(step[n:]).max()), 1e-300))
    shape = start.shape * (1 + step[n + 1]) if start.law.shape_name else start.shape
    return replace(
        start, strength=float(start.strength * (1 + step[n])), shape=float(shape), unknowns=start.unknowns + step[:n]
    )


def _finish(shot: _Shot, rows: FloatArray, *, settled: bool) -> LawFit:
    start, n = shot.start, len(shot.start.unknowns)
    normal, _ = _normal(shot, rows)
    inverse = solve_even(normal, np.eye(len(rows))[:, n:])[n:]
    sizes = np.array([start.strength, start.shape])[: len(rows) - n]
    covariance = np.zeros((2, 2))
    covariance[: len(sizes), : len(sizes)] = inverse * sizes * sizes[:, None]
    return LawFit(
        law=start.law,
        place=start.place,
        strength=start.strength,
        shape=start.shape,
        unknowns=start.unknowns,
        cost=shot.cost,
        n_rows=len(shot.misfit),
        covariance=covariance,
        motion=shot.done.motion,
        velocity=shot.done.velocity,
        force=shot.force,
        misfit=shot.misfit,
        settled=settled,
    )
