"""A damper to the ground that the model lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import (
    Builder,
    Effect,
    Parameter,
    Signature,
    list_neighbouring_nodes,
    list_node_locations,
)
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Attachment, Change

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

WEAKEST, STRONGEST = 1e-6, 1e2  # of the structure's own stiffness over the lowest frequency


class LocalDamper(Effect):
    """A viscous damper between a node and the ground."""

    name = "local_damper"
    has_dynamics = True

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Every node that moves."""
        return list_node_locations(context)

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Damping constant."""
        scale = context.stiffness_against(context.motion(location.dof)) / (2 * np.pi * context.band_hz[0])
        return (Parameter(name="damping_Ns_m", low=WEAKEST * scale, high=STRONGEST * scale),)

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Attach it."""
        motion = context.motion(location.dof).dense(len(context.model.all_dofs))[:, None]
        none = np.zeros((1, 1))

        def change(values: FloatArray) -> Change:
            matrices = none, values[:1, None], none
            return Change(
                attachments=(Attachment(motions=motion, stiffness=lambda s: values[0] * s, matrices=matrices),)
            )

        return change

    def signature(self, context: ModelContext, location: Location) -> Signature:
        """Proportional to s."""
        return Signature(motion=context.motion(location.dof), shapes=context.contour[None], values=np.ones((1, 1)))

    def neighbours(self, context: ModelContext, location: Location) -> Sequence[Location]:
        """Nodes beside."""
        return list_neighbouring_nodes(context, location)

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say how much, and where."""
        damping = values["damping_Ns_m"]
        where = context.describe_node(location.node)
        return f"A damper of {damping.in_words('N s/m')} acts between {where} and the ground."
