"""Drift between recordings: all natural frequencies of an FRF off by one factor, as temperature or support change.

A common factor per FRF moves poles in proportion to themselves. Gauss-Newton steps find it with the information that
the poles are fitted by. Where it explains much of the misfit, each FRF is moved to the mean frequencies by the
model: ``h(s) - h(s / (1 + drift))`` is added to it.

The FRFs are draws of a structure that wavers, so that their mean is that of random effects: each weighs by one over the
variance of the drift plus that of its noise, and the mean is known to no more than that allows [DerSimonian1986].

[DerSimonian1986] R. DerSimonian, N. Laird, Meta-analysis in clinical trials, Controlled Clinical Trials 7, 1986,
177-188, doi:10.1016/0197-2456(86)90046-2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.identification.likelihood.compression import CompressedSystem, model_columns, response
from frf_ipz.identification.likelihood.refinement import RefinedPoles, pole_jacobian, refine_poles
from frf_ipz.identification.measured_lines import WeightedLines
from frf_ipz.numerics.partial_fractions import unstacked

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms

ROUNDS = 8
CONVERGED = 0.3  # standard deviations
MAX_DRIFT = 2e-3  # a larger change is no drift but another structure
MIN_EXPLAINED = 0.3  # part of the excess misfit that the factors must explain
PREDICTED = 0.1  # of that the first step must predict: too little, where the drift exceeds a peak's width
ITERATIONS = 6
BEYOND = 0.01  # chance that two moments of the drift are further apart


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drift:
    """Change of frequencies between FRFs.

    Parameters
    ----------
    relative_change : (n_frfs,) array
        Change of all natural frequencies in each FRF, relative, of mean zero over FRFs unless the poles are held.
    std : (n_frfs,) array
        Its standard deviation, from the noise alone.
    receptance : (n_lines, n_frfs) complex array
        The receptances at the mean frequencies, m/N.
    mean_std : float
        Standard deviation of the mean of the changes, common to all frequencies; 0 where the poles are held.
    """

    relative_change: FloatArray
    std: FloatArray
    receptance: ComplexArray
    mean_std: float

    @property
    def reach(self) -> float:
        """Relative change between two further moments, which it exceeds once in a hundred, by Student's distribution.

        The structure wavers while the impacts of one FRF are averaged as it does between FRFs.
        """
        return float(np.sqrt(2) * np.std(self.relative_change, ddof=1) * stdtrit(len(self.std) - 1, 1 - BEYOND / 2))


def find_drift(
    data: WeightedLines, fit: RefinedPoles, terms: SmoothTerms, *, poles_are_held: bool = False
) -> tuple[Drift, RefinedPoles] | None:
    """Find the drift between FRFs, if there is one.

    Parameters
    ----------
    data : WeightedLines
        Lines and weights.
    fit : RefinedPoles
        A fit without drift.
    terms : SmoothTerms
        Terms for modes out of band.
    poles_are_held : bool
        Poles are given: the drift is against them, and one FRF is enough.

    Returns
    -------
    (Drift, RefinedPoles) or None
        The drift and the fit to the moved FRFs; None where it does not explain the misfit.
    """
    n_frfs = data.receptance.shape[1]
    if (n_frfs < 2 and not poles_are_held) or not len(fit.poles):
        return None
    step, std = frequency_changes(fit.system)
    penalty = n_frfs * np.log(2 * data.receptance.size)
    excess = max(fit.misfit - 2 * data.receptance.size, 1.0)
    predicted = np.sum((step / std) ** 2)
    if predicted < max(penalty, PREDICTED * MIN_EXPLAINED * excess):
        return None
    change, best, receptance = np.zeros(n_frfs), fit, data.receptance
    for _ in range(ROUNDS):
        change = change + step
        if not poles_are_held:
            change = change - np.average(change, weights=_weights(change, std))
        if np.abs(change).max() > MAX_DRIFT:
            return None
        receptance = _at_mean_frequencies(data, best.system, terms, change)
        steps = 0 if poles_are_held else ITERATIONS
        best = refine_poles(replace(data, receptance=receptance), best.poles, terms, iterations=steps)
        step, std = frequency_changes(best.system)
        if not poles_are_held:
            step = step - np.average(step, weights=_weights(change + step, std))
        if np.all(np.abs(step) < CONVERGED * std):
            break
    gain = fit.misfit - best.misfit
    if gain < penalty or gain < MIN_EXPLAINED * excess:
        return None
    mean_std = 0.0 if poles_are_held else float(_weights(change, std).sum() ** -0.5)
    return Drift(relative_change=change, std=std, receptance=receptance, mean_std=mean_std), best


def _weights(change: FloatArray, std: FloatArray) -> FloatArray:
    """Weigh changes by the variance of the drift and of their noise, (n_frfs,)."""
    drift = max(float(np.var(change, ddof=1) - np.mean(std**2)), 0.0)
    return np.asarray(1 / (drift + std**2))


def _at_mean_frequencies(
    data: WeightedLines, system: CompressedSystem, terms: SmoothTerms, relative_change: FloatArray
) -> ComplexArray:
    coefficients = system.coefficients()
    moved = [
        unstacked(model_columns(data.s / (1 + change), system.poles, terms, real_modes=system.real_modes) @ of_frf)
        for change, of_frf in zip(relative_change.tolist(), coefficients, strict=True)
    ]
    return np.asarray(data.receptance + response(system, terms, data.s) - np.stack(moved, axis=1))


def frequency_changes(system: CompressedSystem) -> tuple[FloatArray, FloatArray]:
    """One step towards the relative change of frequencies in each FRF.

    Parameters
    ----------
    system : CompressedSystem
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
