"""Transfer functions away from the axis, and their errors, from FRFs on lines.

What is analytic in the right half of the s-plane follows there from its values along a line, by Cauchy's integral. A
factor that falls with the distance makes the integral forget what is far from the piece of the band that is looked at:
``H(s) = 1 / (2 pi) int H(s') (2 d)^2 / ((d + i x)^2 (d - i x)) d omega'`` with ``x = omega' - omega`` and d the
distance from the line. Beyond the ends of the band an FRF is taken to stay what it is at the end. It does not, and the
error follows from a few numbers, what it is in a few pieces beyond each end: all points err together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.measured.contour import COARSE, Resonances, find_resonances
from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions
from frf_ipz.errors import InputError
from frf_ipz.frf import FrfSet

SPACINGS = 1.5  # of the lines: nearer to them, the sum is no integral any more
OF_THE_WAY = 0.3  # to the nearer end of the lines: farther from them, what lies beyond is missed
BEYOND = 3.0  # times an FRF's size at an end of the band: how far from that it may be beyond
PIECES = (0.02, 0.06, 0.2, 0.6, 2.0, 1e6)  # of the frequency at an end: how far beyond it an FRF is taken as even
UNEVEN = 0.01  # of that: what pieces do not hold
NEAR_END = 0.2  # of the frequency at an end: an FRF may happen to be small at the end itself
FEWEST_LINES = 16
STRETCH = 51  # lines over which unknown noise is taken as even
MEDIAN_OF_NOISE = 0.69  # of its mean: the median of a squared modulus
UNKNOWN_PART = 0.003  # of an FRF's size: error that nobody stated
SECOND_DIFFERENCE = 6.0  # variance of H(-1) - 2 H(0) + H(1) over that of H


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrfSurvey:
    """FRFs, ready to be taken off their lines.

    Parameters
    ----------
    frfs : FrfSet
        In the band.
    variance : (n_lines, n_frfs) array
        Of their errors; estimated from line to line where it was not stated.
    resonances : Resonances
        Peaks of all FRFs.
    least_decay_1_s : float
        Smallest sigma that lines so far apart allow.
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
        What `continue_frfs` needs.

    Raises
    ------
    InputError
        If the band has too few lines.
    """
    inside = frfs.lines(frfs.in_band(band_hz) & (frfs.frequency_hz > 0))
    if inside.n_lines < FEWEST_LINES:
        raise InputError(
            f"the band {band_hz[0]:g} to {band_hz[1]:g} Hz has {inside.n_lines} lines; a diagnosis needs at least "
            f"{FEWEST_LINES}, so widen [fit] band_hz or measure finer lines"
        )
    omega = 2 * np.pi * inside.frequency_hz
    size = np.abs(inside.values) ** 2
    level = (size / np.maximum(np.median(size, axis=0), np.finfo(float).tiny)).sum(1)
    spacing = float(np.median(np.diff(omega)))
    return FrfSurvey(
        frfs=inside,
        variance=_variance(inside),
        resonances=find_resonances(omega, level, inside.window_decay_1_s),
        least_decay_1_s=inside.window_decay_1_s + SPACINGS * spacing,
    )


def _variance(frfs: FrfSet) -> FloatArray:
    second = np.zeros_like(frfs.values)
    second[1:-1] = frfs.values[:-2] - 2 * frfs.values[1:-1] + frfs.values[2:]
    second[[0, -1]] = second[[1, -2]]
    rough = np.abs(second) ** 2 / SECOND_DIFFERENCE
    even = median_filter(rough, size=(min(STRETCH, frfs.n_lines), 1), mode="nearest") / MEDIAN_OF_NOISE
    guessed = even + (UNKNOWN_PART * np.abs(frfs.values)) ** 2
    return np.where(np.isfinite(frfs.variance) & (frfs.variance > 0), frfs.variance, guessed)


def continue_frfs(found: FrfSurvey, s: ComplexArray) -> TransferFunctions:
    """Evaluate transfer functions on a contour.

    Parameters
    ----------
    found : FrfSurvey
        Of the FRFs.
    s : (n_points,) complex array
        rad/s; where it goes too far from the lines it is brought nearer.

    Returns
    -------
    TransferFunctions
        With the covariance of their errors.
    """
    placed = _within_reach(found, s)
    weights, below, above = _parts(found.frfs, placed)
    weights[:, 0] += below.sum(1)  # lines at the ends stand for what is beyond
    weights[:, -1] += above.sum(1)
    level = _level(found, placed)
    covariance = _noise(found, weights) + _missed(placed, below, above, level)
    return _measured(found, placed, weights @ found.frfs.values, level, covariance)


def continue_frfs_coarsely(found: FrfSurvey, s: ComplexArray) -> TransferFunctions:
    """Evaluate transfer functions far from the axis, where a search weighs every point by itself.

    Parameters
    ----------
    found : FrfSurvey
        Of the FRFs.
    s : (n_points,) complex array
        rad/s; where it goes too far from the lines it is brought nearer.

    Returns
    -------
    TransferFunctions
        As if FRFs were beyond the band what they are in it; what that misses is taken for an error of each point.
    """
    placed = _within_reach(found, s)
    weights = _inside(found.frfs, placed)
    values, level = weights @ found.frfs.values, _level(found, placed)
    missed = (_part_beyond(found, placed)[:, None] * np.maximum(np.abs(values), level)) ** 2
    covariance = _noise(found, weights) + np.array([np.diag(one) for one in missed.T])
    return _measured(found, placed, values, level, covariance)


def select_nearest_lines(found: FrfSurvey, s: ComplexArray) -> TransferFunctions:
    """Take the lines themselves that are nearest to a contour: exact, however narrow a resonance is.

    Parameters
    ----------
    found : FrfSurvey
        Of the FRFs.
    s : (n_points,) complex array
        rad/s; only where it is along the band counts.

    Returns
    -------
    TransferFunctions
        On lines, with independent errors.
    """
    frfs = found.frfs
    omega = 2 * np.pi * frfs.frequency_hz
    chosen = np.unique(np.clip(np.searchsorted(omega, s.imag), 0, len(omega) - 1))
    independent = np.array([np.diag(column) for column in found.variance[chosen].T], np.complex128)
    return _measured(found, frfs.s[chosen], frfs.values[chosen], _level(found, frfs.s[chosen]), independent)


def _measured(
    found: FrfSurvey, s: ComplexArray, values: ComplexArray, level: FloatArray, covariance: ComplexArray
) -> TransferFunctions:
    frfs, inputs = found.frfs, list(found.frfs.input_dofs)
    return TransferFunctions(
        s=s,
        labels=frfs.labels,
        values=values,
        size=np.maximum(np.abs(values), level),
        covariance=covariance,
        common=tuple(np.zeros((len(s), 0), np.complex128) for _ in inputs),
        input_of=np.array([inputs.index(label.input_dof) for label in frfs.labels]),
    )


def _noise(found: FrfSurvey, weights: ComplexArray) -> ComplexArray:
    """Covariance of the errors that those of the lines make, (n_frfs, n_points, n_points)."""
    return np.array([(weights * column) @ weights.conj().T for column in found.variance.T])


def _within_reach(found: FrfSurvey, s: ComplexArray, *, keep: bool = False) -> ComplexArray:
    """Bring points near enough to the lines; leave out those at the ends of the band, unless all are wanted."""
    frfs = found.frfs
    omega = 2 * np.pi * frfs.frequency_hz
    reach = OF_THE_WAY * np.minimum(s.imag - omega[0], omega[-1] - s.imag)
    farthest = frfs.window_decay_1_s + np.maximum(reach, 0.0)
    kept = np.full(len(s), fill_value=True) if keep else farthest >= found.least_decay_1_s
    sigma = np.maximum(np.minimum(s.real, farthest), found.least_decay_1_s)
    return np.asarray(sigma[kept] + 1j * s.imag[kept])


def _level(found: FrfSurvey, s: ComplexArray) -> FloatArray:
    """Sizes of FRFs away from their resonances and zeros, (n_points, n_frfs)."""
    wide = _within_reach(found, np.maximum(s.real, COARSE.width * s.imag) + 1j * s.imag, keep=True)
    return np.asarray(np.abs(_inside(found.frfs, wide) @ found.frfs.values))


def _inside(frfs: FrfSet, s: ComplexArray) -> ComplexArray:
    """Give what each line contributes to each point if there is nothing but the lines, (n_points, n_lines)."""
    lines, *_ = _parts(frfs, s)
    return np.asarray(lines / lines.sum(1, keepdims=True))


def _part_beyond(found: FrfSurvey, s: ComplexArray) -> FloatArray:
    """Part of the integral beyond the nearer end of the lines, times how far the FRF may be off there, (n_points,)."""
    omega = 2 * np.pi * found.frfs.frequency_hz
    ends = np.minimum(s.imag - omega[0], omega[-1] - s.imag)
    distance = s.real - found.frfs.window_decay_1_s
    return np.asarray(BEYOND * (2 * distance) ** 2 / (4 * np.pi * np.maximum(ends, distance) ** 2))


def _missed(s: ComplexArray, below: ComplexArray, above: ComplexArray, level: FloatArray) -> ComplexArray:
    """Covariance of the errors by what lies beyond the ends of the band, (n_frfs, n_points, n_points)."""
    missed = np.zeros((level.shape[1], len(s), len(s)), np.complex128)
    for part, end in ((below, s.imag[0]), (above, s.imag[-1])):
        near = np.abs(s.imag / end - 1) <= NEAR_END
        largest = BEYOND * level[near].max(0)
        uneven = np.eye(len(s)) * np.abs(part).sum(1) ** 2
        missed += largest[:, None, None] ** 2 * (part @ part.conj().T + UNEVEN**2 * uneven)
    return missed


def _parts(frfs: FrfSet, s: ComplexArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Parts of the integral by lines, by pieces below the band and by pieces above it, (n_points, n): 1 in all."""
    omega = 2 * np.pi * frfs.frequency_hz
    share = np.gradient(omega)
    distance = (s.real - frfs.window_decay_1_s)[:, None]
    along = omega[None] - s.imag[:, None]
    size = 2 / np.pi * share * (distance / (distance**2 + along**2)) ** 2  # far faster than complex powers
    lines = np.empty(along.shape, np.complex128)
    lines.real, lines.imag = size * distance, -size * along
    low, high = omega[0] - share[0] / 2, omega[-1] + share[-1] / 2
    steps = np.array([0.0, *PIECES])
    below = -np.diff(_integral(low - omega[0] * steps - s.imag[:, None], distance), axis=1)
    above = np.diff(_integral(high + omega[-1] * steps - s.imag[:, None], distance), axis=1)
    total = lines.sum(1) + below.sum(1) + above.sum(1)
    return lines / total[:, None], below / total[:, None], above / total[:, None]


def _integral(along: FloatArray, distance: FloatArray) -> ComplexArray:
    """Integral of the kernel up to x, (n_points, n): a half more than what it is from 0 on."""
    return np.asarray((2 * np.arctan2(along, distance) + 2j * distance / (distance + 1j * along)) / (2 * np.pi))
