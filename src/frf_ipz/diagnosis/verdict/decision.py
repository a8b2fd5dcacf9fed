"""One cause, a few, or none: searches until what is left is no more than noise and tolerances, and decides."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.evidence.map_fit import fit_map
from frf_ipz.diagnosis.search.ambiguity_set import fit_distant_locations, rescore_ambiguity_set
from frf_ipz.diagnosis.search.component_search import Ranking, fit_null_model, search_component, search_small_component
from frf_ipz.diagnosis.search.pair_search import search_pair
from frf_ipz.diagnosis.verdict.findings import is_significant
from frf_ipz.diagnosis.verdict.goodness import (
    FIRST_LOG_BAYES_FACTOR,
    LIMITS,
    PARTIAL_LOG_BAYES_FACTOR,
    STRONG_LOG_BAYES_FACTOR,
    Goodness,
    assess_goodness,
)

if TYPE_CHECKING:
    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.progress import Progress

STRAINED_SCORE = 0.75  # score of a cause that explains, but may stand for two others: 3 of 89 single ones had more
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
    further_rankings : tuple of Ranking
        Of each further cause beside its base, where several were found.
    goodness, null_goodness : Goodness
        Of what was found, and of the nominal model.
    unnamed_force : Fit, optional
        Of a force of another kind that explains more than what was found.
    """

    verdict: str
    null: Fit
    final: Fit
    ranking: Ranking
    further_rankings: tuple[Ranking, ...]
    goodness: Goodness
    null_goodness: Goodness
    unnamed_force: Fit | None = None


def decide(problem: InferenceProblem, progress: Progress) -> Decision:
    """Search, and decide what is missing.

    Parameters
    ----------
    problem : InferenceProblem
        Data, model and effects.
    progress : Progress
        Told how far it is.

    Returns
    -------
    Decision
        The verdict and the fits that it rests on.
    """
    progress(0.2, "fitting the nominal model")
    null = fit_null_model(problem)
    null_goodness = assess_goodness(problem, null)
    progress(0.3, "searching for one cause")
    ranking = search_component(problem, null)
    needed = _required_log_bayes_factor(problem, null_goodness, ranking.best)
    if not null_goodness.is_good or log_bayes_factor(ranking.best, null) >= needed:
        ranking = rescore_ambiguity_set(problem, ranking)
    if ranking.best.explains_nearly_all and not assess_goodness(problem, ranking.best).is_good:
        ranking = rescore_ambiguity_set(problem, fit_distant_locations(problem, ranking))
    best = ranking.best
    goodness = assess_goodness(problem, best)
    one = Decision(
        verdict=EXPLAINED,
        null=null,
        final=best,
        ranking=ranking,
        further_rankings=(),
        goodness=goodness,
        null_goodness=null_goodness,
    )
    if null_goodness.is_good and (log_bayes_factor(best, null) < needed or not is_significant(best, -1)):
        return replace(one, verdict=CONSISTENT, final=null, goodness=null_goodness)
    progress(0.6, "searching for a second cause")
    if goodness.is_good:
        return _accept_first(problem, one)
    second = _search_pair(problem, ranking)
    two = _accept_further(problem, one, second)
    if two is None:
        return replace(one, verdict=UNEXPLAINED, final=best if log_bayes_factor(best, null) > needed else null)
    alone = _drop_needless(problem, one, two.final)
    if alone is not None:
        return alone
    if (
        two.verdict == EXPLAINED
        or not two.final.is_nearly_right
        or log_bayes_factor(second.best, second.base) < STRONG_LOG_BAYES_FACTOR
    ):
        return two
    progress(0.8, "searching for a third cause")
    three = _accept_further(problem, two, search_small_component(problem, second.best, STRONG_LOG_BAYES_FACTOR))
    return three if three is not None and three.verdict == EXPLAINED else two


def _required_log_bayes_factor(problem: InferenceProblem, null_goodness: Goodness, best: Fit) -> float:
    """Evidence that a first cause must have: where it leaves less of a piece, errors there are not underrated."""
    left = assess_goodness(problem, best).error_underestimation
    return null_goodness.required_log_bayes_factor * min(1.0, left / null_goodness.error_underestimation)


