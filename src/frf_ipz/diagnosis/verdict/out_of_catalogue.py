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

from frf_ipz.diagnosis.model.layout import extents
from frf_ipz.diagnosis.verdict.decision import UNEXPLAINED
from frf_ipz.diagnosis.verdict.goodness import goodness

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.evidence.hypothesis import Cause
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.diagnosis.options import DiagnoseOptions
    from frf_ipz.diagnosis.verdict.decision import Decision

OF_MODES = ("damping_level", "structural_damping")
ANY = 20.0  # relative tolerance of damping ratios: more than a factor of ten
MOSTLY = 0.5  # of all pulls
NEAR = 0.05  # of the largest extent of a structure
TWO_ALIKE = (
    "two effects with dynamics of their own explain the measurement together, of one kind or at nearly one place: they "
    "rather are one thing of another kind"
)


def is_damping_alone(bench: InferenceProblem, found: Decision) -> bool:
    """Tell whether damping ratios are what the tolerances do not allow.

    Parameters
    ----------
    bench : InferenceProblem
        Data and model.
    found : Decision
        Unexplained.

    Returns
    -------
    bool
        Then damping is worth to be left free.
    """
    if found.verdict != UNEXPLAINED:
        return False
    suspects = (found.final,) if found.final.is_nearly_all else (found.final, found.null)
    return any(_is_of_damping(bench, fit) for fit in suspects)


def _is_of_damping(bench: InferenceProblem, fit: Fit) -> bool:
    pulls, _ = bench.nuisance.pulls(fit.unknown)
    own = float(np.sum(pulls[bench.nuisance.damping_places] ** 2))
    return own > max(goodness(bench, fit).most_pull, MOSTLY * fit.pull)


def with_any_damping(options: DiagnoseOptions) -> DiagnoseOptions:
    """Leave the damping of modes free.

    Parameters
    ----------
    options : DiagnoseOptions
        Tolerances.

    Returns
    -------
    DiagnoseOptions
        The others.
    """
    return replace(options, damping_tolerance=max(ANY, options.damping_tolerance))


def without_level(bench: InferenceProblem) -> InferenceProblem:
    """Leave out what damping ratios that may be anything stand for.

    Parameters
    ----------
    bench : InferenceProblem
        With damping left free.

    Returns
    -------
    InferenceProblem
        Without the effects of modal damping.
    """
    kept = {name: effect for name, effect in bench.effects.items() if name not in OF_MODES}
    return replace(bench, effects=kept)


def complain(fit: Fit, options: DiagnoseOptions) -> str:
    """Say which damping ratios are not those of the model.

    Parameters
    ----------
    fit : Fit
        With damping left free.
    options : DiagnoseOptions
        The tolerances as stated.

    Returns
    -------
    str
        In words that follow "Something is missing that nothing in the catalogue explains: ".
    """
    nuisance, modes = fit.hypothesis.nuisance, fit.hypothesis.modes(fit.values, fit.unknown)
    changes = fit.unknown[nuisance.damping_places] * nuisance.damping_std
    beyond = np.flatnonzero((np.abs(changes) > options.damping_tolerance) & nuisance.is_stated)
    said = [
        f"{100 * stated * (1 + change):.2g} % instead of {100 * stated:.2g} % at {omega / (2 * np.pi):.4g} Hz"
        for stated, change, omega in zip(
            modes.stated_ratio[beyond], np.maximum(changes[beyond], -1), modes.omega[beyond], strict=True
        )
    ]
    return f"damping ratios are not those of the model ({', '.join(said)})"


def another_kind(fit: Fit) -> str:
    """Say why causes are rather one that the catalogue lacks.

    Parameters
    ----------
    fit : Fit
        Of any number of causes.

    Returns
    -------
    str
        In words that follow "Something is missing that nothing in the catalogue explains: "; empty where two causes
        imitate neither something at their place nor something that is spread, and all have numbers of their kind.
    """
    hypothesis = fit.hypothesis
    dynamic = [cause for cause in hypothesis.causes if cause.effect.has_dynamics]
    if any(
        one.effect.name == other.effect.name or _at_one_place(hypothesis.specimen, one, other)
        for one, other in combinations(dynamic, 2)
    ):
        return TWO_ALIKE
    return next((doubt for doubt in hypothesis.doubts(fit.values) if doubt), "")


def _at_one_place(specimen: ModelContext, first: Cause, second: Cause) -> bool:
    nodes = [_nodes(cause) for cause in (first, second)]
    if nodes[0] & nodes[1]:
        return True
    spans = extents(specimen.model)
    if not spans:
        return False
    apart = [_apart(specimen, a, b) for a in nodes[0] for b in nodes[1]]
    return min(apart, default=np.inf) <= NEAR * max(spans.values())


def _nodes(cause: Cause) -> set[int]:
    named = cause.place.location.get("nodes")
    return {int(node) for node in named} if isinstance(named, list) else set()


def _apart(specimen: ModelContext, first: int, second: int) -> float:
    return float(np.linalg.norm(specimen.positions[first] - specimen.positions[second]))
