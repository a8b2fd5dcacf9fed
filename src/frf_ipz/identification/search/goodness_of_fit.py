"""How well a model explains the lines, and which of its poles the lines ask for.

The misfit is measured against the noise that was recorded. Where a model cannot follow to the noise (a structure that
is not linear, or drifts), the level of the misfit takes the place of the noise, line by line; and where errors of
neighbouring lines are correlated, the level of matches of a pole's own width: otherwise such errors would be explained
by ever more poles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
from frf_ipz.identification.likelihood.compression import CompressedSystem, column_gains, response
from frf_ipz.identification.measured_lines import WeightedLines
from frf_ipz.identification.noise import smooth_level
from frf_ipz.identification.search.candidates import Candidates, find_candidates
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.optimize import linear_sum_assignment

    from frf_ipz.identification.likelihood.refinement import RefinedPoles
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms
else:
    linear_sum_assignment = import_late("scipy.optimize", "linear_sum_assignment")

LEVEL_SCATTER = 1.6  # a level found from one block of lines exceeds its expectation by this about once in a thousand
FAR = 10.0  # mean square of the misfit over that of noise, above which modes are missing
NEEDED = 0.02  # part of such a misfit that a pole must take off to stay
GROWTH = 3  # at most two candidates, and one more for so many poles that there are


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GoodnessOfFit:
    """How a fit compares with the noise, and each of its poles with the misfit.

    Parameters
    ----------
    frequency_hz : (n_lines,) array
        Lines, Hz.
    misfit : (n_lines, n_frfs) complex array
        Measured minus model; each part has variance one where it is noise.
    level : (n_lines, n_frfs) array
        Mean square of the misfit over that of noise, at least 1.
    candidates : Candidates
        Poles that may be missing, from the misfit over its level.
    significance : (n_poles,) array
        What each pole takes off minus twice the log likelihood, over what the BIC demands for it.
    damping_std : (n_poles,) array
        Standard deviation of each damping, relative.
    factor : (n_poles, n_frfs) array
        Level of the misfit at each pole, over that of white noise: what its gains are divided by.
    drops : (n_poles, n_frfs) array
        What each pole takes off minus twice the log likelihood of each FRF, over `factor`.
    is_needed : (n_poles,) bool array
        The model is far from the lines, and would be clearly farther without the pole: whatever its significance, which
        suffers from the modes that are still missing.
    """

    frequency_hz: FloatArray
    misfit: ComplexArray
    level: FloatArray
    candidates: Candidates
    significance: FloatArray
    damping_std: FloatArray
    factor: FloatArray
    drops: FloatArray
    is_needed: BoolArray

    def of_poles(self, before: ComplexArray, after: ComplexArray) -> GoodnessOfFit:
        """Keep what belongs to the poles that a further refinement has left.

        Parameters
        ----------
        before : (n_poles,) complex array
            Poles that were assessed, rad/s.
        after : (n,) complex array
            What became of them; some may have been discarded.

        Returns
        -------
        GoodnessOfFit
            With one row a pole of `after`.
        """
        kept = linear_sum_assignment(np.abs(after[:, None] - before) / np.abs(before))[1]
        return replace(
            self,
            **{
                name: getattr(self, name)[kept]
                for name in ("significance", "damping_std", "factor", "drops", "is_needed")
            },
        )


def assess_fit(
    data: WeightedLines, fit: RefinedPoles, terms: SmoothTerms, *, best: GoodnessOfFit | None = None
) -> GoodnessOfFit:
    """Compare a fit with the noise, and each of its poles with the misfit.

    Parameters
    ----------
    data : WeightedLines
        Lines and weights.
    fit : RefinedPoles
        The fit.
    terms : SmoothTerms
        Terms for modes out of band.
    best : GoodnessOfFit, optional
        Of a fit with more poles: its level is the part that the model cannot follow. Otherwise each pole that is
        dropped would raise the level that the next one is compared with.

    Returns
    -------
    GoodnessOfFit
        Candidates for missing poles, and the significance of those that the fit has.
    """
    misfit = (data.receptance - response(fit.system, terms, data.s)) * data.weight
    level = smooth_level(np.abs(misfit) ** 2) / 2
    level = np.where(level > LEVEL_SCATTER, level, 1.0)
    frequency = data.s.imag / (2 * np.pi)
    over_level = find_candidates(frequency, misfit / np.sqrt(level), _max_count(len(fit.poles)))
    model_error, correlation = (level, over_level) if best is None else (best.level, best.candidates)
    factor = _level_at_poles(data, fit.poles, model_error) * correlation.level_at(fit.poles)[:, None]
    gains = pole_gains(fit.system)
    modes_are_missing = fit.misfit > FAR * 2 * data.receptance.size
    return GoodnessOfFit(
        frequency_hz=frequency,
        misfit=misfit,
        level=level,
        candidates=over_level,
        significance=over_bic(gains / factor, 2 * len(data.s)),
        damping_std=_damping_std(fit) * np.sqrt(np.median(factor, axis=1)),
        factor=factor,
        drops=gains / factor,
        is_needed=modes_are_missing & (gains.sum(axis=1) > NEEDED * fit.misfit),
    )


def missing_poles(goodness: GoodnessOfFit) -> tuple[ComplexArray, ...]:
    """Find the poles that may be missing in a fit.

    Parameters
    ----------
    goodness : GoodnessOfFit
        Of the fit.

    Returns
    -------
    tuple of complex arrays
        rad/s, the strongest first: from the misfit as it is, where it is above its level, and from that over its level.
    """
    over_level = goodness.candidates.poles
    if not (goodness.level > 1).any():
        return (over_level,)
    max_count = _max_count(len(goodness.significance))
    return find_candidates(goodness.frequency_hz, goodness.misfit, max_count).poles, over_level


def _max_count(n_poles: int) -> int:
    return 2 + n_poles // GROWTH


def pole_gains(system: CompressedSystem, poles: Sequence[int] | None = None) -> FloatArray:
    """Find the part of each FRF's misfit that each pole takes off.

    Parameters
    ----------
    system : CompressedSystem
        The fit.
    poles : sequence of int, optional
        Which poles; all by default.

    Returns
    -------
    (n_poles, n_frfs) array
        Increase of minus twice the log likelihood without the pole, the other poles being held.
    """
    first, count = system.n_smooth, system.n_poles
    both = range(1 if system.real_modes else 2)
    asked = range(count) if poles is None else poles
    return column_gains(system, [[first + pole + part * count for part in both] for pole in asked])


def peak_levels(data: WeightedLines, fit: RefinedPoles, misfit: ComplexArray) -> FloatArray:
    """Find how large the misfit is on the lines that determine a pole.

    Parameters
    ----------
    data : WeightedLines
        Lines and weights.
    fit : RefinedPoles
        The fit.
    misfit : (n_lines, n_frfs) complex array
        Over the noise.

    Returns
    -------
    (n_poles,) array
        Mean square over that of noise, lines and FRFs weighed by the square of their slope with the pole.
    """
    slope = np.abs(data.s[:, None] - fit.poles) ** -4
    residues = np.abs(fit.system.residues().T) ** 2
    expected = np.einsum("lp,lp->p", slope, data.weight**2 @ residues)
    observed = np.einsum("lp,lp->p", slope, (data.weight**2 * np.abs(misfit) ** 2 / 2) @ residues)
    return np.asarray(observed / expected)


def over_bic(drops: FloatArray, n_numbers: int) -> FloatArray:
    """Compare what poles take off the misfit with what the BIC demands for them.

    The best subset of FRFs counts: a local mode shows in a few of them, and need not pay for the rest.

    Parameters
    ----------
    drops : (n_poles, n_frfs) array
        What each pole takes off minus twice the log likelihood of each FRF.
    n_numbers : int
        Real numbers that an FRF has.

    Returns
    -------
    (n_poles,) array
        Above 1 where a pole is asked for.
    """
    return np.asarray(np.max(cumulated_drops(drops) / bic_penalty(drops.shape[1], n_numbers), axis=1, initial=0.0))


def demanded_by_bic(goodness: GoodnessOfFit, n_numbers: int) -> FloatArray:
    """Give what the BIC demands of each pole, in the FRFs that show it best.

    Parameters
    ----------
    goodness : GoodnessOfFit
        What the poles take off.
    n_numbers : int
        Real numbers that an FRF has.

    Returns
    -------
    (n_poles,) array
        To be added to minus twice the log likelihood.
    """
    drops = cumulated_drops(goodness.drops)
    penalty = bic_penalty(drops.shape[1], n_numbers)
    return np.asarray(penalty[np.argmax(drops - penalty, axis=1)])


def cumulated_drops(drops: FloatArray) -> FloatArray:
    """Give what a pole takes off in the one, two ... FRFs where it takes off most, (n_poles, n_frfs)."""
    return np.asarray(np.cumsum(-np.sort(-drops, axis=1), axis=1))


def bic_penalty(n_frfs: int, n_numbers: float) -> FloatArray:
    """Give what the BIC demands of a pole that shows in one, two ... FRFs of `n_frfs`, (n_frfs,)."""
    count = np.arange(1, n_frfs + 1)
    return np.asarray((2 * count + 2) * np.log(n_numbers) + 2 * count * np.log(n_frfs / count))


def _level_at_poles(data: WeightedLines, poles: ComplexArray, level: FloatArray) -> FloatArray:
    lines = np.clip(np.searchsorted(data.s.imag, poles.imag), 0, len(level) - 1)
    return np.asarray(level[lines])


def _damping_std(fit: RefinedPoles) -> FloatArray:
    count = len(fit.poles)
    try:
        covariance = np.linalg.inv(fit.information)
    except np.linalg.LinAlgError:
        return np.full(count, np.inf)
    return np.asarray(np.sqrt(np.abs(np.diag(covariance)[:count])) / -fit.poles.real)
