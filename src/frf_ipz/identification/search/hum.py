"""Hum: steady tones that stand in the lines and are no modes.

A tone has no width. It stands on one line, or on the three of a Hann window's main lobe; cut off by a record without a
window, it has the tails of a pole without damping. However narrow a mode is against the distance of lines, its tails
reach over many of them. So a narrow pole must take off the misfit, on the lines outside a tone's lobe alone, what the
BIC [Schwarz1978] demands for it. Under an exponential window a tone has the tails of the window, as any pole has: they
tell nothing there.

A pole with tails and without a width that the lines show is told from a tone by its phase: residues of receptances are
imaginary where the motion is caused by the force, and have any phase where it is not.

[Schwarz1978] G. Schwarz, Estimating the dimension of a model, Annals of Statistics 6, 1978, 461-464,
doi:10.1214/aos/1176344136.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.identification.likelihood.compression import column_gains, without_lines
from frf_ipz.identification.search.goodness_of_fit import over_bic, pole_gains

if TYPE_CHECKING:
    from frf_ipz.arrays import BoolArray, FloatArray
    from frf_ipz.identification.likelihood.refinement import RefinedPoles
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms
    from frf_ipz.identification.measured_lines import WeightedLines
    from frf_ipz.identification.search.goodness_of_fit import GoodnessOfFit

LOBE = 1.5  # lines on either side of a tone's frequency that a Hann window's main lobe reaches, to the half of a line
WIDEST = 3**-0.5  # half width, in lines, of the pole that has half its height a line beside it, as that lobe has


def find_hum(
    data: WeightedLines, fit: RefinedPoles, terms: SmoothTerms, goodness: GoodnessOfFit, *, demanded: float
) -> list[str]:
    """Find the poles that a steady tone explains as well as a mode.

    Parameters
    ----------
    data : WeightedLines
        Lines and weights, the same profile for all FRFs.
    fit : RefinedPoles
        The fit.
    terms : SmoothTerms
        Terms for modes out of band.
    goodness : GoodnessOfFit
        How far the misfit is from noise, and how well damping is determined.
    demanded : float
        Times what the BIC demands that the tails of a mode must take off the misfit.

    Returns
    -------
    list of str
        Why each pole is hum; empty where it may be a mode.
    """
    reasons = [""] * len(fit.poles)
    by_number = float(np.log(2 * len(data.s)))  # by the BIC, for each number more
    gains, is_windowed = pole_gains(fit.system), bool(data.s.real[0] > 0)
    for number in np.flatnonzero(_is_narrow(data, fit)).tolist():
        factor = goodness.factor[number]
        if not is_windowed and _tail_significance(number, data, fit, terms, factor) < demanded:
            reasons[number] = "stands in single lines and has no tails: a steady tone, hum"
        elif not (
            _has_width(number, gains[number], goodness, by_number)
            or _has_phase_of_force(number, fit, factor, by_number)
        ):
            reasons[number] = "has no width that the lines show, nor the force's phase: a steady tone, hum"
    return reasons


def _is_narrow(data: WeightedLines, fit: RefinedPoles) -> BoolArray:
    """Mark the poles whose peak, as the lines see it, is no wider than that of a tone."""
    return np.asarray(data.s.real[0] - fit.poles.real < WIDEST * np.median(np.diff(data.s.imag)))


def _tail_significance(
    number: int, data: WeightedLines, fit: RefinedPoles, terms: SmoothTerms, factor: FloatArray
) -> float:
    """Compare what a pole takes off the misfit outside its lobe with what the BIC demands for it."""
    reach = LOBE * np.median(np.diff(data.s.imag))
    inside = np.abs(data.s.imag - fit.poles[number].imag) < reach
    n_outside = int(np.count_nonzero(~inside))
    if not inside.any() or 2 * n_outside <= fit.system.U.shape[1]:
        return np.inf
    gains = pole_gains(without_lines(fit.system, data, terms, inside), [number])
    return float(over_bic(gains / factor, 2 * n_outside)[0])


def _has_width(number: int, gains: FloatArray, goodness: GoodnessOfFit, by_number: float) -> bool:
    """Compare the damping with its error, to which each FRF adds as it shows the pole."""
    factor = goodness.factor[number]
    level = np.sum(gains * factor) / max(np.sum(gains), np.finfo(float).tiny)
    return bool(goodness.damping_std[number] ** -2 * np.median(factor) > by_number * level)


def _has_phase_of_force(number: int, fit: RefinedPoles, factor: FloatArray, by_number: float) -> bool:
    """Compare imaginary residues with residues of any phase, in the FRFs that show the pole."""
    if fit.system.real_modes:
        return True
    first, count = fit.system.n_smooth, fit.system.n_poles
    real, imag = first + number, first + count + number
    both, real_part = column_gains(fit.system, [[real, imag], [real]]) / factor
    shows = both > 2 * by_number
    return bool(np.sum(real_part[shows]) < np.count_nonzero(shows) * by_number)
