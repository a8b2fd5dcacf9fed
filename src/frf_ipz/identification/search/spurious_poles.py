"""Poles that describe how a strong mode departs from linearity, and are no modes of their own.

Real structures drift, rattle and modulate. Where the model does not reach the noise, or the noise was not measured,
each strong peak leaves a misfit in proportion to itself: poles under the same peak, and side bands beside it. They are
distinguished from modes by their size against the strong one, and by what they leave: a mode is followed to the noise,
what is no pole is not.

Where frequencies waver from FRF to FRF, they waver within an FRF's averages too, so that peaks are no longer those of
single poles. A second pole under a peak and within reach of the drift stands for that, however significant it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
from frf_ipz.rational import damping_ratio

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.refinement import RefinedPoles
    from frf_ipz.identification.measured_lines import WeightedLines
    from frf_ipz.identification.search.goodness_of_fit import GoodnessOfFit

SHARED_PEAK = 1.1  # times the sum of two half widths: poles closer than that share a peak
MINOR = 0.06  # significance of the weaker of two such poles, over that of the stronger
PEAK = 0.05  # damping ratio up to which a pole makes a peak, whose error another pole could be
SAME_PEAK, WEAK = 0.5, 50.0  # that distance at which two poles are one peak, unless the weaker is so significant
EXACT = 1e-3  # of its square is all that a pole leaves of a mode; of what is none, a hundredth in real recordings
SIDE_BAND_DISTANCE = 0.1  # relative distance up to which a strong mode has side bands
SIDE_BAND_ENERGY = 1e-5  # energy of their peaks over that of the mode's
DEMANDED = 6.0  # times what the BIC demands, where the misfit is not noise alone


def find_spurious_poles(
    data: WeightedLines, fit: RefinedPoles, goodness: GoodnessOfFit, *, drift_reach: float = 0.0
) -> list[str]:
    """Find the poles that are no modes of their own.

    Parameters
    ----------
    data : WeightedLines
        Lines and weights.
    fit : RefinedPoles
        The fit.
    goodness : GoodnessOfFit
        How significant its poles are.
    drift_reach : float
        Relative change of frequencies between two moments of the measurement, at most; 0 without a drift.

    Returns
    -------
    list of str
        Why each pole is spurious; empty where it may be a mode.
    """
    poles, significance = fit.poles, goodness.significance
    # as the lines see a peak: no narrower than half a line, or than an exponential window makes it
    width = np.maximum(data.s.real[0] - poles.real, np.median(np.diff(data.s.imag)) / 2)
    energy = np.sum((np.abs(fit.system.residues()) * data.gain / width[:, None]) ** 2, axis=1)
    is_exact = _is_exact(data, poles, goodness)
    reasons = []
    for number, pole in enumerate(poles):
        distance = np.abs(poles.imag - pole.imag)
        reason = "" if is_exact[number] else _same_peak_reason(number, poles, distance, significance)
        reason = reason or _side_band_reason(number, poles, distance, energy)
        reason = reason or _drift_reason(number, poles, distance / (width + width[number]), significance, drift_reach)
        if not reason and significance[number] < DEMANDED and not goodness.is_needed[number]:
            reason = (
                f"takes off the misfit {significance[number]:.2g} times what the BIC demands: within the model error"
            )
        reasons.append(reason)
    return reasons


def half_widths_apart(poles: ComplexArray) -> FloatArray:
    """Measure how far apart poles are.

    Parameters
    ----------
    poles : (n,) complex array
        rad/s.

    Returns
    -------
    (n, n) array
        Distance of each two over the sum of their half widths: below 1 they share a peak.
    """
    return np.asarray(np.abs(poles[:, None] - poles) / -(poles.real[:, None] + poles.real))


def _is_exact(data: WeightedLines, poles: ComplexArray, goodness: GoodnessOfFit) -> BoolArray:
    """Tell which poles take off all of the misfit near them but a small part."""
    is_near = np.abs(data.s.imag[:, None] - poles.imag) < 2.0 * (data.s.real[0] - poles.real)
    left = is_near.T @ np.sum(np.abs(goodness.misfit) ** 2, axis=1)
    return np.asarray(left < EXACT * np.sum(goodness.drops * goodness.factor, axis=1))


def _drift_reason(
    number: int, poles: ComplexArray, apart: FloatArray, significance: FloatArray, drift_reach: float
) -> str:
    is_same = (apart < 1) & (np.abs(poles.imag - poles[number].imag) < drift_reach * poles[number].imag)
    stronger = np.flatnonzero(is_same & (significance > significance[number]))
    if not len(stronger):
        return ""
    strong = poles[stronger[np.argmax(significance[stronger])]]
    return (
        f"lies under the peak at {abs(strong) / (2 * np.pi):.6g} Hz, nearer to it than the structure drifts while it "
        f"is measured ({drift_reach * 1e6:.2g} ppm): averages over a drifting peak look like this"
    )


def _same_peak_reason(number: int, poles: ComplexArray, distance: FloatArray, significance: FloatArray) -> str:
    pole = poles[number]
    apart = distance / -(poles.real + pole.real)
    is_minor = significance[number] < MINOR * significance
    is_same_peak = (apart < SAME_PEAK) & (significance[number] < np.minimum(significance, WEAK))
    makes_peak = damping_ratio(poles) < PEAK
    stronger = np.flatnonzero((((apart < SHARED_PEAK) & is_minor) | is_same_peak) & makes_peak & makes_peak[number])
    if not len(stronger):
        return ""
    strong = poles[stronger[np.argmax(significance[stronger])]]
    return f"lies under the peak at {abs(strong) / (2 * np.pi):.6g} Hz and is far weaker: an error of that mode"


def _side_band_reason(number: int, poles: ComplexArray, distance: FloatArray, energy: FloatArray) -> str:
    carriers = np.flatnonzero(
        (distance < SIDE_BAND_DISTANCE * poles[number].imag) & (energy[number] < SIDE_BAND_ENERGY * energy)
    )
    if not len(carriers):
        return ""
    strong = poles[carriers[np.argmax(energy[carriers])]]
    return f"is a side band of the mode at {abs(strong) / (2 * np.pi):.6g} Hz, far weaker than that"
