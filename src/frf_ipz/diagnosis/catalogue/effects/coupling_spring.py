"""A spring between two nodes that the model lacks: a strut, a cable, parts that touch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter, Signature
from frf_ipz.diagnosis.catalogue.effects.grounded_spring import SOFTEST, STIFFEST, floating, is_floating
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Change
from frf_ipz.diagnosis.model.matrix_sum import MatrixSum
from frf_ipz.diagnosis.model.motion import Motion, make_unit_stiffness
from frf_ipz.dofs import Dof

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

MAX_IN_A_ROW, MAX_NODES = 48, 100  # of which all pairs are listed; those between are stepped to
FURTHEST = 3  # nodes in a row around each end
NEXT_TO = 2  # nodes in a row that count as one location: what joins them is the structure itself


class CouplingSpring(Effect):
    """A spring between two nodes."""

    name = "coupling_spring"

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """All pairs of nodes that are apart and not joined by a spring already."""
        dofs = context.moving_dofs
        return [
            _make_location(first.node, second.node, first.direction)
            for first, second in combinations(dofs[:: _stride(context)], 2)
            if first.direction == second.direction and _is_new(context, first.node, second.node)
        ]

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Stiffness."""
        scale = context.stiffness_against(_motion(context, location))
        return (Parameter(name="stiffness_N_m", low=SOFTEST * scale, high=STIFFEST * scale),)

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Add it to the matrix."""
        unit = make_unit_stiffness(_motion(context, location), len(context.model.all_dofs))
        floats = is_floating(location)
        return lambda values: Change(stiffness=MatrixSum(((values[0], unit),)), floating=floats)

    def log_prior(self, context: ModelContext, location: Location, values: FloatArray) -> float:
        """Share the prior of a listed pair among the pairs that it stands for where not all are listed."""
        del location, values
        return -2 * float(np.log(_stride(context)))

    def signature(self, context: ModelContext, location: Location) -> Signature:
        """Give a constant stiffness."""
        return Signature(
            motion=_motion(context, location),
            shapes=np.ones((1, len(context.contour)), complex),
            values=np.ones((1, 1)),
        )

    def neighbours(self, context: ModelContext, location: Location) -> Sequence[Location]:
        """One end at a node beside; in a row also both ends, for they make up for each other."""
        (first, second), direction = location.nodes, location.direction
        pairs = [(neighbour, second) for neighbour in context.neighbouring_nodes(first, direction)]
        pairs += [(first, neighbour) for neighbour in context.neighbouring_nodes(second, direction)]
        if context.model.kind in ("beam", "lumped"):
            nodes = {dof.node for dof in context.moving_dofs if dof.direction == direction}
            shifted = [(first + a, second + b) for a, b in product((-1, 1), repeat=2)]
            pairs += [pair for pair in shifted if nodes.issuperset(pair)]
        beside = _make_locations(context, location, pairs)
        return [*beside, *([floating(location)] if context.basis.modes.n_rigid and not is_floating(location) else [])]

    def surroundings(self, context: ModelContext, location: Location) -> Sequence[Location]:
        """Both ends at any nodes near: along a line of such pairs, each is nearly as good as the next."""
        (first, second), direction = location.nodes, location.direction
        firsts, seconds = ([node, *context.neighbouring_nodes(node, direction, FURTHEST)] for node in (first, second))
        return _make_locations(
            context, location, [pair for pair in product(firsts, seconds) if pair != (first, second)]
        )

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say how stiff, and between what."""
        stiffness = values["stiffness_N_m"]
        first, second = map(context.describe_node, location.nodes)
        return f"A spring of {stiffness.in_words('N/m')} joins {first} and {second}; the model lacks it."


def _stride(context: ModelContext) -> int:
    """Step from one listed node to the next."""
    max_nodes = MAX_IN_A_ROW if context.model.kind == "beam" else MAX_NODES
    return -(-len(context.moving_dofs) // max_nodes)


def _make_location(first: int, second: int, direction: str) -> Location:
    return Location(nodes=(min(first, second), max(first, second)), directions=(direction,))


def _make_locations(context: ModelContext, template: Location, pairs: Sequence[tuple[int, int]]) -> list[Location]:
    """Make locations of pairs of nodes, floating where the template is."""
    locations = [_make_location(a, b, template.direction) for a, b in pairs if a != b and _is_new(context, a, b)]
    return [floating(location) for location in locations] if is_floating(template) else locations


def _is_new(context: ModelContext, first: int, second: int) -> bool:
    model = context.model
    if model.kind == "beam":
        return abs(first - second) > NEXT_TO
    return not any(part.kind == "spring" and {first, second} == set(part.nodes) for part in model.parts)


def _motion(context: ModelContext, location: Location) -> Motion:
    first, second = (context.motion(Dof(node, location.direction)) for node in location.nodes)
    return second - first
