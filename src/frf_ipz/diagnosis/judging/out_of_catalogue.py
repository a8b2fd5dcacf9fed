"""Findings that explain a measurement and yet rather are something that the catalogue lacks.

Two with dynamics of their own, alike or at nearly one place: two resonators are a chain of two at one of their places,
two dampers or joints what is spread between them. Or one with numbers that its kind hardly has.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.physics.layout import extents

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.search.fit import Fit
    from frf_ipz.diagnosis.search.hypothesis import Cause

NEAR = 0.05  # of the largest extent of a structure
TWO_ALIKE = (
    "two effects with dynamics of their own explain the measurement together, of one kind or at nearly one place: they "
    "rather are one thing of another kind"
)


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
