"""Steps to neighbours of a place, and to effects that look alike, as long as that makes a cause more probable."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from frf_ipz.diagnosis.evidence.fit import Fit
from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem, weights_of
from frf_ipz.diagnosis.evidence.map_fit import polish
from frf_ipz.diagnosis.search.global_scan import best_start, causes_of
from frf_ipz.diagnosis.search.robust_refinement import REFINED_ERROR, refine

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.catalogue.effect import Effect, Place
    from frf_ipz.diagnosis.evidence.hypothesis import Cause, Hypothesis

Fits: TypeAlias = dict[tuple[object, ...], Fit]
"""Fits by the key of their last cause."""

CLIMBED = 6  # effects whose neighbours are looked at
HOPELESS, BEHIND = 2000.0, 300.0  # nats behind the best, and behind one that explains all: not looked at any more
WANTED = 2.0  # times the cost of one that explains all: a fit on its way there may have reached that much
UNSETTLED = 4.0  # times the cost of the best place: a fit beside it that has not converged may yet fall below that
GAIN = 0.5  # nats: a neighbour must be better by that
MOST_STEPS = 12
MOST_STARTS = 64  # of an effect that looks like another one
GLANCED_AT, FITTED_AROUND = 24, 4  # places further around


def bar_of(fits: Iterable[Fit]) -> float:
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
    return WANTED * best.cost + BEHIND if best is not None and best.is_nearly_all else np.inf


def climb_all(bench: InferenceProblem, base: Fit, fits: Fits, n_effects: int = CLIMBED) -> None:
    """Step to neighbours as long as that makes an effect more probable.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    base : Fit
        What is supposed already.
    fits : dict
        By the key of their last cause, whose place is changed; new fits are added.
    n_effects : int
        The best ones that are stepped.
    """
    ranked = sorted(fits.values(), key=lambda fit: -fit.log_evidence)
    if ranked and not ranked[0].is_hopeless:
        _add_imitators(bench, base, ranked[0], fits)
        ranked = sorted(fits.values(), key=lambda fit: -fit.log_evidence)
    leaders: dict[str, Fit] = {}
    for fit in ranked:
        leaders.setdefault(fit.hypothesis.causes[-1].effect.name, fit)
    for leader in list(leaders.values())[:n_effects]:
        best = max(fits.values(), key=lambda fit: fit.log_evidence)
        behind = BEHIND if best.is_nearly_all else HOPELESS
        if leader.log_evidence > best.log_evidence - behind and not leader.is_hopeless:
            _climb(bench, base, leader, fits)


def _add_imitators(bench: InferenceProblem, base: Fit, best: Fit, fits: Fits) -> None:
    """Fit what looks like the best, at its place or at one end of it."""
    for other in imitators_of(bench, best):
        if other.key not in fits:
            fits[other.key] = fit_from_neighbour(bench, base, other, best, bar_of(fits.values()))


def imitators_of(bench: InferenceProblem, fit: Fit) -> list[Cause]:
    """List what looks like the last cause of a fit, at its place or at one end of it.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    fit : Fit
        With one cause at least.

    Returns
    -------
    list of Cause
        Of other effects.
    """
    cause = fit.hypothesis.causes[-1]
    alike = [effect for effect in bench.effects.values() if are_alike(effect, cause.effect)]
    return [
        other for effect in alike for other in causes_of(effect, bench.specimen) if _is_within(other.place, cause.place)
    ]


def _is_within(one: Place, other: Place) -> bool:
    """Say whether a place is another, or one of the two nodes that the other lies between."""
    inner, outer = one.location.get("nodes"), other.location.get("nodes")
    is_end = isinstance(inner, list) and isinstance(outer, list) and set(inner) < set(outer)
    return one.location == other.location or is_end


def are_alike(one: Effect, other: Effect) -> bool:
    """Say whether one effect is known to look like another, either way round."""
    return one.name in other.imitators or other.name in one.imitators


def _climb(bench: InferenceProblem, base: Fit, fit: Fit, fits: Fits) -> None:
    for _ in range(MOST_STEPS):
        cause = fit.hypothesis.causes[-1]
        beside = cause.effect.neighbours(bench.specimen, cause.place)
        better = _best_of(bench, base, fit, beside, fits)
        if better is fit:
            _settle(bench, base, fit, beside, fits)
            better = _best_of(bench, base, fit, beside, fits)
        if better is fit and fit.is_nearly_right:
            better = _best_of(bench, base, fit, _promising_around(bench, fit), fits)
        if better is fit:
            return
        fit = better


def _settle(bench: InferenceProblem, base: Fit, fit: Fit, places: Sequence[Place], fits: Fits) -> None:
    """Go on with fits beside the best place that were given up on their way: small steps may lead far down.

    Where they do not, the best place's values and scatter may be the better start.
    """
    for cause in (replace(fit.hypothesis.causes[-1], place=place) for place in places):
        known = fits[cause.key]
        if known.converged or known.cost >= UNSETTLED * fit.cost + BEHIND:
            continue
        went_on = fits[cause.key] = bench.go_on(known)
        if went_on.cost > fit.cost:
            anew = fit_from_neighbour(bench, base, cause, fit, bar_of(fits.values()))
            fits[cause.key] = max(went_on, anew, key=lambda one: one.log_evidence)


def _best_of(bench: InferenceProblem, base: Fit, fit: Fit, places: Sequence[Place], fits: Fits) -> Fit:
    """Fit the last cause at other places too; the fit itself where none is better."""
    cause = fit.hypothesis.causes[-1]
    better = fit
    for place in places:
        other = replace(cause, place=place)
        if other.key in fits:
            tried = fits[other.key]
        else:
            tried = fits[other.key] = fit_from_neighbour(bench, base, other, fit, bar_of(fits.values()))
        if tried.log_evidence > better.log_evidence + GAIN:
            better = tried
    return better


def _promising_around(bench: InferenceProblem, fit: Fit) -> list[Place]:
    """Choose places further around the last cause by one step on few data: far from the axis they are all alike."""
    glances = []
    for causes, values in further_around(bench, fit.hypothesis.causes, fit.values)[:GLANCED_AT]:
        hypothesis = bench.suppose(causes)
        start, unknown = bench.nearest(hypothesis, (values,), fit)
        glances.append(polish(hypothesis, bench.thin, start, unknown=unknown, iterations=1))
    glances.sort(key=lambda glance: -glance.log_evidence)
    return [glance.hypothesis.causes[-1].place for glance in glances[:FITTED_AROUND]]


def further_around(
    bench: InferenceProblem, causes: tuple[Cause, ...], values: FloatArray
) -> list[tuple[tuple[Cause, ...], FloatArray]]:
    """Bring values to places further around the last cause.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    causes : tuple of Cause
        The last one is moved.
    values : (n_parameters,) array
        Of all causes.

    Returns
    -------
    list of (causes, values)
        The best place first, as seen far from the axis.
    """
    *known, cause = causes
    weights = weights_of(bench.coarse, REFINED_ERROR)
    found = []
    for place in cause.effect.around(bench.specimen, cause.place):
        there = (*known, replace(cause, place=place))
        at, cost = refine(bench.suppose(there), bench.coarse, weights, values, iterations=4)
        found.append((cost, there, at))
    return [(there, at) for _, there, at in sorted(found, key=lambda one: one[0])]


def fit_from_neighbour(bench: InferenceProblem, base: Fit, cause: Cause, fit: Fit, bar: float) -> Fit:
    """Fit a cause from the values and the scatter of a fit of a similar one.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    base : Fit
        What is supposed already.
    cause : Cause
        One more.
    fit : Fit
        Of another last cause beside the same base.
    bar : float
        Cost that the fit is wanted below.

    Returns
    -------
    Fit
        Of all causes.
    """
    causes = (*base.hypothesis.causes, cause)
    hypothesis = bench.suppose(causes)
    weights = weights_of(bench.coarse, REFINED_ERROR)
    is_same = _names(hypothesis) == _names(fit.hypothesis)
    if is_same:
        start = fit.values
    else:
        best = best_start(bench, base, cause, bench.coarse, weights, np.zeros(bench.nuisance.size))
        start = np.concatenate([base.values, best.values])
    few = 4 if is_same and fit.is_nearly_right else 12
    values, _ = refine(hypothesis, bench.coarse, weights, start, iterations=few)
    if not fit.is_nearly_right:
        return bench.fit(causes, values, bar=bar)
    known = fit.values[: len(base.values)]
    own = () if is_same else _some(cause.effect.starts(bench.specimen, cause.place))
    starts = [values, start, *(np.concatenate([known, of_cause]) for of_cause in own)]
    start, unknown = bench.nearest(hypothesis, starts, fit)
    near = polish(hypothesis, bench.data, start, unknown=unknown, iterations=12, tolerance=0.1, bar=bar)
    return near if is_same or near.is_nearly_all else bench.fit(causes, values, bar=bar)


def _names(hypothesis: Hypothesis) -> list[str]:
    return [parameter.name for parameter in hypothesis.parameters]


def _some(grid: FloatArray) -> FloatArray:
    """Thin a grid, by an odd number: all values of each parameter stay."""
    return grid[:: len(grid) // MOST_STARTS | 1]