def _accept_first(problem: InferenceProblem, one: Decision) -> Decision:
    """Take a cause that leaves nothing to explain, if it explains anything, and what explains much beside it."""
    least = min(
        FIRST_LOG_BAYES_FACTOR, LIMITS[problem.kind].second_log_bayes_factor
    )  # the nominal model does not explain: what is likelier does
    if not one.null_goodness.is_good and log_bayes_factor(one.final, one.null) < least:
        return replace(one, verdict=UNEXPLAINED, final=one.null, goodness=one.null_goodness)
    second = rescore_ambiguity_set(
        problem, search_small_component(problem, one.final, LIMITS[problem.kind].beside_log_bayes_factor)
    )
    two = _accept_further(problem, one, second)
    if two is None and one.goodness.score > STRAINED_SCORE:
        two = _accept_further(problem, one, _search_pair(problem, one.ranking))
    return two or one


def _search_pair(problem: InferenceProblem, ranking: Ranking) -> Ranking:
    """Search for two causes of which neither need be the best one alone."""
    return rescore_ambiguity_set(
        problem, search_pair(problem, ranking, lambda fit: assess_goodness(problem, fit).is_good)
    )


def _drop_needless(problem: InferenceProblem, one: Decision, both: Fit) -> Decision | None:
    """Leave out a cause beside which the other one explains as much: it only helped to find it."""
    for number in range(2):
        alone = fit_without_component(problem, both, number)
        goodness = assess_goodness(problem, alone)
        if goodness.is_good and log_bayes_factor(both, alone) <= LIMITS[problem.kind].beside_log_bayes_factor:
            fits = tuple(sorted((alone, *one.ranking.fits), key=lambda fit: -fit.log_evidence))
            return replace(one, final=alone, ranking=replace(one.ranking, fits=fits), goodness=goodness)
    return None


def _accept_further(problem: InferenceProblem, found: Decision, ranking: Ranking) -> Decision | None:
    """Take a further cause, if it explains much."""
    if not ranking.fits:
        return None
    goodness, limits = assess_goodness(problem, ranking.best), LIMITS[problem.kind]
    gain = ranking.best_evidence - max(found.final.log_evidence, found.null.log_evidence)
    needed = limits.second_log_bayes_factor if goodness.is_good else PARTIAL_LOG_BAYES_FACTOR
    if found.goodness.is_good:
        needed = found.goodness.error_underestimation * limits.beside_log_bayes_factor
    if gain <= needed or goodness.score >= max(found.goodness.score, 1.0):
        return None
    verdict = EXPLAINED if goodness.is_good else UNEXPLAINED
    return replace(
        found,
        verdict=verdict,
        final=ranking.best,
        further_rankings=(*found.further_rankings, ranking),
        goodness=goodness,
    )


def decide_without_search(problem: InferenceProblem) -> Decision:
    """Fit the nominal model and search for nothing.

    Parameters
    ----------
    problem : InferenceProblem
        Data and model.

    Returns
    -------
    Decision
        Without a cause: consistent, or unexplained.
    """
    null = fit_null_model(problem)
    goodness = assess_goodness(problem, null)
    nothing = Ranking(base=null, fits=(), n_tried=0)
    verdict = CONSISTENT if goodness.is_good else UNEXPLAINED
    return Decision(
        verdict=verdict,
        null=null,
        final=null,
        ranking=nothing,
        further_rankings=(),
        goodness=goodness,
        null_goodness=goodness,
    )


def drop_last_component(problem: InferenceProblem, found: Decision) -> Decision:
    """Leave out the last cause.

    Parameters
    ----------
    problem : InferenceProblem
        Data and model.
    found : Decision
        With one cause or more.

    Returns
    -------
    Decision
        Unexplained, with one cause less.
    """
    left = found.further_rankings[:-1]
    fit = left[-1].best if left else found.ranking.best if found.further_rankings else found.null
    return replace(found, verdict=UNEXPLAINED, final=fit, further_rankings=left, goodness=assess_goodness(problem, fit))


def fit_without_component(problem: InferenceProblem, fit: Fit, number: int) -> Fit:
    """Fit all causes of a fit but one: what that one explains beside the others.

    Parameters
    ----------
    problem : InferenceProblem
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
    components = tuple(component for index, component in enumerate(fit.hypothesis.components) if index != number)
    from_there = fit_map(
        problem.make_hypothesis(components), problem.data, values, nuisance=fit.nuisance, iterations=12
    )
    if log_bayes_factor(fit, from_there) <= PARTIAL_LOG_BAYES_FACTOR:
        return from_there
    anew = problem.fit(components, values)
    return max(from_there, anew, key=lambda one: one.log_evidence)


def log_bayes_factor(fit: Fit, base: Fit) -> float:
    """Give the evidence of a fit over that of another, nats."""
    return fit.log_evidence - base.log_evidence
