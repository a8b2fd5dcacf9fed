"""The ambiguity set: what explains a test nearly as well as the best does, rescored with smaller model tolerances.

Tolerances are bounds that a user states; many a model is better. Where it is, an effect at a wrong location needs more
of them than at the right one, and that counts for little as long as they are thought to be large. Each candidate's
evidence is the mean of what it is with the stated tolerances and with parts of them: a model that needs them as they
are makes those vanish, and nothing changes. How much of its FRFs no parameter of the model stands for is a part of the
tolerance too; the best explanation says which part is likely.

A search steps to better locations and stops where none is; what is as good on the far side of a structure, or along a
flat valley, it need not have seen. Without these a location looks surer than it is, and now and then the best of them
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
from frf_ipz.diagnosis.search.component_search import Ranking, keep_better, rank_fits
from frf_ipz.diagnosis.search.global_scan import scan_globally
from frf_ipz.diagnosis.search.neighbourhood_search import (
    GAIN,
    Fits,
    find_cost_limit,
    fit_from_neighbour,
    list_imitators,
    search_neighbourhoods,
)
from frf_ipz.diagnosis.search.robust_refinement import REFINED_ERROR, refine, select_apart

if TYPE_CHECKING:
    from collections.abc import Container, Iterable

    from frf_ipz.diagnosis.evidence.fit import Data, Fit
    from frf_ipz.diagnosis.evidence.hypothesis import Component
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem

N_DISTANT = 8  # places anywhere, not beside each other, by what a wide search says of them
EQUAL_COST_RATIO, MAX_EQUAL = (
    1.1,
    4,
)  # times the best cost there: places as good as the best, though beside it, and how many
PARTS = (0.3, 0.1)  # of the tolerances of stiffness, mass and frequencies
FLOORS = (0.3, 0.1)  # parts of the errors of FRFs that no parameter stands for
AMBIGUOUS = 8.0  # nats behind the best: what is so near is weighed again
CANDIDATES_PER_EFFECT, MAX_CANDIDATES = 8, 24  # places of an effect that are, and of all effects
NEIGHBOURS_WITHIN, MAX_NEIGHBOURS = (
    4.0,
    30,
)  # nats behind the best of these, beside which places are looked at, and how many
MAX_IMITATOR_ROUNDS = 2  # times that what looks like the best may lead elsewhere
N_FITTED = 30  # places, by what a wide search says of them
ITERATIONS = 20


def add_distant_candidates(problem: InferenceProblem, ranking: Ranking, fits: Fits) -> int:
    """Fit the most probable effect wherever a wide search finds it likely, and around where that is better.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    ranking : Ranking
        Of a search, with one fit at least.
    fits : dict
        By the key of their last cause; new ones are added.

    Returns
    -------
    int
        Places that were looked at.
    """
    best = ranking.best
    effect = best.hypothesis.components[-1].effect
    starts = scan_globally(replace(problem, effects={effect.name: effect}), ranking.base)
    equal = [start for start in starts[:MAX_EQUAL] if start.cost < EQUAL_COST_RATIO * starts[0].cost]
    for start in (*equal, *select_apart(starts, N_DISTANT)):
        if start.component.key not in fits:
            cost_limit = find_cost_limit(fits.values())
            fits[start.component.key] = fit_from_neighbour(problem, ranking.base, start.component, best, cost_limit)
    if max(fit.log_evidence for fit in fits.values()) > best.log_evidence + GAIN:
        search_neighbourhoods(problem, ranking.base, fits, 1)
    return len(starts)


def find_next_neighbour(
    problem: InferenceProblem, near: Iterable[Fit], known: Container[tuple[object, ...]]
) -> tuple[Component, Fit] | None:
    """Choose a place that is not known beside the first fit that has such.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    near : iterable of Fit
        The best first.
    known : container of keys
        Of last causes.

    Returns
    -------
    (Cause, Fit) or None
        The cause, and the fit beside it; None where all are known.
    """
    for fit in near:
        component = fit.hypothesis.components[-1]
        for location in component.effect.neighbours(problem.context, component.location):
            other = replace(component, location=location)
            if other.key not in known:
                return other, fit
    return None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Rescored:
    """A fit with the values of the likeliest tolerances, and its evidence with all of them."""

    fit: Fit
    log_evidence: float


_RescoredFits: TypeAlias = dict[tuple[object, ...], _Rescored]


def rescore_ambiguity_set(problem: InferenceProblem, ranking: Ranking) -> Ranking:
    """Weigh again what is nearly as probable as the best, with what may be.

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
    near = _select_candidates(fits)
    settled: _RescoredFits = {}
    if len(near) > 1:
        data = _find_likeliest_errors(problem, near[0])
        stricts = {
            part: replace(problem, nuisance_prior=problem.nuisance_prior.with_part(part), data=data) for part in PARTS
        }
        settled = {fit.hypothesis.components[-1].key: _rescore(problem, stricts, fit) for fit in near}
        if is_found:
            _rescore_neighbours(problem, ranking.base, fits, settled, stricts)
            _rescore_imitators(problem, ranking.base, fits, settled, stricts)
    return replace(ranking, fits=_merge_by_evidence(fits, settled), n_tried=n_tried)


