"""The decision: searches for components until no more than noise and tolerances remain, and gives the verdict."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.deadline import DeadlineError
from frf_ipz.diagnosis.evidence.map_fit import fit_map
from frf_ipz.diagnosis.result import DiagnosisVerdict
from frf_ipz.diagnosis.search.ambiguity_set import fit_distant_locations, rescore_ambiguity_set
from frf_ipz.diagnosis.search.component_search import Ranking, fit_null_model, search_component, search_small_component
from frf_ipz.diagnosis.search.pair_search import search_pair
from frf_ipz.diagnosis.verdict.findings import is_significant
from frf_ipz.diagnosis.verdict.goodness import (
    Goodness,
    assess_goodness,
    least_log_bayes_factor,
    required_log_bayes_factor,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.progress import Progress

NEAR_LOG_BAYES_FACTOR = 50.0  # behind a pair: one component that is so near needs no second start
STRONG_LOG_BAYES_FACTOR = 200.0  # of a second component: with less, a third one is not searched for
PAIR_SCORE = 0.75  # of a component that explains: above, pairs are tried too; 3 of 89 single ones had more
# What was not looked at, where the time was over before that step was done
WHOLE = "any effect"
FIRST = "all effects at all their locations, and any second effect"
SECOND = "a second effect beside the first, and how surely the first is located"
THIRD = "a third effect beside the two"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Decision:
    """The verdict of a search, and the fits that it rests on.

    Parameters
    ----------
    verdict : DiagnosisVerdict
        What they say.
    null, final : Fit
        Of the nominal model with what its tolerances allow, and with what was found.
    ranking : Ranking
        Of one component.
    further_rankings : tuple of Ranking
        Of each further component beside its base, where several were found.
    goodness, null_goodness : Goodness
        Of what was found, and of the nominal model.
    unnamed_force : Fit, optional
        Of a force outside the catalogue that explains more than what was found.
    not_searched : str
        What the time did not suffice for, in words; empty for a complete search.
    """

    verdict: DiagnosisVerdict
    null: Fit
    final: Fit
    ranking: Ranking
    further_rankings: tuple[Ranking, ...]
    goodness: Goodness
    null_goodness: Goodness
    unnamed_force: Fit | None = None
    not_searched: str = ""


def decide(problem: InferenceProblem, progress: Progress, *, null: Fit | None = None) -> Decision:
    """Search, and decide what is missing.

    Parameters
    ----------
    problem : InferenceProblem
        Data, model and effects; its deadline says when the search ends.
    progress : Progress
        Receives the progress.
    null : Fit, optional
        Of the nominal model, where it is known.

    Returns
    -------
    Decision
        The verdict and the fits that it rests on; where the time was over, those found until then.
    """
    decision = nothing = decide_without_search(problem, null)
    try:
        for step in _decide_in_steps(problem, nothing, progress):
            decision = step
    except DeadlineError:
        return decision
    return replace(decision, not_searched="")


def _decide_in_steps(problem: InferenceProblem, nothing: Decision, progress: Progress) -> Iterator[Decision]:
    """Give a decision after each step of the search, with what has not been searched at that point."""
    yield replace(nothing, not_searched=WHOLE)
    progress(0.3, "searching for one effect")
    null, null_goodness = nothing.null, nothing.null_goodness
    ranking = search_component(problem, null, min_log_bayes_factor=least_log_bayes_factor(problem, null_goodness))
    first = _judge_first(problem, nothing, ranking)
    yield replace(first, not_searched=SECOND if ranking.is_complete else FIRST)
    if not ranking.is_complete:
        raise DeadlineError
    required = required_log_bayes_factor(problem, null_goodness, first.goodness)
    if not null_goodness.is_good or log_bayes_factor(ranking.best, null) >= required:
        ranking = rescore_ambiguity_set(problem, ranking)
    if ranking.best.explains_nearly_all and not assess_goodness(problem, ranking.best).is_good:
        ranking = rescore_ambiguity_set(problem, fit_distant_locations(problem, ranking))
    first = _judge_first(problem, nothing, ranking)
    yield replace(first, not_searched=SECOND)
    if first.verdict == DiagnosisVerdict.CONSISTENT:
        return
    progress(0.6, "searching for a second effect")
    if first.goodness.is_good:
        yield _accept_first(problem, first)
        return
    second = _search_pair(problem, ranking)
    whole = replace(
        first, verdict=DiagnosisVerdict.EXPLAINED, final=ranking.best, goodness=assess_goodness(problem, ranking.best)
    )
    pair_decision = _accept_further(problem, whole, second)
    if pair_decision is None:
        return
    single = _drop_needless(problem, whole, pair_decision.final)
    yield replace(single or pair_decision, not_searched=THIRD)
    if (
        single is not None
        or pair_decision.verdict == DiagnosisVerdict.EXPLAINED
        or not pair_decision.final.is_nearly_right
        or log_bayes_factor(second.best, second.base) < STRONG_LOG_BAYES_FACTOR
    ):
        return
    progress(0.8, "searching for a third effect")
    missing_gain = second.best.cost - pair_decision.goodness.good_cost(second.best.n_values)
    required = max(STRONG_LOG_BAYES_FACTOR, missing_gain)  # with less it is refused
    third = _accept_further(problem, pair_decision, search_small_component(problem, second.best, required))
    if third is not None and third.verdict == DiagnosisVerdict.EXPLAINED:
        yield third


def _judge_first(problem: InferenceProblem, nothing: Decision, ranking: Ranking) -> Decision:
    """Judge the best single component; the nominal model, where that explains as much."""
    null, best, goodness = nothing.null, ranking.best, assess_goodness(problem, ranking.best)
    first = replace(nothing, verdict=DiagnosisVerdict.EXPLAINED, final=best, ranking=ranking, goodness=goodness)
    gain = log_bayes_factor(best, null)
    required = required_log_bayes_factor(problem, nothing.null_goodness, goodness)
    if nothing.null_goodness.is_good and (gain < required or not is_significant(best, -1)):
        return replace(first, verdict=DiagnosisVerdict.CONSISTENT, final=null, goodness=nothing.goodness)
    if goodness.is_good:
        return first
    return replace(first, verdict=DiagnosisVerdict.UNEXPLAINED, final=best if gain > required else null)


def _accept_first(problem: InferenceProblem, first: Decision) -> Decision:
    """Accept a component that leaves nothing to explain, if it explains anything, and what explains much beside it."""
    required = required_log_bayes_factor(problem, first.null_goodness, first.goodness)
    if not first.null_goodness.is_good and log_bayes_factor(first.final, first.null) < required:
        return replace(first, verdict=DiagnosisVerdict.UNEXPLAINED, final=first.null, goodness=first.null_goodness)
    second = search_small_component(problem, first.final, required_log_bayes_factor(problem, first.goodness))
    pair_decision = _accept_further(problem, first, second)
    if pair_decision is not None:  # the largest evidence stays what it is: what is refused need not be rescored
        pair_decision = _accept_further(problem, first, rescore_ambiguity_set(problem, second))
    if pair_decision is None and first.goodness.score > PAIR_SCORE:
        pair_decision = _accept_further(problem, first, _search_pair(problem, first.ranking))
    return pair_decision or first


def _search_pair(problem: InferenceProblem, ranking: Ranking) -> Ranking:
    """Search for two components of which neither need be the best one alone."""
    good_cost = assess_goodness(problem, ranking.best).good_cost(ranking.best.n_values)
    return rescore_ambiguity_set(
        problem, search_pair(problem, ranking, lambda fit: assess_goodness(problem, fit).is_good, good_cost)
    )


def _drop_needless(problem: InferenceProblem, first: Decision, pair_fit: Fit) -> Decision | None:
    """Drop a component beside which the other one explains as much: it only helped to find it."""
    pair_goodness = assess_goodness(problem, pair_fit)
    for number in range(2):
        single = fit_without_component(problem, pair_fit, number)
        goodness = assess_goodness(problem, single)
        required = required_log_bayes_factor(problem, goodness, pair_goodness)
        if goodness.is_good and log_bayes_factor(pair_fit, single) <= required:
            fits = tuple(sorted((single, *first.ranking.fits), key=lambda fit: -fit.log_evidence))
            return replace(first, final=single, ranking=replace(first.ranking, fits=fits), goodness=goodness)
    return None


def _accept_further(problem: InferenceProblem, decision: Decision, ranking: Ranking) -> Decision | None:
    """Accept a further component, if it explains much."""
    if not ranking.fits:
        return None
    goodness = assess_goodness(problem, ranking.best)
    gain = ranking.best_evidence - max(decision.final.log_evidence, decision.null.log_evidence)
    required = required_log_bayes_factor(problem, decision.goodness, goodness)
    if gain <= required or goodness.score >= max(decision.goodness.score, 1.0):
        return None
    verdict = DiagnosisVerdict.EXPLAINED if goodness.is_good else DiagnosisVerdict.UNEXPLAINED
    return replace(
        decision,
        verdict=verdict,
        final=ranking.best,
        further_rankings=(*decision.further_rankings, ranking),
        goodness=goodness,
    )


def decide_without_search(problem: InferenceProblem, null: Fit | None = None) -> Decision:
    """Decide by a fit of the nominal model alone.

    Parameters
    ----------
    problem : InferenceProblem
        Data and model.
    null : Fit, optional
        Of the nominal model, where it is known.

    Returns
    -------
    Decision
        Without a component: consistent, or unexplained.
    """
    null = fit_null_model(problem) if null is None else null
    goodness = assess_goodness(problem, null)
    return Decision(
        verdict=DiagnosisVerdict.CONSISTENT if goodness.is_good else DiagnosisVerdict.UNEXPLAINED,
        null=null,
        final=null,
        ranking=Ranking(base=null, fits=(), n_tried=0),
        further_rankings=(),
        goodness=goodness,
        null_goodness=goodness,
    )


def drop_last_component(problem: InferenceProblem, decision: Decision) -> Decision:
    """Drop the last component.

    Parameters
    ----------
    problem : InferenceProblem
        Data and model.
    decision : Decision
        With one component or more.

    Returns
    -------
    Decision
        Unexplained, with one component less.
    """
    rankings = decision.further_rankings[:-1]
    fit = rankings[-1].best if rankings else decision.ranking.best if decision.further_rankings else decision.null
    return replace(
        decision,
        verdict=DiagnosisVerdict.UNEXPLAINED,
        final=fit,
        further_rankings=rankings,
        goodness=assess_goodness(problem, fit),
    )


def fit_without_component(problem: InferenceProblem, fit: Fit, number: int) -> Fit:
    """Fit all components of a fit but one: what that one explains beside the others.

    Parameters
    ----------
    problem : InferenceProblem
        Data and model.
    fit : Fit
        With several components.
    number : int
        Index of the one that is left out.

    Returns
    -------
    Fit
        With one component less.
    """
    counts = fit.hypothesis.counts
    start = sum(counts[:number])
    values = np.delete(fit.values, np.arange(start, start + counts[number]))
    components = tuple(component for index, component in enumerate(fit.hypothesis.components) if index != number)
    from_there = fit_map(
        problem.make_hypothesis(components), problem.data, values, nuisance=fit.nuisance, iterations=12
    )
    if log_bayes_factor(fit, from_there) <= NEAR_LOG_BAYES_FACTOR:
        return from_there
    anew = problem.fit(components, values)
    return max(from_there, anew, key=lambda candidate: candidate.log_evidence)


def log_bayes_factor(fit: Fit, base: Fit) -> float:
    """Give the log Bayes factor of a fit over another one."""
    return fit.log_evidence - base.log_evidence
