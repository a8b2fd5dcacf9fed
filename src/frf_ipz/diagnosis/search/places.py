"""Which of many places are looked at: a coarse set all over the structure first, and then all around the best of them.

The mesh may be as fine as it likes: see `model.coarse_places`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.model.coarse_places import PLACES_PER_MODE, spread_places

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from frf_ipz.arrays import FloatArray, IntArray
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.evidence.hypothesis import Component, ComponentKey
    from frf_ipz.diagnosis.search.robust_refinement import Start

BEST_PLACES = 4  # around which all are looked at


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaceGroup:
    """Components that differ by their node alone.

    Parameters
    ----------
    components : list of Component
        An effect at one node after the other.
    positions : (n, 3) array
        Of these nodes, m.
    coarse : (n_coarse,) int array
        Indices of those that are looked at first.
    reach : float
        How far the farthest place is from the nearest of these, m.
    """

    components: Sequence[Component]
    positions: FloatArray
    coarse: IntArray
    reach: float

    def around(self, starts: Iterable[Start]) -> list[Component]:
        """List what lies around the best of the coarse places.

        Parameters
        ----------
        starts : iterable of Start
            Of the coarse places.

        Returns
        -------
        list of Component
            Those that were not looked at yet.
        """
        index = {component.key: number for number, component in enumerate(self.components)}
        ranked = sorted((start.cost, index[start.component.key]) for start in starts if start.component.key in index)
        is_new = np.ones(len(self.components), bool)
        is_new[self.coarse] = False
        is_near = np.zeros(len(self.components), bool)
        for _, best in ranked[:BEST_PLACES]:
            is_near |= np.linalg.norm(self.positions - self.positions[best], axis=1) <= self.reach
        return [self.components[number] for number in np.flatnonzero(is_near & is_new).tolist()]


def search_places(
    context: ModelContext,
    n_modes: int,
    components: Iterable[Component],
    evaluate: Callable[[Sequence[Component]], list[Start]],
) -> list[Start]:
    """Evaluate components, of those that differ by their node alone the promising ones.

    Parameters
    ----------
    context : ModelContext
        Model, layout and tolerances.
    n_modes : int
        Number of modes that the measurement shows.
    components : iterable of Component
        Effects at their locations.
    evaluate : callable
        Gives the best values and the cost of components.

    Returns
    -------
    list of Start
        In the order of evaluation.
    """
    groups, others = _group_by_node(context, PLACES_PER_MODE * n_modes, components)
    starts = evaluate([*others, *(group.components[number] for group in groups for number in group.coarse.tolist())])
    around = [component for group in groups for component in group.around(starts)]
    return starts + (evaluate(around) if around else [])


def _group_by_node(
    context: ModelContext, n_coarse: int, components: Iterable[Component]
) -> tuple[list[PlaceGroup], list[Component]]:
    """Group components that differ by their node, where there are many of them; and give all others."""
    alike: dict[ComponentKey, list[tuple[int, Component]]] = {}
    others: list[Component] = []
    for component in components:
        nodes = component.location.nodes
        if len(nodes) == 1 and nodes[0] in context.positions:
            rest = component.effect.name, replace(component.location, nodes=())
            alike.setdefault(rest, []).append((nodes[0], component))
        else:
            others.append(component)
    groups = []
    for members in alike.values():
        if len(members) <= n_coarse or context.model.geometry.is_schematic:
            others += [component for _, component in members]
            continue
        positions = np.array([context.positions[node] for node, _ in members])
        coarse, reach = spread_places(positions, n_coarse)
        groups.append(
            PlaceGroup(
                components=[component for _, component in members], positions=positions, coarse=coarse, reach=reach
            )
        )
    return groups, others
