"""Transfer functions away from the axis, and their errors, from FRFs on lines.

A function that is analytic in the right half of the s-plane follows there from its values along a line, by Cauchy's
integral. A factor that falls with the distance makes the integral local:
``H(s) = 1 / (2 pi) int H(s') (2 d)^2 / ((d + i x)^2 (d - i x)) d omega'`` with ``x = omega' - omega`` and d the
distance from the line. Outside the band an FRF is taken as constant, as it is at the end of the band. The error of that
follows from a few numbers, its values on a few subbands outside each end: the errors of all points are correlated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import blas
from scipy.ndimage import median_filter

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.measured.contour import COARSE, Resonances, find_resonances
from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions
from frf_ipz.errors import InputError
from frf_ipz.frf import FrfSet

MIN_SPACINGS = 1.5  # of the lines: closer to them, the sum is no good approximation of the integral
REACH = 0.3  # of the distance to the closer end of the band: farther from the lines, the FRF outside the band matters
OUTSIDE_SIZE = 3.0  # times an FRF's size at an end of the band: standard deviation of its change outside
OUTSIDE_SUBBANDS = (0.02, 0.06, 0.2, 0.6, 2.0, 1e6)  # edges, over the frequency at the end of the band
UNEVEN = 0.01  # of that standard deviation: what constant values on subbands miss
END_PART = 0.2  # of the frequency at an end: an FRF may happen to be small at the end itself
MIN_LINES = 16
SMOOTHED_LINES = 51  # over which unknown noise is taken as constant
MEDIAN_OF_NOISE = 0.69  # of its mean: the median of a squared modulus
UNKNOWN_PART = 0.003  # of an FRF's size: error where none is stated
SECOND_DIFFERENCE = 6.0  # variance of H(-1) - 2 H(0) + H(1) over that of H


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrfSurvey:
    """FRFs with what a contour and a continuation off their lines need.

    Parameters
    ----------
    frfs : FrfSet
        In the band.
    variance : (n_lines, n_frfs) array
        Of their errors; estimated from line to line where it was not stated.
    resonances : Resonances
        Peaks of all FRFs.
    least_decay_1_s : float
        Smallest sigma that the spacing of the lines allows.
    """

    frfs: FrfSet
    variance: FloatArray
    resonances: Resonances
    least_decay_1_s: float


def survey_frfs(frfs: FrfSet, band_hz: tuple[float, float]) -> FrfSurvey:
    """Find resonances and errors of FRFs.

    Parameters
    ----------
    frfs : FrfSet
        On lines.
    band_hz : pair of float
        Hz.

    Returns
    -------
    FrfSurvey
        For `continue_frfs`.

    Raises
    ------
    InputError
        If the band has too few lines.
    """
    inside = frfs.select_lines(frfs.in_band(band_hz) & (frfs.frequency_hz > 0))
    if inside.n_lines < MIN_LINES:
        raise InputError(
            f"the band {band_hz[0]:g} to {band_hz[1]:g} Hz has {inside.n_lines} lines; a diagnosis needs at least "
            f"{MIN_LINES}, so widen [fit] band_hz or measure finer lines"
        )
    omega = 2 * np.pi * inside.frequency_hz
    size = np.abs(inside.values) ** 2
    level = (size / np.maximum(np.median(size, axis=0), np.finfo(float).tiny)).sum(1)
    spacing = float(np.median(np.diff(omega)))
    return FrfSurvey(
        frfs=inside,
        variance=_variance(inside),
        resonances=find_resonances(omega, level, inside.window_decay_1_s),
        least_decay_1_s=inside.window_decay_1_s + MIN_SPACINGS * spacing,
    )


def _variance(frfs: FrfSet) -> FloatArray:
    second = np.zeros_like(frfs.values)
    second[1:-1] = frfs.values[:-2] - 2 * frfs.values[1:-1] + frfs.values[2:]
    second[[0, -1]] = second[[1, -2]]
    rough = np.abs(second) ** 2 / SECOND_DIFFERENCE
    smooth = median_filter(rough, size=(min(SMOOTHED_LINES, frfs.n_lines), 1), mode="nearest") / MEDIAN_OF_NOISE
    estimated = smooth + (UNKNOWN_PART * np.abs(frfs.values)) ** 2
    return np.where(np.isfinite(frfs.variance) & (frfs.variance > 0), frfs.variance, estimated)


def continue_frfs(survey: FrfSurvey, s: ComplexArray) -> TransferFunctions:
    """Continue FRFs analytically to a contour.

    Parameters
    ----------
    survey : FrfSurvey
        Of the FRFs.
    s : (n_points,) complex array
        rad/s; points too far from the lines are moved closer.

    Returns
    -------
    TransferFunctions
        With the covariance of their errors.
    """
    points = _within_reach(survey, s)
    weights, below, above = _kernel_parts(survey.frfs, points)
    weights[:, 0] += below.sum(1)  # lines at the ends stand for the FRF outside the band
    weights[:, -1] += above.sum(1)
    level = _level(survey, points)
    covariance = _noise_covariance(survey, weights) + _outside_covariance(points, below, above, level)
    return _as_transfer_functions(survey, points, weights @ survey.frfs.values, level, covariance)


def continue_frfs_coarsely(survey: FrfSurvey, s: ComplexArray) -> TransferFunctions:
    """Continue FRFs to a contour far from the axis, with independent errors, as a global scan takes them.

    Parameters
    ----------
    survey : FrfSurvey
        Of the FRFs.
    s : (n_points,) complex array
        rad/s; points too far from the lines are moved closer.

    Returns
    -------
    TransferFunctions
        By the lines of the band alone; what is missing outside the band counts as an error of each point.
    """
    points = _within_reach(survey, s)
    weights = _line_weights(survey.frfs, points)
    values, level = weights @ survey.frfs.values, _level(survey, points)
    outside = (_outside_part(survey, points)[:, None] * np.maximum(np.abs(values), level)) ** 2
    variance = np.abs(weights) ** 2 @ survey.variance + outside
    covariance = np.array([np.diag(column) for column in variance.T], np.complex128)
    return _as_transfer_functions(survey, points, values, level, covariance)


def select_nearest_lines(survey: FrfSurvey, s: ComplexArray) -> TransferFunctions:
    """Select the lines that are nearest to a contour: exact, however narrow a resonance is.

    Parameters
    ----------
    survey : FrfSurvey
        Of the FRFs.
    s : (n_points,) complex array
        rad/s; only its frequencies count.

    Returns
    -------
    TransferFunctions
        On lines, with independent errors.
    """
    frfs = survey.frfs
    omega = 2 * np.pi * frfs.frequency_hz
    lines = np.unique(np.clip(np.searchsorted(omega, s.imag), 0, len(omega) - 1))
    covariance = np.array([np.diag(column) for column in survey.variance[lines].T], np.complex128)
    return _as_transfer_functions(survey, frfs.s[lines], frfs.values[lines], _level(survey, frfs.s[lines]), covariance)


def _as_transfer_functions(
    survey: FrfSurvey, s: ComplexArray, values: ComplexArray, level: FloatArray, covariance: ComplexArray
) -> TransferFunctions:
    frfs, inputs = survey.frfs, list(survey.frfs.input_dofs)
    return TransferFunctions(
        s=s,
        labels=frfs.labels,
        values=values,
        size=np.maximum(np.abs(values), level),
        covariance=covariance,
        shared_errors=tuple(np.zeros((len(s), 0), np.complex128) for _ in inputs),
        input_index=np.array([inputs.index(label.input_dof) for label in frfs.labels]),
    )


def _noise_covariance(survey: FrfSurvey, weights: ComplexArray) -> ComplexArray:
    """Covariance by the errors of the lines, (n_frfs, n_points, n_points)."""
    covariance = np.empty((survey.variance.shape[1], len(weights), len(weights)), np.complex128)
    for of_frf, column in zip(covariance, survey.variance.T, strict=True):
        scaled = weights * np.sqrt(column)
        upper = np.triu(blas.zherk(1.0, scaled.T, trans=2)).conj()  # one half: the product of a matrix with itself
        of_frf[...] = upper + np.triu(upper, 1).conj().T
    return covariance


def _within_reach(survey: FrfSurvey, s: ComplexArray, *, include_ends: bool = False) -> ComplexArray:
    """Move points close enough to the lines; drop those too close to the ends of the band, unless they are included."""
    frfs = survey.frfs
    omega = 2 * np.pi * frfs.frequency_hz
    reach = REACH * np.minimum(s.imag - omega[0], omega[-1] - s.imag)
    farthest = frfs.window_decay_1_s + np.maximum(reach, 0.0)
    use = np.full(len(s), fill_value=True) if include_ends else farthest >= survey.least_decay_1_s
    sigma = np.maximum(np.minimum(s.real, farthest), survey.least_decay_1_s)
    return np.asarray(sigma[use] + 1j * s.imag[use])


def _level(survey: FrfSurvey, s: ComplexArray) -> FloatArray:
    """Sizes of FRFs away from their resonances and zeros, (n_points, n_frfs)."""
    wide = _within_reach(survey, np.maximum(s.real, COARSE.width * s.imag) + 1j * s.imag, include_ends=True)
    return np.asarray(np.abs(_line_weights(survey.frfs, wide) @ survey.frfs.values))


def _line_weights(frfs: FrfSet, s: ComplexArray) -> ComplexArray:
    """Weights of the lines at each point, (n_points, n_lines), that sum to 1."""
    lines, *_ = _kernel_parts(frfs, s)
    lines /= lines.sum(1, keepdims=True)
    return lines


def _outside_part(survey: FrfSurvey, s: ComplexArray) -> FloatArray:
    """Part of the integral outside the closer end of the band, times the FRF's relative error there, (n_points,)."""
    omega = 2 * np.pi * survey.frfs.frequency_hz
    to_end = np.minimum(s.imag - omega[0], omega[-1] - s.imag)
    distance = s.real - survey.frfs.window_decay_1_s
    return np.asarray(OUTSIDE_SIZE * (2 * distance) ** 2 / (4 * np.pi * np.maximum(to_end, distance) ** 2))


