"""One cause, a few, or none: searches until what is left is no more than noise and tolerances, and decides."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.evidence.map_fit import polish
from frf_ipz.diagnosis.search.ambiguity_set import look_elsewhere, settle_ties
from frf_ipz.diagnosis.search.component_search import Ranking, fit_nothing, search, search_beside
from frf_ipz.diagnosis.search.pair_search import search_second
from frf_ipz.diagnosis.verdict.findings import is_significant
from frf_ipz.diagnosis.verdict.goodness import FOUND_NATS, LIMITS, PARTIAL_NATS, STRONG_NATS, Goodness, goodness

if TYPE_CHECKING:
    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.progress import Progress

STRAINED = 0.75  # score of a cause that explains, but may stand for two others: 3 of 89 single ones had more
CONSISTENT, EXPLAINED, UNEXPLAINED = "consistent", "explained", "unexplained"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Decision:
    """What the search came to.

    Parameters
    ----------
    verdict : str
        ``consistent``, ``explained`` or ``unexplained``.
    null, final : Fit
        Of the nominal model with what its tolerances allow, and with what was found.
    ranking : Ranking
        Of one cause.
    further : tuple of Ranking
        Of each further cause beside its base, where several were found.
    good, null_good : Goodness
        Of what was found, and of the nominal model.
    another : Fit, optional
        Of a force of another kind that explains more than what was found.
    """

    verdict: str
    null: Fit
    final: Fit
    ranking: Ranking
    further: tuple[Ranking, ...]
    good: Goodness
    null_good: Goodness
    another: Fit | None = None


def decide(bench: InferenceProblem, progress: Progress) -> Decision:
    """Search, and decide what is missing.

    Parameters
    ----------
    bench : InferenceProblem
        Data, model and effects.
    progress : Progress
        Told how far it is.

    Returns
    -------
    Decision
        The verdict and the fits that it rests on.
    """
    progress(0.2, "fitting the nominal model")
    null = fit_nothing(bench)
    null_good = goodness(bench, null)
    progress(0.3, "searching for one cause")
    ranking = search(bench, null)
    needed = _needed(bench, null_good, ranking.best)
    if not null_good.is_good or gain_over(ranking.best, null) >= needed:
        ranking = settle_ties(bench, ranking)
    if ranking.best.is_nearly_all and not goodness(bench, ranking.best).is_good:
        ranking = settle_ties(bench, look_elsewhere(bench, ranking))
    best = ranking.best
    good = goodness(bench, best)
    one = Decision(
        verdict=EXPLAINED, null=null, final=best, ranking=ranking, further=(), good=good, null_good=null_good
    )
    if null_good.is_good and (gain_over(best, null) < needed or not is_significant(best, -1)):
        return replace(one, verdict=CONSISTENT, final=null, good=null_good)
    progress(0.6, "searching for a second cause")
    if good.is_good:
        return _enough(bench, one)
    second = _two_at_once(bench, ranking)
    two = _beside(bench, one, second)
    if two is None:
        return replace(one, verdict=UNEXPLAINED, final=best if gain_over(best, null) > needed else null)
    alone = _one_is_enough(bench, one, two.final)
    if alone is not None:
        return alone
    if two.verdict == EXPLAINED or not two.final.is_nearly_right or gain_over(second.best, second.base) < STRONG_NATS:
        return two
    progress(0.8, "searching for a third cause")
    three = _beside(bench, two, search_beside(bench, second.best, STRONG_NATS))
    return three if three is not None and three.verdict == EXPLAINED else two


def _needed(bench: InferenceProblem, null_good: Goodness, best: Fit) -> float:
    """Evidence that a first cause must have: where it leaves less of a piece, errors there are not underrated."""
    left = goodness(bench, best).times_underrated
    return null_good.needed_nats * min(1.0, left / null_good.times_underrated)


def _enough(bench: InferenceProblem, one: Decision) -> Decision:
    """Take a cause that leaves nothing to explain, if it explains anything, and what explains much beside it."""
    least = min(FOUND_NATS, LIMITS[bench.kind].second_nats)  # the nominal model does not explain: what is likelier does
    if not one.null_good.is_good and gain_over(one.final, one.null) < least:
        return replace(one, verdict=UNEXPLAINED, final=one.null, good=one.null_good)
    second = settle_ties(bench, search_beside(bench, one.final, LIMITS[bench.kind].beside_nats))
    two = _beside(bench, one, second)
    if two is None and one.good.score > STRAINED:
        two = _beside(bench, one, _two_at_once(bench, one.ranking))
    return two or one


def _two_at_once(bench: InferenceProblem, ranking: Ranking) -> Ranking:
    """Search for two causes of which neither need be the best one alone."""
    return settle_ties(bench, search_second(bench, ranking, lambda fit: goodness(bench, fit).is_good))


def _one_is_enough(bench: InferenceProblem, one: Decision, both: Fit) -> Decision | None:
    """Leave out a cause beside which the other one explains as much: it only helped to find it."""
    for number in range(2):
        alone = fit_without(bench, both, number)
        good = goodness(bench, alone)
        if good.is_good and gain_over(both, alone) <= LIMITS[bench.kind].beside_nats:
            fits = tuple(sorted((alone, *one.ranking.fits), key=lambda fit: -fit.log_evidence))
            return replace(one, final=alone, ranking=replace(one.ranking, fits=fits), good=good)
    return None


def _beside(bench: InferenceProblem, found: Decision, ranking: Ranking) -> Decision | None:
    """Take a further cause, if it explains much."""
    if not ranking.fits:
        return None
    good, limits = goodness(bench, ranking.best), LIMITS[bench.kind]
    gain = ranking.best_evidence - max(found.final.log_evidence, found.null.log_evidence)
    needed = limits.second_nats if good.is_good else PARTIAL_NATS
    if found.good.is_good:
        needed = found.good.times_underrated * limits.beside_nats
    if gain <= needed or good.score >= max(found.good.score, 1.0):
        return None
    verdict = EXPLAINED if good.is_good else UNEXPLAINED
    return replace(found, verdict=verdict, final=ranking.best, further=(*found.further, ranking), good=good)


def only_null(bench: InferenceProblem) -> Decision:
    """Fit the nominal model and search for nothing.

    Parameters
    ----------
    bench : InferenceProblem
        Data and model.

    Returns
    -------
    Decision
        Without a cause: consistent, or unexplained.
    """
    null = fit_nothing(bench)
    good = goodness(bench, null)
    nothing = Ranking(base=null, fits=(), n_tried=0)
    verdict = CONSISTENT if good.is_good else UNEXPLAINED
    return Decision(verdict=verdict, null=null, final=null, ranking=nothing, further=(), good=good, null_good=good)


def without_last(bench: InferenceProblem, found: Decision) -> Decision:
    """Leave out the last cause.

    Parameters
    ----------
    bench : InferenceProblem
        Data and model.
    found : Decision
        With one cause or more.

    Returns
    -------
    Decision
        Unexplained, with one cause less.
    """
    left = found.further[:-1]
    fit = left[-1].best if left else found.ranking.best if found.further else found.null
    return replace(found, verdict=UNEXPLAINED, final=fit, further=left, good=goodness(bench, fit))


def fit_without(bench: InferenceProblem, fit: Fit, number: int) -> Fit:
    """Fit all causes of a fit but one: what that one explains beside the others.

    Parameters
    ----------
    bench : InferenceProblem
        Data and model.
    fit : Fit
        With several causes.
    number : int
        Which one is left out.

    Returns
    -------
    Fit
        With one cause less.
    """
    counts = fit.hypothesis.counts
    start = sum(counts[:number])
    values = np.delete(fit.values, np.arange(start, start + counts[number]))
    causes = tuple(cause for index, cause in enumerate(fit.hypothesis.causes) if index != number)
    from_there = polish(bench.suppose(causes), bench.data, values, unknown=fit.unknown, iterations=12)
    if gain_over(fit, from_there) <= PARTIAL_NATS:
        return from_there
    anew = bench.fit(causes, values)
    return max(from_there, anew, key=lambda one: one.log_evidence)


def gain_over(fit: Fit, base: Fit) -> float:
    """Give the evidence of a fit over that of another, nats."""
    return fit.log_evidence - base.log_evidence
