"""Which modes there are: poles added where the misfit has peaks, dropped where they are not significant."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray
from frf_ipz.identification.likelihood.refinement import Refined, refine
from frf_ipz.identification.measured_lines import Weighted
from frf_ipz.identification.search.drift import Drift, find_drift
from frf_ipz.identification.search.goodness_of_fit import Judgement, judge
from frf_ipz.identification.search.spurious_poles import find_artefacts
from frf_ipz.rational import damping_ratio, natural_frequency_hz

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms
    from frf_ipz.identification.options import FitOptions

ROUNDS = 8  # of adding poles
CLEARER = 0.6  # times the misfit before: what was refused then may be proposed again
ROUGH_ITERATIONS = 12  # of a fit whose poles are still to be judged
UNCERTAIN = 0.3  # relative standard deviation of a damping above which a pole says nothing
SURE = 6.0  # times what the BIC demands: such a pole stays even where its damping is uncertain
NEAR_PIN = 0.02  # relative distance up to which a pole is the one that was pinned or struck
MODEL_ERROR = 1.7  # mean square of the misfit over that of noise, above which the model is to blame
SAID = "the user says that a mode is here"  # of a pin without a reason
NEAR_REFUSED = 2.0  # half widths within which a refused pole is not proposed again


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Selected:
    """The fit with the modes that the lines ask for.

    Parameters
    ----------
    data : Weighted
        What was fitted: FRFs moved to their mean frequencies where the structure drifted.
    drift : Drift or None
        The drift, where there is one.
    fit : Refined
        Poles and residues.
    judgement : Judgement
        Of this fit.
    decisions : tuple of dict
        What was added, dropped, pinned and struck.
    """

    data: Weighted
    drift: Drift | None
    fit: Refined
    judgement: Judgement
    decisions: tuple[dict[str, object], ...]


@dataclass(slots=True, kw_only=True, eq=False)
class _Search:
    """The work: what is fitted, and what was decided so far."""

    data: Weighted
    terms: SmoothTerms
    pinned: tuple[tuple[float, str], ...]
    struck: tuple[tuple[float, str], ...]
    trusted: bool
    drift: Drift | None = None
    refused: list[complex] = field(default_factory=list)
    decisions: list[dict[str, object]] = field(default_factory=list)

    def note(self, poles: ComplexArray, action: str, reasons: list[str]) -> None:
        for pole, reason in zip(poles, reasons, strict=True):
            hz, ratio = float(natural_frequency_hz(pole[None])[0]), float(damping_ratio(pole[None])[0])
            self.decisions.append({"frequency_hz": hz, "damping_ratio": ratio, "action": action, "reason": reason})


def select_modes(
    data: Weighted, poles: ComplexArray, terms: SmoothTerms, options: FitOptions, *, noise_is_known: bool
) -> Selected:
    """Find the modes that the lines ask for.

    Parameters
    ----------
    data : Weighted
        Lines and weights.
    poles : (n_poles,) complex array
        Where to start, rad/s.
    terms : SmoothTerms
        What lies out of band.
    options : FitOptions
        Poles that are pinned and struck.
    noise_is_known : bool
        All FRFs came with their variance.

    Returns
    -------
    Selected
        The fit.
    """
    struck = tuple((one.hz, one.why) for one in options.strike)
    pinned = tuple((one.hz, one.why) for one in options.pinned)
    search = _Search(data=data, terms=terms, pinned=pinned, struck=struck, trusted=noise_is_known)
    poles = _pin(search, _strike(search, poles))
    search.trusted = True  # first poles are not many, and errors of strong modes are not told yet
    fit, judgement = _skim(search, refine(data, poles, terms, iterations=ROUGH_ITERATIONS))
    search.trusted = noise_is_known
    for _ in range(ROUNDS):
        fit, judgement = _with_drift(search, fit, judgement)
        proposed = _proposed(search, judgement)
        if not len(proposed):
            break
        trial = refine(search.data, np.concatenate([fit.poles, proposed]), terms, iterations=ROUGH_ITERATIONS)
        search.refused.extend(trial.lost.tolist())
        better, verdict = _skim(search, trial)
        if len(better.poles) <= len(fit.poles) and better.misfit > fit.misfit:
            continue
        if better.misfit < CLEARER * fit.misfit:
            search.refused.clear()  # they were judged against a misfit that was not noise
        search.note(*_added(fit.poles, better.poles))
        fit, judgement = better, verdict
    search.trusted = search.trusted and bool(np.median(judgement.level) < MODEL_ERROR)
    if not search.trusted:
        fit, judgement = _skim(search, fit)
    return Selected(
        data=search.data, drift=search.drift, fit=fit, judgement=judgement, decisions=tuple(search.decisions)
    )


def _strike(search: _Search, poles: ComplexArray) -> ComplexArray:
    for hz, why in search.struck:
        mine = np.array([_is_near(pole, hz) for pole in poles], bool)
        found = poles[mine] if mine.any() else np.array([2j * np.pi * hz])  # remembered even where no pole came up
        search.note(found, "struck", [why] * len(found))
    return poles[~_near_struck(search, poles)]


def _near_struck(search: _Search, poles: ComplexArray) -> BoolArray:
    return np.array([any(_is_near(pole, hz) for hz, _ in search.struck) for pole in poles], bool)


def _is_near(pole: complex, hz: float) -> bool:
    return abs(abs(pole) / (2 * np.pi) - hz) < NEAR_PIN * hz


def _pin(search: _Search, poles: ComplexArray) -> ComplexArray:
    for hz, why in search.pinned:
        omega = 2 * np.pi * hz
        if not any(_is_near(pole, hz) for pole in poles):
            poles = np.append(poles, omega * complex(-0.01, 1.0))
        search.note(np.array([omega * 1j]), "pinned", [why or SAID])
    return poles


def _protected(search: _Search, poles: ComplexArray) -> BoolArray:
    """Mark the pole nearest to each pinned frequency."""
    kept = np.zeros(len(poles), bool)
    for hz, _ in search.pinned:
        if len(poles):
            kept[np.argmin(np.abs(natural_frequency_hz(poles) - hz))] = True
    return kept


def _skim(search: _Search, fit: Refined) -> tuple[Refined, Judgement]:
    """Drop poles that are not significant, the weakest half of them at a time: one may have hidden another."""
    best = None
    while True:
        judgement = judge(search.data, fit, search.terms, best=best)
        best = best if search.trusted else best or judgement
        struck = _near_struck(search, fit.poles)
        uncertain = (judgement.damping_std > UNCERTAIN) & (judgement.significance < SURE)
        weak = ((judgement.significance < 1) | uncertain) & ~judgement.is_needed
        artefacts = [""] * len(fit.poles) if search.trusted else find_artefacts(search.data, fit, judgement)
        bad = struck | (
            (weak | np.array([bool(reason) for reason in artefacts], bool)) & ~_protected(search, fit.poles)
        )
        if not bad.any():
            return fit, judgement
        bad &= struck | (judgement.significance <= np.median(judgement.significance[bad]))
        reasons = [_why(judgement, number) or artefacts[number] for number in np.flatnonzero(bad).tolist()]
        search.note(fit.poles[bad], "dropped", reasons)
        search.refused.extend(fit.poles[bad].tolist())
        fit = refine(search.data, fit.poles[~bad], search.terms, iterations=ROUGH_ITERATIONS)


def _why(judgement: Judgement, number: int) -> str:
    if judgement.significance[number] < 1:
        return f"takes off the misfit {judgement.significance[number]:.2g} of what the BIC demands"
    if judgement.damping_std[number] > UNCERTAIN:
        return f"its damping is known to {judgement.damping_std[number]:.0%} only"
    return ""


def _with_drift(search: _Search, fit: Refined, judgement: Judgement) -> tuple[Refined, Judgement]:
    found = None if search.drift else find_drift(search.data, fit, search.terms)
    if found is None:
        return fit, judgement
    search.drift, moved_fit = found
    search.data = replace(search.data, receptance=search.drift.moved)
    search.refused.clear()
    return _skim(search, moved_fit)


def _proposed(search: _Search, judgement: Judgement) -> ComplexArray:
    chosen: list[complex] = []
    for pole in np.concatenate([one.poles for one in judgement.missing]):
        again = any(abs(other - pole) < NEAR_REFUSED * -pole.real for other in chosen)
        refused = any(
            abs(other.imag - pole.imag) < NEAR_REFUSED * max(-pole.real, -other.real) for other in search.refused
        )
        if not (again or refused):
            chosen.append(complex(pole))
    poles = np.array(chosen, complex)
    return poles[~_near_struck(search, poles)]


def _added(before: ComplexArray, after: ComplexArray) -> tuple[ComplexArray, str, list[str]]:
    new = after
    if len(before):
        new = after[np.min(np.abs(after[:, None] - before), axis=1) > -after.real]
    return new, "added", ["the misfit had a peak here that noise does not make"] * len(new)
