"""Where in the s-plane transfer functions are evaluated.

A recording gives the transfer function at any s = sigma + i omega. The window e^(-sigma t) that belongs to sigma
removes noise together with the end of the record, so each part of the band has a best sigma: about the decay rate of a
mode at its resonance, where exp(-conj(p) t) is the matched filter of a mode with the pole p, and more with the distance
from resonances, where the transfer function is smooth. A contour of that kind, with points about sigma apart, holds
what the record holds with some hundred numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray

WINDOW_DECAYS = 8.0  # sigma times a record: 3e-4 of a mode remains at its end
SLOPE = 0.6  # of sigma over the distance to the next resonance
STEP = 0.9  # from point to point, over sigma
MAX_SIGMA_RATIO = 0.02  # sigma over omega: lightly damped modes that nobody knows of are not stepped over
MAX_POINTS = 260


@dataclass(frozen=True, slots=True, kw_only=True)
class Distance:
    """How far from the imaginary axis a contour lies.

    Parameters
    ----------
    width : float
        sigma over omega.
    step : float
        From point to point, over sigma.
    """

    width: float
    step: float


COARSE = Distance(width=0.06, step=0.8)  # for the global scan: no peak is missed
MIDDLE = Distance(width=0.015, step=1.5)  # between the global scan and the fine contour


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Resonances:
    """Peaks of measured FRFs.

    Parameters
    ----------
    omega_rad_s : (n_peaks,) array
        Their frequencies, ascending.
    decay_1_s : (n_peaks,) array
        Half their width: about the decay rate of the mode.
    """

    omega_rad_s: FloatArray
    decay_1_s: FloatArray


def find_resonances(
    omega_rad_s: FloatArray, level: FloatArray, decay_1_s: float, *, at_ends: bool = False
) -> Resonances:
    """Find peaks and their half-power widths.

    Parameters
    ----------
    omega_rad_s : (n_lines,) array
        Uniform lines.
    level : (n_lines,) array
        Sum of squared FRFs, each over its own typical size.
    decay_1_s : float
        sigma of the lines: it widens every peak.
    at_ends : bool
        Count a peak of which one half lies outside the lines.

    Returns
    -------
    Resonances
        Peaks that are at least twice as high as the valleys beside them.
    """
    inner = np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] >= level[2:])) + 1
    sides = np.stack([_half_power_frequencies(omega_rad_s, level, inner, step) for step in (-1, 1)], 1)
    is_known = np.isfinite(sides)
    is_peak = is_known.all(1)
    if at_ends:
        is_peak = is_known.any(1) & ~np.isinf(sides).any(1)
    peaks = omega_rad_s[inner[is_peak]]
    width = np.nanmean(np.abs(sides[is_peak] - peaks[:, None]), axis=1)
    return Resonances(omega_rad_s=peaks, decay_1_s=np.maximum(width - decay_1_s, 0.02 * width))


def _half_power_frequencies(omega: FloatArray, level: FloatArray, peaks: IntArray, step: int) -> FloatArray:
    """Interpolate where the level falls to a half; infinite where it rises again first, NaN outside the lines."""
    found = np.full(len(peaks), np.nan)
    left = np.arange(len(peaks))  # those whose end was not reached
    line = peaks.copy()
    while len(left):
        line = line + step
        here, top = level[line], level[peaks[left]]
        is_half = here <= 0.5 * top
        inside, outside = line[is_half] - step, line[is_half]
        part = (level[inside] - 0.5 * top[is_half]) / (level[inside] - here[is_half])
        found[left[is_half]] = omega[inside] + part * (omega[outside] - omega[inside])
        found[left[~is_half & (here > top)]] = np.inf
        goes_on = ~is_half & (here <= top) & (line > 0) & (line < len(level) - 1)
        left, line = left[goes_on], line[goes_on]
    return found


def fine_contour(resonances: Resonances, band_hz: tuple[float, float], least_decay_1_s: float) -> ComplexArray:
    """Lay a contour that is close to the axis at resonances.

    Parameters
    ----------
    resonances : Resonances
        Their frequencies and widths.
    band_hz : pair of float
        Hz.
    least_decay_1_s : float
        Least sigma: what records that end before they have decayed need.

    Returns
    -------
    (n_points,) complex array
        rad/s, by ascending frequency.
    """
    step = STEP
    while True:
        contour = _lay_points(band_hz, step, lambda omega: _best_sigma(omega, resonances, least_decay_1_s))
        if len(contour) <= MAX_POINTS:
            return contour
        step *= 1.02 * len(contour) / MAX_POINTS


def wide_contour(band_hz: tuple[float, float], least_decay_1_s: float, distance: Distance) -> ComplexArray:
    """Lay a contour away from the axis, where FRFs are smooth.

    Parameters
    ----------
    band_hz, least_decay_1_s
        As for `fine_contour`.
    distance : Distance
        How far.

    Returns
    -------
    (n_points,) complex array
        rad/s, by ascending frequency.
    """
    return _lay_points(band_hz, distance.step, lambda omega: max(distance.width * omega, least_decay_1_s))


def _best_sigma(omega: float, resonances: Resonances, least: float) -> float:
    largest = MAX_SIGMA_RATIO * omega
    if len(resonances.omega_rad_s):
        away = SLOPE * np.abs(omega - resonances.omega_rad_s)
        largest = min(largest, float(np.hypot(resonances.decay_1_s, away).min()))
    return max(largest, least)


def _lay_points(band_hz: tuple[float, float], step: float, sigma_at: Callable[[float], float]) -> ComplexArray:
    omega, end = 2 * np.pi * band_hz[0], 2 * np.pi * band_hz[1]
    points = []
    while omega <= end:
        sigma = sigma_at(omega)
        points.append(complex(sigma, omega))
        omega += step * sigma
    return np.array(points)
