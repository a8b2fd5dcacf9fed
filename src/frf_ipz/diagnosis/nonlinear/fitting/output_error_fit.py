"""Output-error fit of a law at its location: every segment is simulated.

Unlike in `alternating_fit`, no motion is estimated from the data: the law's force follows from the measured force
alone, and so do its derivatives by all parameters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawFit, LawStart
from frf_ipz.diagnosis.nonlinear.fitting.linear_fit import as_real_rows, linear_sensor_motion
from frf_ipz.diagnosis.nonlinear.fitting.location_motion import NumericalLaplace
from frf_ipz.diagnosis.nonlinear.fitting.normal_equations import ROUNDING, solve_scaled
from frf_ipz.diagnosis.nonlinear.model.modal_model import ModalResponse, respond
from frf_ipz.diagnosis.nonlinear.model.time_response import TimeResponse
from frf_ipz.diagnosis.nonlinear.model.time_stepping import (
    HOLD_LEAD,
    LocationCompliance,
    TimeHistory,
    step_in_time,
    step_tangent,
)
from frf_ipz.numerics.levenberg_marquardt import LeastSquaresStatus, LevenbergMarquardt, NormalEquations, minimise

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.model.nuisance_prior import NuisancePrior
    from frf_ipz.diagnosis.nonlinear.segments import SegmentSet

SETTINGS = LevenbergMarquardt(
    steps=6,
    initial_damping=1e-3,
    min_damping=ROUNDING,
    max_damping=5e3,
    relative_decrease=3e-3,
)
WEAKER = 0.1  # factor of a law's strength as long as its motion diverges
DIVERGED = 1e100  # standard deviations: a derivative as large has diverged, and is set to zero
LONGEST = 0.5  # relative change of a law's parameter in one step
ForceBasis = Callable[[FloatArray, FloatArray], FloatArray]
WEAK_PRIOR = 1e-6  # on relative changes of strength and shape: without contact, they are not determined separately


@dataclass(frozen=True, kw_only=True, eq=False)
class Simulation:
    """A simulation of all segments.

    Parameters
    ----------
    start : LawStart
        The law at its location, and the nuisance parameters.
    response, time_response, compliance
        Of the linear model.
    history : TimeHistory
        Of the law.
    force : (n_segments, n_lines) complex array
        Of the law against the structure, N s.
    misfit : (n_rows,) array
        Weighted, measured minus simulated.
    """

    start: LawStart
    response: ModalResponse
    time_response: TimeResponse
    compliance: LocationCompliance
    history: TimeHistory
    force: ComplexArray
    misfit: FloatArray

    @property
    def cost(self) -> float:
        """Weighted sum of squared misfits, and of squared nuisance parameters; infinite where the motion diverges."""
        with np.errstate(all="ignore"):  # of a motion that diverges
            cost = float(self.misfit @ self.misfit + self.start.nuisance @ self.start.nuisance)
        return cost if np.isfinite(cost) else np.inf

    @cached_property
    def equations(self) -> NormalEquations:
        """Derivatives by nuisance, strength and shape."""
        return _normal_equations(self, _derivative_rows(self))

    @cached_property
    def covariance(self) -> FloatArray:
        """(2, 2) covariance of strength and shape."""
        equations, n = self.equations, len(self.start.nuisance)
        n_law = len(equations.right) - n
        inverse = solve_scaled(equations.matrix, np.eye(n + n_law)[:, n:])[n:]
        sizes = np.array([self.start.strength, self.start.shape])[:n_law]
        covariance = np.zeros((2, 2))
        covariance[: len(sizes), : len(sizes)] = inverse * sizes * sizes[:, None]
        return covariance

    def weigh(self, segments: SegmentSet) -> Simulation:
        """Weigh the misfit by the variance of other data, which are the same but for that."""
        used, present = segments.used, np.isfinite(segments.variance)
        known = np.where(present, self.time_response.segments.variance, 0.0)
        ratio = np.sqrt(known / np.where(present, segments.variance, 1.0))[:, :, used]
        misfit = as_real_rows(self.misfit.view(complex).reshape(ratio.shape) * ratio)
        return replace(self, time_response=replace(self.time_response, segments=segments), misfit=misfit)

    def is_of(self, segments: SegmentSet, nuisance_prior: NuisancePrior, start: LawStart) -> bool:
        """Tell whether these data would be simulated with these numbers."""
        simulated, time_response = self.start, self.time_response
        return (
            time_response.segments is segments
            and time_response.nuisance_prior is nuisance_prior
            and simulated.law is start.law
            and (simulated.location, simulated.strength, simulated.shape)
            == (start.location, start.strength, start.shape)
            and np.array_equal(simulated.nuisance, start.nuisance)
        )


def fit_output_error(
    segments: SegmentSet,
    nuisance_prior: NuisancePrior,
    start: LawStart,
    *,
    iterations: int = 6,
    known: Simulation | None = None,
) -> LawFit:
    """Fit a law at a location.

    Parameters
    ----------
    segments : SegmentSet
        The data.
    nuisance_prior : NuisancePrior
        Of the linear model.
    start : LawStart
        Law, location, and first values; the strength is not zero.
    iterations : int
        Steps at most; with 0 the start is only simulated.
    known : Simulation, optional
        Used where it is one of the start with these segments.

    Returns
    -------
    LawFit
        The best simulation.
    """
    problem = _OutputErrorProblem(segments=segments, nuisance_prior=nuisance_prior)
    simulation = _simulate_unless_known(segments, nuisance_prior, start, known)
    while not np.isfinite(simulation.cost):  # a softening spring that is too strong diverges
        weaker = replace(simulation.start, strength=WEAKER * simulation.start.strength)
        simulation = _simulate(segments, nuisance_prior, weaker)
    optimum = minimise(problem, simulation, replace(SETTINGS, steps=iterations))
    converged = optimum.status in {LeastSquaresStatus.CONVERGED, LeastSquaresStatus.STALLED}
    return _as_law_fit(optimum.point, converged=converged)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _OutputErrorProblem:
    """What is minimised: misfit of the simulation and nuisance parameters, strength and shape by relative changes."""

    segments: SegmentSet
    nuisance_prior: NuisancePrior

    def cost(self, simulation: Simulation) -> float:
        """Give the cost; infinite where the motion diverges."""
        return simulation.cost

    def linearise(self, simulation: Simulation) -> NormalEquations:
        """Derive by nuisance, strength and shape."""
        return simulation.equations

    def move(self, simulation: Simulation, _equations: NormalEquations, step: FloatArray) -> Simulation:
        """Simulate after a step that changes no parameter of the law by much."""
        start, n = simulation.start, len(simulation.start.nuisance)
        step = step * min(1.0, LONGEST / max(float(np.abs(step[n:]).max()), 1e-300))
        moved = replace(
            start,
            strength=float(start.strength * (1 + step[n])),
            shape=float(start.shape * (1 + step[n + 1])) if start.law.shape_name else start.shape,
            nuisance=start.nuisance + step[:n],
        )
        return _simulate(self.segments, self.nuisance_prior, moved)


def gain_of_added_forces(
    segments: SegmentSet,
    nuisance_prior: NuisancePrior,
    start: LawStart,
    force_basis: ForceBasis,
    *,
    known: Simulation | None = None,
) -> float:
    """Compute how far other forces at a law's location, free in all their strengths, would lower the cost.

    Parameters
    ----------
    segments : SegmentSet
        The data.
    nuisance_prior : NuisancePrior
        Of the linear model.
    start : LawStart
        The law as it was fitted.
    force_basis : callable
        Gives the forces, (n_forces, n_segments, n_times), for motion and velocity.
    known : Simulation, optional
        Used where it is one of the start with these segments.

    Returns
    -------
    float
        Drop of the weighted sum of squares, linearised in the strengths.
    """
    simulation = _simulate_unless_known(segments, nuisance_prior, start, known)
    forces = force_basis(simulation.history.motion, simulation.history.velocity)
    rows = _derivative_rows(simulation, forces)
    n_plain = len(rows) - len(forces)
    sizes = np.linalg.norm(rows[n_plain:], axis=1)
    rows[n_plain:] /= np.maximum(sizes, 1e-300)[:, None]
    equations = _normal_equations(simulation, rows)
    normal, right = equations.matrix, equations.right
    drops = [right[:n] @ solve_scaled(normal[:n, :n], right[:n]) for n in (n_plain, len(rows))]
    return float(drops[1] - drops[0])


def _simulate_unless_known(
    segments: SegmentSet, nuisance_prior: NuisancePrior, start: LawStart, known: Simulation | None
) -> Simulation:
    is_known = known is not None and known.is_of(segments, nuisance_prior, start)
    return known if known is not None and is_known else _simulate(segments, nuisance_prior, start)


def _simulate(segments: SegmentSet, nuisance_prior: NuisancePrior, start: LawStart) -> Simulation:
    time_response = TimeResponse(
        segments=segments, nuisance_prior=nuisance_prior, nuisance=start.nuisance, location=start.location
    )
    compliance = time_response.compliance(hold=start.law.holds)
    response = respond(nuisance_prior.modal_model, segments.s, nuisance_prior.to_values(start.nuisance, start.location))
    used = segments.used
    with np.errstate(all="ignore"):  # too long a step may diverge: its cost is infinite
        history = step_in_time(
            start.law, (start.strength, start.shape), compliance, *time_response.motion_without_law()
        )
        force = _transform_force(segments, history.force, holds=start.law.holds)
        by_law = response.to_sensors(start.location) * force[:, None]
        motion = linear_sensor_motion(segments, nuisance_prior, response) - by_law
        motion[nuisance_prior.moving] += nuisance_prior.sensor_free_vibration(start.nuisance, response)
        misfit = as_real_rows((segments.motion - motion)[:, :, used] / np.sqrt(segments.variance[:, :, used]))
    return Simulation(
        start=start,
        response=response,
        time_response=time_response,
        compliance=compliance,
        history=history,
        force=force,
        misfit=misfit,
    )


def _transform_force(segments: SegmentSet, force: FloatArray, *, holds: bool) -> ComplexArray:
    """Transform a law's force; one that is held for a step acts around its time as in `discretise_modes`."""
    laplace = NumericalLaplace(segments, oversampling=segments.steps_per_sample, fades=False)
    lines = laplace.at_lines(np.where(np.isfinite(force), force, 0.0))
    lines[~np.isfinite(force).all(-1)] = np.inf
    angle = segments.s * laplace.step_s
    return lines * (np.expm1(HOLD_LEAD * angle) - np.expm1((HOLD_LEAD - 1) * angle)) / angle if holds else lines


