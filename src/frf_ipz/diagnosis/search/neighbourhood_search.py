"""Steps to neighbours of a place, and to effects that look alike, as long as that makes a cause more probable."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from frf_ipz.diagnosis.evidence.fit import Fit
from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem, compute_weights
from frf_ipz.diagnosis.evidence.map_fit import fit_map
from frf_ipz.diagnosis.search.global_scan import find_best_start, list_components
from frf_ipz.diagnosis.search.robust_refinement import REFINED_ERROR, refine

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.catalogue.effect import Effect, Location
    from frf_ipz.diagnosis.evidence.hypothesis import Component, Hypothesis

Fits: TypeAlias = dict[tuple[object, ...], Fit]
"""Fits by the key of their last cause."""

N_EFFECTS = 6  # effects whose neighbours are looked at
MAX_BEHIND, MAX_BEHIND_COMPLETE = (
    2000.0,
    300.0,
)  # nats behind the best, and behind one that explains all: not looked at any more
COST_RATIO = 2.0  # times the cost of one that explains all: a fit on its way there may have reached that much
UNFINISHED_COST_RATIO = (
    4.0  # times the cost of the best place: a fit beside it that has not converged may yet fall below that
)
GAIN = 0.5  # nats: a neighbour must be better by that
MAX_STEPS = 12
MAX_STARTS = 64  # of an effect that looks like another one
N_GLANCED, N_FITTED_AROUND = 24, 4  # places further around


def find_cost_limit(fits: Iterable[Fit]) -> float:
    """Say below what cost a further fit is wanted.

    Parameters
    ----------
    fits : iterable of Fit
        What is known already.

    Returns
    -------
    float
        Not far above that of the best, if that explains nearly all; infinite otherwise: from a start that is a little
        off, a fit may gain little for many steps before it falls to a thousandth.
    """
    best = max(fits, key=lambda fit: fit.log_evidence, default=None)
    return COST_RATIO * best.cost + MAX_BEHIND_COMPLETE if best is not None and best.explains_nearly_all else np.inf


def search_neighbourhoods(problem: InferenceProblem, base: Fit, fits: Fits, n_effects: int = N_EFFECTS) -> None:
    """Step to neighbours as long as that makes an effect more probable.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    base : Fit
        What is supposed already.
    fits : dict
        By the key of their last cause, whose place is changed; new fits are added.
    n_effects : int
        The best ones that are stepped.
    """
    ranked = sorted(fits.values(), key=lambda fit: -fit.log_evidence)
    if ranked and not ranked[0].is_far_off:
        _add_imitators(problem, base, ranked[0], fits)
        ranked = sorted(fits.values(), key=lambda fit: -fit.log_evidence)
    leaders: dict[str, Fit] = {}
    for fit in ranked:
        leaders.setdefault(fit.hypothesis.components[-1].effect.name, fit)
    for leader in list(leaders.values())[:n_effects]:
        best = max(fits.values(), key=lambda fit: fit.log_evidence)
        behind = MAX_BEHIND_COMPLETE if best.explains_nearly_all else MAX_BEHIND
        if leader.log_evidence > best.log_evidence - behind and not leader.is_far_off:
            _search_neighbourhood(problem, base, leader, fits)


def _add_imitators(problem: InferenceProblem, base: Fit, best: Fit, fits: Fits) -> None:
    """Fit what looks like the best, at its place or at one end of it."""
    for other in list_imitators(problem, best):
        if other.key not in fits:
            fits[other.key] = fit_from_neighbour(problem, base, other, best, find_cost_limit(fits.values()))


def list_imitators(problem: InferenceProblem, fit: Fit) -> list[Component]:
    """List what looks like the last cause of a fit, at its place or at one end of it.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    fit : Fit
        With one cause at least.

    Returns
    -------
    list of Cause
        Of other effects.
    """
    component = fit.hypothesis.components[-1]
    alike = [effect for effect in problem.effects.values() if are_imitators(effect, component.effect)]
    return [
        other
        for effect in alike
        for other in list_components(effect, problem.context)
        if _is_within(other.location, component.location)
    ]


def _is_within(one: Location, other: Location) -> bool:
    """Say whether a place is another, or one of the two nodes that the other lies between."""
    inner, outer = one.entries.get("nodes"), other.entries.get("nodes")
    is_end = isinstance(inner, list) and isinstance(outer, list) and set(inner) < set(outer)
    return one.entries == other.entries or is_end


def are_imitators(one: Effect, other: Effect) -> bool:
    """Say whether one effect is known to look like another, either way round."""
    return one.name in other.imitators or other.name in one.imitators


def _search_neighbourhood(problem: InferenceProblem, base: Fit, fit: Fit, fits: Fits) -> None:
    for _ in range(MAX_STEPS):
        component = fit.hypothesis.components[-1]
        beside = component.effect.neighbours(problem.context, component.location)
        better = _best_of_locations(problem, base, fit, beside, fits)
        if better is fit:
            _continue_unfinished(problem, base, fit, beside, fits)
            better = _best_of_locations(problem, base, fit, beside, fits)
        if better is fit and fit.is_nearly_right:
            better = _best_of_locations(problem, base, fit, _promising_surroundings(problem, fit), fits)
        if better is fit:
            return
        fit = better


def _continue_unfinished(
    problem: InferenceProblem, base: Fit, fit: Fit, locations: Sequence[Location], fits: Fits
) -> None:
    """Go on with fits beside the best place that were given up on their way: small steps may lead far down.

    Where they do not, the best place's values and scatter may be the better start.
    """
    for component in (replace(fit.hypothesis.components[-1], location=location) for location in locations):
        known = fits[component.key]
        if known.has_converged or known.cost >= UNFINISHED_COST_RATIO * fit.cost + MAX_BEHIND_COMPLETE:
            continue
        went_on = fits[component.key] = problem.fit_to_convergence(known)
        if went_on.cost > fit.cost:
            anew = fit_from_neighbour(problem, base, component, fit, find_cost_limit(fits.values()))
            fits[component.key] = max(went_on, anew, key=lambda one: one.log_evidence)


def _best_of_locations(
    problem: InferenceProblem, base: Fit, fit: Fit, locations: Sequence[Location], fits: Fits
) -> Fit:
    """Fit the last cause at other places too; the fit itself where none is better."""
    component = fit.hypothesis.components[-1]
    better = fit
    for location in locations:
        other = replace(component, location=location)
        if other.key in fits:
            tried = fits[other.key]
        else:
            tried = fits[other.key] = fit_from_neighbour(problem, base, other, fit, find_cost_limit(fits.values()))
        if tried.log_evidence > better.log_evidence + GAIN:
            better = tried
    return better


def _promising_surroundings(problem: InferenceProblem, fit: Fit) -> list[Location]:
    """Choose places further around the last cause by one step on few data: far from the axis they are all alike."""
    glances = []
    for components, values in refine_surroundings(problem, fit.hypothesis.components, fit.values)[:N_GLANCED]:
        hypothesis = problem.make_hypothesis(components)
        start, nuisance = problem.nearest_start(hypothesis, (values,), fit)
        glances.append(fit_map(hypothesis, problem.sparse_data, start, nuisance=nuisance, iterations=1))
    glances.sort(key=lambda glance: -glance.log_evidence)
    return [glance.hypothesis.components[-1].location for glance in glances[:N_FITTED_AROUND]]


def refine_surroundings(
    problem: InferenceProblem, components: tuple[Component, ...], values: FloatArray
) -> list[tuple[tuple[Component, ...], FloatArray]]:
    """Bring values to places further around the last cause.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    components : tuple of Cause
        The last one is moved.
    values : (n_parameters,) array
        Of all causes.

    Returns
    -------
    list of (causes, values)
        The best place first, as seen far from the axis.
    """
    *known, component = components
    weights = compute_weights(problem.coarse, REFINED_ERROR)
    found = []
    for location in component.effect.surroundings(problem.context, component.location):
        there = (*known, replace(component, location=location))
        at, cost = refine(problem.make_hypothesis(there), problem.coarse, weights, values, iterations=4)
        found.append((cost, there, at))
    return [(there, at) for _, there, at in sorted(found, key=lambda one: one[0])]


def fit_from_neighbour(problem: InferenceProblem, base: Fit, component: Component, fit: Fit, cost_limit: float) -> Fit:
    """Fit a cause from the values and the scatter of a fit of a similar one.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    base : Fit
        What is supposed already.
    component : Cause
        One more.
    fit : Fit
        Of another last cause beside the same base.
    cost_limit : float
        Cost that the fit is wanted below.

    Returns
    -------
    Fit
        Of all causes.
    """
    components = (*base.hypothesis.components, component)
    hypothesis = problem.make_hypothesis(components)
    weights = compute_weights(problem.coarse, REFINED_ERROR)
    is_same = _names(hypothesis) == _names(fit.hypothesis)
    if is_same:
        start = fit.values
    else:
        best = find_best_start(problem, base, component, problem.coarse, weights, np.zeros(problem.nuisance_prior.size))
        start = np.concatenate([base.values, best.values])
    few = 4 if is_same and fit.is_nearly_right else 12
    values, _ = refine(hypothesis, problem.coarse, weights, start, iterations=few)
    if not fit.is_nearly_right:
        return problem.fit(components, values, cost_limit=cost_limit)
    known = fit.values[: len(base.values)]
    own = () if is_same else _thin_grid(component.effect.start_values(problem.context, component.location))
    starts = [values, start, *(np.concatenate([known, of_cause]) for of_cause in own)]
    start, nuisance = problem.nearest_start(hypothesis, starts, fit)
    near = fit_map(
        hypothesis, problem.data, start, nuisance=nuisance, iterations=12, tolerance=0.1, cost_limit=cost_limit
    )
    return near if is_same or near.explains_nearly_all else problem.fit(components, values, cost_limit=cost_limit)


def _names(hypothesis: Hypothesis) -> list[str]:
    return [parameter.name for parameter in hypothesis.parameters]


def _thin_grid(grid: FloatArray) -> FloatArray:
    """Thin a grid, by an odd number: all values of each parameter stay."""
    return grid[:: len(grid) // MAX_STARTS | 1]
