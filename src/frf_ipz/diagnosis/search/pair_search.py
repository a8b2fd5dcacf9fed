"""Two causes at once.

Where one cause explains nearly everything, the second is searched on top of it, and then the first anew. Where it does
not, it may be the wrong one: then several first causes get companions far from the axis, where all is smooth, and the
best pairs are fitted. Both causes of a pair that leaves little are then placed anew beside each other. What explains
nearly all is compared with pairs of other first causes: one with parameters of its own, a resonator or a joint, may
have stood for both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.evidence.fit import VERY_NEARLY, Fit
from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem, weights_of
from frf_ipz.diagnosis.evidence.map_fit import polish
from frf_ipz.diagnosis.search.component_search import Ranking, by_effect, how_many, ranked, search, search_beside
from frf_ipz.diagnosis.search.global_scan import wide_search
from frf_ipz.diagnosis.search.neighbourhood_search import GAIN, Fits, bar_of, climb_all
from frf_ipz.diagnosis.search.robust_refinement import REFINED_ERROR, Start, bring_closer, refine, spread, step_far

if TYPE_CHECKING:
    from collections.abc import Callable

    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.evidence.hypothesis import Cause

OTHERS, ALL_OTHERS = 3, 5  # first causes that are tried where a pair explains all, and where it lacks a little
MOST_LEFT = 0.8  # of the cost of one cause: where a second leaves more, the first is not searched anew beside it
NEAR_NATS = 100.0  # behind the best pair: such a pair's causes are stepped to better places
MOST_SIMPLER = 2  # other effects that are tried for one cause of a pair
MOST_TURNS = 6  # from one cause of a pair to the other
PROMISED = 0.5  # of the evidence that another pair needs: what it must gain to be looked at
FIRSTS, NOT_FAR = 8, 3.0  # causes that get companions, and times the best cost
COMPANIONS, PLACES_EACH = 12, 3  # of each that are refined, and of an effect
STEPPED, NOT_MUCH = 8, 2.0  # pairs whose neighbours are looked at far from the axis, and times the best cost
CLOSER_PAIRS, EARLY_PAIRS, EXACT_PAIRS = 16, 8, 4  # that come half-way to the axis, to it, and are fitted exactly
FAR_BEHIND, SLACK = 4.0, 400.0  # times the best one's cost, and nats: such pairs are not fitted exactly


def search_second(bench: InferenceProblem, first: Ranking, is_good: Callable[[Fit], bool]) -> Ranking:
    """Search for two causes.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    first : Ranking
        Of one cause.
    is_good : callable
        Tells whether a fit leaves nothing to explain: then nothing further is tried.

    Returns
    -------
    Ranking
        Its base has one cause, its fits have two.
    """
    found: list[Ranking] = []
    if not first.best.is_hopeless or not first.refined:
        beside = search(bench, first.best)
        found.append(beside)
        if beside.fits and not is_good(beside.best) and beside.best.cost < MOST_LEFT * first.best.cost:
            found.append(search(bench, _newest_alone(bench, beside.best)))
    is_open = first.refined and not first.best.is_nearly_all
    if is_open and not any(ranking.fits and is_good(ranking.best) for ranking in found):
        found += _of_pairs(bench, first, min((ranking.best.cost for ranking in found), default=np.inf))
    best = _likeliest(found)
    if best.fits and best.best.mean_misfit <= VERY_NEARLY:
        best = _settled(bench, best)
        if all(cause.effect.has_dynamics for cause in best.best.hypothesis.causes):
            best = _simpler(bench, best)
    if not best.best.is_nearly_all:
        return best
    return _likeliest([best, *_from_others(bench, first, best.best, OTHERS if is_good(best.best) else ALL_OTHERS)])


def _likeliest(found: list[Ranking]) -> Ranking:
    best = found[0]
    for ranking in found[1:]:
        if ranking.best.log_evidence > best.best.log_evidence + GAIN:
            best = ranking
    return best


def _from_others(bench: InferenceProblem, first: Ranking, best: Fit, count: int) -> list[Ranking]:
    """Search beside other first causes: one with parameters of its own may have stood for both."""
    others = [fits[0] for fits in by_effect(first.fits)[1 : 1 + count] if fits[0].is_nearly_right]
    found = [search_beside(bench, other, PROMISED * (best.log_evidence - other.log_evidence)) for other in others]
    return [_settled(bench, pairs) if _is_near(pairs.best, best) else pairs for pairs in found]


def _is_near(pair: Fit, best: Fit) -> bool:
    return len(pair.hypothesis.causes) > 1 and pair.log_evidence > best.log_evidence - NEAR_NATS


def _settled(bench: InferenceProblem, pairs: Ranking) -> Ranking:
    """Step both causes of the best pair to better places: the first was placed when it was alone.

    Where the first one moves, others are searched beside it again.
    """
    best = _climbed(bench, _climbed(bench, pairs.best))
    if best.log_evidence < pairs.best.log_evidence + GAIN:
        return pairs
    settled = _around(bench, best, pairs.n_tried)
    base = settled.base
    if base.hypothesis.causes[0].key == pairs.base.hypothesis.causes[0].key or not base.is_nearly_right:
        return settled
    return _likeliest([settled, search_beside(bench, base, PROMISED * (best.log_evidence - base.log_evidence))])


def _simpler(bench: InferenceProblem, pairs: Ranking) -> Ranking:
    """Try other effects for either cause of a pair, and go on from there: one with dynamics can stand for many."""
    found = pairs.best
    for pair in (found, _turned(bench, found)):
        others = [fits[0] for fits in by_effect(_neighbours(bench, pair)) if _is_other(fits[0], pair)]
        for other in others[:MOST_SIMPLER]:
            found = max(found, _climbed_up(bench, other), key=lambda fit: fit.log_evidence)
    return pairs if found is pairs.best else _around(bench, found, pairs.n_tried)


def _is_other(fit: Fit, pair: Fit) -> bool:
    one, other = fit.hypothesis.causes[-1].effect, pair.hypothesis.causes[-1].effect
    return one.name != other.name and _is_near(fit, pair)


def _around(bench: InferenceProblem, best: Fit, n_tried: int) -> Ranking:
    """Look at all neighbours of the last cause of a pair."""
    base = bench.fit(best.hypothesis.causes[:1], best.values[: best.hypothesis.counts[0]])
    return Ranking(base=base, fits=ranked(bench, _neighbours(bench, best)), n_tried=n_tried)


def _newest_alone(bench: InferenceProblem, fit: Fit) -> Fit:
    count = fit.hypothesis.counts[-1]
    return bench.fit((fit.hypothesis.causes[-1],), fit.values[len(fit.values) - count :])


def _of_pairs(bench: InferenceProblem, first: Ranking, known: float) -> list[Ranking]:
    """Search for pairs far from the axis; the best one is kept, and stepped to better places, if it beats a cost."""
    starts = spread(first.refined, 1)[:FIRSTS]
    pairs: list[tuple[Cause, Start]] = []
    for start in starts:
        if start.cost < NOT_FAR * starts[0].cost:
            pairs += [(start.cause, both) for both in _companions(bench, start)]
    exact: list[Fit] = []
    for fit in _early(bench, pairs):
        exact.append(bench.fit_from(fit, bar=bar_of(exact)))
    best = max(exact, key=lambda fit: fit.log_evidence)
    if best.cost > known:
        return []
    if not best.is_hopeless:
        best = _climbed(bench, _climbed(bench, best))
    return [_around(bench, best, first.n_tried * len(starts))]


def _early(bench: InferenceProblem, pairs: list[tuple[Cause, Start]]) -> list[Fit]:
    """Fit the best pairs with large errors, each one once whichever of its causes came first."""
    pairs = _once(pairs)
    limit = NOT_MUCH * pairs[0][1].cost
    near = [_stepped(bench, *pair) if pair[1].cost < limit else pair for pair in pairs[:STEPPED]]
    pairs = _once([*near, *pairs[STEPPED:]])
    closer = bring_closer(bench, [((cause,), both) for cause, both in pairs[:CLOSER_PAIRS]])
    early = [bench.fit_early((*known, both.cause), both.values) for known, both in closer[:EARLY_PAIRS]]
    early.sort(key=lambda fit: fit.cost)
    exact = early[: how_many(early, EXACT_PAIRS)]
    return [fit for fit in exact if fit.cost <= FAR_BEHIND * early[0].cost + SLACK]


def _once(pairs: list[tuple[Cause, Start]]) -> list[tuple[Cause, Start]]:
    """Take each pair once, the best first."""
    once: dict[frozenset[tuple[object, ...]], tuple[Cause, Start]] = {}
    for pair in sorted(pairs, key=lambda pair: pair[1].cost):
        once.setdefault(frozenset((pair[0].key, pair[1].cause.key)), pair)
    return list(once.values())


def _stepped(bench: InferenceProblem, cause: Cause, both: Start) -> tuple[Cause, Start]:
    """Step one cause of a pair to better places, and then the other."""
    for _ in range(2):
        both = step_far(bench, (cause,), both)
        count = len(bench.suppose((cause,)).parameters)
        turned = np.concatenate([both.values[count:], both.values[:count]])
        cause, both = both.cause, Start(cause=cause, values=turned, cost=both.cost)
    return cause, both


def _companions(bench: InferenceProblem, start: Start) -> list[Start]:
    """Find what explains most beside a cause, far from the axis."""
    base = _as_it_is(bench, start.cause, start.values)
    starts = [one for one in wide_search(bench, base) if one.cause.key != start.cause.key]
    weights = weights_of(bench.coarse, REFINED_ERROR)
    found = []
    for one in sorted(spread(starts, PLACES_EACH), key=lambda one: one.cost)[:COMPANIONS]:
        hypothesis = bench.suppose((start.cause, one.cause))
        values, cost = refine(hypothesis, bench.coarse, weights, np.concatenate([base.values, one.values]))
        found.append(Start(cause=one.cause, values=values, cost=cost))
    return found


def _as_it_is(bench: InferenceProblem, cause: Cause, values: FloatArray) -> Fit:
    """Take a cause with the values that it has beside another one."""
    return polish(bench.suppose((cause,)), bench.early, values, iterations=0)


def _climbed(bench: InferenceProblem, fit: Fit) -> Fit:
    """Exchange the two causes and step the new last one to better places."""
    return max(_neighbours(bench, _turned(bench, fit)), key=lambda one: one.log_evidence)


def _climbed_up(bench: InferenceProblem, fit: Fit) -> Fit:
    """Step both causes in turn until neither gains."""
    vain = 0
    for _ in range(MOST_TURNS):
        better = _climbed(bench, fit)
        vain = vain + 1 if better.log_evidence < fit.log_evidence + GAIN else 0
        fit = better
        if vain == len(fit.hypothesis.causes):
            break
    return fit


def _turned(bench: InferenceProblem, fit: Fit) -> Fit:
    """Exchange the two causes."""
    hypothesis, count = fit.hypothesis, fit.hypothesis.counts[0]
    values = np.concatenate([fit.values[count:], fit.values[:count]])
    causes = hypothesis.causes[::-1]
    return polish(bench.suppose(causes), bench.data, values, unknown=fit.unknown, iterations=4, tolerance=0.5)


def _neighbours(bench: InferenceProblem, pair: Fit) -> list[Fit]:
    """Step the last cause of a pair to better places; the pair is among what is given."""
    hypothesis = pair.hypothesis
    first = _as_it_is(bench, hypothesis.causes[0], pair.values[: hypothesis.counts[0]])
    fits: Fits = {hypothesis.causes[-1].key: pair}
    climb_all(bench, first, fits)
    return list(fits.values())
