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
from frf_ipz.diagnosis.evidence.fit import Data, Fit
from frf_ipz.diagnosis.model.response import nuisance_jacobian

if TYPE_CHECKING:
    from frf_ipz.diagnosis.evidence.hypothesis import Hypothesis
    from frf_ipz.diagnosis.model.modes import Modes
    from frf_ipz.diagnosis.model.nuisance import Nuisance
    from frf_ipz.diagnosis.model.response import Response

STEP = 1e-6  # of the logarithm of a parameter, to both sides: peaks are so narrow that one side is not exact enough
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-5, 1e-9, 1e6
FASTER, SLOWER = 0.2, 6.0  # what damping is multiplied with after a good and a bad step
LONGEST_STEP = 0.7  # of the logarithm of a parameter, or a tenth of a linear range
PRIOR_CURVATURE = 12.0  # over the squared range: that of a uniform prior, where the data say nothing
KEPT_TWICE = 2  # corrections of the frequencies after a step
FARTHEST = 0.1  # of a squared frequency: more is no small correction
LEAST_OF_RATIO = 0.05  # of a stated damping ratio: scatter takes no more away
MATTERS = 0.02  # squared norm of a whitened derivative per standard deviation: less changes nothing

PATIENCE = 3  # steps after which a fit may be given up
MANY = 0.3  # of the longest step: parameters that move so much are still on their way
FURTHER = 6.0  # times the last gain: what further steps may gain together
ROUNDING = 1e-9  # of a diagonal entry: what a sum of squares of many lines is exact to


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Point:
    """Where the iteration is."""

    searched: FloatArray
    unknown: FloatArray
    misfit: FloatArray
    response: Response
    pulls: FloatArray  # of the unknown
    slopes: FloatArray

    @property
    def objective(self) -> float:
        return float(self.misfit @ self.misfit + self.pulls @ self.pulls)


