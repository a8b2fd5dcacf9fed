"""Where in the s-plane transfer functions are looked at.

A recording gives the transfer function at any s = sigma + i omega. The decay e^(-sigma t) that belongs to sigma takes
noise away together with the end of the record, so each stretch of the band has a best sigma: about the decay rate of a
mode at its resonance, where exp(-conj(p) t) is the matched filter of a mode with the pole p, and more and more with the
distance from resonances, where the transfer function is smooth. A contour of that kind, with points about sigma apart,
holds what the record holds with some hundred numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray

SLOPE = 0.6  # of sigma over the distance to the next resonance
STEP = 0.9  # from point to point, over sigma
WIDEST = 0.02  # sigma over omega: lightly damped things that nobody knows of are not passed over
MOST_POINTS = 260


@dataclass(frozen=True, slots=True, kw_only=True)
class Distance:
    """How far from the axis a contour lies.

    Parameters
    ----------
    width : float
        sigma over omega.
    step : float
        From point to point, over sigma.
    """

    width: float
    step: float


COARSE = Distance(width=0.06, step=0.8)  # for searching: no peak is missed
MIDDLE = Distance(width=0.015, step=1.5)  # on the way from there to the axis


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Resonances:
    """Peaks of what was measured.

    Parameters
    ----------
    omega_rad_s : (n_peaks,) array
        Where they are, ascending.
    decay_1_s : (n_peaks,) array
        Half their width: about the decay rate of the mode.
    """

    omega_rad_s: FloatArray
    decay_1_s: FloatArray


def find_resonances(
    omega_rad_s: FloatArray, level: FloatArray, decay_1_s: float, *, at_ends: bool = False
) -> Resonances:
    """Find peaks and their widths.

    Parameters
    ----------
    omega_rad_s : (n_lines,) array
        Uniform lines.
    level : (n_lines,) array
        Sum of squared FRFs, each over its own typical size.
    decay_1_s : float
        sigma of the lines: it widens every peak.
    at_ends : bool
        Count a peak of which one half lies beyond the lines.

    Returns
    -------
    Resonances
        Peaks that stand out from what is beside them.
    """
    inner = np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] >= level[2:])) + 1
    peaks, decays = [], []
    for place in inner.tolist():
        sides = np.array([_half_power(omega_rad_s, level, place, step) for step in (-1, 1)])
        sides = sides[~np.isnan(sides)] if at_ends else sides
        if not np.isfinite(sides).all() or not len(sides):
            continue
        width = float(np.mean(np.abs(sides - omega_rad_s[place])))
        peaks.append(omega_rad_s[place])
        decays.append(max(width - decay_1_s, 0.02 * width))
    return Resonances(omega_rad_s=np.array(peaks), decay_1_s=np.array(decays))


def _half_power(omega: FloatArray, level: FloatArray, place: int, step: int) -> float:
    """Where the level has fallen to a half, between lines; infinite where it rises again before, NaN beyond the end."""
    at = place
    while 0 < at < len(level) - 1:
        at += step
        if level[at] <= 0.5 * level[place]:
            inside = at - step
            part = (level[inside] - 0.5 * level[place]) / (level[inside] - level[at])
            return float(omega[inside] + part * (omega[at] - omega[inside]))
        if level[at] > level[place]:
            return np.inf
    return np.nan


def fine_contour(resonances: Resonances, band_hz: tuple[float, float], least_decay_1_s: float) -> ComplexArray:
    """Lay a contour that is close to the axis at resonances.

    Parameters
    ----------
    resonances : Resonances
        Where they are.
    band_hz : pair of float
        Hz.
    least_decay_1_s : float
        Least sigma: what records that were cut off need.

    Returns
    -------
    (n_points,) complex array
        rad/s, by ascending frequency.
    """
    step = STEP
    while True:
        found = _march(band_hz, step, lambda omega: _decay(omega, resonances, least_decay_1_s))
        if len(found) <= MOST_POINTS:
            return found
        step *= 1.02 * len(found) / MOST_POINTS


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
    return _march(band_hz, distance.step, lambda omega: max(distance.width * omega, least_decay_1_s))


def _decay(omega: float, resonances: Resonances, least: float) -> float:
    widest = WIDEST * omega
    if len(resonances.omega_rad_s):
        away = SLOPE * np.abs(omega - resonances.omega_rad_s)
        widest = min(widest, float(np.hypot(resonances.decay_1_s, away).min()))
    return max(widest, least)


def _march(band_hz: tuple[float, float], step: float, decay: Callable[[float], float]) -> ComplexArray:
    omega, end = 2 * np.pi * band_hz[0], 2 * np.pi * band_hz[1]
    points = []
    while omega <= end:
        sigma = decay(omega)
        points.append(complex(sigma, omega))
        omega += step * sigma
    return np.array(points)
