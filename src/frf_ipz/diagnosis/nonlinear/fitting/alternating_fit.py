"""One law at one location, fitted in alternation: its force from the motion, then strength, shape and the linear model.

Each round estimates the motion of the location with the present force, applies the law's force to the structure, and
takes one Gauss-Newton step in all parameters together. The best round counts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.nonlinear.fitting.linear_fit import as_real_rows, linear_location_motion, linear_sensor_motion
from frf_ipz.diagnosis.nonlinear.fitting.location_motion import NumericalLaplace, estimate_motion
from frf_ipz.diagnosis.nonlinear.fitting.normal_equations import solve_with_prior
from frf_ipz.diagnosis.nonlinear.model.modal_model import ModalResponse, respond

if TYPE_CHECKING:
    from collections.abc import Callable

    from frf_ipz.diagnosis.nonlinear.fitting.output_error_fit import Simulation
    from frf_ipz.diagnosis.nonlinear.laws.law import Law
    from frf_ipz.diagnosis.nonlinear.model.nuisance_prior import NuisancePrior
    from frf_ipz.diagnosis.nonlinear.segments import SegmentSet

CONVERGED = 1e-3  # relative change of the cost between rounds
DIFFERENCE = 1e-4  # of the shape: its derivative; kinks average out over many samples
RIDGE = 1e-8  # of a column's own square: without contact, strength and shape are not determined separately
LARGEST_STEP = 0.3  # of the shape, a round


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LawFit:
    """A law at a location, fitted.

    Parameters
    ----------
    law : Law
        Which.
    location : int
        Index in `ModalModel.locations`.
    strength, shape : float
        Of the law.
    nuisance : (n_nuisance,) array
        Of the linear model, in prior standard deviations.
    cost : float
        Weighted sum of squared misfits, and of squared nuisance parameters.
    n_rows : int
        Number of real data.
    estimate_covariance : callable
        Gives the (2, 2) covariance of strength and shape, all nuisance parameters free, for data whose variance is
        right. It is asked of few of many fits, and of those whose simulation has been forgotten.
    motion, velocity : (n_segments, n_times) array
        Of the location, m and m/s.
    force : (n_segments, n_lines) complex array
        Of the law against the structure, N s.
    misfit : (n_rows,) array
        Weighted, measured minus fitted.
    converged : bool
        Further steps would not lower the cost.
    simulation : Simulation, optional
        Of an output-error fit that further steps may start from.
    """

    law: Law
    location: int
    strength: float
    shape: float
    nuisance: FloatArray
    cost: float
    n_rows: int
    estimate_covariance: Callable[[], FloatArray]
    motion: FloatArray
    velocity: FloatArray
    force: ComplexArray
    misfit: FloatArray
    converged: bool = False
    simulation: Simulation | None = None

    @property
    def numbers(self) -> dict[str, tuple[float, float]]:
        """The law's parameters by their names, each with its variance."""
        covariance = self.estimate_covariance() if self.simulation is None else self.simulation.covariance
        numbers = {self.law.strength_name: (self.strength, float(covariance[0, 0]))}
        if self.law.shape_name:
            numbers[self.law.shape_name] = (self.shape, float(covariance[1, 1]))
        return numbers

    def start(self, nuisance: FloatArray | None = None) -> LawStart:
        """Start another fit from here, with these or other nuisance parameters."""
        return LawStart(
            law=self.law,
            location=self.location,
            strength=self.strength,
            shape=self.shape,
            nuisance=self.nuisance if nuisance is None else nuisance,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LawStart:
    """Start values of a fit.

    Parameters
    ----------
    law : Law
        Which.
    location : int
        Index in `ModalModel.locations`.
    strength, shape : float
        Of the law.
    nuisance : (n_nuisance,) array
        Of the linear model.
    """

    law: Law
    location: int
    strength: float
    shape: float
    nuisance: FloatArray


def fit_alternating(
    segments: SegmentSet, nuisance_prior: NuisancePrior, start: LawStart, *, n_rounds: int = 4, known: bool = True
) -> LawFit:
    """Fit a law at a location.

    Parameters
    ----------
    segments : SegmentSet
        The data.
    nuisance_prior : NuisancePrior
        Of the linear model.
    start : LawStart
        Law, location, and first values.
    n_rounds : int
        At most.
    known : bool
        The start's strength is good enough to correct the motion with from the first round.

    Returns
    -------
    LawFit
        The round with the smallest cost.
    """
    laplace = NumericalLaplace(segments)
    best, force = None, None
    if known:
        force = _start_force(segments, nuisance_prior, start, laplace)
    for _ in range(n_rounds):
        fit, start, force = _fit_round(segments, nuisance_prior, start, laplace, force)
        if best is not None and fit.cost > (1 - CONVERGED) * best.cost:
            return best if best.cost <= fit.cost else fit
        best = fit
    if best is None:
        raise ValueError("a fit needs at least one round")
    return best


def _start_force(
    segments: SegmentSet, nuisance_prior: NuisancePrior, start: LawStart, laplace: NumericalLaplace
) -> ComplexArray:
    """Force of the law in the motion that is estimated without a force."""
    _, w, v = estimate_location_motion(segments, nuisance_prior, start, laplace, None)
    return laplace.at_lines(start.strength * start.law.unit_force(w, v, start.shape))


def estimate_location_motion(
    segments: SegmentSet,
    nuisance_prior: NuisancePrior,
    start: LawStart,
    laplace: NumericalLaplace,
    force: ComplexArray | None,
) -> tuple[ModalResponse, FloatArray, FloatArray]:
    """Estimate how the location of a law moves.

    Parameters
    ----------
    segments : SegmentSet
        The data.
    nuisance_prior : NuisancePrior
        Of the linear model.
    start : LawStart
        The location, and the nuisance parameters.
    laplace : NumericalLaplace
        Times.
    force : (n_segments, n_lines) complex array, optional
        Of the law, as far as it is known, N s.

    Returns
    -------
    response : ModalResponse
        With these nuisance parameters.
    w, v : (n_segments, n_times) array
        Motion and velocity, m and m/s.
    """
    response = respond(nuisance_prior.modal_model, segments.s, nuisance_prior.to_values(start.nuisance, start.location))
    excess = segments.motion - linear_sensor_motion(segments, nuisance_prior, response)
    excess[nuisance_prior.moving] -= nuisance_prior.sensor_free_vibration(start.nuisance, response)
    driving_point, linear = linear_location_motion(segments, nuisance_prior, start.nuisance, response, start.location)
    ratio = response.to_sensors(start.location) / driving_point
    by_law = None if force is None else -driving_point * force
    w = laplace.at_times(estimate_motion(segments, excess, linear, ratio, by_law))
    return response, w, laplace.velocity(w)


def _fit_round(
    segments: SegmentSet,
    nuisance_prior: NuisancePrior,
    start: LawStart,
    laplace: NumericalLaplace,
    force: ComplexArray | None,
) -> tuple[LawFit, LawStart, ComplexArray]:
    law = start.law
    response, w, v = estimate_location_motion(segments, nuisance_prior, start, laplace, force)
    rows, misfit = _derivative_rows(segments, nuisance_prior, start, response, _unit_forces(start, laplace, w, v))
    step, covariance = solve_with_prior(rows, misfit, start.nuisance, RIDGE)
    n = nuisance_prior.n_nuisance
    strength = float(step[n]) if law.strength_can_be_negative else max(float(step[n]), 0.0)
    shape = start.shape
    if law.shape_name:
        shape *= 1 + float(np.clip(step[n + 1] / shape, -LARGEST_STEP, LARGEST_STEP))
    nuisance = start.nuisance + step[:n]
    remaining = misfit - step @ rows
    following = replace(start, strength=strength, shape=shape, nuisance=nuisance)
    fit = LawFit(
        law=law,
        location=start.location,
        strength=strength,
        shape=shape,
        nuisance=nuisance,
        cost=float(remaining @ remaining + nuisance @ nuisance),
        n_rows=len(remaining),
        estimate_covariance=partial(np.pad, covariance, (0, 2 - len(covariance))),
        motion=w,
        velocity=v,
        force=strength * laplace.at_lines(law.unit_force(w, v, shape)),
        misfit=remaining,
    )
    return fit, following, fit.force


def _unit_forces(start: LawStart, laplace: NumericalLaplace, w: FloatArray, v: FloatArray) -> list[ComplexArray]:
    """Transform the force for a strength of 1, and its derivative by the shape."""
    law, step = start.law, DIFFERENCE * start.shape
    forces = [laplace.at_lines(law.unit_force(w, v, start.shape))]
    if law.shape_name:
        change = law.unit_force(w, v, start.shape + step) - law.unit_force(w, v, start.shape - step)
        forces.append(laplace.at_lines(change * (start.strength / (2 * step))))
    return forces


def _derivative_rows(
    segments: SegmentSet,
    nuisance_prior: NuisancePrior,
    start: LawStart,
    response: ModalResponse,
    forces: list[ComplexArray],
) -> tuple[FloatArray, FloatArray]:
    """Derive by nuisance, strength and shape, and give the misfit without the law; weighted, (.., n_rows)."""
    used = segments.used
    on_used = response.on(used)
    weight = 1 / np.sqrt(segments.variance[:, :, used])
    to_sensors = response.to_sensors(start.location)[:, used]
    linear = linear_sensor_motion(segments, nuisance_prior, response)
    linear[nuisance_prior.moving] += nuisance_prior.sensor_free_vibration(start.nuisance, response)
    misfit = as_real_rows((segments.motion - linear)[:, :, used] * weight)
    by_law = [as_real_rows(-to_sensors * force[:, None, used] * weight)[None] for force in forces]
    jacobian = nuisance_prior.jacobian(segments, on_used, -start.strength * forces[0][:, used], start.location)
    return np.concatenate([as_real_rows(jacobian), *by_law]), misfit
