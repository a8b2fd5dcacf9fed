"""Poles that describe what a strong mode does besides being linear, not modes of their own.

Real structures drift, rattle and modulate. Where the model does not reach the noise, or nobody has measured the noise,
each strong peak leaves a misfit in proportion to itself: poles under the same peak, and side bands beside it. They are
told from modes by their size against the strong one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.rational import damping_ratio

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.refinement import Refined
    from frf_ipz.identification.measured_lines import Weighted
    from frf_ipz.identification.search.goodness_of_fit import Judgement

UNDER = 1.1  # times the sum of two half widths: poles closer than that share a peak
MINOR = 0.06  # significance of the weaker of two such poles, over that of the stronger
PEAK = 0.05  # damping ratio up to which a pole makes a peak, whose error another pole could be
SAME, WEAK = 0.5, 50.0  # the same distance at which two poles are one peak, unless the weaker is as significant as that
BESIDE = 0.1  # relative distance up to which a strong mode has side bands
SIDE_BAND = 1e-5  # energy of their peaks over that of the mode's
SPIKE = 0.15  # half width in lines below which a pole is a single line: hum, not a mode
DEMANDED = 6.0  # times what the BIC demands, where the misfit is not noise alone


def find_artefacts(data: Weighted, fit: Refined, judgement: Judgement) -> list[str]:
    """Tell which poles are no modes of their own.

    Parameters
    ----------
    data : Weighted
        Lines and weights.
    fit : Refined
        The fit.
    judgement : Judgement
        How significant its poles are.

    Returns
    -------
    list of str
        Why each pole is none; empty where it may be a mode.
    """
    poles, significance = fit.poles, judgement.significance
    energy = np.sum((np.abs(fit.system.residues()) * data.gain / -poles.real[:, None]) ** 2, axis=1)
    line = float(np.median(np.diff(data.s.imag)))
    reasons = []
    for number, pole in enumerate(poles):
        distance = np.abs(poles.imag - pole.imag)
        reason = _beside_stronger(number, poles, distance, significance, energy)
        if not reason and -pole.real < SPIKE * line:
            reason = f"is a single line: its half width is {-pole.real / line:.2g} of the distance of lines"
        if not reason and significance[number] < DEMANDED and not judgement.is_needed[number]:
            reason = (
                f"takes off the misfit {significance[number]:.2g} times what the BIC demands: within the model error"
            )
        reasons.append(reason)
    return reasons


def _beside_stronger(
    number: int, poles: ComplexArray, distance: FloatArray, significance: FloatArray, energy: FloatArray
) -> str:
    pole = poles[number]
    apart = distance / -(poles.real + pole.real)
    minor = significance[number] < MINOR * significance
    same = (apart < SAME) & (significance[number] < np.minimum(significance, WEAK))
    peaks = damping_ratio(poles) < PEAK
    under = np.flatnonzero((((apart < UNDER) & minor) | same) & peaks & peaks[number])
    if len(under):
        strong = poles[under[np.argmax(significance[under])]]
        return f"lies under the peak at {abs(strong) / (2 * np.pi):.6g} Hz and is far weaker: an error of that mode"
    sides = np.flatnonzero((distance < BESIDE * pole.imag) & (energy[number] < SIDE_BAND * energy))
    if len(sides):
        strong = poles[sides[np.argmax(energy[sides])]]
        return f"is a side band of the mode at {abs(strong) / (2 * np.pi):.6g} Hz, far weaker than that"
    return ""
