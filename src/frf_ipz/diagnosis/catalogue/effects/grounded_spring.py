"""A spring to the ground that the model lacks: a cord, a cable, a part that touches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.catalogue.effect import (
    Builder,
    Effect,
    Parameter,
    Signature,
    list_neighbouring_nodes,
    list_node_locations,
)
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Change
from frf_ipz.diagnosis.model.matrix_sum import MatrixSum
from frf_ipz.diagnosis.model.motion import make_unit_stiffness

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

FLOATING = "floating"
SOFTEST, STIFFEST = 1e-5, 1e3  # of the structure's own stiffness there


class GroundedSpring(Effect):
    """A spring between a node and the ground."""

    name = "grounded_spring"

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Every node that moves; not where a lumped model has such a spring already, which is then stiffer."""
        springs = [part for part in context.model.parts if part.kind == "spring"]
        grounded = {node for part in springs if 0 in part.nodes for node in part.nodes}
        return [location for location in list_node_locations(context) if location.node not in grounded]

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Stiffness."""
        scale = context.stiffness_against(context.motion(location.dof))
        return (Parameter(name="stiffness_N_m", low=SOFTEST * scale, high=STIFFEST * scale),)

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Add it to the diagonal."""
        unit = make_unit_stiffness(context.motion(location.dof), len(context.model.all_dofs))
        floats = is_floating(location)
        return lambda values: Change(stiffness=MatrixSum(((values[0], unit),)), floating=floats)

    def signature(self, context: ModelContext, location: Location) -> Signature | None:
        """Give a constant stiffness."""
        return Signature(
            motion=context.motion(location.dof),
            shapes=np.ones((1, len(context.contour)), complex),
            values=np.ones((1, 1)),
        )

    def neighbours(self, context: ModelContext, location: Location) -> Sequence[Location]:
        """Nodes beside; what a free structure touches may also float with it."""
        beside = list_neighbouring_nodes(context, location)
        return [*beside, *([floating(location)] if context.basis.modes.n_rigid and not is_floating(location) else [])]

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say how stiff, and where."""
        stiffness = values["stiffness_N_m"]
        where = context.describe_node(location.node)
        return (
            f"A spring of {stiffness.in_words('N/m')} holds {where} "
            f"to {'something that hangs as softly as the structure' if is_floating(location) else 'the ground'}; "
            "the model lacks it."
        )


def floating(location: Location) -> Location:
    """Make a location one at which what is added floats with the structure, as softly suspended as it is.

    Parameters
    ----------
    location : Location
        A location on a free structure.

    Returns
    -------
    Location
        The same, floating.
    """
    return replace(location, form=FLOATING)


def is_floating(location: Location) -> bool:
    """Tell whether what is added at a location floats with the structure.

    Parameters
    ----------
    location : Location
        The location.

    Returns
    -------
    bool
        True for one that `floating` made.
    """
    return location.form == FLOATING
