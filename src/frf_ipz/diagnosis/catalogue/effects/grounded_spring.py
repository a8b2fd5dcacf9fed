"""A spring to the ground that the model lacks: a cord, a cable, a part that touches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter, Place, Signature, at_nodes, beside_node
from frf_ipz.diagnosis.model.change import Change

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

FLOATING = "floating"
SOFTEST, STIFFEST = 1e-5, 1e3  # of the structure's own stiffness there


class GroundedSpring(Effect):
    """A spring between a node and the ground."""

    name = "grounded_spring"
    imitators = ("coupling_spring", "axial_load", "viscoelastic_joint", "boundary_compliance")

    def places(self, specimen: ModelContext) -> Sequence[Place]:
        """Every node that moves; not where a lumped model has such a spring already, which is then stiffer."""
        springs = [part for part in specimen.model.parts if part.kind == "spring"]
        taken = {node for part in springs if 0 in part.nodes for node in part.nodes}
        return [place for place in at_nodes(specimen) if place.key[0] not in taken]

    def parameters(self, specimen: ModelContext, place: Place) -> tuple[Parameter, ...]:
        """Stiffness."""
        own = specimen.stiffness_against(_motion(specimen, place))
        return (Parameter(name="stiffness_N_m", low=SOFTEST * own, high=STIFFEST * own),)

    def build(self, specimen: ModelContext, place: Place) -> Builder:
        """Add it to the diagonal."""
        unit = sparse.csr_array(sparse.diags_array(_motion(specimen, place)))
        floats = is_floating(place)
        return lambda values: Change(stiffness=values[0] * unit, floating=floats)

    def sketch(self, specimen: ModelContext, place: Place) -> Signature | None:
        """Draw a constant."""
        return Signature(
            motion=_motion(specimen, place),
            shapes=np.ones((1, len(specimen.contour)), complex),
            values=np.ones((1, 1)),
        )

    def neighbours(self, specimen: ModelContext, place: Place) -> Sequence[Place]:
        """Nodes beside; what a free structure touches may also hang as softly as the structure does."""
        if is_floating(place):
            return [
                floating(other) for other in beside_node(specimen, Place(key=place.key[:2], location=place.location))
            ]
        return [*beside_node(specimen, place), *([floating(place)] if specimen.basis.modes.n_rigid else [])]

    def statement(self, specimen: ModelContext, place: Place, values: Mapping[str, Estimate]) -> str:
        """Say how stiff, and where."""
        stiffness = values["stiffness_N_m"]
        where = specimen.where(int(str(place.key[0])))
        return (
            f"A spring of {stiffness.value:.4g} N/m (+- {stiffness.std:.2g}) holds {where} "
            f"to {'something that hangs as softly as the structure' if is_floating(place) else 'the ground'}; "
            "the model lacks it."
        )


def floating(place: Place) -> Place:
    """Make a place one at which what is added hangs as softly as the structure.

    Parameters
    ----------
    place : Place
        A place on a free structure.

    Returns
    -------
    Place
        The same, hanging.
    """
    return Place(key=(*place.key, FLOATING), location=place.location)


def is_floating(place: Place) -> bool:
    """Tell whether what is added at a place hangs as softly as the structure.

    Parameters
    ----------
    place : Place
        The place.

    Returns
    -------
    bool
        True for one that `floating` made.
    """
    return FLOATING in place.key


def _motion(specimen: ModelContext, place: Place) -> np.ndarray:
    return specimen.unit(next(d for d in specimen.moving_dofs if (d.node, d.direction) == place.key[:2]))
