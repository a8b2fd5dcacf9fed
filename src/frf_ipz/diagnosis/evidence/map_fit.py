"""Fits a hypothesis to measured transfer functions at the maximum of its posterior, and approximates its evidence.

Levenberg-Marquardt on the parameters of the components and on the nuisance parameters, which have a prior. The
evidence is Laplace's: the likelihood at the maximum, times the volume of the posterior over that of the prior.

[MacKay2003] D. J. C. MacKay, Information theory, inference, and learning algorithms, Cambridge University Press, 2003,
chapters 27 and 28.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.arrays import BoolArray, FloatArray
from frf_ipz.diagnosis.evidence.fit import Data, Fit
from frf_ipz.diagnosis.evidence.interpolated_slopes import differentiate_by_nuisance
from frf_ipz.numerics.levenberg_marquardt import (
    AcceptedStep,
    LeastSquaresStatus,
    LevenbergMarquardt,
    NormalEquations,
    minimise,
)

if TYPE_CHECKING:
    from frf_ipz.diagnosis.evidence.hypothesis import Hypothesis
    from frf_ipz.diagnosis.model.modes import Modes
    from frf_ipz.diagnosis.model.nuisance import NuisancePrior
    from frf_ipz.diagnosis.model.response import Response

STEP = 1e-6  # of the logarithm of a parameter, to both sides: peaks are so narrow that one side is not exact enough
SETTINGS = LevenbergMarquardt(
    steps=8, initial_damping=1e-5, min_damping=1e-9, max_damping=1e6, damping_decrease=0.2, damping_increase=6.0
)
LONGEST_STEP = 0.7  # of the logarithm of a parameter, or a tenth of a linear range
PRIOR_CURVATURE = 12.0  # over the squared range: that of a uniform prior, where the data say nothing
MODE_CORRECTIONS = 2  # corrections of the frequencies after a step
MAX_CORRECTION = 0.1  # of a squared frequency: more is no small correction
MIN_RATIO_PART = 0.05  # of a stated damping ratio: scatter takes no more away
MIN_INFLUENCE = 0.02  # squared norm of a whitened derivative per standard deviation: less changes nothing

LARGE_STEP = 0.3  # of the longest step: parameters that move so much are still on their way
ROUNDING = 1e-9  # of a diagonal entry: what a sum of squares of many lines is exact to


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Point:
    """Where the iteration is."""

    searched: FloatArray
    nuisance: FloatArray
    misfit: FloatArray
    response: Response
    whitened_nuisance: FloatArray
    slopes: FloatArray

    @property
    def objective(self) -> float:
        return float(self.misfit @ self.misfit + self.whitened_nuisance @ self.whitened_nuisance)


def fit_map(
    hypothesis: Hypothesis,
    data: Data,
    values: FloatArray,
    *,
    nuisance: FloatArray | None = None,
    iterations: int = 8,
    tolerance: float = 0.02,
    cost_limit: float = np.inf,
) -> Fit:
    """Find the maximum a posteriori (MAP) of a hypothesis.

    Parameters
    ----------
    hypothesis : Hypothesis
        Components at their locations.
    data : Data
        What to fit to.
    values : (n_parameters,) array
        Physical values to start from.
    nuisance : (n_nuisance,) array, optional
        Nuisance parameters to start from; zero where they are left out.
    iterations : int
        At most so many.
    tolerance : float
        Stop when a step changes the objective by less, in squared standard deviations.
    cost_limit : float
        Cost, half the objective, below which a fit is of use: one that is unlikely to get there is stopped early.

    Returns
    -------
    Fit
        At the maximum, or where it was stopped.

    Raises
    ------
    DeadlineError
        If the hypothesis' time is over.
    """
    problem = _MapProblem(hypothesis=hypothesis, data=data)
    start = problem.evaluate(
        hypothesis.clip_to_searched(values),
        np.zeros(hypothesis.nuisance_prior.size) if nuisance is None else nuisance,
    )

    def is_of_no_use(step: AcceptedStep[_Point]) -> bool:
        moved = np.abs(step.after.searched - step.before.searched)
        is_far = bool(np.any(moved > LARGE_STEP * _longest_step(hypothesis)))
        return not is_far and not step.can_reach(2 * cost_limit, step.after.objective)

    settings = replace(SETTINGS, steps=iterations, absolute_decrease=tolerance, negligible_increase=tolerance)
    optimum = minimise(problem, start, settings, stop=is_of_no_use)
    has_converged = optimum.status in {LeastSquaresStatus.CONVERGED, LeastSquaresStatus.STALLED}
    return _finish(hypothesis, optimum.point, optimum.linearise(), has_converged=has_converged)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Linearisation(NormalEquations):
    """How everything changes around a point: first by the parameters, then by the nuisance parameters that matter."""

    used: BoolArray
    squares: FloatArray  # (m, n_parameters), of the modes' squared frequencies
    scatter: FloatArray  # (m, n_nuisance), of the same
    ratios: FloatArray  # (m, n_parameters), of their damping ratios without scatter


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _MapProblem:
    """What is minimised: misfit and whitened nuisance parameters."""

    hypothesis: Hypothesis
    data: Data

    def evaluate(self, searched: FloatArray, nuisance: FloatArray) -> _Point:
        """Compute response and misfit for some parameters."""
        response = self.hypothesis.respond(self.hypothesis.to_physical(searched), nuisance, self.data.measured.s)
        whitened_nuisance, slopes = self.hypothesis.nuisance_prior.whiten(nuisance, is_bounded=self.data.is_bounded)
        return _Point(
            searched=searched,
            nuisance=nuisance,
            misfit=self.data.misfit(response),
            response=response,
            whitened_nuisance=whitened_nuisance,
            slopes=slopes,
        )

    def cost(self, point: _Point) -> float:
        """Give the objective."""
        return point.objective

    def linearise(self, point: _Point) -> _Linearisation:
        """Derive by all parameters; where data say nothing of one, its prior is uniform."""
        self.hypothesis.deadline.check()  # the longest part of a step
        hypothesis, data = self.hypothesis, self.data
        m, n_parameters = hypothesis.nuisance_prior.n_modes, len(hypothesis.parameters)
        changes, squares, ratios = [], [], []
        for index in range(n_parameters):
            low, high = point.searched.copy(), point.searched.copy()
            low[index] = max(low[index] - STEP, hypothesis.low[index])
            high[index] = min(high[index] + STEP, hypothesis.high[index])
            before, after = (
                hypothesis.respond(hypothesis.to_physical(searched), point.nuisance, data.measured.s)
                for searched in (low, high)
            )
            step = high[index] - low[index]
            changes.append((after.values - before.values) / step)
            squares.append((after.modes.squares[:m] - before.modes.squares[:m]) / step)
            ratios.append((after.modes.stated_ratio[:m] - before.modes.stated_ratio[:m]) / step)
        slopes = differentiate_by_nuisance(data, point.response, hypothesis.nuisance_prior, hypothesis.context.layout)
        products = slopes.products()
        used = np.diag(products) > MIN_INFLUENCE
        n_data = len(point.misfit)
        by_parameters = data.slopes(point.response, np.dstack(changes)) if changes else np.zeros((n_data, 0))
        across = slopes.products_with(np.column_stack([by_parameters, point.misfit]))[used]
        prior = np.concatenate([PRIOR_CURVATURE / (hypothesis.high - hypothesis.low) ** 2, point.slopes[used] ** 2])
        right = np.concatenate([by_parameters.T @ point.misfit, across[:, -1]])
        right[n_parameters:] -= (point.whitened_nuisance * point.slopes)[used]
        between = across[:, :-1]
        matrix = np.block([[by_parameters.T @ by_parameters, between.T], [between, products[np.ix_(used, used)]]])
        return _Linearisation(
            matrix=matrix + np.diag(prior),
            right=right,
            used=used,
            squares=np.reshape(squares, (n_parameters, m)).T,
            scatter=_scatter_of_squares(point.response.modes, hypothesis.nuisance_prior),
            ratios=np.reshape(ratios, (n_parameters, m)).T,
        )

    def move(self, point: _Point, slope: _Linearisation, step: FloatArray) -> _Point:
        """Take a step that is not too long, within bounds, with modes where the linear step puts them."""
        hypothesis, n_parameters = self.hypothesis, len(self.hypothesis.parameters)
        if n_parameters:
            longest = _longest_step(hypothesis)
            step = step * min(1.0, float(np.min(longest / np.maximum(np.abs(step[:n_parameters]), 1e-300))))
        searched = np.clip(point.searched + step[:n_parameters], hypothesis.low, hypothesis.high)
        nuisance = point.nuisance.copy()
        nuisance[slope.used] += step[n_parameters:]
        return self.evaluate(searched, _correct_modes(hypothesis, point, slope, searched, nuisance))


def _longest_step(hypothesis: Hypothesis) -> FloatArray:
    """How far each parameter may be moved at once, as searched."""
    return np.where([parameter.is_log for parameter in hypothesis.parameters], LONGEST_STEP, 0.1)


def _correct_modes(
    hypothesis: Hypothesis, point: _Point, slope: _Linearisation, searched: FloatArray, nuisance: FloatArray
) -> FloatArray:
    """Bring frequencies and damping of the modes to where the linear step puts them.

    A sharp peak allows no long step, unless the scatter of its frequency makes up for what the step does to it beyond
    the linear: the data fix frequencies, not the parameters that they depend on.
    """
    nuisance_prior, here = hypothesis.nuisance_prior, point.response.modes
    m, moved, spread = nuisance_prior.n_modes, searched - point.searched, np.diag(nuisance_prior.kappa_std)
    values, corrected = hypothesis.to_physical(searched), nuisance.copy()
    linear = here.squares[:m] + slope.squares @ moved + slope.scatter @ (nuisance - point.nuisance)
    indices = nuisance_prior.frequency_indices
    for _ in range(MODE_CORRECTIONS):
        there = hypothesis.modes(values, corrected)
        elastic = (there.omega[:m] > 0) & (spread > 0) & (linear > 0) & slope.used[indices]
        scale = np.where(elastic, there.omega[:m] ** 2 * spread, 1.0)
        off = np.clip((linear - there.squares[:m]) / scale, -MAX_CORRECTION / np.maximum(spread, 1e-12), np.inf)
        corrected[indices] += np.where(elastic, np.minimum(off, MAX_CORRECTION / np.maximum(spread, 1e-12)), 0.0)
    indices = nuisance_prior.damping_indices
    linear_ratio = here.stated_ratio[:m] + slope.ratios @ moved
    old, new = point.nuisance[indices] * nuisance_prior.damping_std, nuisance[indices] * nuisance_prior.damping_std
    required_ratio = linear_ratio * (1 + old) + here.stated_ratio[:m] * (new - old)
    damped = slope.used[indices] & (there.stated_ratio[:m] > 0)
    least = MIN_RATIO_PART * there.stated_ratio[:m]
    stated = np.where(damped, there.stated_ratio[:m], 1.0)
    relative = np.maximum(required_ratio, least) / stated - 1
    corrected[indices] = np.where(damped, relative / nuisance_prior.damping_std, nuisance[indices])
    return corrected


def _scatter_of_squares(modes: Modes, nuisance_prior: NuisancePrior) -> FloatArray:
    """Change of the squared frequencies by nuisance parameters, (m, n_nuisance)."""
    m = nuisance_prior.n_modes
    i, j = nuisance_prior.pairs
    turned = modes.rotation[i] * modes.rotation[j] * np.where(i == j, 1.0, 2.0)[:, None]
    omega = modes.omega[:m]
    kappa = turned * (omega[i] * omega[j] * nuisance_prior.kappa_std[i, j])[:, None]
    mu = -turned * modes.squares[:m] * nuisance_prior.mu_std[i, j][:, None]
    suspension = modes.rotation[: nuisance_prior.n_rigid] ** 2 * nuisance_prior.suspension_std
    derivatives, blocks = np.zeros((m, nuisance_prior.size)), nuisance_prior.blocks
    derivatives[:, blocks.stiffness], derivatives[:, blocks.mass] = kappa.T, mu.T
    derivatives[:, blocks.suspension] = suspension.T
    return derivatives


def adopt_modes(hypothesis: Hypothesis, values: FloatArray, fit: Fit) -> FloatArray:
    """Give a hypothesis the frequencies and damping ratios of a fit: the data fix them, whatever explains them.

    Parameters
    ----------
    hypothesis : Hypothesis
        Components near those of the fit.
    values : (n_parameters,) array
        Physical values of its parameters.
    fit : Fit
        With the right modes.

    Returns
    -------
    (n_nuisance,) array
        Nuisance parameters, in standard deviations: zero but for frequencies, damping and gains.
    """
    nuisance_prior = hypothesis.nuisance_prior
    m, nuisance, spread = nuisance_prior.n_modes, np.zeros(nuisance_prior.size), np.diag(nuisance_prior.kappa_std)
    here, there = hypothesis.modes(values, nuisance), fit.hypothesis.modes(fit.values, fit.nuisance)
    elastic = (here.omega[:m] > 0) & (spread > 0)
    kappa = there.squares[:m] / np.where(elastic, here.omega[:m], 1.0) ** 2 - 1
    nuisance[nuisance_prior.frequency_indices] = np.where(elastic, kappa / np.where(spread > 0, spread, 1.0), 0.0)
    damped = here.stated_ratio[:m] > 0
    change = there.ratio[:m] / np.where(damped, here.stated_ratio[:m], 1.0) - 1
    nuisance[nuisance_prior.damping_indices] = np.where(damped, change / nuisance_prior.damping_std, 0.0)
    nuisance[nuisance_prior.gain_indices] = fit.nuisance[nuisance_prior.gain_indices]
    return nuisance


def _finish(hypothesis: Hypothesis, point: _Point, slope: _Linearisation, *, has_converged: bool) -> Fit:
    n_parameters = len(hypothesis.parameters)
    curvature = slope.matrix
    lower = _cholesky(curvature)
    log_volume = float(np.sum(np.log(np.diag(lower))))
    values = hypothesis.to_physical(point.searched)
    log_prior = hypothesis.log_prior(values)
    log_prior -= float(np.sum(np.log(hypothesis.high - hypothesis.low)))
    misfit, nuisance_chi2 = float(point.misfit @ point.misfit), float(point.whitened_nuisance @ point.whitened_nuisance)
    rows = linalg.solve_triangular(lower, np.eye(len(curvature)), lower=True, check_finite=False)
    inverse = linalg.cho_solve((lower, True), np.eye(len(curvature))[:, :n_parameters])
    return Fit(
        hypothesis=hypothesis,
        values=values,
        nuisance=point.nuisance,
        misfit=misfit,
        nuisance_chi2=nuisance_chi2,
        log_evidence=-0.5 * (misfit + nuisance_chi2) - log_volume + 0.5 * n_parameters * np.log(2 * np.pi) + log_prior,
        covariance=np.asarray(inverse[:n_parameters]),
        has_converged=has_converged,
        n_values=len(point.misfit),
        n_determined=float(np.sum(1 - (rows[:, n_parameters:] ** 2).sum(0))),
    )


def _cholesky(curvature: FloatArray) -> FloatArray:
    """Lower Cholesky factor of the curvature, which rounding may have left without one."""
    try:
        return np.asarray(linalg.cholesky(curvature, lower=True, check_finite=False))
    except linalg.LinAlgError:
        size = np.sqrt(np.diag(curvature))
        values, vectors = linalg.eigh(curvature / np.outer(size, size), check_finite=False)
        mended = (vectors * np.maximum(values, ROUNDING)) @ vectors.T * np.outer(size, size)
        return np.asarray(linalg.cholesky(mended + np.diag(ROUNDING * size**2), lower=True, check_finite=False))
