"""Explanations that the catalogue does not name: damping ratios left free, and findings that are rather something else.

A nominal model's damping ratios are often no more than a guess, and those of single modes may be wrong by a factor. The
tolerance of damping then hides everything else that is wrong. What is found beside it is found with damping ratios that
may be anything; the verdict remains that something is not explained.

Findings may explain a measurement and yet be rather something that the catalogue lacks. Two with dynamics of their own,
alike or at nearly one location: two resonators are a chain of two at one of their locations, two dampers or joints what
is spread between them. Or one with numbers that its kind hardly has.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.model.layout import measure_extents
from frf_ipz.diagnosis.result import DiagnosisVerdict
from frf_ipz.diagnosis.verdict.goodness import assess_goodness

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.evidence.hypothesis import Component
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.diagnosis.options import DiagnoseOptions
    from frf_ipz.diagnosis.verdict.decision import Decision

STATED_FROM = 0.3  # relative deviation of a damping ratio that is stated, however wide the tolerance: its default
DAMPING_EFFECTS = ("damping_level", "structural_damping")
FREE_TOLERANCE = 20.0  # relative tolerance of damping ratios: more than a factor of ten
MOST_RATIOS = 6  # in a sentence
MAIN_PART = 0.5  # of the whole nuisance chi2
SAME_LOCATION = 0.05  # of the largest extent of a structure
TWO_DYNAMIC = (
    "two effects with dynamics of their own explain the measurement together, of one kind or at nearly one location: "
    "they rather are one thing of another kind"
)


def is_damping_only(problem: InferenceProblem, decision: Decision) -> bool:
    """Tell whether damping ratios alone exceed the tolerances.

    Parameters
    ----------
    problem : InferenceProblem
        Data and model.
    decision : Decision
        Unexplained.

    Returns
    -------
    bool
        True where a search with free damping is worthwhile.
    """
    if decision.verdict != DiagnosisVerdict.UNEXPLAINED:
        return False
    fits = (decision.final,) if decision.final.explains_nearly_all else (decision.final, decision.null)
    return any(is_damping_dominant(problem, fit) for fit in fits)


def is_damping_dominant(problem: InferenceProblem, fit: Fit) -> bool:
    """Tell whether damping ratios are most of what a fit needs beyond the tolerances.

    Parameters
    ----------
    problem : InferenceProblem
        Data and model.
    fit : Fit
        Any fit.

    Returns
    -------
    bool
        True where they exceed the tolerances by themselves.
    """
    whitened_nuisance, _ = problem.nuisance_prior.whiten(fit.nuisance)
    damping_chi2 = float(np.sum(whitened_nuisance[problem.nuisance_prior.damping_indices] ** 2))
    return damping_chi2 > max(assess_goodness(problem, fit).nuisance_chi2_limit, MAIN_PART * fit.nuisance_chi2)


def free_damping(options: DiagnoseOptions) -> DiagnoseOptions:
    """Free the damping ratios of modes.

    Parameters
    ----------
    options : DiagnoseOptions
        Tolerances.

    Returns
    -------
    DiagnoseOptions
        With the other tolerances.
    """
    return replace(options, damping_tolerance=max(FREE_TOLERANCE, options.damping_tolerance))


def drop_damping_effects(problem: InferenceProblem) -> InferenceProblem:
    """Drop the effects that free damping ratios stand for.

    Parameters
    ----------
    problem : InferenceProblem
        With free damping ratios.

    Returns
    -------
    InferenceProblem
        Without the effects of modal damping.
    """
    effects = {name: effect for name, effect in problem.effects.items() if name not in DAMPING_EFFECTS}
    return replace(problem, effects=effects)


def describe_damping(fit: Fit, options: DiagnoseOptions) -> str:
    """Say which damping ratios are not those of the model.

    Parameters
    ----------
    fit : Fit
        With damping ratios as measured.
    options : DiagnoseOptions
        The stated tolerances.

    Returns
    -------
    str
        A sentence; empty where all are within the usual tolerance, or the stated one where that is smaller.
    """
    nuisance_prior, modes = fit.hypothesis.nuisance_prior, fit.hypothesis.modes(fit.values, fit.nuisance)
    changes = fit.nuisance[nuisance_prior.damping_indices] * nuisance_prior.damping_std
    tolerance = min(options.damping_tolerance, STATED_FROM)
    beyond = np.flatnonzero((np.abs(changes) > tolerance) & nuisance_prior.is_stated)
    if not len(beyond):
        return ""
    ratios = [
        f"{100 * stated * (1 + change):.2g} % at {omega / (2 * np.pi):.4g} Hz (model: {100 * stated:.2g} %)"
        for stated, change, omega in zip(
            modes.stated_ratio[beyond], np.maximum(changes[beyond], -1), modes.omega[beyond], strict=True
        )
    ]
    rest = f" and of {len(ratios) - MOST_RATIOS} further modes" if len(ratios) > MOST_RATIOS else ""
    return f"Damping ratios are as measured, and nothing missing: {', '.join(ratios[:MOST_RATIOS])}{rest}."


def describe_implausibility(fit: Fit) -> str:
    """Say why components rather are something that the catalogue lacks.

    Parameters
    ----------
    fit : Fit
        Of any number of components.

    Returns
    -------
    str
        In words that follow "Something is missing that nothing in the catalogue explains: "; empty where two components
        imitate neither something at their location nor something that is spread, and all have numbers of their kind.
    """
    hypothesis = fit.hypothesis
    dynamic = [component for component in hypothesis.components if component.effect.has_dynamics]
    if any(
        first.effect.name == second.effect.name or _are_at_one_location(hypothesis.context, first, second)
        for first, second in combinations(dynamic, 2)
    ):
        return TWO_DYNAMIC
    return next((reason for reason in hypothesis.implausibilities(fit.values) if reason), "")


def _are_at_one_location(context: ModelContext, first: Component, second: Component) -> bool:
    nodes = [set(component.location.nodes) for component in (first, second)]
    if nodes[0] & nodes[1]:
        return True
    spans = measure_extents(context.model)
    if not spans:
        return False
    distances = [_distance(context, a, b) for a in nodes[0] for b in nodes[1]]
    return min(distances, default=np.inf) <= SAME_LOCATION * max(spans.values())


def _distance(context: ModelContext, first: int, second: int) -> float:
    return float(np.linalg.norm(context.positions[first] - context.positions[second]))
