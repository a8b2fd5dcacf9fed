"""Drift between recordings: all natural frequencies of an FRF off by one factor, as temperature or support change.

A common factor per FRF moves poles in proportion to themselves. Gauss-Newton steps find it with the information that
the poles are fitted by. Where it explains much of the misfit, each FRF is moved to the mean frequencies by what the
model says: ``h(s) - h(s / (1 + drift))`` is added to it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.identification.likelihood.compression import Compressed, response
from frf_ipz.identification.likelihood.refinement import Refined, pole_jacobian, refine
from frf_ipz.identification.measured_lines import Weighted

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms

ROUNDS = 8
SETTLED = 0.3  # standard deviations
LARGEST = 2e-3  # a larger change is no drift but another structure
WORTH = 0.3  # part of the excess misfit that the factors must explain
ITERATIONS = 6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drift:
    """Change of frequencies between FRFs.

    Parameters
    ----------
    relative : (n_frfs,) array
        Change of all natural frequencies in each FRF, relative, of mean zero over FRFs unless the poles are held.
    std : (n_frfs,) array
        Its standard deviation, from the noise alone.
    moved : (n_lines, n_frfs) complex array
        The receptances at the mean frequencies, m/N.
    """

    relative: FloatArray
    std: FloatArray
    moved: ComplexArray


def find_drift(
    data: Weighted, fit: Refined, terms: SmoothTerms, *, poles_are_held: bool = False
) -> tuple[Drift, Refined] | None:
    """Find the drift between FRFs, if there is one.

    Parameters
    ----------
    data : Weighted
        Lines and weights.
    fit : Refined
        A fit without drift.
    terms : SmoothTerms
        What lies out of band.
    poles_are_held : bool
        Poles come from elsewhere: the drift is against them, and one FRF is enough.

    Returns
    -------
    (Drift, Refined) or None
        The drift and the fit to the moved FRFs; None where it does not explain the misfit.
    """
    n_frfs = data.receptance.shape[1]
    if (n_frfs < 2 and not poles_are_held) or not len(fit.poles):
        return None
    step, std = stretches(fit.system)
    demanded = n_frfs * np.log(2 * data.receptance.size)
    if np.sum((step / std) ** 2) < demanded:
        return None
    relative, best, moved = np.zeros(n_frfs), fit, data.receptance
    for _ in range(ROUNDS):
        relative = relative + step
        if not poles_are_held:
            relative = relative - np.average(relative, weights=std**-2)
        if np.abs(relative).max() > LARGEST:
            return None
        moved = _moved(data, best.system, terms, relative)
        steps = 0 if poles_are_held else ITERATIONS
        best = refine(replace(data, receptance=moved), best.poles, terms, iterations=steps)
        step, std = stretches(best.system)
        if not poles_are_held:
            step = step - np.average(step, weights=std**-2)
        if np.all(np.abs(step) < SETTLED * std):
            break
    excess = max(fit.misfit - 2 * data.receptance.size, 1.0)
    gain = fit.misfit - best.misfit
    if gain < demanded or gain < WORTH * excess:
        return None
    return Drift(relative=relative, std=std, moved=moved), best


def _moved(data: Weighted, system: Compressed, terms: SmoothTerms, relative: FloatArray) -> ComplexArray:
    moved = data.receptance + response(system, terms, data.s)
    for frf, change in enumerate(relative):
        moved[:, frf] -= response(system, terms, data.s / (1 + change))[:, frf]
    return moved


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
