"""The noise of an FRF's records as a smooth function of the frequency, fitted to their scatter.

The response's noise has the power a(f), the force's noise b(f), and what H1 leaves unexplained of one record is

    v = a + b |H|^2.

With few records the raw scatter is far too noisy to be a weight, and smoothing it would smear peaks into their
surroundings. Here a and b are smooth instead: they are fitted to the raw scatter in overlapping bands, by maximum
likelihood for the gamma distribution that the unexplained power of n records has (n - 1 degrees of freedom), and
|H|^2 carries the peaks and notches exactly. Lines that stick out of the fit, such as hum, keep their raw scatter.

[Pintelon2012]: R. Pintelon, J. Schoukens, System Identification, 2nd ed., Wiley 2012 (doi:10.1002/9781118287422),
chapter 2, for the distribution.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from scipy import special
else:
    special = import_late("scipy.special")

MAX_ITERATIONS = 30
TOLERANCE = 1e-4  # relative change of a and b
FEWEST_LINES = 64  # in a band
DEGREES = 192  # of freedom that a band has at least, where there are lines enough
OUTLIERS = 1e-3  # lines of an FRF that may stick out by chance
ROUNDING = 1e-24  # of the responses' power: below this, scatter is rounding


def fit_noise_power(
    scatter: FloatArray, gain: FloatArray, degrees: float, known_force: FloatArray | None = None
) -> FloatArray:
    """Fit a + b |H|^2, with a and b smooth, to the scatter of one FRF.

    Parameters
    ----------
    scatter : (n_lines,) array
        Unexplained power of one record, estimated line by line; gamma distributed about its expectation.
    gain : (n_lines,) array
        |H|^2.
    degrees : float
        Degrees of freedom of each line: complex, so records less one.
    known_force : (n_lines,) array, optional
        What is known of b: it is no less. Noise of a force that is kept for a short time is alike on all lines of a
        band, which then tell its power hardly better than one line does.

    Returns
    -------
    (n_lines,) array
        The expectation.
    """
    if not scatter.any():
        return np.zeros_like(scatter)
    bands, weights = overlapping_bands(len(scatter), max(FEWEST_LINES, round(DEGREES / degrees)))
    limit = special.gammainccinv(degrees, OUTLIERS / len(scatter)) / degrees
    used = np.ones_like(scatter)
    power = np.empty_like(scatter)
    for _ in range(2):
        kept = weights * used[bands]
        response, force = _fit_bands(scatter[bands], gain[bands], kept)
        if known_force is not None:
            least = np.sum(kept * known_force[bands], axis=1) / np.maximum(kept.sum(axis=1), np.finfo(float).tiny)
            response, force = _with_least_force(scatter[bands], gain[bands], kept, (response, force), least)
        band_power = response[:, None] + force[:, None] * gain[bands]
        power = np.asarray(np.bincount(bands.ravel(), (weights * band_power).ravel(), len(scatter)), np.float64)
        used = (scatter <= limit * power).astype(float)
        if used.all():
            break
    return np.where(used > 0, power, scatter)


def overlapping_bands(n_lines: int, width: int) -> tuple[IntArray, FloatArray]:
    """Lay overlapping bands over the lines.

    Parameters
    ----------
    n_lines : int
        Lines.
    width : int
        Lines of a band.

    Returns
    -------
    lines, weights : (n_bands, width) arrays
        Which lines are in each, and how much they count; the weights add up to 1 at every line.
    """
    if n_lines <= width:
        return np.arange(n_lines)[None], np.ones((1, n_lines))
    hop = width // 2
    starts = np.append(np.arange(0, n_lines - width, hop), n_lines - width)
    bands = starts[:, None] + np.arange(width)
    bell = np.sin(np.pi * (np.arange(width) + 0.5) / width) ** 2
    weights = np.tile(bell, (len(starts), 1))
    weights[0, :hop] = weights[-1, width - hop :] = 1.0
    total = np.bincount(bands.ravel(), weights.ravel(), n_lines)
    return bands, weights / total[bands]


def _fit_bands(scatter: FloatArray, gain: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fit a and b in every band by Fisher scoring, which for the gamma distribution is reweighted least squares."""
    total = np.maximum(weights.sum(axis=1), np.finfo(float).tiny)
    mean_gain = np.maximum((weights * gain).sum(axis=1) / total, np.finfo(float).tiny)
    relative = gain / mean_gain[:, None]
    level = (weights * scatter).sum(axis=1) / total
    response, force = 0.5 * level, 0.5 * level
    tiny = np.finfo(float).tiny + 1e-12 * level
    for _ in range(MAX_ITERATIONS):
        expected = response[:, None] + force[:, None] * relative + tiny[:, None]
        new_response, new_force = _fit_positive(weights / expected**2, relative, scatter)
        change = np.abs(new_response - response) + np.abs(new_force - force)
        response, force = new_response, new_force
        if np.all(change <= TOLERANCE * (response + force + tiny)):
            break
    return response, force / mean_gain


def _with_least_force(
    scatter: FloatArray,
    gain: FloatArray,
    weights: FloatArray,
    fitted: tuple[FloatArray, FloatArray],
    least: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Raise b of the bands to what it is at least, and take a from what that leaves of the scatter."""
    response, force = fitted
    raised = np.maximum(force, least)
    by_force = raised[:, None] * gain
    weight = weights / np.maximum(response[:, None] + by_force, np.finfo(float).tiny) ** 2
    total = np.maximum(weight.sum(axis=1), np.finfo(float).tiny)
    left = np.maximum(np.sum(weight * (scatter - by_force), axis=1) / total, 0.0)
    return np.where(raised > force, np.minimum(left, response), response), raised


def _fit_positive(weight: FloatArray, gain: FloatArray, scatter: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Solve scatter = a + b gain in every band by weighted least squares, with a and b not negative."""
    s0, s1, s2 = (np.sum(weight * gain**power, axis=1) for power in range(3))
    t0, t1 = (np.sum(weight * scatter * gain**power, axis=1) for power in range(2))
    tiny = np.finfo(float).tiny
    determinant = s0 * s2 - s1**2
    solvable = determinant > 1e-10 * s0 * s2
    safe = np.where(solvable, determinant, 1.0)
    response = np.where(solvable, (s2 * t0 - s1 * t1) / safe, t0 / np.maximum(s0, tiny))
    force = np.where(solvable, (s0 * t1 - s1 * t0) / safe, 0.0)
    force = np.where(response < 0.0, t1 / np.maximum(s2, tiny), force)
    response = np.where(force < 0.0, t0 / np.maximum(s0, tiny), response)
    return np.maximum(response, 0.0), np.maximum(force, 0.0)
