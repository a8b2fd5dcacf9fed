"""The ambiguity set: what explains a test nearly as well as the best does, rescored with smaller model tolerances.

Tolerances are bounds that a user states; many a model is better. Where it is, an effect at a wrong location needs more
of them than at the right one, and that counts for little as long as they are thought to be large. Each candidate's
evidence is the mean of what it is with the stated tolerances and with parts of them: a model that needs them as they
are makes those vanish, and nothing changes. How much of its FRFs no parameter of the model stands for is a part of the
tolerance too; the best explanation says which part is likely.

A search steps to better locations and stops where none is; what is as good on the far side of a structure, or along a
flat valley, it need not have found. Without these a location looks surer than it is, and now and then the best of them
is the true one. So candidates are added wherever a global scan finds the best effect likely, and beside the best ones
until all neighbours are worse.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from frf_ipz.diagnosis.evidence.inference_problem import compute_weights, make_data
from frf_ipz.diagnosis.evidence.map_fit import adopt_modes, fit_map
from frf_ipz.diagnosis.search.component_search import AMBIGUOUS, Ranking, keep_better, rank_fits
from frf_ipz.diagnosis.search.global_scan import scan_globally
from frf_ipz.diagnosis.search.neighbourhood_search import (
    Fits,
    find_cost_limit,
    fit_from_neighbour,
    list_imitators,
    search_neighbourhoods,
)
from frf_ipz.diagnosis.search.robust_refinement import GAIN, REFINED_ERROR, refine, select_apart

if TYPE_CHECKING:
    from collections.abc import Container, Iterable

    from frf_ipz.diagnosis.catalogue.effect import Effect
    from frf_ipz.diagnosis.evidence.fit import Data, Fit
    from frf_ipz.diagnosis.evidence.hypothesis import Component, ComponentKey
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.diagnosis.search.robust_refinement import Start

N_DISTANT = 8  # locations anywhere, no neighbours of each other, by the cost of a global scan
EQUAL_COST_RATIO = 1.1  # times the best cost there: locations as good as the best, though they may be its neighbours
MAX_EQUAL = 4  # such locations
PARTS = (0.3, 0.1)  # of the tolerances of stiffness, mass and frequencies
FLOORS = (0.3, 0.1)  # parts of the errors of FRFs that no parameter stands for
CANDIDATES_PER_EFFECT, MAX_CANDIDATES = 8, 24  # locations of one effect that are rescored, and of all effects
NEIGHBOURS_WITHIN = 4.0  # log Bayes factor behind the best rescored fit: neighbours of these are rescored too
MAX_NEIGHBOURS = 30  # that are rescored
MAX_IMITATOR_ROUNDS = 2  # times that an imitator of the best may become the best itself
N_FITTED = 30  # locations, by the cost of a global scan
ITERATIONS = 20


def add_distant_candidates(problem: InferenceProblem, ranking: Ranking, fits: Fits) -> int:
    """Fit the most probable effect wherever a global scan finds it likely, and around where that is better.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    ranking : Ranking
        Of a search, with one fit at least.
    fits : dict
        By the key of their last component; new ones are added.

    Returns
    -------
    int
        Number of scanned locations.
    """
    best = ranking.best
    effect = best.hypothesis.components[-1].effect
    starts = _scan_effect(problem, ranking, effect)
    equal = [start for start in starts[:MAX_EQUAL] if start.cost < EQUAL_COST_RATIO * starts[0].cost]
    for start in (*equal, *select_apart(starts, N_DISTANT)):
        if start.component.key not in fits:
            cost_limit = find_cost_limit(fits.values())
            fits[start.component.key] = fit_from_neighbour(problem, ranking.base, start.component, best, cost_limit)
    if max(fit.log_evidence for fit in fits.values()) > best.log_evidence + GAIN:
        search_neighbourhoods(problem, ranking.base, fits, 1)
    return len(starts)


def _scan_effect(problem: InferenceProblem, ranking: Ranking, effect: Effect) -> list[Start]:
    """Scan one effect, if the search has not: of each it scanned all locations by themselves."""
    known = [start for start in ranking.scanned if start.component.effect.name == effect.name]
    return known or scan_globally(replace(problem, effects={effect.name: effect}), ranking.base)


def find_next_neighbour(
    problem: InferenceProblem, candidates: Iterable[Fit], known: Container[ComponentKey]
) -> tuple[Component, Fit] | None:
    """Choose an unknown neighbour of the first fit that has one.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    candidates : iterable of Fit
        The best first.
    known : container of keys
        Of last components.

    Returns
    -------
    (Component, Fit) or None
        The component, and the fit that it is a neighbour of; None where all are known.
    """
    for fit in candidates:
        component = fit.hypothesis.components[-1]
        for location in component.effect.neighbours(problem.context, component.location):
            neighbour = replace(component, location=location)
            if neighbour.key not in known:
                return neighbour, fit
    return None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Rescored:
    """A fit with the values of the likeliest tolerances, and its evidence over all of them."""

    fit: Fit
    log_evidence: float


_RescoredFits: TypeAlias = "dict[ComponentKey, _Rescored]"


def rescore_ambiguity_set(problem: InferenceProblem, ranking: Ranking) -> Ranking:
    """Rescore what is nearly as probable as the best, and further candidates.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    ranking : Ranking
        Of a search.

    Returns
    -------
    Ranking
        With other evidences relative to each other; the largest stays what it was.
    """
    if not ranking.fits or not ranking.fits[0].explains_nearly_all:
        return ranking
    fits: Fits = {fit.hypothesis.components[-1].key: fit for fit in ranking.fits}
    is_found = ranking.best.log_evidence > ranking.base.log_evidence + AMBIGUOUS
    n_tried = ranking.n_tried + (add_distant_candidates(problem, ranking, fits) if is_found else 0)
    candidates = _select_candidates(fits)
    rescored: _RescoredFits = {}
    if len(candidates) > 1:
        data = _find_likeliest_errors(problem, candidates[0])
        strict_problems = {
            part: replace(problem, nuisance_prior=problem.nuisance_prior.scaled_by(part), data=data) for part in PARTS
        }
        rescored = {fit.hypothesis.components[-1].key: _rescore(problem, strict_problems, fit) for fit in candidates}
        if is_found:
            _rescore_neighbours(problem, ranking.base, fits, rescored, strict_problems)
            _rescore_imitators(problem, ranking.base, fits, rescored, strict_problems)
    return replace(ranking, fits=_merge_by_evidence(fits, rescored), n_tried=n_tried)


def _select_candidates(fits: Fits) -> list[Fit]:
    """Select what is nearly as probable as the best, some locations of each effect, the best first."""
    order = sorted(fits.values(), key=lambda fit: -fit.log_evidence)
    counts = Counter[str]()
    candidates: list[Fit] = []
    for fit in order:
        effect = fit.hypothesis.components[-1].effect.name
        counts[effect] += 1
        if fit.log_evidence > order[0].log_evidence - AMBIGUOUS and counts[effect] <= CANDIDATES_PER_EFFECT:
            candidates.append(fit)
    return candidates[:MAX_CANDIDATES]


def _rescore_neighbours(
    problem: InferenceProblem,
    base: Fit,
    fits: Fits,
    rescored: _RescoredFits,
    strict_problems: dict[float, InferenceProblem],
) -> None:
    """Rescore neighbours of the best candidates until all further ones are worse."""
    rejected: set[ComponentKey] = set()
    for _ in range(MAX_NEIGHBOURS):
        order = sorted(rescored.values(), key=lambda candidate: -candidate.log_evidence)
        candidates = [
            candidate.fit for candidate in order if candidate.log_evidence > order[0].log_evidence - NEIGHBOURS_WITHIN
        ]
        neighbour = find_next_neighbour(problem, candidates, rejected | rescored.keys())
        if neighbour is None:
            return
        component, template = neighbour
        if not _add_candidate(problem, base, component, template, fits, rescored, strict_problems):
            rejected.add(component.key)


def _rescore_imitators(
    problem: InferenceProblem,
    base: Fit,
    fits: Fits,
    rescored: _RescoredFits,
    strict_problems: dict[float, InferenceProblem],
) -> None:
    """Rescore imitators of the best at its location, and their neighbours: a search found theirs elsewhere."""
    for _ in range(MAX_IMITATOR_ROUNDS):
        best = max(rescored.values(), key=lambda candidate: candidate.log_evidence)
        imitators = [component for component in list_imitators(problem, best.fit) if component.key not in rescored]
        added = [
            component
            for component in imitators
            if _add_candidate(problem, base, component, best.fit, fits, rescored, strict_problems)
        ]
        if all(rescored[component.key].log_evidence < best.log_evidence - NEIGHBOURS_WITHIN for component in added):
            return
        _rescore_neighbours(problem, base, fits, rescored, strict_problems)


def _add_candidate(
    problem: InferenceProblem,
    base: Fit,
    component: Component,
    template: Fit,
    fits: Fits,
    rescored: _RescoredFits,
    strict_problems: dict[float, InferenceProblem],
) -> bool:
    """Fit a component from a similar one, and rescore it if it is near the best; False if it is not."""
    if component.key not in fits:
        fits[component.key] = fit_from_neighbour(problem, base, component, template, find_cost_limit(fits.values()))
    fit = fits[component.key]
    is_near = fit.log_evidence > max(candidate.log_evidence for candidate in fits.values()) - AMBIGUOUS
    if is_near:
        rescored[component.key] = _rescore(problem, strict_problems, fit)
    return is_near


def _merge_by_evidence(fits: Fits, rescored: _RescoredFits) -> tuple[Fit, ...]:
    """Sort fits by falling evidence; what was not rescored is put behind the ambiguity set."""
    if not rescored:
        return tuple(sorted(fits.values(), key=lambda fit: -fit.log_evidence))
    largest = max(fit.log_evidence for fit in fits.values())
    shift = largest - max(candidate.log_evidence for candidate in rescored.values())
    merged = [replace(candidate.fit, log_evidence=candidate.log_evidence + shift) for candidate in rescored.values()]
    remaining = [
        replace(fit, log_evidence=min(fit.log_evidence, largest - AMBIGUOUS))
        for key, fit in fits.items()
        if key not in rescored
    ]
    return tuple(sorted([*merged, *remaining], key=lambda fit: -fit.log_evidence))


def _find_likeliest_errors(problem: InferenceProblem, best: Fit) -> Data:
    """Give the data the FRF errors that are likeliest by the best explanation."""
    data, options = problem.data, problem.context.options
    largest = best.log_evidence + data.whitening.log_density
    for floor in FLOORS:
        tighter = make_data(data.measured, options, free_gains=data.free_gains, floor=floor)
        refitted = fit_map(best.hypothesis, tighter, best.values, nuisance=best.nuisance, iterations=8, tolerance=0.1)
        log_evidence = refitted.log_evidence + tighter.whitening.log_density
        if log_evidence < largest:
            break
        data, largest = tighter, log_evidence
    return data


def _rescore(problem: InferenceProblem, strict_problems: dict[float, InferenceProblem], fit: Fit) -> _Rescored:
    """Give a fit its evidence summed over tolerances, and the values of the likeliest ones."""
    best, mean, last = fit, fit.log_evidence, fit
    for part, strict_problem in strict_problems.items():
        last = _fit_with_part(problem, strict_problem, part, last)
        mean = float(np.logaddexp(mean, last.log_evidence))
        best = max(best, last, key=lambda candidate: candidate.log_evidence)
    return _Rescored(fit=replace(best, log_evidence=fit.log_evidence), log_evidence=mean)


def _fit_with_part(problem: InferenceProblem, strict_problem: InferenceProblem, part: float, fit: Fit) -> Fit:
    """Refit with a part of the tolerances; everything but the evidence is given for the full ones."""
    nuisance_prior = problem.nuisance_prior
    hypothesis = strict_problem.make_hypothesis(fit.hypothesis.components)
    nuisance = nuisance_prior.rescale(fit.nuisance, part)
    refitted = fit_map(hypothesis, strict_problem.data, fit.values, nuisance=nuisance, iterations=8, tolerance=0.1)
    rescaled = nuisance_prior.rescale(refitted.nuisance, 1 / part)
    whitened_nuisance, _ = nuisance_prior.whiten(rescaled)
    white = problem.data.misfit(fit.hypothesis.respond(refitted.values, rescaled, problem.data.measured.s))
    return replace(
        fit,
        values=refitted.values,
        nuisance=rescaled,
        misfit=float(white @ white),
        nuisance_chi2=float(whitened_nuisance @ whitened_nuisance),
        log_evidence=refitted.log_evidence
        + strict_problem.data.whitening.log_density
        - problem.data.whitening.log_density,
    )


def fit_distant_locations(problem: InferenceProblem, ranking: Ranking) -> Ranking:
    """Fit the most probable component elsewhere, where it explains the test but needs too much of the tolerances.

    A short stiff spring between two nodes does nearly what a softer one between nodes farther apart does, and on the
    way from one to the other everything is worse. The frequencies of what explains the test already are right, whatever
    the location: every likely location is fitted from there.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    ranking : Ranking
        Of a search.

    Returns
    -------
    Ranking
        With more fits.
    """
    best, base = ranking.best, ranking.base
    effect = best.hypothesis.components[-1].effect
    starts = _scan_effect(problem, ranking, effect)
    fits: Fits = {fit.hypothesis.components[-1].key: fit for fit in ranking.fits}
    weights = compute_weights(problem.coarse, REFINED_ERROR)
    for start in [start for start in starts if start.component.key not in fits][:N_FITTED]:
        hypothesis = problem.make_hypothesis((*base.hypothesis.components, start.component))
        refined, _ = refine(hypothesis, problem.coarse, weights, best.values)  # far from the axis, where all is smooth
        for values in (np.concatenate([base.values, start.values]), refined):
            nuisance = adopt_modes(hypothesis, hypothesis.to_physical(hypothesis.clip_to_searched(values)), best)
            cost_limit = find_cost_limit(fits.values())
            keep_better(
                fits,
                fit_map(
                    hypothesis, problem.data, values, nuisance=nuisance, iterations=ITERATIONS, cost_limit=cost_limit
                ),
            )
    search_neighbourhoods(problem, base, fits)
    return replace(ranking, fits=rank_fits(problem, fits.values()), n_tried=ranking.n_tried + len(starts))
