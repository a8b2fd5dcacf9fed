"""A mass that was there before and is gone: a bolt, a piece, material that was worn or cut away."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.linalg import splu

from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter, Place, Signature, at_nodes, beside_node
from frf_ipz.diagnosis.model.change import Change
from frf_ipz.fe.changes import with_point_masses

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate
    from frf_ipz.structure import StructuralModel

SMALLEST = 1e-5  # of the mass of the structure
WORTH_A_LOOK = 1e-3  # of the mass of the structure: nodes that have less cannot lose it
MOST = 0.999  # of what a node has: what is left still moves


class MassLoss(Effect):
    """A point mass that is gone from a node."""

    name = "mass_loss"
    imitators = ("local_stiffness", "added_mass")

    def places(self, specimen: ModelContext) -> Sequence[Place]:
        """Every node that has something to lose."""
        least = WORTH_A_LOOK * specimen.mass_kg
        first = {place.key[0]: place for place in reversed(at_nodes(specimen))}
        had = _mass_there(specimen.model, [str(place.key[1]) for place in first.values()], list(first))
        return [place for place, mass in sorted(zip(first.values(), had, strict=True), key=_by_node) if mass > least]

    def parameters(self, specimen: ModelContext, place: Place) -> tuple[Parameter, ...]:
        """Mass, at most what the node has."""
        (had,) = _mass_there(specimen.model, [str(place.key[1])], [place.key[0]])
        return (Parameter(name="mass_kg", low=SMALLEST * specimen.mass_kg, high=MOST * had),)

    def build(self, specimen: ModelContext, place: Place) -> Builder:
        """Less mass in all translational directions of the node."""
        model = specimen.model
        unit = with_point_masses(model, {int(str(place.key[0])): 1.0}).mass_all - model.mass_all
        return lambda values: Change(mass=-values[0] * unit)

    def sketch(self, specimen: ModelContext, place: Place) -> Signature:
        """-s^2 m against the direction of the test."""
        node, direction = place.key
        dof = next(d for d in specimen.moving_dofs if (d.node, d.direction) == (node, direction))
        (parameter,) = self.parameters(specimen, place)
        return Signature(
            motion=specimen.unit(dof),
            shapes=-(specimen.contour[None] ** 2),
            values=np.ones((1, 1)),
            amplitudes=np.geomspace(0.05, 1.0, 8) * parameter.high,
        )

    def neighbours(self, specimen: ModelContext, place: Place) -> Sequence[Place]:
        """Nodes beside that have something to lose."""
        known = {other.key for other in self.places(specimen)}
        return [other for other in beside_node(specimen, place) if other.key in known]

    def statement(self, specimen: ModelContext, place: Place, values: Mapping[str, Estimate]) -> str:
        """Say how much is gone from where."""
        mass = values["mass_kg"]
        return (
            f"A mass of {1e3 * mass.value:.3g} g (+- {1e3 * mass.std:.2g} g) is gone from "
            f"{specimen.where(int(str(place.key[0])))}."
        )


def _by_node(entry: tuple[Place, float]) -> int:
    return int(str(entry[0].key[0]))


def _mass_there(model: StructuralModel, directions: Sequence[str], nodes: Sequence[object]) -> list[float]:
    """Largest masses that could be taken from nodes with the mass matrix still positive, ``1 / (M^-1)_uu``, kg."""
    free = np.flatnonzero(~model.fixed)
    number = {int(row): place for place, row in enumerate(free)}
    rows = {(dof.node, dof.direction): number[row] for dof, row in model.full_indices.items() if row in number}
    loads = np.zeros((len(free), len(nodes)))
    wanted = [rows[int(str(node)), direction] for node, direction in zip(nodes, directions, strict=True)]
    loads[wanted, np.arange(len(wanted))] = 1.0
    try:
        solved = splu(model.mass.tocsc()).solve(loads)
    except RuntimeError:  # DOFs without mass: nothing is known to be there
        return [0.0] * len(wanted)
    return [float(1 / solved[row, column]) for column, row in enumerate(wanted)]