def polish(
    hypothesis: Hypothesis,
    data: Data,
    values: FloatArray,
    *,
    unknown: FloatArray | None = None,
    iterations: int = 8,
    tolerance: float = 0.02,
    bar: float = np.inf,
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
    bar : float
        Cost, half the objective, that a fit is wanted below: one whose last step does not lead there is given up.

    Returns
    -------
    Fit
        The best found.
    """
    start = hypothesis.start_at(values)
    point = _at(hypothesis, data, start, np.zeros(hypothesis.nuisance.size) if unknown is None else unknown)
    slope = _linearise(hypothesis, data, point)
    damping, converged = FIRST_DAMPING, False
    for done in range(iterations):
        gain = 0.0
        while damping < MOST_DAMPING:
            trial = _step(hypothesis, data, point, slope, damping)
            gain = point.objective - trial.objective
            if gain > 0 or abs(gain) < tolerance:
                break
            damping *= SLOWER
        is_far = bool(np.any(np.abs(trial.searched - point.searched) > MANY * _longest_step(hypothesis)))
        if gain > 0:
            point, damping = trial, max(FASTER * damping, LEAST_DAMPING)
            slope = _linearise(hypothesis, data, point)
        if gain < tolerance:
            converged = True
            break
        if done >= PATIENCE and not is_far and point.objective - FURTHER * gain > 2 * bar:
            break
    return _finish(hypothesis, point, slope, converged=converged)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Slope:
    """How everything changes around a point: first by the parameters, then by the unknowns that matter."""

    jacobian: FloatArray
    used: BoolArray
    squares: FloatArray  # (m, n_parameters), of the modes' squared frequencies
    scatter: FloatArray  # (m, n_unknowns), of the same
    ratios: FloatArray  # (m, n_parameters), of their damping ratios without scatter
    slopes: FloatArray  # of the unknowns' pulls

    def curvature(self, hypothesis: Hypothesis) -> FloatArray:
        """Sum the data's curvature, the unknowns' priors, and uniform priors where data say nothing."""
        n_parameters = len(hypothesis.parameters)
        prior = np.ones(self.jacobian.shape[1])
        prior[:n_parameters] = PRIOR_CURVATURE / (hypothesis.high - hypothesis.low) ** 2
        prior[n_parameters:] = self.slopes**2
        return np.asarray(self.jacobian.T @ self.jacobian + np.diag(prior))


def _at(hypothesis: Hypothesis, data: Data, searched: FloatArray, unknown: FloatArray) -> _Point:
    response = hypothesis.respond(hypothesis.physical(searched), unknown, data.measured.s)
    pulls, slopes = hypothesis.nuisance.pulls(unknown, is_bounded=data.is_bounded)
    misfit = data.misfit(response)
    return _Point(searched=searched, unknown=unknown, misfit=misfit, response=response, pulls=pulls, slopes=slopes)


def _linearise(hypothesis: Hypothesis, data: Data, point: _Point) -> _Slope:
    m = hypothesis.nuisance.n_modes
    changes, squares, ratios = [], [], []
    for index in range(len(hypothesis.parameters)):
        low, high = point.searched.copy(), point.searched.copy()
        low[index] = max(low[index] - STEP, hypothesis.low[index])
        high[index] = min(high[index] + STEP, hypothesis.high[index])
        before, after = (
            hypothesis.respond(hypothesis.physical(searched), point.unknown, data.measured.s)
            for searched in (low, high)
        )
        step = high[index] - low[index]
        changes.append((after.values - before.values) / step)
        squares.append((after.modes.squares[:m] - before.modes.squares[:m]) / step)
        ratios.append((after.modes.stated_ratio[:m] - before.modes.stated_ratio[:m]) / step)
    by_unknown = nuisance_jacobian(point.response, hypothesis.nuisance, hypothesis.specimen.layout)
    white = data.slopes(point.response, np.dstack([*changes, by_unknown]))
    used = np.sum(white[:, len(changes) :] ** 2, 0) > MATTERS
    return _Slope(
        jacobian=white[:, np.concatenate([np.ones(len(changes), bool), used])],
        used=used,
        squares=np.reshape(squares, (len(changes), m)).T,
        scatter=_scatter_of_squares(point.response.modes, hypothesis.nuisance),
        ratios=np.reshape(ratios, (len(changes), m)).T,
        slopes=point.slopes[used],
    )


def _step(hypothesis: Hypothesis, data: Data, point: _Point, slope: _Slope, damping: float) -> _Point:
    n_parameters = len(hypothesis.parameters)
    curvature = slope.curvature(hypothesis)
    gradient = slope.jacobian.T @ point.misfit
    gradient[n_parameters:] -= (point.pulls * point.slopes)[slope.used]
    damped = curvature + damping * np.diag(np.diag(curvature))
    step = linalg.cho_solve(linalg.cho_factor(damped, lower=True, check_finite=False), gradient, check_finite=False)
    if n_parameters:
        longest = _longest_step(hypothesis)
        step *= min(1.0, float(np.min(longest / np.maximum(np.abs(step[:n_parameters]), 1e-300))))
    searched = np.clip(point.searched + step[:n_parameters], hypothesis.low, hypothesis.high)
    unknown = point.unknown.copy()
    unknown[slope.used] += step[n_parameters:]
    unknown = _keep_modes(hypothesis, point, slope, searched, unknown)
    return _at(hypothesis, data, searched, unknown)


def _longest_step(hypothesis: Hypothesis) -> FloatArray:
    """How far each parameter may be moved at once, as searched."""
    return np.where([parameter.is_log for parameter in hypothesis.parameters], LONGEST_STEP, 0.1)


def _keep_modes(
    hypothesis: Hypothesis, point: _Point, slope: _Slope, searched: FloatArray, unknown: FloatArray
) -> FloatArray:
    """Bring frequencies and damping of the modes to where the linear step wants them.

    A sharp peak allows no long step, unless the scatter of its frequency makes up for what the step does to it beyond
    the linear: the data fix frequencies, not the parameters that they depend on.
    """
    nuisance, here = hypothesis.nuisance, point.response.modes
    m, moved, spread = nuisance.n_modes, searched - point.searched, np.diag(nuisance.kappa_std)
    values, corrected = hypothesis.physical(searched), unknown.copy()
    linear = here.squares[:m] + slope.squares @ moved + slope.scatter @ (unknown - point.unknown)
    places = nuisance.frequency_places
    for _ in range(KEPT_TWICE):
        there = hypothesis.modes(values, corrected)
        elastic = (there.omega[:m] > 0) & (spread > 0) & (linear > 0) & slope.used[places]
        scale = np.where(elastic, there.omega[:m] ** 2 * spread, 1.0)
        off = np.clip((linear - there.squares[:m]) / scale, -FARTHEST / np.maximum(spread, 1e-12), np.inf)
        corrected[places] += np.where(elastic, np.minimum(off, FARTHEST / np.maximum(spread, 1e-12)), 0.0)
    places = nuisance.damping_places
    linear_ratio = here.stated_ratio[:m] + slope.ratios @ moved
    old, new = point.unknown[places] * nuisance.damping_std, unknown[places] * nuisance.damping_std
    wanted_ratio = linear_ratio * (1 + old) + here.stated_ratio[:m] * (new - old)
    damped = slope.used[places] & (there.stated_ratio[:m] > 0)
    least = LEAST_OF_RATIO * there.stated_ratio[:m]
    stated = np.where(damped, there.stated_ratio[:m], 1.0)
    relative = np.maximum(wanted_ratio, least) / stated - 1
    corrected[places] = np.where(damped, relative / nuisance.damping_std, unknown[places])
    return corrected


def _scatter_of_squares(modes: Modes, nuisance: Nuisance) -> FloatArray:
    """Change of the squared frequencies by what cannot be known, (m, n_nuisance)."""
    m = nuisance.n_modes
    i, j = nuisance.pairs
    turned = modes.rotation[i] * modes.rotation[j] * np.where(i == j, 1.0, 2.0)[:, None]
    omega = modes.omega[:m]
    kappa = turned * (omega[i] * omega[j] * nuisance.kappa_std[i, j])[:, None]
    mu = -turned * modes.squares[:m] * nuisance.mu_std[i, j][:, None]
    cords = modes.rotation[: nuisance.n_rigid] ** 2 * nuisance.cords_std
    found = np.zeros((m, nuisance.size))
    size = len(i)
    found[:, :size], found[:, size : 2 * size] = kappa.T, mu.T
    found[:, 2 * size + m : 2 * size + m + nuisance.n_rigid] = cords.T
    return found


def same_modes(hypothesis: Hypothesis, values: FloatArray, fit: Fit) -> FloatArray:
    """Give a hypothesis the frequencies and damping ratios of a fit: the data fix them, whatever their cause.

    Parameters
    ----------
    hypothesis : Hypothesis
        Causes near those of the fit.
    values : (n_parameters,) array
        Physical values of its parameters.
    fit : Fit
        With the right modes.

    Returns
    -------
    (n_nuisance,) array
        What cannot be known, in standard deviations: zero but for frequencies, damping and gains.
    """
    nuisance = hypothesis.nuisance
    m, unknown, spread = nuisance.n_modes, np.zeros(nuisance.size), np.diag(nuisance.kappa_std)
    here, there = hypothesis.modes(values, unknown), fit.hypothesis.modes(fit.values, fit.unknown)
    elastic = (here.omega[:m] > 0) & (spread > 0)
    kappa = there.squares[:m] / np.where(elastic, here.omega[:m], 1.0) ** 2 - 1
    unknown[nuisance.frequency_places] = np.where(elastic, kappa / np.where(spread > 0, spread, 1.0), 0.0)
    damped = here.stated_ratio[:m] > 0
    change = there.ratio[:m] / np.where(damped, here.stated_ratio[:m], 1.0) - 1
    unknown[nuisance.damping_places] = np.where(damped, change / nuisance.damping_std, 0.0)
    unknown[nuisance.gain_places] = fit.unknown[nuisance.gain_places]
    return unknown


def _finish(hypothesis: Hypothesis, point: _Point, slope: _Slope, *, converged: bool) -> Fit:
    n_parameters = len(hypothesis.parameters)
    curvature = slope.curvature(hypothesis)
    lower = _factor(curvature)
    log_volume = float(np.sum(np.log(np.diag(lower))))
    values = hypothesis.physical(point.searched)
    log_prior = hypothesis.log_prior(values)
    log_prior -= float(np.sum(np.log(hypothesis.high - hypothesis.low)))
    misfit, pull = float(point.misfit @ point.misfit), float(point.pulls @ point.pulls)
    rows = linalg.solve_triangular(lower, np.eye(len(curvature)), lower=True, check_finite=False)
    inverse = linalg.cho_solve((lower, True), np.eye(len(curvature))[:, :n_parameters])
    return Fit(
        hypothesis=hypothesis,
        values=values,
        unknown=point.unknown,
        misfit=misfit,
        pull=pull,
        log_evidence=-0.5 * (misfit + pull) - log_volume + 0.5 * n_parameters * np.log(2 * np.pi) + log_prior,
        covariance=np.asarray(inverse[:n_parameters]),
        converged=converged,
        n_values=len(point.misfit),
        freedom=float(np.sum(1 - (rows[:, n_parameters:] ** 2).sum(0))),
    )


def _factor(curvature: FloatArray) -> FloatArray:
    """Lower Cholesky factor of the curvature, which rounding may have left without one."""
    try:
        return np.asarray(linalg.cholesky(curvature, lower=True, check_finite=False))
    except linalg.LinAlgError:
        size = np.sqrt(np.diag(curvature))
        values, vectors = linalg.eigh(curvature / np.outer(size, size), check_finite=False)
        mended = (vectors * np.maximum(values, ROUNDING)) @ vectors.T * np.outer(size, size)
        return np.asarray(linalg.cholesky(mended + np.diag(ROUNDING * size**2), lower=True, check_finite=False))
