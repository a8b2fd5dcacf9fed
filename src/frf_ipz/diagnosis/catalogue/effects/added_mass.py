"""A mass that the model lacks: a sensor, a cable, a part that was not drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
from frf_ipz.fe.changes import with_point_masses

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

SMALLEST, LARGEST = 1e-5, 2.0  # of the mass of the structure


class AddedMass(Effect):
    """A point mass at a node."""

    name = "added_mass"

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Every node that moves."""
        return _one_per_node(list_node_locations(context))

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Mass."""
        del location
        total = context.mass_kg
        return (Parameter(name="mass_kg", low=SMALLEST * total, high=LARGEST * total),)

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Mass in all translational directions of the node."""
        model = context.model
        unit = with_point_masses(model, {location.node: 1.0}).mass_all - model.mass_all
        return lambda values: Change(mass=MatrixSum(((values[0], unit),)))

    def signature(self, context: ModelContext, location: Location) -> Signature:
        """s^2 m in all translational directions of the node."""
        amplitudes = np.geomspace(3e-4, 1.0, 14) * context.mass_kg
        return Signature(
            motion=context.motion(location.dof),
            shapes=context.contour[None] ** 2,
            values=np.ones((1, 1)),
            amplitudes=amplitudes,
            further_motions=context.other_translations(location.dof),
        )

    def neighbours(self, context: ModelContext, location: Location) -> Sequence[Location]:
        """Nodes beside."""
        return list_neighbouring_nodes(context, location)

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say how much sits where."""
        mass = values["mass_kg"]
        return (
            f"A mass of {mass.in_words('g', 1e3)} sits at {context.describe_node(location.node)} that the model lacks."
        )


def _one_per_node(locations: Sequence[Location]) -> list[Location]:
    """Keep one location a node: a mass acts in all directions."""
    return sorted({location.node: location for location in reversed(locations)}.values())
