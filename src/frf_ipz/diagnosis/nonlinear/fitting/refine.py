"""One law at one place, fitted in turns: its force from the motion, then strength, shape and the linear model.

Each turn estimates the place's motion with what is known so far, puts the law's force on the structure, and takes one
damped Gauss-Newton step in all unknowns together. The best turn counts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.nonlinear.fitting.motion import Clock, place_motion
from frf_ipz.diagnosis.nonlinear.fitting.normal_equations import step_to
from frf_ipz.diagnosis.nonlinear.fitting.score_test import as_real, linear_motion, linear_motion_of_place
from frf_ipz.diagnosis.nonlinear.linear.modal_model import ModalResponse, respond

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.laws.law import Law
    from frf_ipz.diagnosis.nonlinear.linear.nuisance_prior import NuisancePrior
    from frf_ipz.diagnosis.nonlinear.recorded.segments import SegmentSet

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
    settled : bool
        Further steps would not make it better.
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
    settled: bool = False

    @property
    def numbers(self) -> dict[str, tuple[float, float]]:
        """The law's numbers by their names, each with its variance."""
        found = {self.law.strength_name: (self.strength, float(self.covariance[0, 0]))}
        if self.law.shape_name:
            found[self.law.shape_name] = (self.shape, float(self.covariance[1, 1]))
        return found

    def start(self, unknowns: FloatArray | None = None) -> Start:
        """Start another fit from here, with these or other unknowns of the linear model."""
        return Start(
            law=self.law,
            place=self.place,
            strength=self.strength,
            shape=self.shape,
            unknowns=self.unknowns if unknowns is None else unknowns,
        )


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


def refine(
    stretches: SegmentSet, nuisance_prior: NuisancePrior, start: Start, *, n_turns: int = 4, known: bool = True
) -> LawFit:
    """Fit a law at a place.

    Parameters
    ----------
    stretches : SegmentSet
        The data.
    nuisance_prior : NuisancePrior
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
        force = _first_force(stretches, nuisance_prior, start, clock)
    for _ in range(n_turns):
        fit, start, force = _turn(stretches, nuisance_prior, start, clock, force)
        if best is not None and fit.cost > (1 - SETTLED) * best.cost:
            return best if best.cost <= fit.cost else fit
        best = fit
    if best is None:
        raise ValueError("a fit needs at least one turn")
    return best


def _first_force(stretches: SegmentSet, nuisance_prior: NuisancePrior, start: Start, clock: Clock) -> ComplexArray:
    """Force of the law in the motion that follows without knowing it."""
    _, w, v = motion_at(stretches, nuisance_prior, start, clock, None)
    return clock.at_lines(start.strength * start.law.unit_force(w, v, start.shape))


def motion_at(
    stretches: SegmentSet, nuisance_prior: NuisancePrior, start: Start, clock: Clock, force: ComplexArray | None
) -> tuple[ModalResponse, FloatArray, FloatArray]:
    """Estimate how the place of a law moves.

    Parameters
    ----------
    stretches : SegmentSet
        The data.
    nuisance_prior : NuisancePrior
        Unknowns of the linear model.
    start : Start
        The place, and the values of the unknowns.
    clock : Clock
        Times.
    force : (n_blows, n_lines) complex array, optional
        Of the law as far as it is known, N s.

    Returns
    -------
    response : ModalResponse
        With these unknowns.
    w, v : (n_blows, n_times) array
        Motion and velocity, m and m/s.
    """
    modal_model = nuisance_prior.modal_model
    response = respond(modal_model, stretches.s, nuisance_prior.deviations(start.unknowns, start.place))
    beyond = stretches.motion - linear_motion(stretches, nuisance_prior, response)
    beyond[nuisance_prior.moving] -= nuisance_prior.sensor_starts(start.unknowns, response)
    own, linear = linear_motion_of_place(stretches, nuisance_prior, start.unknowns, response, start.place)
    ratio = response.to_sensors(start.place) / own
    w = clock.at_times(place_motion(stretches, beyond, linear, ratio, None if force is None else -own * force))
    return response, w, clock.velocity(w)


def _turn(
    stretches: SegmentSet, nuisance_prior: NuisancePrior, start: Start, clock: Clock, force: ComplexArray | None
) -> tuple[LawFit, Start, ComplexArray]:
    law = start.law
    response, w, v = motion_at(stretches, nuisance_prior, start, clock, force)
    rows, misfit = _rows(stretches, nuisance_prior, start, response, _unit_forces(start, clock, w, v))
    step, covariance = step_to(rows, misfit, start.unknowns, RIDGE)
    n = nuisance_prior.n_unknowns
    strength = float(step[n]) if law.strength_can_be_negative else max(float(step[n]), 0.0)
    shape = start.shape
    if law.shape_name:
        shape *= 1 + float(np.clip(step[n + 1] / shape, -LARGEST_STEP, LARGEST_STEP))
    unknowns = start.unknowns + step[:n]
    left = misfit - step @ rows
    following = replace(start, strength=strength, shape=shape, unknowns=unknowns)
    fit = LawFit(
        law=law,
        place=start.place,
        strength=strength,
        shape=shape,
        unknowns=unknowns,
        cost=float(left @ left + unknowns @ unknowns),
        n_rows=len(left),
        covariance=np.pad(covariance, (0, 2 - len(covariance))),
        motion=w,
        velocity=v,
        force=strength * clock.at_lines(law.unit_force(w, v, shape)),
        misfit=left,
    )
    return fit, following, fit.force


def _unit_forces(start: Start, clock: Clock, w: FloatArray, v: FloatArray) -> list[ComplexArray]:
    """Transform the force for a strength of 1, and its change by the shape."""
    law, way = start.law, DIFFERENCE * start.shape
    forces = [clock.at_lines(law.unit_force(w, v, start.shape))]
    if law.shape_name:
        bent = law.unit_force(w, v, start.shape + way) - law.unit_force(w, v, start.shape - way)
        forces.append(clock.at_lines(bent * (start.strength / (2 * way))))
    return forces


def _rows(
    stretches: SegmentSet,
    nuisance_prior: NuisancePrior,
    start: Start,
    response: ModalResponse,
    forces: list[ComplexArray],
) -> tuple[FloatArray, FloatArray]:
    """Give derivatives by unknowns, strength and shape, and the misfit without the law; weighted, (.., n_rows)."""
    used = stretches.used
    on_used = response.on(used)
    weight = 1 / np.sqrt(stretches.variance[:, :, used])
    to_sensors = response.to_sensors(start.place)[:, used]
    linear = linear_motion(stretches, nuisance_prior, response)
    linear[nuisance_prior.moving] += nuisance_prior.sensor_starts(start.unknowns, response)
    misfit = as_real((stretches.motion - linear)[:, :, used] * weight)
    by_law = [as_real(-to_sensors * force[:, None, used] * weight)[None] for force in forces]
    rows = [
        as_real(nuisance_prior.columns(stretches, on_used, -start.strength * forces[0][:, used], start.place)),
        *by_law,
    ]
    return np.concatenate(rows), misfit