def _select_candidates(fits: Fits) -> list[Fit]:
    """Give what is nearly as probable as the best, some places of each effect, the best first."""
    order = sorted(fits.values(), key=lambda fit: -fit.log_evidence)
    counts = Counter[str]()
    near: list[Fit] = []
    for fit in order:
        effect = fit.hypothesis.components[-1].effect.name
        counts[effect] += 1
        if fit.log_evidence > order[0].log_evidence - AMBIGUOUS and counts[effect] <= CANDIDATES_PER_EFFECT:
            near.append(fit)
    return near[:MAX_CANDIDATES]


def _rescore_neighbours(
    problem: InferenceProblem, base: Fit, fits: Fits, settled: _RescoredFits, stricts: dict[float, InferenceProblem]
) -> None:
    """Weigh places beside the best ones until all that are left are worse."""
    far: set[tuple[object, ...]] = set()
    for _ in range(MAX_NEIGHBOURS):
        order = sorted(settled.values(), key=lambda one: -one.log_evidence)
        near = [one.fit for one in order if one.log_evidence > order[0].log_evidence - NEIGHBOURS_WITHIN]
        found = find_next_neighbour(problem, near, far | settled.keys())
        if found is None:
            return
        component, beside = found
        if not _add_candidate(problem, base, component, beside, fits, settled, stricts):
            far.add(component.key)


def _rescore_imitators(
    problem: InferenceProblem, base: Fit, fits: Fits, settled: _RescoredFits, stricts: dict[float, InferenceProblem]
) -> None:
    """Weigh what looks like the best where that sits now, and places beside it: theirs were found elsewhere before."""
    for _ in range(MAX_IMITATOR_ROUNDS):
        best = max(settled.values(), key=lambda one: one.log_evidence)
        others = [component for component in list_imitators(problem, best.fit) if component.key not in settled]
        added = [
            component
            for component in others
            if _add_candidate(problem, base, component, best.fit, fits, settled, stricts)
        ]
        if all(settled[component.key].log_evidence < best.log_evidence - NEIGHBOURS_WITHIN for component in added):
            return
        _rescore_neighbours(problem, base, fits, settled, stricts)


def _add_candidate(
    problem: InferenceProblem,
    base: Fit,
    component: Component,
    like: Fit,
    fits: Fits,
    settled: _RescoredFits,
    stricts: dict[float, InferenceProblem],
) -> bool:
    """Fit a cause from a similar one, and weigh it if it is near the best; False if it is not."""
    if component.key not in fits:
        fits[component.key] = fit_from_neighbour(problem, base, component, like, find_cost_limit(fits.values()))
    fit = fits[component.key]
    is_near = fit.log_evidence > max(one.log_evidence for one in fits.values()) - AMBIGUOUS
    if is_near:
        settled[component.key] = _rescore(problem, stricts, fit)
    return is_near


