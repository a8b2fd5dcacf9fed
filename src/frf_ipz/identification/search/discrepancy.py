"""Discrepancy: by how much FRFs differ from those of the structure where the noise that was seen does not show it.

The noise in the record of a single impact tells nothing of how the next impact would differ: where it hits, in which
direction, how hard. Such errors are in proportion to the FRF, and common to the lines of a peak, so that neighbouring
lines are no further evidence. An error of relative size e that is common to m lines weighs, in sums over many lines,
as one of the variance ``e^2 m`` in each of them by itself. That enters the variance of the lines, so that selection,
standard deviations and bands follow from it.

Several impacts show it themselves: their scatter is the variance of the FRFs. Where the misfit is larger than that,
it tells the size.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.identification.search.selection import select_modes
from frf_ipz.identification.search.spurious_poles import PEAK

if TYPE_CHECKING:
    from frf_ipz.arrays import BoolArray, ComplexArray
    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms
    from frf_ipz.identification.measured_lines import MeasuredLines
    from frf_ipz.identification.options import FitOptions

# relative scatter of the FRFs of single impacts by hand on one spot: 1.5 to 2.4 % (rms over 500 to 6500 Hz) in the five
# recordings of pyFRF's first showcase, 2016
ONE_IMPACT = 0.02
ROUNDS = 3  # of choosing modes and measuring their widths in turn
SAME_WIDTH = 1.5  # ratio of widths that are the same


def of_one_impact(frfs: FrfSet) -> BoolArray:
    """Tell which FRFs come of one impact, whose scatter cannot be seen.

    Parameters
    ----------
    frfs : FrfSet
        Measured FRFs.

    Returns
    -------
    (n_frfs,) bool array
        True where one record was averaged.
    """
    return np.asarray((frfs.averages == 1) & np.isfinite(frfs.variance).any(axis=0))


def with_discrepancy(
    frfs: FrfSet, lines: MeasuredLines, poles: ComplexArray, terms: SmoothTerms, options: FitOptions
) -> MeasuredLines:
    """Add to the variance of the lines what a single impact does not show.

    Parameters
    ----------
    frfs : FrfSet
        Measured FRFs.
    lines : MeasuredLines
        The lines that are fitted, with the noise that was seen.
    poles : (n_poles,) complex array
        Start poles, rad/s.
    terms : SmoothTerms
        Terms for modes out of band.
    options : FitOptions
        Of the fit.

    Returns
    -------
    MeasuredLines
        With the variance that weighs them.
    """
    alone = of_one_impact(frfs)
    if not alone.any():
        return lines
    power = np.abs(lines.receptance) ** 2 * alone
    width_hz = PEAK * float(np.sqrt(np.prod(lines.band_hz)))
    for _ in range(ROUNDS):
        common_lines = max(1.0, width_hz / lines.line_hz)
        weighed = replace(lines, variance=lines.variance + ONE_IMPACT**2 * common_lines * power)
        data = replace(weighed.weighted(shared=True), real_modes=options.modes == "real")
        found = select_modes(data, poles, terms, options, noise_is_known=bool(lines.known.all())).fit.poles
        inside = found[(np.abs(found) > data.s.imag[0]) & (np.abs(found) < data.s.imag[-1])]
        if not len(inside):
            break
        previous, width_hz = width_hz, float(np.median(-inside.real)) / (2 * np.pi)
        if max(width_hz / previous, previous / width_hz) < SAME_WIDTH:
            break
    return weighed
