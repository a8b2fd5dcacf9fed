"""Which modes there are: poles added where the misfit has peaks, dropped where they are not significant."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
from frf_ipz.identification.likelihood.compression import response
from frf_ipz.identification.likelihood.refinement import RefinedPoles, refine_poles
from frf_ipz.identification.measured_lines import WeightedLines
from frf_ipz.identification.options import NEAR_PIN
from frf_ipz.identification.search.drift import Drift, find_drift
from frf_ipz.identification.search.force_error import ForceError, find_force_error, share_beyond_known_noise
from frf_ipz.identification.search.goodness_of_fit import (
    GoodnessOfFit,
    assess_fit,
    demanded_by_bic,
    missing_poles,
    over_bic,
)
from frf_ipz.identification.search.hum import find_hum
from frf_ipz.identification.search.spurious_poles import DEMANDED, find_spurious_poles, half_widths_apart
from frf_ipz.rational import damping_ratio, natural_frequency_hz

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms
    from frf_ipz.identification.options import FitOptions

ROUNDS = 8  # of adding poles
CLEARED = 0.6  # times the misfit before: poles that were refused then may be proposed again
ROUGH_ITERATIONS = 12  # of a fit whose poles are still to be judged
UNCERTAIN = 0.3  # relative standard deviation of a damping above which a pole is not determined
SURE = 6.0  # times what the BIC demands: such a pole stays even where its damping is uncertain
MODEL_ERROR = 1.7  # mean square of the misfit over that of noise, above which the model is to blame
PIN_REASON = "the user says that a mode is here"  # of a pin without a reason
FORCE_REASON = "an error of the force that is smooth over the lines explains the misfit as well"
NEAR_REFUSED = 2.0  # half widths within which a refused pole is not proposed again


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SelectedModes:
    """The fit with the modes that the lines support.

    Parameters
    ----------
    data : WeightedLines
        The fitted lines: FRFs moved to their mean frequencies where the structure drifted.
    drift : Drift or None
        The drift, where there is one.
    force_error : ForceError or None
        The error of the force that FRFs share, where there is one: it is taken off the FRFs.
    fit : RefinedPoles
        Poles and residues.
    goodness : GoodnessOfFit
        Of this fit.
    decisions : tuple of dict
        Poles that were added, dropped, pinned and rejected, with the reason.
    """

    data: WeightedLines
    drift: Drift | None
    force_error: ForceError | None
    fit: RefinedPoles
    goodness: GoodnessOfFit
    decisions: tuple[dict[str, object], ...]


@dataclass(slots=True, kw_only=True, eq=False)
class _Search:
    """State of the search: the fitted lines, and the decisions so far."""

    data: WeightedLines
    terms: SmoothTerms
    pinned: tuple[tuple[float, str], ...]
    rejected: tuple[tuple[float, str], ...]
    noise_is_known: bool
    noise_is_trusted: bool = True
    drift: Drift | None = None
    force_error: ForceError | None = None
    refused: list[complex] = field(default_factory=list)
    decisions: list[dict[str, object]] = field(default_factory=list)

    def record(self, poles: ComplexArray, action: str, reasons: list[str]) -> None:
        for pole, reason in zip(poles, reasons, strict=True):
            hz, ratio = float(natural_frequency_hz(pole[None])[0]), float(damping_ratio(pole[None])[0])
            self.decisions.append({"frequency_hz": hz, "damping_ratio": ratio, "action": action, "reason": reason})


def select_modes(
    data: WeightedLines,
    poles: ComplexArray,
    terms: SmoothTerms,
    options: FitOptions,
    *,
    noise_is_known: bool,
    drift: Drift | None = None,
) -> SelectedModes:
    """Find the modes that the lines support.

    Parameters
    ----------
    data : WeightedLines
        Lines and weights.
    poles : (n_poles,) complex array
        Start poles, rad/s.
    terms : SmoothTerms
        Terms for modes out of band.
    options : FitOptions
        Poles that are pinned and rejected.
    noise_is_known : bool
        All FRFs came with their variance.
    drift : Drift, optional
        That has been taken off the lines; it is looked for by default.

    Returns
    -------
    SelectedModes
        The fit.
    """
    search = _search(data, terms, options, noise_is_known=noise_is_known)
    search.drift = drift
    poles = _with_pinned(search, _without_rejected(search, poles))
    # start poles are not many, and neither errors of strong modes nor tails of weak ones show yet
    start = refine_poles(data, poles, terms, iterations=ROUGH_ITERATIONS)
    fit, goodness = _without_force_error(search, *_add_and_drop(search, start))
    return SelectedModes(
        data=search.data,
        drift=search.drift,
        force_error=search.force_error,
        fit=fit,
        goodness=goodness,
        decisions=tuple(search.decisions),
    )


def drop_insignificant(
    data: WeightedLines, fit: RefinedPoles, terms: SmoothTerms, options: FitOptions, *, noise_is_known: bool
) -> tuple[RefinedPoles, GoodnessOfFit, tuple[dict[str, object], ...]]:
    """Drop the poles that the lines do not ask for, as they are weighed now.

    Parameters
    ----------
    data : WeightedLines
        Lines and weights.
    fit : RefinedPoles
        A fit to them.
    terms : SmoothTerms
        Terms for modes out of band.
    options : FitOptions
        Poles that are pinned and rejected.
    noise_is_known : bool
        All FRFs came with their variance.

    Returns
    -------
    fit : RefinedPoles
        The same where nothing was dropped, else roughly refined.
    goodness : GoodnessOfFit
        Of that fit.
    decisions : tuple of dict
        Poles that were dropped, with the reason.
    """
    search = _search(data, terms, options, noise_is_known=noise_is_known)
    fit, goodness = _drop_insignificant(search, fit, spurious_too=False)
    return fit, goodness, tuple(search.decisions)


def _search(data: WeightedLines, terms: SmoothTerms, options: FitOptions, *, noise_is_known: bool) -> _Search:
    rejected = tuple((pole.hz, pole.why) for pole in options.strike)
    pinned = tuple((pole.hz, pole.why) for pole in options.pinned)
    return _Search(data=data, terms=terms, pinned=pinned, rejected=rejected, noise_is_known=noise_is_known)


def _add_and_drop(search: _Search, start: RefinedPoles) -> tuple[RefinedPoles, GoodnessOfFit]:
    search.noise_is_trusted = search.noise_is_known
    fit, goodness = _drop_insignificant(search, start, spurious_too=False)
    in_vain = np.zeros(0, complex)  # proposed beside the same fit before
    for number in range(ROUNDS):
        fit, goodness = _without_drift(search, fit, goodness, is_start=number == 0)
        proposed = _proposed_poles(search, goodness)[: _room(search, fit)]
        if not len(proposed) or np.array_equal(proposed, in_vain):
            break
        trial = refine_poles(
            search.data, np.concatenate([fit.poles, proposed]), search.terms, iterations=ROUGH_ITERATIONS
        )
        search.refused.extend(trial.discarded.tolist())
        trial, trial_goodness = _drop_insignificant(search, trial)
        if len(trial.poles) <= len(fit.poles) and trial.misfit > fit.misfit:
            in_vain = proposed
            continue
        in_vain = in_vain[:0]
        if trial.misfit < CLEARED * fit.misfit:
            search.refused.clear()  # they were compared with a misfit that was not noise
        search.record(*_added_poles(fit.poles, trial.poles))
        fit, goodness = trial, trial_goodness
    search.noise_is_trusted = search.noise_is_known and bool(np.median(goodness.level) < MODEL_ERROR)
    return _drop_insignificant(search, fit)


def _without_force_error(
    search: _Search, fit: RefinedPoles, goodness: GoodnessOfFit
) -> tuple[RefinedPoles, GoodnessOfFit]:
    """Take the error of the force off where poles stand that it could make, and it explains the lines better.

    Where the misfit is more than noise, it is left alone: what a structure does by itself would be taken for it. A pole
    that the known noise of the force is likely to make goes in any case: beside a null of the force that noise is more
    than a factor, and part of it stays.
    """
    if not search.noise_is_trusted:
        return fit, goodness
    beyond_noise = goodness.drops * share_beyond_known_noise(search.data, fit, search.terms)[:, None]
    is_noise = (over_bic(beyond_noise, 2 * len(search.data.s)) < 1) & ~_is_pinned(search, fit.poles)
    doubts = np.where(is_noise, np.inf, _doubts(search, fit, goodness))
    # where the model does not follow to the noise, its level is that of the noise: of the lines, and of FRFs
    level = np.log(goodness.level) / 2
    of_frfs = level.mean(axis=0) - level.mean()  # one that is missed is no error of all
    weighed = replace(
        search.data,
        profile=search.data.profile / np.exp(level.mean(axis=1)),
        gain=search.data.gain / np.exp(of_frfs),
    )
    found = _error_beside_best_poles(search, weighed, fit, goodness, doubts)  # without what is noise
    if found is None:
        return fit, goodness
    error, beside = found
    corrected = replace(
        search,
        data=replace(search.data, receptance=error.receptance),
        force_error=error,
        refused=fit.poles[is_noise].tolist(),
        decisions=list(search.decisions),
    )
    other = refine_poles(corrected.data, beside.poles, search.terms, iterations=ROUGH_ITERATIONS)
    other, other_goodness = _add_and_drop(corrected, other)
    n_numbers = 2 * len(level)
    before = _misfit(search, weighed, fit) + np.sum(demanded_by_bic(goodness, n_numbers))
    after = _misfit(corrected, weighed, other) + np.sum(demanded_by_bic(other_goodness, n_numbers)) + error.cost
    if after > before and not is_noise.any():
        return fit, goodness
    gone, _, _ = _added_poles(other.poles, fit.poles)
    corrected.record(gone, "dropped", [FORCE_REASON] * len(gone))
    search.data, search.drift, search.force_error = corrected.data, corrected.drift, error
    search.decisions, search.refused = corrected.decisions, corrected.refused
    return other, other_goodness


def _error_beside_best_poles(
    search: _Search, weighed: WeightedLines, fit: RefinedPoles, goodness: GoodnessOfFit, doubts: FloatArray
) -> tuple[ForceError, RefinedPoles] | None:
    """Find the error of the force beside the poles, the surest first, that explain the lines best together with it."""
    n_doubtful = int(np.count_nonzero(doubts > 0))
    if not 0 < n_doubtful < len(doubts):
        return None
    order = np.argsort(doubts)
    demanded = demanded_by_bic(goodness, 2 * len(weighed.s))
    best, least, last = None, np.inf, 0
    for count in range(len(order) - n_doubtful, len(order) + 1 - int(np.isinf(doubts).sum())):
        chosen = order[:count]
        some = refine_poles(search.data, fit.poles[chosen], search.terms, iterations=ROUGH_ITERATIONS)
        some = refine_poles(weighed, some.poles, search.terms, iterations=0)
        found = find_force_error(weighed, some, search.terms)
        length = (found[1].misfit + found[0].cost if found else some.misfit) + demanded[chosen].sum()
        if length < least:
            best, least, last = found, length, count
        elif count > last + 1:  # no better with one more and with two
            break
    return best


def _misfit(search: _Search, weighed: WeightedLines, fit: RefinedPoles) -> float:
    """Weigh the misfit with other weights than those it was fitted by."""
    misfit = search.data.receptance - response(fit.system, search.terms, weighed.s)
    return float(np.sum(np.abs(misfit * weighed.weight) ** 2))


def _without_rejected(search: _Search, poles: ComplexArray) -> ComplexArray:
    for hz, why in search.rejected:
        is_meant = np.array([_is_near(pole, hz) for pole in poles], bool)
        rejected = poles[is_meant] if is_meant.any() else np.array([2j * np.pi * hz])  # recorded even without a pole
        search.record(rejected, "rejected", [why] * len(rejected))
    return poles[~_is_rejected(search, poles)]


def _is_rejected(search: _Search, poles: ComplexArray) -> BoolArray:
    return np.array([any(_is_near(pole, hz) for hz, _ in search.rejected) for pole in poles], bool)


def _is_near(pole: complex, hz: float) -> bool:
    return abs(abs(pole) / (2 * np.pi) - hz) < NEAR_PIN * hz


def _with_pinned(search: _Search, poles: ComplexArray) -> ComplexArray:
    for hz, why in search.pinned:
        omega = 2 * np.pi * hz
        if not any(_is_near(pole, hz) for pole in poles):
            poles = np.append(poles, omega * complex(-0.01, 1.0))
        search.record(np.array([omega * 1j]), "pinned", [why or PIN_REASON])
    return poles


def _is_pinned(search: _Search, poles: ComplexArray) -> BoolArray:
    """Mark the pole nearest to each pinned frequency."""
    is_pinned = np.zeros(len(poles), bool)
    for hz, _ in search.pinned:
        if len(poles):
            is_pinned[np.argmin(np.abs(natural_frequency_hz(poles) - hz))] = True
    return is_pinned


def _drop_insignificant(
    search: _Search, fit: RefinedPoles, *, spurious_too: bool = True
) -> tuple[RefinedPoles, GoodnessOfFit]:
    """Drop poles that are not significant, the weakest half of them at a time: one may have hidden another."""
    best = None
    while True:
        goodness = assess_fit(search.data, fit, search.terms, best=best)
        if spurious_too and not search.noise_is_trusted:
            best = best or goodness
        rejected = _is_rejected(search, fit.poles)
        uncertain = (goodness.damping_std > UNCERTAIN) & (goodness.significance < SURE)
        weak = ((goodness.significance < 1) | uncertain) & ~goodness.is_needed
        spurious = _spurious_reasons(search, fit, goodness) if spurious_too else [""] * len(fit.poles)
        dropped = rejected | (
            (weak | np.array([bool(reason) for reason in spurious], bool)) & ~_is_pinned(search, fit.poles)
        )
        if not dropped.any():
            return fit, goodness
        dropped &= rejected | (goodness.significance <= np.median(goodness.significance[dropped]))
        reasons = [_reason(goodness, number, spurious[number]) for number in np.flatnonzero(dropped).tolist()]
        search.record(fit.poles[dropped], "dropped", reasons)
        search.refused.extend(fit.poles[dropped].tolist())
        fit = refine_poles(search.data, fit.poles[~dropped], search.terms, iterations=ROUGH_ITERATIONS)


def _doubts(search: _Search, fit: RefinedPoles, goodness: GoodnessOfFit) -> FloatArray:
    """Measure how doubtful poles are where errors are as smooth over the lines as the pole is: above 0 where they are.

    In time a pole decays, and such errors stand in the same short time. So their size there is not known by that of
    all other times: only the few numbers of that time tell it. Where a pole's square over that of noise is
    ``x exp(-2 a t)``, it then takes off ``log(1 + x exp(-2 a t))``, and over all times a dilogarithm.
    """
    s = search.data.s
    times = (s.imag[-1] - s.imag[0]) / (2 * np.pi) / (2 * (s.real[0] - fit.poles.real))[:, None]
    drops = -2 * times * special.spence(1 + goodness.drops / (2 * times))
    doubts = SURE - over_bic(drops, 2 * len(s))
    return np.asarray(np.where(_is_pinned(search, fit.poles), np.minimum(doubts, 0.0), doubts))


def _spurious_reasons(search: _Search, fit: RefinedPoles, goodness: GoodnessOfFit) -> list[str]:
    demanded = 1.0 if search.noise_is_trusted else DEMANDED
    hum = find_hum(search.data, fit, search.terms, goodness, demanded=demanded)
    if search.noise_is_trusted:
        return hum
    drift_reach = search.drift.reach if search.drift else 0.0
    by_mode = find_spurious_poles(search.data, fit, goodness, drift_reach=drift_reach)
    return [first or second for first, second in zip(by_mode, hum, strict=True)]


def _reason(goodness: GoodnessOfFit, number: int, spurious: str) -> str:
    if goodness.significance[number] < 1:
        return f"makes the misfit smaller by {goodness.significance[number]:.2g} times what the BIC demands of a mode"
    if not spurious and goodness.damping_std[number] > UNCERTAIN:
        return f"its damping is uncertain by {100 * goodness.damping_std[number]:.2g} %"
    return spurious


def _without_drift(
    search: _Search, fit: RefinedPoles, goodness: GoodnessOfFit, *, is_start: bool
) -> tuple[RefinedPoles, GoodnessOfFit]:
    if search.drift:
        return fit, goodness
    beside_modes = _drift_beside_modes(search, fit, goodness) if is_start else None
    drift_and_fit = beside_modes or find_drift(search.data, fit, search.terms)
    if drift_and_fit is None:
        return fit, goodness
    search.drift, fit_without_drift = drift_and_fit
    search.data = replace(search.data, receptance=search.drift.receptance)
    search.refused.clear()
    return _drop_insignificant(search, fit_without_drift)


def _drift_beside_modes(
    search: _Search, fit: RefinedPoles, goodness: GoodnessOfFit
) -> tuple[Drift, RefinedPoles] | None:
    """Find the drift with one pole a peak, if it explains more: others there may stand for it, at more numbers each."""
    weaker = (half_widths_apart(fit.poles) < 1) & (goodness.significance > goodness.significance[:, None])
    shares_peak = weaker.any(axis=1) & ~_is_pinned(search, fit.poles)
    if not shares_peak.any():
        return None
    one_a_peak = refine_poles(search.data, fit.poles[~shares_peak], search.terms, iterations=ROUGH_ITERATIONS)
    found = find_drift(search.data, one_a_peak, search.terms)
    return found if found is not None and found[1].misfit < fit.misfit else None


def _proposed_poles(search: _Search, goodness: GoodnessOfFit) -> ComplexArray:
    proposed: list[complex] = []
    for pole in np.concatenate(missing_poles(goodness)):
        is_double = any(abs(known - pole) < NEAR_REFUSED * -pole.real for known in proposed)
        was_refused = any(
            abs(known.imag - pole.imag) < NEAR_REFUSED * max(-pole.real, -known.real) for known in search.refused
        )
        if not (is_double or was_refused):
            proposed.append(complex(pole))
    poles = np.array(proposed, complex)
    return poles[~_is_rejected(search, poles)]


def _room(search: _Search, fit: RefinedPoles) -> int:
    """Count the poles for which the lines have as many numbers as they have unknowns, besides those of a fit."""
    each = (1 if search.data.real_modes else 2) + 2  # a residue and a pole
    return max(0, (2 * len(search.data.s) - search.terms.n_columns) // each - len(fit.poles))


def _added_poles(before: ComplexArray, after: ComplexArray) -> tuple[ComplexArray, str, list[str]]:
    new = after
    if len(before):
        new = after[np.min(np.abs(after[:, None] - before), axis=1) > -after.real]
    return new, "added", ["the misfit had a peak here that noise does not make"] * len(new)
