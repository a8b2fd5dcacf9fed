"""The linear Gaussian step of an update: the smallest change that meets the targets to within their noise.

With the whitened parameters xi (prior: unit normal), data ``d = G xi + noise`` and the noise covariance R, the mean is
``G^T (G G^T + R)^-1 d``: the change of least norm for weights that follow from R. The size of the changes is not known
beforehand; the standard deviations of the prior terms are those of the largest evidence ([MacKay1992],
doi:10.1162/neco.1992.4.3.415), each with a log-normal prior.

How closely targets are met follows from the discrepancy principle: the weighted misfit must not exceed their number.
Where the most likely change leaves a larger misfit, the targets contradict one another (or a reduced model cannot
express them), and the slack, a variance on top of their covariance, grows until it does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import Bounds, minimize

from frf_ipz.arrays import FloatArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.updating.parameters import PriorTerm

GROWTH = 1.5  # of the slack from trial to trial
MAX_TRIALS = 40  # up to ten million times the slack
MAX_SCALE_STEPS = 25  # the evidence is flat near its top: more steps change nothing that matters
MAX_DEVIATION = 6.0  # standard deviations of a scale's prior within which the search stays: a line search may overflow


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GaussianStep:
    """Posterior mean of a linear step, and the gain that draws from the posterior need.

    Parameters
    ----------
    mean : (k,) array
        Whitened parameters.
    gain : (k, n) array
        ``G^T (G G^T + R)^-1``.
    misfit : float
        ``(d - G mean)^T R^-1 (d - G mean)``, to be compared with the number of data.
    n_determined : float
        Effective number of data that determine parameters against the prior: the trace of ``G gain``.
    """

    mean: FloatArray
    gain: FloatArray
    misfit: float
    n_determined: float


def solve_step(sensitivity: FloatArray, data: FloatArray, noise: FloatArray) -> GaussianStep:
    """Mean of the whitened parameters, given linear data.

    Parameters
    ----------
    sensitivity : (n, k) array
        G, by whitened parameters.
    data : (n,) array
        d.
    noise : (n, n) array
        R, positive definite.

    Returns
    -------
    GaussianStep
        The posterior.
    """
    total = sensitivity @ sensitivity.T + noise
    gain = cho_solve(cho_factor(total), sensitivity).T
    mean = gain @ data
    error = data - sensitivity @ mean
    return GaussianStep(
        mean=mean,
        gain=gain,
        misfit=float(error @ cho_solve(cho_factor(noise), error)),
        n_determined=float(np.einsum("nk,kn->", sensitivity, gain)),
    )


def slack_by_discrepancy(
    sensitivity: FloatArray, data: FloatArray, noise: FloatArray, slack: FloatArray, factor: float
) -> float:
    """Find the smallest factor on the slack with which the misfit is no more than the number of data.

    Parameters
    ----------
    sensitivity : (n, k) array
        G.
    data : (n,) array
        d.
    noise : (n, n) array
        Covariance of the targets.
    slack : (n,) array
        Standard deviations of what no parameter explains, for a factor of 1.
    factor : float
        The most likely factor, where the search starts.

    Returns
    -------
    float
        The factor by the discrepancy principle, to within its growth from trial to trial.
    """
    for _ in range(MAX_TRIALS):
        if solve_step(sensitivity, data, noise + np.diag((factor * slack) ** 2)).misfit <= len(data):
            break
        factor *= GROWTH
    return factor


def most_contradicted(
    sensitivity: FloatArray, data: FloatArray, noise: FloatArray, limit: float, *, least: float = 0.0
) -> int:
    """Find the datum that all other data and the prior contradict most.

    Parameters
    ----------
    sensitivity : (n, k) array
        G.
    data : (n,) array
        d.
    noise : (n, n) array
        R.
    limit : float
        Standard deviations from the prediction by the other data beyond which a datum is contradicted.
    least : float
        Data of a smaller modulus are ignored.

    Returns
    -------
    int
        Its index; -1 where none is beyond the limit.
    """
    inverse = np.linalg.inv(sensitivity @ sensitivity.T + noise)
    distance = np.where(np.abs(data) >= least, np.abs(inverse @ data) / np.sqrt(np.diagonal(inverse)), 0.0)
    worst = int(np.argmax(distance))
    return worst if distance[worst] > limit else -1


def draw_posterior(
    step: GaussianStep, sensitivity: FloatArray, noise: FloatArray, rng: np.random.Generator, count: int
) -> FloatArray:
    """Draw whitened parameters from the posterior: a draw of the prior, corrected by its data.

    Parameters
    ----------
    step : GaussianStep
        The posterior.
    sensitivity : (n, k) array
        G.
    noise : (n, n) array
        R.
    rng : Generator
        Source of randomness.
    count : int
        Number of draws.

    Returns
    -------
    (count, k) array
        Draws.
    """
    prior = rng.standard_normal((count, sensitivity.shape[1]))
    errors = rng.standard_normal((count, len(noise))) @ np.linalg.cholesky(noise).T
    return np.asarray(step.mean + prior - (prior @ sensitivity.T + errors) @ step.gain.T)


def most_likely_scales(
    parts: Sequence[FloatArray], terms: Sequence[PriorTerm], data: FloatArray, noise: FloatArray, start: FloatArray
) -> FloatArray:
    """Find the standard deviations of the prior terms under which the data are most likely.

    Parameters
    ----------
    parts : sequence of (n, k_i) arrays
        Sensitivity of the data to each term's unit normal numbers, for a standard deviation of 1.
    terms : sequence of PriorTerm
        The terms, with the priors of their standard deviations.
    data : (n,) array
        d.
    noise : (n, n) array
        R.
    start : (t,) array
        Standard deviations to start from.

    Returns
    -------
    (t,) array
        Standard deviations; fixed ones as they were.
    """
    free = np.array([term.scale_uncertainty > 0 for term in terms])
    if not free.any() or not len(data):
        return start
    covariances = np.array([part @ part.T for part in parts])
    prior_mean = np.log([term.std for term in terms])
    prior_std = np.array([term.scale_uncertainty for term in terms])

    def cost(logs: FloatArray) -> tuple[float, FloatArray]:
        log_scales = np.log(start)
        log_scales[free] = logs
        weights = np.exp(2 * log_scales)
        factor, _ = cho_factor(np.tensordot(weights, covariances, 1) + noise, lower=True)
        solved = cho_solve((factor, True), data)
        inverse = cho_solve((factor, True), np.eye(len(data)))
        deviation = (logs - prior_mean[free]) / prior_std[free]
        value = 0.5 * data @ solved + np.log(np.diagonal(factor)).sum() + 0.5 * deviation @ deviation
        traces = np.einsum("tnm,nm->t", covariances, inverse - np.outer(solved, solved))
        return float(value), (weights * traces)[free] + deviation / prior_std[free]

    limit = MAX_DEVIATION * prior_std[free]
    low, high = prior_mean[free] - limit, prior_mean[free] + limit
    optimum = minimize(
        cost,
        np.clip(np.log(start)[free], low, high),
        jac=True,
        method="L-BFGS-B",
        bounds=Bounds(low, high),
        options={"maxiter": MAX_SCALE_STEPS},
    )
    scales = start.copy()
    scales[free] = np.exp(optimum.x)
    return scales