def _derivative_rows(simulation: Simulation, added: FloatArray | None = None) -> FloatArray:
    """Derive the weighted responses by nuisance, strength and shape (times their size), and added forces."""
    segments, nuisance_prior = simulation.time_response.segments, simulation.time_response.nuisance_prior
    start, used, n_free = simulation.start, segments.used, len(nuisance_prior.modes)
    changes = simulation.time_response.derivatives(simulation.history.force)
    with np.errstate(all="ignore"):  # derivatives that diverge are set to zero below
        by_force = step_tangent(start.law, simulation.compliance, simulation.history, changes, added)
    to_sensors = simulation.response.to_sensors(start.location)[:, used]
    weight = 1 / np.sqrt(segments.variance[:, :, used])
    lines = _transform_force(segments, by_force, holds=start.law.holds)[..., used].swapaxes(0, 1)
    with np.errstate(all="ignore"):
        by_law = -to_sensors * lines[:, :, None] * weight
    on_used = simulation.response.on(used)
    rows = nuisance_prior.jacobian(segments, on_used, -simulation.force[:, used], start.location, start.nuisance)
    rows[: 2 * n_free] += by_law[: 2 * n_free]
    first = 2 * n_free + nuisance_prior.sensors.size
    for number in range(len(nuisance_prior.inputs)):
        of_input = segments.input_of == number
        rows[first + number * n_free : first + (number + 1) * n_free, of_input] += by_law[
            2 * n_free : 3 * n_free, of_input
        ]
    first += nuisance_prior.inputs.size
    rows[first : first + n_free] += by_law[3 * n_free : 4 * n_free]
    first += n_free
    for which in range(2 if len(nuisance_prior.moving) else 0):
        for segment in nuisance_prior.moving:
            rows[first : first + n_free, segment] += by_law[(4 + which) * n_free : (5 + which) * n_free, segment]
            first += n_free
    real_rows = np.nan_to_num(as_real_rows(np.concatenate([rows, by_law[changes.shape[1] :]])), posinf=0.0, neginf=0.0)
    return np.where(np.abs(real_rows).max(axis=1, keepdims=True) < DIVERGED, real_rows, 0.0)


def _normal_equations(simulation: Simulation, rows: FloatArray) -> NormalEquations:
    n = len(simulation.start.nuisance)
    prior = np.full(len(rows), WEAK_PRIOR)
    prior[:n] = 1.0
    right = rows @ simulation.misfit
    right[:n] -= simulation.start.nuisance
    return NormalEquations(matrix=rows @ rows.T + np.diag(prior), right=right)


def _as_law_fit(simulation: Simulation, *, converged: bool) -> LawFit:
    start, time_response = simulation.start, simulation.time_response
    return LawFit(
        law=start.law,
        location=start.location,
        strength=start.strength,
        shape=start.shape,
        nuisance=start.nuisance,
        cost=simulation.cost,
        n_rows=len(simulation.misfit),
        estimate_covariance=cache(
            partial(_estimate_covariance, time_response.segments, time_response.nuisance_prior, start)
        ),
        motion=simulation.history.motion,
        velocity=simulation.history.velocity,
        force=simulation.force,
        misfit=simulation.misfit,
        converged=converged,
        simulation=simulation,
    )


def _estimate_covariance(segments: SegmentSet, nuisance_prior: NuisancePrior, start: LawStart) -> FloatArray:
    return _simulate(segments, nuisance_prior, start).covariance
