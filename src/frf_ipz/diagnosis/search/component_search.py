"""Finds the causes that explain the measurement best: wide search, refinement, exact fits, steps to neighbours."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from frf_ipz.diagnosis.evidence.fit import Fit
from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
from frf_ipz.diagnosis.search.global_scan import search_among_scatter, wide_search
from frf_ipz.diagnosis.search.neighbourhood_search import (
    CLIMBED,
    GAIN,
    HOPELESS,
    Fits,
    are_alike,
    bar_of,
    climb_all,
    further_around,
)
from frf_ipz.diagnosis.search.robust_refinement import Start, bring_closer, refine_far, spread
from frf_ipz.diagnosis.search.score_test import close_search

CLOSE_FITTED = 14  # hypotheses that are fitted after the close search
PROMISING = 5.0  # nats that a linear step promises: with less, a hypothesis is not fitted
MOST_OF_IT = 0.3  # of the cost of a fit far off: with less, a small effect is not what it lacks
PROMISED_PART = 0.5  # of what a fit gains: what a linear step on fewer points must promise of it
BROKEN, BROKEN_PART = 10.0, 0.5  # nats, and of what a linear step promises: a fit that lacks more begins anew
CLOSE_EACH = 3  # places of an effect that are fitted after the close search
FITTED = 12  # hypotheses that are fitted with large errors
FITTED_EXACTLY, FITTED_HOPELESS = 7, 2
FAR_BEHIND, SLACK = 4.0, 400.0  # times the best one's cost, and nats: such hypotheses are not fitted exactly
CLIMBED_VAINLY = 2  # effects whose neighbours are looked at, where no further cause explains much
VAIN = 0.6  # of the cost of what is known: a fit that leaves more does not explain it
SETTLED = 2  # fits that go on until they converge
AMONG_SCATTER, AMONG_SCATTER_EXACTLY = 12, 3  # effects that stand out beside fitted scatter, and are fitted
EARLY_AROUND = 16  # places further around that are fitted with large errors


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ranking:
    """What a search found.

    Parameters
    ----------
    base : Fit
        What was supposed before: the nominal model, or a cause that is known already.
    fits : tuple of Fit
        Each one more cause, by falling evidence.
    n_tried : int
        Hypotheses that were looked at.
    refined : tuple of Start
        What a wide search led to, by rising cost; empty where none was made.
    """

    base: Fit
    fits: tuple[Fit, ...]
    n_tried: int
    refined: tuple[Start, ...] = ()

    @property
    def best(self) -> Fit:
        """The best place of the most probable effect; the base where nothing was found."""
        return by_effect(self.fits)[0][0] if self.fits else self.base

    @property
    def best_evidence(self) -> float:
        """Evidence of the most probable effect, wherever it is, nats."""
        fits = by_effect(self.fits)[0] if self.fits else (self.base,)
        return float(np.logaddexp.reduce([fit.log_evidence for fit in fits]))


def by_effect(fits: Iterable[Fit]) -> list[tuple[Fit, ...]]:
    """Sort fits by effects: one is as probable as all its places together.

    Parameters
    ----------
    fits : iterable of Fit
        Each with one cause more than is known.

    Returns
    -------
    list of tuple of Fit
        The most probable effect first; of each, the most probable place first.
    """
    groups: dict[str, list[Fit]] = {}
    for fit in sorted(fits, key=lambda fit: -fit.log_evidence):
        groups.setdefault(fit.hypothesis.causes[-1].effect.name, []).append(fit)
    total = {name: float(np.logaddexp.reduce([fit.log_evidence for fit in group])) for name, group in groups.items()}
    return [tuple(groups[name]) for name in sorted(groups, key=lambda name: -total[name])]


def fit_nothing(bench: InferenceProblem) -> Fit:
    """Fit the nominal model with what cannot be known."""
    return bench.fit((), np.zeros(0))


def search(bench: InferenceProblem, base: Fit) -> Ranking:
    """Search for one more cause.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    base : Fit
        What is supposed already.

    Returns
    -------
    Ranking
        All that was fitted.
    """
    n_tried, refined = 0, list[Start]()
    fits: Fits = {}
    if not base.is_nearly_all:
        starts = wide_search(bench, base)
        n_tried += len(starts)
        refined = refine_far(bench, base, starts)
        fits = _fitted(bench, base, refined)
        if all(fit.is_hopeless for fit in fits.values()):
            _add_among_scatter(bench, base, fits)
    if not base.is_hopeless:
        n_tried += _add_close(bench, base, fits)
    if fits and (n_effects := _how_many_climb(base, fits)):
        climb_all(bench, base, fits, n_effects)
    return Ranking(base=base, fits=ranked(bench, fits.values()), n_tried=n_tried, refined=tuple(refined))


def ranked(bench: InferenceProblem, fits: Iterable[Fit]) -> tuple[Fit, ...]:
    """Sort fits by falling evidence; the best ones go on where they have not converged.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    fits : iterable of Fit
        In any order.

    Returns
    -------
    tuple of Fit
        The best first.
    """
    order = sorted(fits, key=lambda fit: -fit.log_evidence)
    bar = bar_of(order)
    settled = [
        fit if fit.converged or fit.is_hopeless or fit.cost > bar else bench.go_on(fit) for fit in order[:SETTLED]
    ]
    return tuple(sorted([*settled, *order[SETTLED:]], key=lambda fit: -fit.log_evidence))


def search_beside(bench: InferenceProblem, base: Fit, least: float) -> Ranking:
    """Search for one more cause that is small: from a fit that leaves nothing to explain but what scatter hides.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    base : Fit
        Nearly right.
    least : float
        nats: what explains less is not fitted.

    Returns
    -------
    Ranking
        Without fits where one linear step promises less of everything.
    """
    fits: Fits = {}
    found = close_search(bench, base)
    for start in _most_promising(found, PROMISED_PART * least):
        _keep_close(bench, base, start, fits)
    if any(fit.log_evidence > base.log_evidence + PROMISED_PART * least for fit in fits.values()):
        climb_all(bench, base, fits, _how_many_climb(base, fits))
    return Ranking(base=base, fits=ranked(bench, fits.values()), n_tried=len(found))


def _add_close(bench: InferenceProblem, base: Fit, fits: Fits) -> int:
    """Fit small effects from where the base is, if one linear step promises something."""
    found = close_search(bench, base)
    starts = _most_promising(found, PROMISING if base.is_nearly_right else MOST_OF_IT * base.cost)
    if not starts and base.is_nearly_right:
        starts = _most_promising(found, -np.inf)[:1]  # how little the best one explains is told
    for start in starts:
        _keep_close(bench, base, start, fits)
    return len(found)


def _most_promising(found: Sequence[Start], least: float) -> list[Start]:
    """Take the best places of each effect that promise so much, nats, and are not far behind the best of all.

    The best place of each comes first: a linear step may promise a small part of what an effect explains.
    """
    starts = sorted(spread(found, CLOSE_EACH), key=lambda start: start.cost)
    firsts = {start.cause.effect.name: start for start in reversed(starts)}
    starts.sort(key=lambda start: start is not firsts[start.cause.effect.name])
    return [start for start in starts[:CLOSE_FITTED] if -start.cost > max(least, -starts[0].cost - HOPELESS)]


def _keep_close(bench: InferenceProblem, base: Fit, start: Start, fits: Fits) -> None:
    """Fit a small effect from where the base is; anew, where that gains much less than one linear step promised."""
    hypothesis = bench.suppose((*base.hypothesis.causes, start.cause))
    values, bar = np.concatenate([base.values, start.values]), bar_of((base, *fits.values()))
    fit = bench.fit_beside(hypothesis, values, base, bar=bar)
    keep(fits, fit)
    if fit.cost - base.cost - start.cost > max(BROKEN, -BROKEN_PART * start.cost):
        keep(fits, bench.fit(hypothesis.causes, values, bar=bar))


def keep(fits: Fits, fit: Fit) -> None:
    """Add a fit, unless a better one with the same last cause is known.

    Parameters
    ----------
    fits : dict
        By the key of their last cause.
    fit : Fit
        To be added.
    """
    key = fit.hypothesis.causes[-1].key
    if key not in fits or fits[key].log_evidence < fit.log_evidence:
        fits[key] = fit


def _fitted(bench: InferenceProblem, base: Fit, refined: Sequence[Start]) -> Fits:
    """Fit with large errors first, and exactly what then is not far behind."""
    known = base.hypothesis.causes
    closer = bring_closer(bench, [(known, start) for start in refined[:FITTED]])
    early = [bench.fit_early((*known, start.cause), start.values) for known, start in closer]
    if all(fit.is_hopeless for fit in early):
        for start in spread(refined[:FITTED], 1):
            around = further_around(bench, (*known, start.cause), start.values)[:EARLY_AROUND]
            early += [bench.fit_early(*there) for there in around]
    early.sort(key=lambda fit: fit.cost)
    fits: Fits = {}
    for fit in early[: how_many(early, FITTED_EXACTLY)]:
        if fit.cost < FAR_BEHIND * early[0].cost + SLACK:
            keep(fits, bench.fit_from(fit, bar=bar_of(fits.values())))
    if not early[0].is_hopeless:
        _fit_imitators(bench, early, fits)
    return fits


def _add_among_scatter(bench: InferenceProblem, base: Fit, fits: Fits) -> None:
    """Fit what stands out beside the scatter that was fitted without it."""
    known = base.hypothesis.causes
    starts = sorted(spread(search_among_scatter(bench, base), CLOSE_EACH), key=lambda start: start.cost)
    early = [
        bench.fit_early((*known, start.cause), np.concatenate([base.values, start.values]), base.unknown)
        for start in starts[:AMONG_SCATTER]
    ]
    for fit in sorted(early, key=lambda fit: fit.cost)[:AMONG_SCATTER_EXACTLY]:
        keep(fits, bench.fit_from(fit, bar=bar_of(fits.values())))


def how_many(early: Sequence[Fit], usual: int) -> int:
    """Say how many fits with large errors are worth an exact one.

    Parameters
    ----------
    early : sequence of Fit
        By rising cost.
    usual : int
        Where one of them is nearly right.

    Returns
    -------
    int
        Few where none is.
    """
    return FITTED_HOPELESS if early and early[0].is_hopeless else usual


def _fit_imitators(bench: InferenceProblem, early: Sequence[Fit], fits: Fits) -> None:
    """Fit what is known to look like the best: far behind at first, it may yet be as good."""
    best = max(fits.values(), key=lambda fit: fit.log_evidence).hypothesis.causes[-1].effect
    fitted = {fit.hypothesis.causes[-1].effect.name for fit in fits.values()}
    for fit in sorted(early, key=lambda fit: fit.cost):
        effect = fit.hypothesis.causes[-1].effect
        if are_alike(effect, best) and effect.name not in fitted:
            fitted.add(effect.name)
            keep(fits, bench.fit_from(fit, bar=bar_of(fits.values())))


def _how_many_climb(base: Fit, fits: Fits) -> int:
    """Say how many effects are worth steps: few, where much is left beside known causes and none explains it."""
    found = list(fits.values())
    if base.is_nearly_all:
        return CLIMBED if max(fit.log_evidence for fit in found) > base.log_evidence + GAIN else 0
    is_vain = bool(base.hypothesis.causes) and min(fit.cost for fit in found) > VAIN * base.cost
    return CLIMBED_VAINLY if is_vain else CLIMBED
