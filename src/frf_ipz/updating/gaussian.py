"""The linear Gaussian step of an update: the smallest change that meets the targets as far as they deserve.

With the whitened parameters xi (prior: unit normal), data ``d = G xi + noise`` and the noise covariance R, the mean is
``G^T (G G^T + R)^-1 d``: the change of least norm for weights that follow from R. How large changes have to be expected
is not known beforehand; the standard deviations of the prior terms are those of the largest evidence ([MacKay1992],
doi:10.1162/neco.1992.4.3.415), each with a log-normal prior of its own.

How closely targets are met follows from the discrepancy principle: the weighted misfit must not exceed their number.
Where the change that is likely does not bring it down so far, the targets contradict one another (or what a reduced
model can express), and the slack, a variance on top of their covariance, grows until it does.
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

GROWTH = 1.5  # of the slack from try to try
MAX_TRIES = 40  # up to ten million times the slack
MAX_SCALE_STEPS = 25  # the evidence is flat near its top: more steps change nothing that matters
FARTHEST = 6.0  # standard deviations of doubt that the search may try: a line search may leap out of all numbers


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GaussianStep:
    """Mean and what is needed to draw from the posterior.

    Parameters
    ----------
    mean : (k,) array
        Whitened parameters.
    gain : (k, n) array
        ``G^T (G G^T + R)^-1``.
    misfit : float
        ``(d - G mean)^T R^-1 (d - G mean)``, to be compared with the number of data.
    freedom : float
        Data that the prior leaves free to be met: the trace of ``G gain``.
    """

    mean: FloatArray
    gain: FloatArray
    misfit: float
    freedom: float


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
    left = data - sensitivity @ mean
    return GaussianStep(
        mean=mean,
        gain=gain,
        misfit=float(left @ cho_solve(cho_factor(noise), left)),
        freedom=float(np.einsum("nk,kn->", sensitivity, gain)),
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
        The most likely factor: the smallest that is tried.

    Returns
    -------
    float
        The factor by the discrepancy principle, to within its growth from try to try.
    """
    for _ in range(MAX_TRIES):
        if solve_step(sensitivity, data, noise + np.diag((factor * slack) ** 2)).misfit <= len(data):
            break
        factor *= GROWTH
    return factor


def most_contradicted(
    sensitivity: FloatArray, data: FloatArray, noise: FloatArray, limit: float, *, least: float = 0.0
) -> int:
    """Find the datum that all others and the prior contradict most.

    Parameters
    ----------
    sensitivity : (n, k) array
        G.
    data : (n,) array
        d.
    noise : (n, n) array
        R.
    limit : float
        Standard deviations from what the others predict beyond which a datum is contradicted.
    least : float
        Data of a smaller modulus are not looked at.

    Returns
    -------
    int
        Its place; -1 where none is beyond the limit.
    """
    inverse = np.linalg.inv(sensitivity @ sensitivity.T + noise)
    distance = np.where(np.abs(data) >= least, np.abs(inverse @ data) / np.sqrt(np.diagonal(inverse)), 0.0)
    worst = int(np.argmax(distance))
    return worst if distance[worst] > limit else -1


def draw_posterior(
    step: GaussianStep, sensitivity: FloatArray, noise: FloatArray, rng: np.random.Generator, count: int
) -> FloatArray:
    """Draw whitened parameters from the posterior: a draw of the prior, corrected by what its data would have shown.

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
        How many.

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
        The terms, with what is believed of their standard deviations beforehand.
    data : (n,) array
        d.
    noise : (n, n) array
        R.
    start : (t,) array
        Standard deviations to start from.

    Returns
    -------
    (t,) array
        Standard deviations; those without doubt as they were.
    """
    free = np.array([term.scale_uncertainty > 0 for term in terms])
    if not free.any() or not len(data):
        return start
    covariances = np.array([part @ part.T for part in parts])
    believed = np.log([term.std for term in terms])
    doubt = np.array([term.scale_uncertainty for term in terms])

    def cost(logs: FloatArray) -> tuple[float, FloatArray]:
        everything = np.log(start)
        everything[free] = logs
        weights = np.exp(2 * everything)
        factor, _ = cho_factor(np.tensordot(weights, covariances, 1) + noise, lower=True)
        solved = cho_solve((factor, True), data)
        inverse = cho_solve((factor, True), np.eye(len(data)))
        pull = (logs - believed[free]) / doubt[free]
        value = 0.5 * data @ solved + np.log(np.diagonal(factor)).sum() + 0.5 * pull @ pull
        traces = np.einsum("tnm,nm->t", covariances, inverse - np.outer(solved, solved))
        return float(value), (weights * traces)[free] + pull / doubt[free]

    farthest = FARTHEST * doubt[free]
    low, high = believed[free] - farthest, believed[free] + farthest
    found = minimize(
        cost,
        np.clip(np.log(start)[free], low, high),
        jac=True,
        method="L-BFGS-B",
        bounds=Bounds(low, high),
        options={"maxiter": MAX_SCALE_STEPS},
    )
    scales = start.copy()
    scales[free] = np.exp(found.x)
    return scales
