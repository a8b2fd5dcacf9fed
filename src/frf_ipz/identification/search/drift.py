"""Drift between recordings: all natural frequencies of an FRF off by one factor, as temperature or support change.

A common factor per FRF moves poles in proportion to themselves. One Gauss-Newton step finds it with the information
that the poles are fitted by; where it explains much of the misfit, the lines of each FRF are stretched instead.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.identification.likelihood.refinement import Refined, pole_jacobian, refine

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.compression import Compressed, Weighted
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms

ROUNDS = 6
SETTLED = 0.1  # standard deviations
LARGEST = 2e-3  # a larger change is no drift but another structure
WORTH = 0.3  # part of the excess misfit that the factors must explain
ITERATIONS = 6


def drift_of(data: Weighted, fit: Refined, terms: SmoothTerms) -> FloatArray | None:
    """Find the drift between FRFs, if there is one.

    Parameters
    ----------
    data : Weighted
        Lines and weights.
    fit : Refined
        A fit without drift.
    terms : SmoothTerms
        What lies out of band.

    Returns
    -------
    (n_frfs,) array or None
        Relative change of all natural frequencies, of mean zero; None where it does not explain the misfit.
    """
    n_frfs = data.receptance.shape[1]
    if n_frfs < 2:
        return None
    first, std = stretches(fit.system)
    demanded = n_frfs * np.log(2 * data.receptance.size)
    if np.sum((first / std) ** 2) < demanded:
        return None
    stretch, best = np.zeros(n_frfs), fit
    for _ in range(ROUNDS):
        step, std = stretches(best.system)
        stretch = stretch + step
        stretch = stretch - np.average(stretch, weights=std**-2)
        if np.abs(stretch).max() > LARGEST:
            return None
        best = refine(replace(data, stretch=stretch), best.poles, terms, iterations=ITERATIONS)
        if np.all(np.abs(step) < SETTLED * std):
            break
    excess = max(fit.misfit - 2 * data.receptance.size, 1.0)
    gain = fit.misfit - best.misfit
    return stretch if gain > demanded and gain > WORTH * excess else None


def stretches(system: Compressed) -> tuple[FloatArray, FloatArray]:
    """One step towards the relative change of frequencies in each FRF.

    Parameters
    ----------
    system : Compressed
        The fit.

    Returns
    -------
    step, std : (n_frfs,) array
        The change and its standard deviation.
    """
    poles = system.poles
    slope = pole_jacobian(system) @ np.concatenate([poles.real, poles.imag])
    information = np.einsum("fi,fi->f", slope, slope)
    information = np.maximum(information, np.finfo(float).tiny)
    step = np.einsum("fi,fi->f", slope, system.z[:, system.n_linear :]) / information
    return np.asarray(step), 1 / np.sqrt(information)
