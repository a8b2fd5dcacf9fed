"""Weights of the impacts at one point in their mean: the inverse of their noise, as far as records and scatter show it.

Impact k has the noise power p_k, and H of the least variance is the mean of the weights 1 / p_k (maximum likelihood).
Each record shows its own noise m_k where the structure has come to rest. Scatter v may hold more than that, such as
impacts beside their point, of which a record shows nothing and which all impacts share. So

    p_k = v (1 - theta + theta m_k / m),

m being the mean over the impacts, and theta no more than the share m / v of the scatter that the records show.
Theta has the largest restricted likelihood [Patterson1971] of what the impacts leave of their mean H, over the lines of
a band. Levels m_k that differ by no more than chance are one: their logarithms are drawn to their mean by t / (t + c),
where c is the variance that chance gives them, and t what they vary by beyond it [Morris1983].

[Patterson1971]: H. D. Patterson, R. Thompson, Biometrika 58 (1971) 545-554 (doi:10.1093/biomet/58.3.545).
[Morris1983]: C. N. Morris, Parametric empirical Bayes inference, Journal of the American Statistical Association 78
(1983) 47-55 (doi:10.1080/01621459.1983.10477920).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.signals.decay import NEIGHBOURS
from frf_ipz.ingest.signals.scatter import overlapping_bands

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, FloatArray

BAND = 64  # lines of which one theta is estimated, as of the scatter's fit
CHANCE = 1.5 / np.log(2.0) ** 2  # times the number of lines under a Hann window: variance of a logarithm of a median
LOG_ODDS = np.log(1e3)  # of the likelihood, against what records show
CLEAR = 3.0  # deviations by which the share that records show may be off
UNSHOWN = np.append(0.0, np.geomspace(1e-4, 1.0, 21))  # 1 - theta that are tried: 2 dB apart


def noise_weights(force: ComplexArray, response: ComplexArray, relative: FloatArray, n_shown: float) -> FloatArray:
    """Give the weights of the impacts at one point for one response.

    Parameters
    ----------
    force, response : (n_impacts, n_lines) complex array
        Of at least two impacts, over the root of the scatter v.
    relative : (n_impacts, n_lines) array
        Noise power that each record shows, over the scatter.
    n_shown : float
        Lines of the spectrum that shows the noise, for each line here.

    Returns
    -------
    (n_impacts, n_lines) array
        Their mean over the impacts is 1.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> noise = rng.standard_normal((3, 200, 2)).view(complex)[..., 0] * np.array([[0.1], [0.1], [2.4]])
    >>> relative = np.array([0.01, 0.01, 5.76])[:, None] * np.full(200, 0.52)
    >>> weights = noise_weights(np.ones((3, 200), complex), 1.0 + noise, relative, 1.0)
    >>> weights.mean(axis=1).round(2)
    array([1.5 , 1.5 , 0.01])
    """
    n_lines = force.shape[1]
    bands, shares = overlapping_bands(n_lines, BAND)
    counts = shares.sum(axis=1) ** 2 / np.sum(shares**2, axis=1)
    levels = np.sum(relative[:, bands] * shares, axis=2) / shares.sum(axis=1)
    is_shown = (levels > 0.0).all(axis=0)
    chance = CHANCE / np.maximum(n_shown * counts, NEIGHBOURS)
    levels = np.where(is_shown, _without_chance(np.where(is_shown, levels, 1.0), chance), 1.0)
    mean = np.sum(_expected_shares(np.abs(force) ** 2)[:, bands] * shares, axis=2) / shares.sum(axis=1)
    mean = np.sum(mean * levels, axis=0)
    most = np.where(is_shown, np.minimum(mean * (1.0 + CLEAR * np.sqrt(chance)), 1.0), 0.0)
    forces, responses = force[:, bands], response[:, bands]
    likelihoods, scales = [], []
    for unshown in UNSHOWN:
        theta = np.minimum(1.0 - unshown, most)
        scales.append(1.0 - theta + theta * levels / mean)
        likelihoods.append(_restricted_likelihood(forces, responses, scales[-1][..., None], shares))
    is_likely = np.array(likelihoods) >= np.max(likelihoods, axis=0) - LOG_ODDS
    first = np.argmax(is_likely, axis=0)
    chosen = np.take_along_axis(np.array(scales), first[None, None], axis=0)[0]
    logs = [np.bincount(bands.ravel(), (shares * row[:, None]).ravel(), n_lines) for row in np.log(chosen)]
    weights = np.exp(-np.array(logs))
    return np.asarray(weights / weights.mean(axis=0))


def _expected_shares(power: FloatArray) -> FloatArray:
    """How much of each impact's noise the scatter holds: 1 - h over n - 1, with its share h of the force's power."""
    total = power.sum(axis=0)
    shares = np.divide(power, total, out=np.full_like(power, 1.0 / len(power)), where=total > 0.0)
    return np.asarray((1.0 - shares) / (len(power) - 1))


def _without_chance(levels: FloatArray, chance: FloatArray) -> FloatArray:
    """Draw levels, (n_impacts, n_bands), to their mean; `chance` is the variance of their logarithms by chance."""
    logs = np.log(levels)
    mean = logs.mean(axis=0)
    beyond = np.maximum(logs.var(axis=0, ddof=1) - chance, 0.0)
    return np.asarray(np.exp(mean + beyond / (beyond + chance) * (logs - mean)))


def _restricted_likelihood(
    force: ComplexArray, response: ComplexArray, scales: FloatArray, shares: FloatArray
) -> FloatArray:
    """Give the logarithm, (n_bands,), of (n_impacts, n_bands, n) spectra of unit noise times the root of scales."""
    power = np.sum(np.abs(force) ** 2 / scales, axis=0)
    cross = np.sum(force.conj() * response / scales, axis=0)
    explained = np.divide(np.abs(cross) ** 2, power, out=np.zeros_like(power), where=power > 0.0)
    left = np.sum(np.abs(response) ** 2 / scales, axis=0) - explained
    spread = np.log(np.maximum(power, np.finfo(float).tiny)) + np.sum(np.log(scales), axis=0)
    return np.asarray(-np.sum(shares * (left + spread), axis=1))
