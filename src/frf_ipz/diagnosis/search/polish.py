"""Fits a hypothesis to measured transfer functions, and weighs its evidence.

Levenberg-Marquardt on the parameters of the causes and on everything that cannot be known, which has a prior. The
evidence is Laplace's: the likelihood at the top, times the volume of the posterior over that of the prior.

[MacKay2003] D. J. C. MacKay, Information theory, inference, and learning algorithms, Cambridge University Press, 2003,
chapters 27 and 28.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.arrays import BoolArray, FloatArray
from frf_ipz.diagnosis.physics.response import Response, nuisance_jacobian

if TYPE_CHECKING:
    from frf_ipz.diagnosis.measured.transfer import Measured, Whitening
    from frf_ipz.diagnosis.search.hypothesis import Hypothesis

STEP = 1e-5  # of the logarithm of a parameter, for its derivative
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-8, 1e6
FASTER, SLOWER = 0.2, 6.0  # what damping is multiplied with after a good and a bad step
LONGEST_STEP = 0.7  # of the logarithm of a parameter, or a tenth of a linear range
PRIOR_CURVATURE = 12.0  # over the squared range: that of a uniform prior, where the data say nothing
MATTERS = 0.02  # squared norm of a whitened derivative per standard deviation: less changes nothing


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """A hypothesis at its best.

    Parameters
    ----------
    hypothesis : Hypothesis
        Causes at their places.
    values : (n_parameters,) array
        Physical values of the parameters.
    unknown : (n_nuisance,) array
        What cannot be known, in standard deviations.
    misfit : float
        Sum of squares of the whitened misfit.
    pull : float
        Sum of squares of `unknown`.
    log_evidence : float
        nats, up to a constant that all hypotheses share.
    covariance : (n_parameters, n_parameters) array
        Of the parameters as searched (logarithms, parts of ranges).
    converged : bool
        The last step was small.
    """

    hypothesis: Hypothesis
    values: FloatArray
    unknown: FloatArray
    misfit: float
    pull: float
    log_evidence: float
    covariance: FloatArray
    converged: bool

    @property
    def cost(self) -> float:
        """Minus the logarithm of likelihood times prior, up to a constant."""
        return 0.5 * (self.misfit + self.pull)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Data:
    """What hypotheses are fitted to.

    Parameters
    ----------
    measured : Measured
        Transfer functions.
    whitening : Whitening
        Of their errors.
    """

    measured: Measured
    whitening: Whitening

    def misfit(self, response: Response) -> FloatArray:
        """Whitened difference of measurement and model, (n_data,) array."""
        return self.whitening(self.measured.values - response.values)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Point:
    """Where the iteration is."""

    searched: FloatArray
    unknown: FloatArray
    misfit: FloatArray
    response: Response

    @property
    def objective(self) -> float:
        return float(self.misfit @ self.misfit + self.unknown @ self.unknown)


def polish(
    hypothesis: Hypothesis,
    data: Data,
    values: FloatArray,
    *,
    unknown: FloatArray | None = None,
    iterations: int = 8,
    tolerance: float = 0.02,
    used: BoolArray | None = None,
) -> Fit:
    """Fit a hypothesis.

    Parameters
    ----------
    hypothesis : Hypothesis
        Causes at their places.
    data : Data
        What to fit to.
    values : (n_parameters,) array
        Physical values to start from.
    unknown : (n_nuisance,) array, optional
        What cannot be known, to start from; zero where it is left out.
    iterations : int
        At most that many.
    tolerance : float
        Stop when a step changes the objective by less, in squared standard deviations.
    used : (n_nuisance,) bool array, optional
        Unknowns that may move; those that matter where it is left out.

    Returns
    -------
    Fit
        The best found.
    """
    start = np.clip(hypothesis.searched(values), hypothesis.low, hypothesis.high)
    unknown = np.zeros(hypothesis.nuisance.size) if unknown is None else unknown
    point = _at(hypothesis, data, start, unknown)
    damping, converged = FIRST_DAMPING, False
    for _ in range(iterations):
        jacobian, used = _jacobian(hypothesis, data, point, used)
        step_taken = False
        while damping < MOST_DAMPING:
            trial = _step(hypothesis, data, point, jacobian, used, damping)
            gain = point.objective - trial.objective
            if gain > 0:
                damping, step_taken = max(FASTER * damping, LEAST_DAMPING), True
                point = trial
                break
            damping *= SLOWER
            if abs(gain) < tolerance:
                break
        if not step_taken or gain < tolerance:
            converged = True
            break
    jacobian, _ = _jacobian(hypothesis, data, point, used)
    return _finish(hypothesis, point, jacobian, converged=converged)


def _at(hypothesis: Hypothesis, data: Data, searched: FloatArray, unknown: FloatArray) -> _Point:
    response = hypothesis.respond(hypothesis.physical(searched), unknown, data.measured.s)
    return _Point(searched=searched, unknown=unknown, misfit=data.misfit(response), response=response)


def _jacobian(
    hypothesis: Hypothesis, data: Data, point: _Point, used: BoolArray | None
) -> tuple[FloatArray, BoolArray]:
    """Differentiate the whitened FRFs by parameters, then by the unknowns that matter."""
    columns = [_derivative(hypothesis, data, point, index)[:, None] for index in range(len(hypothesis.parameters))]
    by_unknown = nuisance_jacobian(point.response, hypothesis.nuisance, hypothesis.specimen.layout)
    if used is None:
        white = data.whitening(by_unknown)
        used = np.sum(white**2, 0) > MATTERS
        return np.hstack([*columns, white[:, used]]), used
    return np.hstack([*columns, data.whitening(by_unknown[:, :, used])]), used


def _derivative(hypothesis: Hypothesis, data: Data, point: _Point, index: int) -> FloatArray:
    moved = point.searched.copy()
    step = STEP if moved[index] + STEP <= hypothesis.high[index] else -STEP
    moved[index] += step
    response = hypothesis.respond(hypothesis.physical(moved), point.unknown, data.measured.s)
    return data.whitening((response.values - point.response.values) / step)


def _normal(hypothesis: Hypothesis, jacobian: FloatArray) -> FloatArray:
    """Curvature of the objective's half: data, priors of unknowns, and uniform priors where data say nothing."""
    n_parameters = len(hypothesis.parameters)
    prior = np.ones(jacobian.shape[1])
    prior[:n_parameters] = PRIOR_CURVATURE / (hypothesis.high - hypothesis.low) ** 2
    return np.asarray(jacobian.T @ jacobian + np.diag(prior))


