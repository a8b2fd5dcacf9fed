"""The probability that a mode is found again in a measurement with half as many lines.

A mode stays in a fit where it takes more off the misfit than the BIC demands. What it takes off half as many lines
follows a noncentral chi-square distribution [Abramowitz1972, 26.4.25 to 26.4.28], whose noncentrality the lines of this
fit tell, as well as its own drop is known. As in the selection, a mode of uncertain damping must take off more, and
misfits that are larger than the noise count as noise. Where the even and the odd lines have been fitted by themselves,
each of the two is an observation beside that expectation.

[Abramowitz1972] M. Abramowitz, I. A. Stegun, Handbook of Mathematical Functions, 10th printing, 1972.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr

from frf_ipz.identification.search.goodness_of_fit import bic_penalty, cumulated_drops
from frf_ipz.identification.search.selection import SURE, UNCERTAIN
from frf_ipz.identification.search.split_half import HALVES

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray, IntArray
    from frf_ipz.identification.search.goodness_of_fit import GoodnessOfFit
    from frf_ipz.identification.search.split_half import SplitHalf


def found_again(goodness: GoodnessOfFit, modes: IntArray, halves: SplitHalf | None) -> FloatArray:
    """Give the probability that each mode is found again.

    Parameters
    ----------
    goodness : GoodnessOfFit
        Of the fit.
    modes : (n_modes,) int array
        Indices of the modes among the poles.
    halves : SplitHalf or None
        The fits of even and of odd lines, where they were made.

    Returns
    -------
    (n_modes,) array
        0 to 1.
    """
    n_lines, n_frfs = len(goodness.frequency_hz) / HALVES, goodness.drops.shape[1]
    count = np.arange(1, n_frfs + 1)
    n_numbers = 2 * count + 2  # residues, and the pole
    here = np.maximum(cumulated_drops(goodness.drops) - n_numbers, 0.0)  # noncentrality, known as its drop is
    mean = n_numbers + here / HALVES
    variance = 2 * (n_numbers + 2 * here / HALVES) + 2 * (n_numbers + 2 * here) / HALVES**2
    penalty = bic_penalty(n_frfs, max(2 * n_lines, 2.0))
    sure, usual = (ndtr((mean - times * penalty) / np.sqrt(variance)).max(axis=1) for times in (SURE, 1.0))
    damping_std = np.sqrt(HALVES) * goodness.damping_std  # relative; it scatters as the damping itself does
    uncertain = ndtr(np.log(damping_std / UNCERTAIN) / damping_std)
    expected = np.asarray(uncertain * sure + (1 - uncertain) * usual)[modes]
    return expected if halves is None else (expected + halves.n_halves[modes]) / (1 + HALVES)
