"""A damper to the ground that the model lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter, Place, Signature, at_nodes, beside_node
from frf_ipz.diagnosis.model.change import Attachment, Change

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

WEAKEST, STRONGEST = 1e-6, 1e2  # of the structure's own stiffness over the lowest frequency


class LocalDamper(Effect):
    """A viscous damper between a node and the ground."""

    name = "local_damper"
    imitators = ("attached_resonator", "viscoelastic_joint", "damping_level")
    has_dynamics = True

    def places(self, specimen: ModelContext) -> Sequence[Place]:
        """Every node that moves."""
        return at_nodes(specimen)

    def parameters(self, specimen: ModelContext, place: Place) -> tuple[Parameter, ...]:
        """Damping constant."""
        scale = specimen.stiffness_against(_motion(specimen, place)) / (2 * np.pi * specimen.band_hz[0])
        return (Parameter(name="damping_Ns_m", low=WEAKEST * scale, high=STRONGEST * scale),)

    def build(self, specimen: ModelContext, place: Place) -> Builder:
        """Attach it."""
        motion = _motion(specimen, place)[:, None]
        none = np.zeros((1, 1))

        def change(values: FloatArray) -> Change:
            matrices = none, values[:1, None], none
            return Change(
                attachments=(Attachment(motions=motion, stiffness=lambda s: values[0] * s, matrices=matrices),)
            )

        return change

    def sketch(self, specimen: ModelContext, place: Place) -> Signature:
        """Proportional to s."""
        return Signature(motion=_motion(specimen, place), shapes=specimen.contour[None], values=np.ones((1, 1)))

    def neighbours(self, specimen: ModelContext, place: Place) -> Sequence[Place]:
        """Nodes beside."""
        return beside_node(specimen, place)

    def statement(self, specimen: ModelContext, place: Place, values: Mapping[str, Estimate]) -> str:
        """Say how much, and where."""
        damping = values["damping_Ns_m"]
        return (
            f"A damper of {damping.value:.4g} N s/m (+- {damping.std:.2g}) acts between "
            f"{specimen.where(int(str(place.key[0])))} and the ground."
        )


def _motion(specimen: ModelContext, place: Place) -> np.ndarray:
    return specimen.unit(next(d for d in specimen.moving_dofs if (d.node, d.direction) == place.key))
