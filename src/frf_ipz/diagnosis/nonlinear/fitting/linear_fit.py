"""The linear model with its nuisance parameters, fitted to segments: every law is compared with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.nonlinear.fitting.normal_equations import ROUNDING
from frf_ipz.diagnosis.nonlinear.model.modal_model import ModalResponse, nominal_values, respond
from frf_ipz.diagnosis.nonlinear.model.nuisance_prior import NuisancePrior
from frf_ipz.diagnosis.nonlinear.segments import SegmentSet
from frf_ipz.numerics.least_squares import cholesky_with_prior
from frf_ipz.numerics.levenberg_marquardt import LevenbergMarquardt, NormalEquations, minimise

SETTINGS = LevenbergMarquardt(  # whole steps, as long as they lower the cost by what is worth one
    steps=5, trials_per_step=1, initial_damping=ROUNDING, min_damping=ROUNDING, relative_decrease=0.01
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearFit:
    """The linear model with its nuisance parameters, fitted to the data.

    Parameters
    ----------
    response : ModalResponse
        Of the nominal model, on all lines.
    excess : (n_segments, n_sensors, n_lines) complex array
        Data minus nominal model with the initial states of the best linear model, m s.
    misfit : (n_rows,) array
        Data minus nominal model on the used lines, weighted, real and imaginary parts in turn.
    columns : (n_nuisance, n_rows) array
        Derivatives by each nuisance parameter.
    factor : (n_nuisance, n_nuisance) array
        Lower Cholesky factor of columns columns^T + 1.
    cost : float
        Of the best linear model, its prior included.
    nuisance_prior : NuisancePrior
        Of the linear model.
    nuisance : (n_nuisance,) array
        Of the best linear model.
    """

    response: ModalResponse
    excess: ComplexArray
    misfit: FloatArray
    columns: FloatArray
    factor: FloatArray
    cost: float
    nuisance_prior: NuisancePrior
    nuisance: FloatArray

    @property
    def n_rows(self) -> int:
        """Number of real data."""
        return len(self.misfit)

    @property
    def start_nuisance(self) -> FloatArray:
        """(n_nuisance,) nuisance of the nominal model, with the initial states of the best linear one."""
        return self.nuisance_prior.keep_initial_states(self.nuisance)


def fit_linear(segments: SegmentSet, nuisance_prior: NuisancePrior) -> LinearFit:
    """Fit the linear model alone.

    Parameters
    ----------
    segments : SegmentSet
        The data.
    nuisance_prior : NuisancePrior
        Of the linear model.

    Returns
    -------
    LinearFit
        One step from the nominal model; its cost is that after further steps.
    """
    modal_model, used = nuisance_prior.modal_model, segments.used
    response = respond(modal_model, segments.s, nominal_values(modal_model))
    excess = segments.motion - linear_sensor_motion(segments, nuisance_prior, response)
    on_used = respond(modal_model, segments.s[used], nominal_values(modal_model))
    no_force = np.zeros((segments.n_segments, len(used)), complex)
    columns = as_real_rows(nuisance_prior.jacobian(segments, on_used, no_force, None))
    misfit = as_real_rows(excess[:, :, used] / np.sqrt(segments.variance[:, :, used]))
    factor = cholesky_with_prior(columns)
    projection = linalg.solve_triangular(factor, columns @ misfit, lower=True)
    nuisance = linalg.solve_triangular(factor.T, projection, lower=False)
    excess[nuisance_prior.moving] -= nuisance_prior.sensor_free_vibration(nuisance, response)
    cost = float(misfit @ misfit - projection @ projection)
    return LinearFit(
        response=response,
        nuisance_prior=nuisance_prior,
        nuisance=nuisance,
        excess=excess,
        misfit=misfit,
        columns=columns,
        factor=factor,
        cost=min(cost, _converged_cost(segments, nuisance_prior, nuisance)),
    )


def _converged_cost(segments: SegmentSet, nuisance_prior: NuisancePrior, nuisance: FloatArray) -> float:
    """Cost of the linear model after a few steps: a law must explain what is left then, not after the first one."""
    problem = _LinearProblem(segments=segments, nuisance_prior=nuisance_prior)
    return minimise(problem, problem.evaluate(nuisance), SETTINGS).cost


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _LinearPoint:
    """Nuisance parameters, and what the linear model leaves with them."""

    nuisance: FloatArray
    response: ModalResponse
    misfit: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _LinearProblem:
    """What is minimised: misfit of the linear model, and nuisance parameters."""

    segments: SegmentSet
    nuisance_prior: NuisancePrior

    def evaluate(self, nuisance: FloatArray) -> _LinearPoint:
        """Compute response and misfit."""
        segments, nuisance_prior, used = self.segments, self.nuisance_prior, self.segments.used
        response = respond(nuisance_prior.modal_model, segments.s, nuisance_prior.to_values(nuisance))
        motion = linear_sensor_motion(segments, nuisance_prior, response)
        motion[nuisance_prior.moving] += nuisance_prior.sensor_free_vibration(nuisance, response)
        misfit = as_real_rows((segments.motion - motion)[:, :, used] / np.sqrt(segments.variance[:, :, used]))
        return _LinearPoint(nuisance=nuisance, response=response, misfit=misfit)

    def cost(self, point: _LinearPoint) -> float:
        """Sum the weighted squares."""
        return float(point.misfit @ point.misfit + point.nuisance @ point.nuisance)

    def linearise(self, point: _LinearPoint) -> NormalEquations:
        """Derive by the nuisance parameters."""
        segments, used = self.segments, self.segments.used
        no_force = np.zeros((segments.n_segments, len(used)), complex)
        columns = self.nuisance_prior.jacobian(segments, point.response.on(used), no_force, None, point.nuisance)
        rows = as_real_rows(columns)
        return NormalEquations(matrix=rows @ rows.T + np.eye(len(rows)), right=rows @ point.misfit - point.nuisance)

    def move(self, point: _LinearPoint, _equations: NormalEquations, step: FloatArray) -> _LinearPoint:
        """Compute response and misfit after a step."""
        return self.evaluate(point.nuisance + step)


def linear_sensor_motion(segments: SegmentSet, nuisance_prior: NuisancePrior, response: ModalResponse) -> ComplexArray:
    """Compute the motion of the sensors by the measured force, without initial states.

    Where a segment starts in motion, modes above the free ones follow the force as if at rest; the force's own start
    is then missing in a velocity or an acceleration that is integrated from rest.

    Parameters
    ----------
    segments : SegmentSet
        The forces.
    nuisance_prior : NuisancePrior
        Which modes are free.
    response : ModalResponse
        On all lines.

    Returns
    -------
    (n_segments, n_sensors, n_lines) complex array
        As `SegmentSet.motion`.
    """
    s, moving = segments.s, nuisance_prior.moving
    motion = response.from_inputs()[segments.input_of] * segments.force[:, None]
    if len(moving):
        above = response.from_inputs(len(nuisance_prior.modes))[segments.input_of[moving]]
        force, slope = segments.start_force[moving].T[:, :, None]
        lost = np.array([np.zeros((len(moving), len(s))), force / s, force / s + slope / s**2])
        powers = [sensor.quantity.power for sensor in response.modal_model.sensors]
        motion[moving] -= above * lost[powers].swapaxes(0, 1)
    return motion


def linear_location_motion(
    segments: SegmentSet, nuisance_prior: NuisancePrior, nuisance: FloatArray, response: ModalResponse, location: int
) -> tuple[ComplexArray, ComplexArray]:
    """Compute the motion of a location by the linear model alone, and its driving-point receptance.

    Parameters
    ----------
    segments : SegmentSet
        The forces.
    nuisance_prior : NuisancePrior
        Of the linear model.
    nuisance : (n_nuisance,) array
        In prior standard deviations: their initial states count.
    response : ModalResponse
        With these nuisance parameters, on all lines.
    location : int
        Index in `ModalModel.locations`.

    Returns
    -------
    driving_point : (n_lines,) complex array
        Receptance of the location to itself, m/N.
    motion : (n_segments, n_lines) complex array
        m s.
    """
    driving_point, transfer = response.at_location(location)
    motion = transfer[segments.input_of] * segments.force
    motion[nuisance_prior.moving] += nuisance_prior.location_free_vibration(nuisance, response, location)
    return driving_point, motion


def as_real_rows(values: ComplexArray) -> FloatArray:
    """Lay complex arrays out as rows of real numbers: (..., n_segments, n_sensors, n_lines) to (..., n_rows)."""
    lead = values.shape[:-3]
    return np.ascontiguousarray(values.reshape(*lead, -1)).view(np.float64)