def _outside_covariance(s: ComplexArray, below: ComplexArray, above: ComplexArray, level: FloatArray) -> ComplexArray:
    """Covariance by the unknown FRF outside the band, (n_frfs, n_points, n_points)."""
    covariance = np.zeros((level.shape[1], len(s), len(s)), np.complex128)
    for part, end in ((below, s.imag[0]), (above, s.imag[-1])):
        at_end = np.abs(s.imag / end - 1) <= END_PART
        largest = OUTSIDE_SIZE * level[at_end].max(0)
        uneven = np.eye(len(s)) * np.abs(part).sum(1) ** 2
        covariance += largest[:, None, None] ** 2 * (part @ part.conj().T + UNEVEN**2 * uneven)
    return covariance


def _kernel_parts(frfs: FrfSet, s: ComplexArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Parts of the kernel's integral by lines, by subbands below the band and above it, (n_points, n): 1 in all."""
    omega = 2 * np.pi * frfs.frequency_hz
    share = np.gradient(omega)
    distance = (s.real - frfs.window_decay_1_s)[:, None]
    lines = np.empty((len(s), len(omega)), np.complex128)
    for row, point, away in zip(lines, s, distance[:, 0], strict=True):  # one fits into a cache, all of them do not
        along = omega - point.imag
        size = 2 / np.pi * share * (away / (away**2 + along**2)) ** 2  # far faster than complex powers
        row.real, row.imag = size * away, -size * along
    low, high = omega[0] - share[0] / 2, omega[-1] + share[-1] / 2
    steps = np.array([0.0, *OUTSIDE_SUBBANDS])
    below = -np.diff(_kernel_integral(low - omega[0] * steps - s.imag[:, None], distance), axis=1)
    above = np.diff(_kernel_integral(high + omega[-1] * steps - s.imag[:, None], distance), axis=1)
    total = lines.sum(1) + below.sum(1) + above.sum(1)
    lines /= total[:, None]
    return lines, below / total[:, None], above / total[:, None]


def _kernel_integral(along: FloatArray, distance: FloatArray) -> ComplexArray:
    """Integral of the kernel up to x, (n_points, n), less a half."""
    return np.asarray((2 * np.arctan2(along, distance) + 2j * distance / (distance + 1j * along)) / (2 * np.pi))
