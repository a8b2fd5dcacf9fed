"""Searches for one more component: global scan, score test, refinement, exact fits, neighbourhood search."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.deadline import DeadlineError
from frf_ipz.diagnosis.evidence.fit import Fit
from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
from frf_ipz.diagnosis.search.global_scan import scan_beside_nuisance, scan_globally
from frf_ipz.diagnosis.search.neighbourhood_search import (
    MAX_BEHIND,
    N_EFFECTS,
    Fits,
    evaluate_without_fit,
    find_cost_limit,
    may_be_as_good,
    refine_surroundings,
    search_neighbourhoods,
)
from frf_ipz.diagnosis.search.rivals import is_hopeless
from frf_ipz.diagnosis.search.robust_refinement import (
    COST_RATIO,
    GAIN,
    LOCATIONS_PER_EFFECT,
    Start,
    refine_halfway,
    refine_starts,
    select_apart,
)
from frf_ipz.diagnosis.search.score_tests import prepare_small_effects

if TYPE_CHECKING:
    from collections.abc import Callable

    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.evidence.hypothesis import Component

AMBIGUOUS = 8.0  # log Bayes factor behind the best: what is so near is compared more closely
N_SCORED = 14  # hypotheses that are fitted after the score test
MIN_PROMISE = 5.0  # log-likelihood that a linear step promises: with less, a hypothesis is not fitted
MIN_PROMISED_COST = 0.3  # of the cost of a fit far off: with less, a small effect is not what it lacks
PROMISED_PART = 0.5  # of what a fit gains: what a linear step on fewer points must promise of it
BROKEN_PROMISE, BROKEN_PART = 10.0, 0.5  # log-likelihood, and part of a promise: a fit that lacks more begins anew
N_ROUGH = 12  # hypotheses that are fitted with inflated errors
N_EXACT, N_EXACT_FAR_OFF = 7, 2
COST_SLACK = 400.0  # besides a multiple of the best cost: beyond, hypotheses are not fitted exactly
N_EFFECTS_IN_VAIN = 2  # effects whose neighbourhoods are searched where no further component explains much
VAIN_COST_RATIO = 0.6  # of the cost of the base: a fit that leaves more does not explain it
MAX_COST_LEFT = 0.8  # the same: what leaves more is no basis to search from, unless that is little enough
N_CONTINUED = 2  # fits that go on until they converge
N_BESIDE_NUISANCE, N_EXACT_BESIDE_NUISANCE = 12, 3  # effects that stand out beside a fitted nuisance, and are fitted
N_ROUGH_AROUND = 16  # locations further around that are fitted with inflated errors


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ranking:
    """The result of a search.

    Parameters
    ----------
    base : Fit
        The fit that it was built on: the nominal model, or with components that are known already.
    fits : tuple of Fit
        Each with one more component, by falling evidence.
    n_tried : int
        Number of hypotheses that were scanned.
    scanned, refined : tuple of Start
        Starts of a global scan, and refined ones, by rising cost; empty where none was made.
    is_complete : bool
        False where the time was over before all was tried.
    """

    base: Fit
    fits: tuple[Fit, ...]
    n_tried: int
    scanned: tuple[Start, ...] = ()
    refined: tuple[Start, ...] = ()
    is_complete: bool = True

    @property
    def best(self) -> Fit:
        """The best location of the most probable effect; the base where nothing was found."""
        return group_by_effect(self.fits)[0][0] if self.fits else self.base

    @property
    def best_evidence(self) -> float:
        """Log evidence of the most probable effect, wherever it is."""
        fits = group_by_effect(self.fits)[0] if self.fits else (self.base,)
        return float(np.logaddexp.reduce([fit.log_evidence for fit in fits]))


def group_by_effect(fits: Iterable[Fit]) -> list[tuple[Fit, ...]]:
    """Sort fits by effects: one is as probable as all its locations together.

    Parameters
    ----------
    fits : iterable of Fit
        Each with one component more than the base.

    Returns
    -------
    list of tuple of Fit
        The most probable effect first; of each, the most probable location first.
    """
    groups: dict[str, list[Fit]] = {}
    for fit in sorted(fits, key=lambda fit: -fit.log_evidence):
        groups.setdefault(fit.hypothesis.components[-1].effect.name, []).append(fit)
    total = {name: float(np.logaddexp.reduce([fit.log_evidence for fit in group])) for name, group in groups.items()}
    return [tuple(groups[name]) for name in sorted(groups, key=lambda name: -total[name])]


def fit_null_model(problem: InferenceProblem) -> Fit:
    """Fit the nominal model with nuisance parameters."""
    return problem.fit((), np.zeros(0))


def search_component(
    problem: InferenceProblem, base: Fit, *, good_cost: float = np.inf, min_log_bayes_factor: float = 0.0
) -> Ranking:
    """Search for one more component.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    base : Fit
        The fit to build on.
    good_cost : float
        Cost of a fit that leaves nothing to explain. Where no component is likely to get there, nor to explain a
        considerable part, none is fitted exactly.
    min_log_bayes_factor : float
        What explains less counts for nothing, where the base explains nearly all: its neighbours are not fitted.

    Returns
    -------
    Ranking
        All fits; those that there was time for.

    Raises
    ------
    DeadlineError
        If there was time for none.
    """
    n_tried, scanned, refined, is_complete = 0, list[Start](), list[Start](), True
    worth_fitting: Callable[[Component], bool] = may_be_as_good
    fits: Fits = {}
    try:
        if not base.explains_nearly_all:
            scanned = scan_globally(problem, base)
            n_tried += len(scanned)
            refined = refine_starts(problem, base, scanned)
            is_of_use = _fit_starts(problem, base, refined, good_cost, fits)
            if is_of_use and all(fit.is_far_off for fit in fits.values()):
                _add_beside_nuisance(problem, base, fits)
        if base.is_nearly_right or not (base.is_far_off or any(fit.explains_nearly_all for fit in fits.values())):
            # from far off, what a linear step promises is no match
            effects = prepare_small_effects(problem, base)
            scored = effects.score_everywhere()
            n_tried += len(scored)
            _add_by_score_test(problem, base, scored, good_cost, fits)
            if base.explains_nearly_all:
                least = PROMISED_PART * max(_gain(base, fits), min_log_bayes_factor)
                worth_fitting = _promising(scored, least, effects.score, AMBIGUOUS)
        if fits and (n_effects := _count_searched_effects(base, fits, good_cost)):
            search_neighbourhoods(problem, base, fits, n_effects, worth_fitting)
        ranked = rank_fits(problem, fits.values())
    except DeadlineError:
        if not fits:
            raise
        ranked, is_complete = _sort_by_evidence(fits.values()), False
    return Ranking(
        base=base,
        fits=ranked,
        n_tried=n_tried,
        scanned=tuple(scanned),
        refined=tuple(refined),
        is_complete=is_complete,
    )


def rank_fits(problem: InferenceProblem, fits: Iterable[Fit]) -> tuple[Fit, ...]:
    """Sort fits by falling evidence; the best ones are continued where they have not converged.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    fits : iterable of Fit
        In any order.

    Returns
    -------
    tuple of Fit
        The best first.
    """
    order = _sort_by_evidence(fits)
    cost_limit = find_cost_limit(order)
    continued = [
        fit if fit.has_converged or fit.is_far_off or fit.cost > cost_limit else problem.fit_to_convergence(fit)
        for fit in order[:N_CONTINUED]
    ]
    return _sort_by_evidence([*continued, *order[N_CONTINUED:]])


def _sort_by_evidence(fits: Iterable[Fit]) -> tuple[Fit, ...]:
    return tuple(sorted(fits, key=lambda fit: -fit.log_evidence))


def search_small_component(problem: InferenceProblem, base: Fit, min_log_bayes_factor: float) -> Ranking:
    """Search for one more, small component: from a fit that leaves nothing but what the nuisance hides.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    base : Fit
        Nearly right.
    min_log_bayes_factor : float
        What explains less is not fitted.

    Returns
    -------
    Ranking
        Without fits where one linear step promises less of everything.
    """
    fits: Fits = {}
    effects = prepare_small_effects(problem, base)
    scored = effects.score_everywhere()
    for start in _most_promising(_with_location_prior(scored), PROMISED_PART * min_log_bayes_factor):
        _fit_and_keep(problem, base, start, fits)
    gain = _gain(base, fits)
    if gain > PROMISED_PART * min_log_bayes_factor:
        worth_fitting = _promising(scored, PROMISED_PART * gain, effects.score, GAIN)
        search_neighbourhoods(problem, base, fits, _count_searched_effects(base, fits), worth_fitting)
    return Ranking(base=base, fits=rank_fits(problem, fits.values()), n_tried=len(scored))


def _with_location_prior(scored: Iterable[Start]) -> list[Start]:
    """Give scores the prior of their locations: of many, one promises something by chance."""
    return [replace(start, cost=start.cost + float(np.log(start.component.n_locations))) for start in scored]


def _gain(base: Fit, fits: Fits) -> float:
    """Give the log Bayes factor of the best fit over the base."""
    return max((fit.log_evidence for fit in fits.values()), default=-np.inf) - base.log_evidence


def _promising(
    scored: Iterable[Start], min_gain: float, score: Callable[[Sequence[Component]], list[Start]], behind: float
) -> Callable[[Component], bool]:
    """Say which components may gain so much: of each effect those that promise it and are not far behind the best.

    Small effects act linearly: a location that promises less than another of the same effect is no better. What was
    passed over, as places between others are, is scored when it is asked for.
    """
    scored = list(scored)
    highest = _best_costs(scored)
    costs = {start.component.key: start.cost for start in scored}

    def is_promising(component: Component) -> bool:
        if component.key not in costs:
            costs[component.key] = min((start.cost for start in score([component])), default=np.inf)
        return costs[component.key] <= min(highest.get(component.effect.name, np.inf) + behind, -min_gain)

    return is_promising


def _best_costs(scored: Iterable[Start]) -> dict[str, float]:
    """Give the lowest cost of each effect."""
    costs: dict[str, float] = {}
    for start in scored:
        name = start.component.effect.name
        costs[name] = min(start.cost, costs.get(name, np.inf))
    return costs


def _add_by_score_test(
    problem: InferenceProblem, base: Fit, scored: Sequence[Start], good_cost: float, fits: Fits
) -> None:
    """Fit small effects from the base, if one linear step promises something, and enough to be of use."""
    if base.explains_nearly_all:
        scored = _with_location_prior(scored)
    promise = MIN_PROMISE if base.is_nearly_right else MIN_PROMISED_COST * base.cost
    starts = _most_promising(scored, max(promise, PROMISED_PART * (base.cost - _useful_cost(base.cost, good_cost))))
    if not starts and base.is_nearly_right:
        starts = _most_promising(scored, -np.inf)[:1]  # to report how little the best one explains
    for start in starts:
        _fit_and_keep(problem, base, start, fits)


def _most_promising(scored: Sequence[Start], min_log_bayes_factor: float) -> list[Start]:
    """Select the best locations of each effect that promise so much and are not far behind the best of all.

    The best location of each comes first: a linear step may promise a small part of what an effect explains.
    """
    starts = sorted(select_apart(scored, LOCATIONS_PER_EFFECT), key=lambda start: start.cost)
    firsts = {start.component.effect.name: start for start in reversed(starts)}
    starts.sort(key=lambda start: start is not firsts[start.component.effect.name])
    return [
        start for start in starts[:N_SCORED] if -start.cost > max(min_log_bayes_factor, -starts[0].cost - MAX_BEHIND)
    ]


def _fit_and_keep(problem: InferenceProblem, base: Fit, start: Start, fits: Fits) -> None:
    """Fit a small effect from the base; anew, where that gains much less than one linear step promised."""
    hypothesis = problem.make_hypothesis((*base.hypothesis.components, start.component))
    values, cost_limit = np.concatenate([base.values, start.values]), find_cost_limit((base, *fits.values()))
    fit = problem.fit_from_base(hypothesis, values, base, cost_limit=cost_limit)
    keep_better(fits, fit)
    if fit.cost - base.cost - start.cost > max(BROKEN_PROMISE, -BROKEN_PART * start.cost):
        keep_better(fits, problem.fit(hypothesis.components, values, cost_limit=cost_limit))


def keep_better(fits: Fits, fit: Fit) -> None:
    """Add a fit, unless a better one with the same last component is known.

    Parameters
    ----------
    fits : dict
        By the key of their last component.
    fit : Fit
        To be added.
    """
    key = fit.hypothesis.components[-1].key
    if key not in fits or fits[key].log_evidence < fit.log_evidence:
        fits[key] = fit


def _fit_starts(problem: InferenceProblem, base: Fit, refined: Sequence[Start], good_cost: float, fits: Fits) -> bool:
    """Fit with inflated errors first, and then exactly what is not far behind; False where none is likely of use."""
    known = base.hypothesis.components
    halfway = refine_halfway(problem, [(known, start) for start in refined[:N_ROUGH]])
    candidates = [((*known, start.component), start.values) for known, start in halfway]
    rough_fits = [problem.fit_roughly(*candidates[0])]
    if rough_fits[0].explains_nearly_all:
        best = problem.fit_exactly(rough_fits[0])
        keep_better(fits, best)
        if best.explains_nearly_all:
            _fit_rivals(problem, best, candidates[1:], fits)
            return True
    rough_fits += [problem.fit_roughly(*candidate) for candidate in candidates[1:]]
    if all(fit.is_far_off for fit in rough_fits):
        for start in select_apart(refined[:N_ROUGH], 1):
            around = refine_surroundings(problem, (*known, start.component), start.values)[:N_ROUGH_AROUND]
            rough_fits += [problem.fit_roughly(*moved) for moved in around]
    rough_fits.sort(key=lambda fit: fit.cost)
    if not explain_enough(problem, base, rough_fits, good_cost):
        return False
    for fit in rough_fits[: count_exact_fits(rough_fits, N_EXACT)]:
        if fit.cost < COST_RATIO * rough_fits[0].cost + COST_SLACK:
            keep_better(fits, problem.fit_exactly(fit, cost_limit=find_cost_limit(fits.values())))
    if not rough_fits[0].is_far_off:
        _fit_other_effects(problem, rough_fits, fits)
    return True


def explain_enough(problem: InferenceProblem, base: Fit, rough_fits: Iterable[Fit], good_cost: float) -> bool:
    """Tell whether exact fits are of use: one of them may leave nothing, or much less than the base.

    Larger errors make a cost no larger: what leaves more with inflated errors than a fit may that lacks nothing, leaves
    more with the right ones.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    base : Fit
        With fewer components.
    rough_fits : iterable of Fit
        With inflated errors; those that have not converged are continued.
    good_cost : float
        Cost of a fit that leaves nothing to explain.

    Returns
    -------
    bool
        True where one is likely to be of use.
    """
    rough_fits = list(rough_fits)
    if min((fit.cost for fit in rough_fits), default=np.inf) <= good_cost:
        return True
    of_base = problem.fit_roughly(base.hypothesis.components, base.values, base.nuisance)
    useful_cost = _useful_cost(of_base.cost, good_cost)
    return any(fit.cost < useful_cost or _continue_roughly(problem, fit).cost < useful_cost for fit in rough_fits)


def _continue_roughly(problem: InferenceProblem, fit: Fit) -> Fit:
    if fit.has_converged:
        return fit
    return problem.fit_roughly(fit.hypothesis.components, fit.values, fit.nuisance)


def _useful_cost(base_cost: float, good_cost: float) -> float:
    """Cost below which one more component is of use: it leaves nothing, or much less than its base."""
    return max(good_cost, MAX_COST_LEFT * base_cost)


def _fit_rivals(
    problem: InferenceProblem, best: Fit, candidates: Sequence[tuple[tuple[Component, ...], FloatArray]], fits: Fits
) -> None:
    """Fit what may explain as much as one that explains nearly all; of each other effect say how far behind it is."""
    for components, values in candidates:
        if components[-1].key in fits:  # candidates may have stepped to one location
            continue
        hypothesis = problem.make_hypothesis(components)
        if not is_hopeless(problem, best, hypothesis, (values,)):
            keep_better(fits, problem.fit(components, values, cost_limit=find_cost_limit(fits.values())))
        elif all(fit.hypothesis.components[-1].effect.name != components[-1].effect.name for fit in fits.values()):
            keep_better(fits, evaluate_without_fit(problem, hypothesis, values, best))


def _add_beside_nuisance(problem: InferenceProblem, base: Fit, fits: Fits) -> None:
    """Fit what stands out beside the nuisance that was fitted without it."""
    known = base.hypothesis.components
    scanned = select_apart(scan_beside_nuisance(problem, base), LOCATIONS_PER_EFFECT)
    starts = sorted(scanned, key=lambda start: start.cost)
    rough_fits = [
        problem.fit_roughly((*known, start.component), np.concatenate([base.values, start.values]), base.nuisance)
        for start in starts[:N_BESIDE_NUISANCE]
    ]
    for fit in sorted(rough_fits, key=lambda fit: fit.cost)[:N_EXACT_BESIDE_NUISANCE]:
        keep_better(fits, problem.fit_exactly(fit, cost_limit=find_cost_limit(fits.values())))


def count_exact_fits(rough_fits: Sequence[Fit], usual: int) -> int:
    """Count the fits with inflated errors that are worth an exact one.

    Parameters
    ----------
    rough_fits : sequence of Fit
        By rising cost.
    usual : int
        Number where one of them is nearly right.

    Returns
    -------
    int
        Few where none is.
    """
    return N_EXACT_FAR_OFF if rough_fits and rough_fits[0].is_far_off else usual


def _fit_other_effects(problem: InferenceProblem, rough_fits: Sequence[Fit], fits: Fits) -> None:
    """Fit each effect that has no fit yet, until it cannot imitate the best: far behind at first, it may be as good."""
    fitted = {fit.hypothesis.components[-1].effect.name for fit in fits.values()}
    for fit in sorted(rough_fits, key=lambda fit: fit.cost):
        effect = fit.hypothesis.components[-1].effect
        if effect.name not in fitted:
            fitted.add(effect.name)
            keep_better(fits, problem.fit_exactly(fit, cost_limit=find_cost_limit(fits.values())))


def _count_searched_effects(base: Fit, fits: Fits, good_cost: float = np.inf) -> int:
    """Count the effects worth a neighbourhood search: few, where much is left and none explains it."""
    known = list(fits.values())
    if base.explains_nearly_all:
        return N_EFFECTS if max(fit.log_evidence for fit in known) > base.log_evidence + GAIN else 0
    least = min(fit.cost for fit in known)
    if least > _useful_cost(base.cost, good_cost):
        return 0
    is_vain = bool(base.hypothesis.components) and least > VAIN_COST_RATIO * base.cost
    return N_EFFECTS_IN_VAIN if is_vain else N_EFFECTS