def _merge_by_evidence(fits: Fits, settled: _RescoredFits) -> tuple[Fit, ...]:
    """Sort fits by falling evidence; what was not weighed is worse than what was by as much as counts."""
    if not settled:
        return tuple(sorted(fits.values(), key=lambda fit: -fit.log_evidence))
    most = max(fit.log_evidence for fit in fits.values())
    shift = most - max(one.log_evidence for one in settled.values())
    weighed = [replace(one.fit, log_evidence=one.log_evidence + shift) for one in settled.values()]
    others = [
        replace(fit, log_evidence=min(fit.log_evidence, most - AMBIGUOUS))
        for key, fit in fits.items()
        if key not in settled
    ]
    return tuple(sorted([*weighed, *others], key=lambda fit: -fit.log_evidence))


def _find_likeliest_errors(problem: InferenceProblem, best: Fit) -> Data:
    """Give the data the errors of FRFs that are likeliest by the best explanation."""
    data, options = problem.data, problem.context.options
    most = best.log_evidence + data.whitening.log_density
    for floor in FLOORS:
        smaller = make_data(data.measured, options, free_gains=data.free_gains, floor=floor)
        again = fit_map(best.hypothesis, smaller, best.values, nuisance=best.nuisance, iterations=8, tolerance=0.1)
        likely = again.log_evidence + smaller.whitening.log_density
        if likely < most:
            break
        data, most = smaller, likely
    return data


def _rescore(problem: InferenceProblem, stricts: dict[float, InferenceProblem], fit: Fit) -> _Rescored:
    """Give a fit the mean evidence, and the values of the likeliest tolerances."""
    best, mean, last = fit, fit.log_evidence, fit
    for part, strict in stricts.items():
        last = _fit_with_part(problem, strict, part, last)
        mean = float(np.logaddexp(mean, last.log_evidence))
        best = max(best, last, key=lambda one: one.log_evidence)
    return _Rescored(fit=replace(best, log_evidence=fit.log_evidence), log_evidence=mean)


def _fit_with_part(problem: InferenceProblem, strict: InferenceProblem, part: float, fit: Fit) -> Fit:
    """Fit again with a part of the tolerances; everything but the evidence is given for all of them."""
    nuisance_prior = problem.nuisance_prior
    hypothesis = strict.make_hypothesis(fit.hypothesis.components)
    nuisance = nuisance_prior.in_parts(fit.nuisance, part)
    again = fit_map(hypothesis, strict.data, fit.values, nuisance=nuisance, iterations=8, tolerance=0.1)
    back = nuisance_prior.in_parts(again.nuisance, 1 / part)
    whitened_nuisance, _ = nuisance_prior.whiten(back)
    white = problem.data.misfit(fit.hypothesis.respond(again.values, back, problem.data.measured.s))
    return replace(
        fit,
        values=again.values,
        nuisance=back,
        misfit=float(white @ white),
        nuisance_chi2=float(whitened_nuisance @ whitened_nuisance),
        log_evidence=again.log_evidence + strict.data.whitening.log_density - problem.data.whitening.log_density,
    )


def fit_distant_locations(problem: InferenceProblem, ranking: Ranking) -> Ranking:
    """Fit the most probable cause at other places, where it explains the test but needs too much of the tolerances.

    A short stiff spring between two nodes does nearly what a softer one between nodes farther apart does, and on the
    way from one to the other everything is worse. The frequencies of what explains the test already are right, whatever
    the place: every likely place is fitted from there.

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
    starts = scan_globally(replace(problem, effects={effect.name: effect}), base)
    fits: Fits = {fit.hypothesis.components[-1].key: fit for fit in ranking.fits}
    weights = compute_weights(problem.coarse, REFINED_ERROR)
    for start in [start for start in starts if start.component.key not in fits][:N_FITTED]:
        hypothesis = problem.make_hypothesis((*base.hypothesis.components, start.component))
        moved, _ = refine(hypothesis, problem.coarse, weights, best.values)  # far from the axis, where all is smooth
        for values in (np.concatenate([base.values, start.values]), moved):
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
