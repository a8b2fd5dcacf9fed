"""A mass that the model lacks: a sensor, a cable, a part that was not drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter, Place, Signature, at_nodes, beside_node
from frf_ipz.diagnosis.model.change import Change
from frf_ipz.fe.changes import with_point_masses

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

SMALLEST, LARGEST = 1e-5, 2.0  # of the mass of the structure


class AddedMass(Effect):
    """A point mass at a node."""

    name = "added_mass"
    imitators = ("local_stiffness", "attached_resonator", "boundary_compliance")

    def places(self, specimen: ModelContext) -> Sequence[Place]:
        """Every node that moves."""
        return _once_a_node(at_nodes(specimen))

    def parameters(self, specimen: ModelContext, place: Place) -> tuple[Parameter, ...]:
        """Mass."""
        del place
        total = specimen.mass_kg
        return (Parameter(name="mass_kg", low=SMALLEST * total, high=LARGEST * total),)

    def build(self, specimen: ModelContext, place: Place) -> Builder:
        """Mass in all translational directions of the node."""
        model = specimen.model
        unit = with_point_masses(model, {int(str(place.key[0])): 1.0}).mass_all - model.mass_all
        return lambda values: Change(mass=values[0] * unit)

    def sketch(self, specimen: ModelContext, place: Place) -> Signature:
        """s^2 m against the direction of the test."""
        node, direction = place.key
        dof = next(d for d in specimen.moving_dofs if (d.node, d.direction) == (node, direction))
        amplitudes = np.geomspace(3e-4, 1.0, 14) * specimen.mass_kg
        return Signature(
            motion=specimen.unit(dof),
            shapes=specimen.contour[None] ** 2,
            values=np.ones((1, 1)),
            amplitudes=amplitudes,
        )

    def neighbours(self, specimen: ModelContext, place: Place) -> Sequence[Place]:
        """Nodes beside."""
        return beside_node(specimen, place)

    def statement(self, specimen: ModelContext, place: Place, values: Mapping[str, Estimate]) -> str:
        """Say how much sits where."""
        mass = values["mass_kg"]
        return (
            f"A mass of {1e3 * mass.value:.3g} g (+- {1e3 * mass.std:.2g} g) sits at "
            f"{specimen.where(int(str(place.key[0])))} that the model lacks."
        )


def _once_a_node(places: Sequence[Place]) -> list[Place]:
    """Keep one place a node: a mass acts in all directions."""
    first = {place.key[0]: place for place in reversed(places)}
    return [first[node] for node in sorted(first, key=lambda node: int(str(node)))]
