"""Neighbourhood search: steps to neighbours and to imitators as long as that makes a component more probable."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from frf_ipz.diagnosis.evidence.fit import Fit
from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem, compute_weights
from frf_ipz.diagnosis.evidence.map_fit import fit_map
from frf_ipz.diagnosis.search.global_scan import find_best_start, list_components
from frf_ipz.diagnosis.search.rivals import MAX_BEHIND_COMPLETE, is_hopeless
from frf_ipz.diagnosis.search.robust_refinement import COST_RATIO, GAIN, MAX_STEPS, REFINED_ERROR, refine

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.evidence.hypothesis import Component, ComponentKey, Hypothesis
    from frf_ipz.diagnosis.location import Location

Fits: TypeAlias = "dict[ComponentKey, Fit]"
"""Fits by the key of their last component."""

N_EFFECTS = 6  # effects whose neighbourhoods are searched
MAX_BEHIND = 2000.0  # log Bayes factor behind the best: an effect that is further behind is not searched any more
COMPLETE_COST_RATIO = 2.0  # times the cost of one that explains nearly all: a fit on its way may have reached that much
MAX_STARTS = 64  # start values of an imitator
N_GLANCED, N_FITTED_AROUND = 24, 4  # locations further around that are compared by one step, and fitted


def find_cost_limit(fits: Iterable[Fit]) -> float:
    """Find the cost below which a further fit is of use.

    Parameters
    ----------
    fits : iterable of Fit
        Those known already.

    Returns
    -------
    float
        Not far above that of the best, if that explains nearly all; infinite otherwise: from a start that is a little
        off, a fit may gain little for many steps before it falls to a thousandth.
    """
    best = max(fits, key=lambda fit: fit.log_evidence, default=None)
    if best is None or not best.explains_nearly_all:
        return np.inf
    return COMPLETE_COST_RATIO * best.cost + MAX_BEHIND_COMPLETE


def may_be_as_good(_: Component) -> bool:
    """Say of any component that it may be as good: where much is left, what a small step promises tells little."""
    return True


def search_neighbourhoods(
    problem: InferenceProblem,
    base: Fit,
    fits: Fits,
    n_effects: int = N_EFFECTS,
    worth_fitting: Callable[[Component], bool] = may_be_as_good,
) -> None:
    """Search the neighbourhoods of the best effects, as long as that makes them more probable.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    base : Fit
        The fit to build on.
    fits : dict
        By the key of their last component, whose location is changed; new fits are added.
    n_effects : int
        Number of effects, the best ones, whose neighbourhoods are searched.
    worth_fitting : callable
        Which components may be as good; no other one is fitted.
    """
    ranked = sorted(fits.values(), key=lambda fit: -fit.log_evidence)
    if ranked and not ranked[0].is_far_off:
        _add_imitators(problem, base, ranked[0], fits, worth_fitting)
        ranked = sorted(fits.values(), key=lambda fit: -fit.log_evidence)
    leaders: dict[str, Fit] = {}
    for fit in ranked:
        leaders.setdefault(fit.hypothesis.components[-1].effect.name, fit)
    for leader in list(leaders.values())[:n_effects]:
        best = max(fits.values(), key=lambda fit: fit.log_evidence)
        if best.explains_nearly_all and not leader.is_far_off:
            leader = _step_to_rivals(problem, base, leader, best, fits, worth_fitting)
        behind = MAX_BEHIND_COMPLETE if best.explains_nearly_all else MAX_BEHIND
        if leader.log_evidence > best.log_evidence - behind and not leader.is_far_off:
            _search_neighbourhood(problem, base, leader, fits, worth_fitting)


def _step_to_rivals(
    problem: InferenceProblem,
    base: Fit,
    fit: Fit,
    best: Fit,
    fits: Fits,
    worth_fitting: Callable[[Component], bool],
) -> Fit:
    """Step from a location that is too far behind to neighbours that need not be, seen far from the axis.

    An effect has been fitted at locations apart from one another: right at one that lies between them, it may be
    hundreds behind at each.
    """
    while fit.log_evidence <= best.log_evidence - MAX_BEHIND_COMPLETE:
        component = fit.hypothesis.components[-1]
        beside = []
        for location in component.effect.neighbours(problem.context, component.location):
            moved = replace(component, location=location)
            if moved.key in fits or not worth_fitting(moved):
                continue
            hypothesis = problem.make_hypothesis((*base.hypothesis.components, moved))
            starts = [fit.values]
            if _names(hypothesis) != _names(fit.hypothesis):  # as at an end, and at a node beside it
                grid = _thin_grid(component.effect.start_values(problem.context, location))
                starts = [np.concatenate([base.values, values]) for values in grid]
            if not is_hopeless(problem, best, hypothesis, starts):
                beside.append(location)
        better = _best_of_locations(problem, base, fit, beside, fits)
        if better is fit:
            break
        fit = better
    return fit


def _add_imitators(
    problem: InferenceProblem, base: Fit, best: Fit, fits: Fits, worth_fitting: Callable[[Component], bool]
) -> None:
    """Fit imitators of the best, at its location or at one end of it."""
    for imitator in list_imitators(problem, best):
        if imitator.key not in fits and worth_fitting(imitator):
            fits[imitator.key] = fit_from_neighbour(problem, base, imitator, best, find_cost_limit(fits.values()))


def list_imitators(problem: InferenceProblem, fit: Fit) -> list[Component]:
    """List what may imitate the last component of a fit: all other effects at its location or at one end of it.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    fit : Fit
        With one component at least.

    Returns
    -------
    list of Component
        Of other effects.
    """
    component = fit.hypothesis.components[-1]
    effects = [effect for effect in problem.effects.values() if effect.name != component.effect.name]
    return [
        imitator
        for effect in effects
        for imitator in list_components(effect, problem.context)
        if _is_within(imitator.location, component.location)
    ]


def _is_within(location: Location, reference: Location) -> bool:
    """Say whether a location equals another, or is one of the two nodes that the other one joins."""
    is_end = bool(location.nodes) and set(location.nodes) < set(reference.nodes)
    return is_end or location.place == reference.place


def _search_neighbourhood(
    problem: InferenceProblem, base: Fit, fit: Fit, fits: Fits, worth_fitting: Callable[[Component], bool]
) -> None:
    for _ in range(MAX_STEPS):
        component = fit.hypothesis.components[-1]
        neighbours = component.effect.neighbours(problem.context, component.location)
        beside = [location for location in neighbours if worth_fitting(replace(component, location=location))]
        known = set(fits)
        better = _best_of_locations(problem, base, fit, beside, fits)
        if better is fit:
            _continue_unfinished(problem, base, fit, beside, fits, known)
            better = _best_of_locations(problem, base, fit, beside, fits)
        if better is fit and fit.is_nearly_right:
            around = [
                location
                for location in _promising_surroundings(problem, fit)
                if worth_fitting(replace(component, location=location))
            ]
            better = _best_of_locations(problem, base, fit, around, fits)
        if better is fit:
            return
        fit = better


def _continue_unfinished(
    problem: InferenceProblem,
    base: Fit,
    fit: Fit,
    locations: Sequence[Location],
    fits: Fits,
    known: Container[ComponentKey],
) -> None:
    """Continue fits of neighbours that were stopped early: small steps may lead far down.

    Where they do not, the values and the nuisance at the best location may be the better start: for those that were
    known before; the others began there.
    """
    for component in (replace(fit.hypothesis.components[-1], location=location) for location in locations):
        unfinished = fits[component.key]
        if unfinished.has_converged or unfinished.cost >= COST_RATIO * fit.cost + MAX_BEHIND_COMPLETE:
            continue
        continued = fits[component.key] = problem.fit_to_convergence(unfinished)
        if continued.cost > fit.cost and component.key in known:
            anew = fit_from_neighbour(problem, base, component, fit, find_cost_limit(fits.values()))
            fits[component.key] = max(continued, anew, key=lambda candidate: candidate.log_evidence)


def _best_of_locations(
    problem: InferenceProblem, base: Fit, fit: Fit, locations: Sequence[Location], fits: Fits
) -> Fit:
    """Fit the last component at further locations; the fit itself where none is better."""
    component = fit.hypothesis.components[-1]
    best = fit
    for location in locations:
        moved = replace(component, location=location)
        if moved.key in fits:
            candidate = fits[moved.key]
        else:
            candidate = fits[moved.key] = fit_from_neighbour(problem, base, moved, fit, find_cost_limit(fits.values()))
        if candidate.log_evidence > best.log_evidence + GAIN:
            best = candidate
    return best


def _promising_surroundings(problem: InferenceProblem, fit: Fit) -> list[Location]:
    """Choose locations further around by one step on few data: far from the axis they are all alike."""
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
    """Refine values at locations further around the last component.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    components : tuple of Component
        The last one is moved.
    values : (n_parameters,) array
        Of all components.

    Returns
    -------
    list of (components, values)
        The best location first, as seen far from the axis.
    """
    *known, component = components
    weights = compute_weights(problem.coarse, REFINED_ERROR)
    refined = []
    for location in component.effect.surroundings(problem.context, component.location):
        moved = (*known, replace(component, location=location))
        refined_values, cost = refine(problem.make_hypothesis(moved), problem.coarse, weights, values, iterations=4)
        refined.append((cost, moved, refined_values))
    return [(moved, refined_values) for _, moved, refined_values in sorted(refined, key=lambda entry: entry[0])]


def fit_from_neighbour(problem: InferenceProblem, base: Fit, component: Component, fit: Fit, cost_limit: float) -> Fit:
    """Fit a component from the values and the nuisance of a fit of a similar one.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    base : Fit
        The fit to build on.
    component : Component
        One more.
    fit : Fit
        Of another last component beside the same base.
    cost_limit : float
        Cost below which the fit is of use.

    Returns
    -------
    Fit
        Of all components.
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
    iterations = 4 if is_same and fit.is_nearly_right else 12
    values, _ = refine(hypothesis, problem.coarse, weights, start, iterations=iterations)
    if not fit.is_nearly_right:
        return problem.fit(components, values, cost_limit=cost_limit)
    known = fit.values[: len(base.values)]
    of_all = fit.values if is_same else np.concatenate([known, values[len(known) :]])
    imitator_values = () if is_same else _thin_grid(component.effect.start_values(problem.context, component.location))
    starts = [values, start, *(np.concatenate([known, of_component]) for of_component in imitator_values)]
    if is_hopeless(problem, fit, hypothesis, [of_all, *starts]):
        return evaluate_without_fit(problem, hypothesis, values, fit)
    start, nuisance = problem.nearest_start(hypothesis, starts, fit)
    neighbour_fit = fit_map(
        hypothesis, problem.data, start, nuisance=nuisance, iterations=12, tolerance=0.1, cost_limit=cost_limit
    )
    return (
        neighbour_fit
        if is_same or neighbour_fit.explains_nearly_all
        else problem.fit(components, values, cost_limit=cost_limit)
    )


def evaluate_without_fit(problem: InferenceProblem, hypothesis: Hypothesis, values: FloatArray, fit: Fit) -> Fit:
    """Evaluate components that are not worth a fit, with the modes of another fit.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    hypothesis : Hypothesis
        Its components.
    values : (n_parameters,) array
        Physical values of their parameters.
    fit : Fit
        With the right modes.

    Returns
    -------
    Fit
        Not converged.
    """
    start, nuisance = problem.nearest_start(hypothesis, (values,), fit)
    return fit_map(hypothesis, problem.data, start, nuisance=nuisance, iterations=0)


def _names(hypothesis: Hypothesis) -> list[str]:
    return [parameter.name for parameter in hypothesis.parameters]


def _thin_grid(grid: FloatArray) -> FloatArray:
    """Thin a grid, by an odd number: all values of each parameter stay."""
    return grid[:: len(grid) // MAX_STARTS | 1]
