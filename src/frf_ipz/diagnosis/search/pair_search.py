"""Searches for two components at once.

Where one component explains nearly everything, the second is searched on top of it, and then the first anew. Where it
does not, it may be the wrong one: then several first components get companions far from the axis, where all is smooth,
and the best pairs are fitted. Both components of a pair that leaves little are then located anew beside each other.
What explains nearly all is compared with pairs of other first components: one with parameters of its own, a resonator
or a joint, may have stood for both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from frf_ipz.diagnosis.evidence.fit import NEARLY_ALL, Fit
from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem, compute_weights
from frf_ipz.diagnosis.evidence.map_fit import fit_map
from frf_ipz.diagnosis.search.component_search import (
    COST_SLACK,
    MAX_COST_LEFT,
    PROMISED_PART,
    Ranking,
    count_exact_fits,
    explain_enough,
    group_by_effect,
    rank_fits,
    search_component,
    search_small_component,
)
from frf_ipz.diagnosis.search.global_scan import scan_globally
from frf_ipz.diagnosis.search.neighbourhood_search import Fits, find_cost_limit, search_neighbourhoods
from frf_ipz.diagnosis.search.robust_refinement import (
    COST_RATIO,
    GAIN,
    LOCATIONS_PER_EFFECT,
    N_STEPPED,
    NEIGHBOURHOOD,
    REFINED_ERROR,
    Start,
    refine,
    refine_halfway,
    select_apart,
    step_to_neighbours,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.evidence.hypothesis import Component, ComponentKey

PairFits: TypeAlias = "dict[tuple[ComponentKey, ...], Fit]"
"""Fits of two components, by their keys in turn."""

N_OTHERS = 3  # other first components that are tried where a pair explains all
N_OTHERS_INCOMPLETE = 5  # the same where it lacks a little
COMPETITIVE = 100.0  # log Bayes factor behind the best pair: such a pair's components are located anew
MAX_SIMPLER = 2  # other effects that are tried for one component of a pair
MAX_TURNS = 6  # of stepping one component of a pair and then the other
N_FIRSTS, FIRST_COST_RATIO = 8, 3.0  # components that get companions, and times the best cost
N_COMPANIONS = 12  # of each that are refined
STEPPED_COST_RATIO = 2.0  # times the best cost: pairs whose neighbours are tried far from the axis
N_HALFWAY, N_ROUGH, N_EXACT = 16, 8, 4  # that come half-way to the axis, to it, and are fitted exactly


def search_pair(
    problem: InferenceProblem, first: Ranking, is_good: Callable[[Fit], bool], good_cost: float = np.inf
) -> Ranking:
    """Search for two components.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    first : Ranking
        Of one component.
    is_good : callable
        True for a fit that leaves nothing to explain: then nothing further is tried.
    good_cost : float
        What such a fit costs at most: what cannot come near it is not fitted exactly.

    Returns
    -------
    Ranking
        Its base has one component, its fits have two; `first` itself where effects have no location to be paired at.
    """
    rankings: list[Ranking] = []
    known: PairFits = {}
    if not first.best.is_far_off or not first.refined:
        beside = search_component(problem, first.best, good_cost=good_cost)
        rankings.append(beside)
        if beside.fits and not is_good(beside.best) and beside.best.cost < MAX_COST_LEFT * first.best.cost:
            newest = _fit_newest_alone(problem, beside.best)
            rankings.append(search_component(problem, newest, good_cost=good_cost))
    is_open = first.refined and not first.best.explains_nearly_all
    if is_open and not any(ranking.fits and is_good(ranking.best) for ranking in rankings):
        cost_to_beat = min((ranking.best.cost for ranking in rankings), default=np.inf)
        rankings += _search_far_pairs(problem, first, cost_to_beat, good_cost)
    if not rankings:  # of effects without a location there is one component only
        return first
    best = _most_probable(rankings)
    if best.fits and best.best.mean_misfit <= NEARLY_ALL:
        for ranking in rankings:
            _keep_all(known, ranking.fits)
        best = _reposition(problem, best, known)
        if all(component.effect.has_dynamics for component in best.best.hypothesis.components):
            best = _try_simpler_effects(problem, best, known)
    if not best.best.explains_nearly_all:
        return best
    return _most_probable(
        [
            best,
            *_search_other_firsts(
                problem, first, best.best, N_OTHERS if is_good(best.best) else N_OTHERS_INCOMPLETE, known
            ),
        ]
    )


def _most_probable(rankings: list[Ranking]) -> Ranking:
    best = rankings[0]
    for ranking in rankings[1:]:
        if ranking.best.log_evidence > best.best.log_evidence + GAIN:
            best = ranking
    return best


def _keep_all(known: PairFits, fits: Iterable[Fit]) -> None:
    """Keep the better fit of each pair."""
    for fit in fits:
        if fit.hypothesis.key not in known or known[fit.hypothesis.key].log_evidence < fit.log_evidence:
            known[fit.hypothesis.key] = fit


def _search_other_firsts(
    problem: InferenceProblem, first: Ranking, best: Fit, count: int, known: PairFits
) -> list[Ranking]:
    """Search beside other first components: one with parameters of its own may have stood for both."""
    firsts = [fits[0] for fits in group_by_effect(first.fits)[1 : 1 + count] if fits[0].is_nearly_right]
    rankings = [
        search_small_component(problem, alternative, PROMISED_PART * (best.log_evidence - alternative.log_evidence))
        for alternative in firsts
    ]
    for pairs in rankings:
        _keep_all(known, pairs.fits)
    return [
        _reposition(problem, pairs, known)
        if _is_competitive(pairs.best, best) and not _was_searched_beside(pairs.best, first.best)
        else pairs
        for pairs in rankings
    ]


def _was_searched_beside(pair: Fit, single: Fit) -> bool:
    """Tell whether a pair has the one component of a fit that is not far off, or nearly: all were tried beside that."""
    known = single.hypothesis.components[-1]
    return not single.is_far_off and any(
        component.effect.name == known.effect.name and component.location.is_near(known.location, NEIGHBOURHOOD)
        for component in pair.hypothesis.components
    )


def _is_competitive(pair: Fit, best: Fit) -> bool:
    return len(pair.hypothesis.components) > 1 and pair.log_evidence > best.log_evidence - COMPETITIVE


def _reposition(problem: InferenceProblem, pairs: Ranking, known: PairFits) -> Ranking:
    """Step both components of the best pair to better locations: the first was located when it was alone.

    Where the first one moves, second ones are searched beside it again.
    """
    best = _exchange_and_step(problem, _exchange_and_step(problem, pairs.best, known), known)
    if best.log_evidence < pairs.best.log_evidence + GAIN:
        return pairs
    repositioned = _rank_neighbours(problem, best, pairs.n_tried, known)
    base = repositioned.base
    if base.hypothesis.components[0].key == pairs.base.hypothesis.components[0].key or not base.is_nearly_right:
        return repositioned
    return _most_probable(
        [repositioned, search_small_component(problem, base, PROMISED_PART * (best.log_evidence - base.log_evidence))]
    )


def _try_simpler_effects(problem: InferenceProblem, pairs: Ranking, known: PairFits) -> Ranking:
    """Try other effects for either component of a pair, and continue from there: dynamics can imitate much."""
    best = pairs.best
    for pair in (best, _exchange(problem, best)):
        simpler = [
            fits[0]
            for fits in group_by_effect(_step_last(problem, pair, known))
            if _is_competitive_other(fits[0], pair)
        ]
        for candidate in simpler[:MAX_SIMPLER]:
            best = max(best, _step_in_turn(problem, candidate, known), key=lambda fit: fit.log_evidence)
    return pairs if best is pairs.best else _rank_neighbours(problem, best, pairs.n_tried, known)


def _is_competitive_other(fit: Fit, pair: Fit) -> bool:
    effect, pair_effect = fit.hypothesis.components[-1].effect, pair.hypothesis.components[-1].effect
    return effect.name != pair_effect.name and _is_competitive(fit, pair)


def _rank_neighbours(problem: InferenceProblem, best: Fit, n_tried: int, known: PairFits) -> Ranking:
    """Rank all neighbours of the last component of a pair."""
    base = problem.fit(best.hypothesis.components[:1], best.values[: best.hypothesis.counts[0]])
    return Ranking(base=base, fits=rank_fits(problem, _step_last(problem, best, known)), n_tried=n_tried)


def _fit_newest_alone(problem: InferenceProblem, fit: Fit) -> Fit:
    count = fit.hypothesis.counts[-1]
    return problem.fit((fit.hypothesis.components[-1],), fit.values[len(fit.values) - count :])


def _search_far_pairs(
    problem: InferenceProblem, first: Ranking, cost_to_beat: float, good_cost: float
) -> list[Ranking]:
    """Search for pairs far from the axis; the best one is stepped to better locations if it beats a cost."""
    starts = select_apart(first.refined, 1)[:N_FIRSTS]
    pairs: list[tuple[Component, Start]] = []
    for start in starts:
        if start.cost < FIRST_COST_RATIO * starts[0].cost:
            pairs += [(start.component, start_of_both) for start_of_both in _find_companions(problem, start)]
    if not pairs:  # effects that sit nowhere have no companions
        return []
    rough_fits, exact = _fit_pairs_roughly(problem, pairs), list[Fit]()
    if not explain_enough(problem, first.best, rough_fits, good_cost):
        return []
    for fit in rough_fits:
        exact.append(problem.fit_exactly(fit, cost_limit=find_cost_limit(exact)))
    best = max(exact, key=lambda fit: fit.log_evidence)
    if best.cost > cost_to_beat:
        return []
    known: PairFits = {}
    if not best.is_far_off:
        best = _exchange_and_step(problem, _exchange_and_step(problem, best, known), known)
    return [_rank_neighbours(problem, best, first.n_tried * len(starts), known)]


def _fit_pairs_roughly(problem: InferenceProblem, pairs: list[tuple[Component, Start]]) -> list[Fit]:
    """Fit the best pairs with inflated errors, each one once whichever of its components came first."""
    pairs = _drop_duplicates(pairs)
    limit = STEPPED_COST_RATIO * pairs[0][1].cost
    stepped = [_step_both(problem, *pair) if pair[1].cost < limit else pair for pair in pairs[:N_STEPPED]]
    pairs = _drop_duplicates([*stepped, *pairs[N_STEPPED:]])
    halfway = refine_halfway(problem, [((component,), start) for component, start in pairs[:N_HALFWAY]])
    rough_fits = [problem.fit_roughly((*known, start.component), start.values) for known, start in halfway[:N_ROUGH]]
    rough_fits.sort(key=lambda fit: fit.cost)
    exact = rough_fits[: count_exact_fits(rough_fits, N_EXACT)]
    return [fit for fit in exact if fit.cost <= COST_RATIO * rough_fits[0].cost + COST_SLACK]


def _drop_duplicates(pairs: list[tuple[Component, Start]]) -> list[tuple[Component, Start]]:
    """Keep each pair once, the best first."""
    unique: dict[frozenset[ComponentKey], tuple[Component, Start]] = {}
    for pair in sorted(pairs, key=lambda pair: pair[1].cost):
        unique.setdefault(frozenset((pair[0].key, pair[1].component.key)), pair)
    return list(unique.values())


def _step_both(problem: InferenceProblem, component: Component, start: Start) -> tuple[Component, Start]:
    """Step one component of a pair to better locations, and then the other."""
    for _ in range(2):
        start = step_to_neighbours(problem, (component,), start)
        count = len(problem.make_hypothesis((component,)).parameters)
        exchanged = np.concatenate([start.values[count:], start.values[:count]])
        component, start = start.component, Start(component=component, values=exchanged, cost=start.cost)
    return component, start


def _find_companions(problem: InferenceProblem, start: Start) -> list[Start]:
    """Find what explains most beside a component, far from the axis."""
    base = _evaluate_unfitted(problem, start.component, start.values)
    starts = [candidate for candidate in scan_globally(problem, base) if candidate.component.key != start.component.key]
    weights = compute_weights(problem.coarse, REFINED_ERROR)
    companions = []
    for candidate in sorted(select_apart(starts, LOCATIONS_PER_EFFECT), key=lambda candidate: candidate.cost)[
        :N_COMPANIONS
    ]:
        hypothesis = problem.make_hypothesis((start.component, candidate.component))
        values, cost = refine(hypothesis, problem.coarse, weights, np.concatenate([base.values, candidate.values]))
        companions.append(Start(component=candidate.component, values=values, cost=cost))
    return companions


def _evaluate_unfitted(problem: InferenceProblem, component: Component, values: FloatArray) -> Fit:
    """Evaluate a component with the values that it has beside another one."""
    return fit_map(problem.make_hypothesis((component,)), problem.rough_data, values, iterations=0)


def _exchange_and_step(problem: InferenceProblem, fit: Fit, known: PairFits) -> Fit:
    """Exchange the two components and step the new last one to better locations."""
    return max(_step_last(problem, _exchange(problem, fit), known), key=lambda candidate: candidate.log_evidence)


def _step_in_turn(problem: InferenceProblem, fit: Fit, known: PairFits) -> Fit:
    """Step both components in turn until neither gains."""
    n_vain = 0
    for _ in range(MAX_TURNS):
        better = _exchange_and_step(problem, fit, known)
        n_vain = n_vain + 1 if better.log_evidence < fit.log_evidence + GAIN else 0
        fit = better
        if n_vain == len(fit.hypothesis.components):
            break
    return fit


def _exchange(problem: InferenceProblem, fit: Fit) -> Fit:
    """Exchange the two components."""
    hypothesis, count = fit.hypothesis, fit.hypothesis.counts[0]
    values = np.concatenate([fit.values[count:], fit.values[:count]])
    components = hypothesis.components[::-1]
    return fit_map(
        problem.make_hypothesis(components), problem.data, values, nuisance=fit.nuisance, iterations=4, tolerance=0.5
    )


def _step_last(problem: InferenceProblem, pair: Fit, known: PairFits) -> list[Fit]:
    """Step the last component of a pair to better locations; the pair itself is among the fits.

    A maximum does not depend on where it was found from: pairs that are known are not fitted again.
    """
    hypothesis = pair.hypothesis
    first = _evaluate_unfitted(problem, hypothesis.components[0], pair.values[: hypothesis.counts[0]])
    _keep_all(known, [pair])
    fits: Fits = {fit.hypothesis.components[-1].key: fit for key, fit in known.items() if key[0] == hypothesis.key[0]}
    search_neighbourhoods(problem, first, fits)
    _keep_all(known, fits.values())
    return list(fits.values())