def _step(
    hypothesis: Hypothesis, data: Data, point: _Point, jacobian: FloatArray, used: BoolArray, damping: float
) -> _Point:
    n_parameters = len(hypothesis.parameters)
    curvature = _normal(hypothesis, jacobian)
    gradient = jacobian.T @ point.misfit
    gradient[n_parameters:] -= point.unknown[used]
    damped = curvature + damping * np.diag(np.diag(curvature))
    step = linalg.cho_solve(linalg.cho_factor(damped, lower=True, check_finite=False), gradient, check_finite=False)
    longest = np.where([parameter.is_log for parameter in hypothesis.parameters], LONGEST_STEP, 0.1)
    if n_parameters:
        step *= min(1.0, float(np.min(longest / np.maximum(np.abs(step[:n_parameters]), 1e-300))))
    searched = np.clip(point.searched + step[:n_parameters], hypothesis.low, hypothesis.high)
    unknown = point.unknown.copy()
    unknown[used] += step[n_parameters:]
    return _at(hypothesis, data, searched, unknown)


def _finish(hypothesis: Hypothesis, point: _Point, jacobian: FloatArray, *, converged: bool) -> Fit:
    n_parameters = len(hypothesis.parameters)
    curvature = _normal(hypothesis, jacobian)
    lower = linalg.cholesky(curvature, lower=True, check_finite=False)
    log_volume = float(np.sum(np.log(np.diag(lower))))
    log_prior = -sum(np.log(cause.n_places) for cause in hypothesis.causes)
    log_prior -= float(np.sum(np.log(hypothesis.high - hypothesis.low)))
    misfit, pull = float(point.misfit @ point.misfit), float(point.unknown @ point.unknown)
    inverse = linalg.cho_solve((lower, True), np.eye(len(curvature))[:, :n_parameters])
    return Fit(
        hypothesis=hypothesis,
        values=hypothesis.physical(point.searched),
        unknown=point.unknown,
        misfit=misfit,
        pull=pull,
        log_evidence=-0.5 * (misfit + pull) - log_volume + 0.5 * n_parameters * np.log(2 * np.pi) + log_prior,
        covariance=np.asarray(inverse[:n_parameters]),
        converged=converged,
    )
