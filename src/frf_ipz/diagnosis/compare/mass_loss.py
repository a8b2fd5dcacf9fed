"""A mass that was there before and is gone: a bolt, a piece, material that was worn or cut away."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.linalg import splu

from frf_ipz.diagnosis.catalogue.effect import (
    Builder,
    Effect,
    Parameter,
    Signature,
    list_neighbouring_nodes,
    list_node_locations,
)
from frf_ipz.diagnosis.catalogue.effects.added_mass import SMALLEST
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Change
from frf_ipz.diagnosis.model.matrix_sum import MatrixSum
from frf_ipz.fe.changes import with_point_masses

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate
    from frf_ipz.structure import StructuralModel

MIN_MASS = 1e-3  # of the mass of the structure: nodes that have less cannot lose it
MAX_PART = 0.999  # of what a node has: what is left still moves


class MassLoss(Effect):
    """A point mass that is gone from a node."""

    name = "mass_loss"

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Every node that has something to lose."""
        least = MIN_MASS * context.mass_kg
        first = sorted({location.node: location for location in reversed(list_node_locations(context))}.values())
        masses = _removable_masses(context.model, first)
        return [location for location, mass in zip(first, masses, strict=True) if mass > least]

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Mass, at most what the node has."""
        (removable,) = _removable_masses(context.model, [location])
        return (Parameter(name="mass_kg", low=SMALLEST * context.mass_kg, high=MAX_PART * removable),)

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Less mass in all translational directions of the node."""
        model = context.model
        unit = with_point_masses(model, {location.node: 1.0}).mass_all - model.mass_all
        return lambda values: Change(mass=MatrixSum(((-values[0], unit),)))

    def signature(self, context: ModelContext, location: Location) -> Signature:
        """-s^2 m in all translational directions of the node."""
        (parameter,) = self.parameters(context, location)
        return Signature(
            motion=context.motion(location.dof),
            shapes=-(context.contour[None] ** 2),
            values=np.ones((1, 1)),
            amplitudes=np.geomspace(0.05, 1.0, 8) * parameter.high,
            further_motions=context.other_translations(location.dof),
        )

    def neighbours(self, context: ModelContext, location: Location) -> Sequence[Location]:
        """Nodes beside that have something to lose."""
        known = set(self.locations(context))
        return [candidate for candidate in list_neighbouring_nodes(context, location) if candidate in known]

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say how much is gone from where."""
        mass = values["mass_kg"]
        return (
            f"A mass of {1e3 * mass.value:.3g} g (+- {1e3 * mass.std:.2g} g) is gone from "
            f"{context.describe_node(location.node)}."
        )


def _removable_masses(model: StructuralModel, locations: Sequence[Location]) -> list[float]:
    """Largest masses that could be taken from nodes with the mass matrix still positive, ``1 / (M^-1)_uu``, kg."""
    free = np.flatnonzero(~model.fixed)
    free_index = {int(row): index for index, row in enumerate(free)}
    required_rows = [free_index[model.full_index(location.dof)] for location in locations]
    loads = np.zeros((len(free), len(locations)))
    loads[required_rows, np.arange(len(required_rows))] = 1.0
    try:
        solved = splu(model.mass.tocsc()).solve(loads)
    except RuntimeError:  # DOFs without mass: nothing is known to be there
        return [0.0] * len(required_rows)
    return [float(1 / solved[row, column]) for column, row in enumerate(required_rows)]
