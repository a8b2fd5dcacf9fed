"""An axial force in a beam: tension or compression between its supports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Change
from frf_ipz.diagnosis.model.matrix_sum import MatrixSum
from frf_ipz.fe.beam_models import geometric_stiffness
from frf_ipz.fe.kinds.beam import BeamFile

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

NEARLY_BUCKLED, STRONGEST = 0.97, 10.0  # of the buckling load: compression and tension
START_VALUES = np.array([0.01, 0.03, 0.1, 0.25, 0.5, 0.8])


class AxialLoad(Effect):
    """An axial force that is the same all along."""

    name = "axial_load"

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Return a beam that is held at both ends."""
        source = context.model.source
        applies = isinstance(source, BeamFile) and "free" not in (source.beam.left, source.beam.right)
        return [Location()] if applies else []

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Force, from near buckling to strong tension."""
        del location
        load = buckling_load(context)
        return (Parameter(name="force_N", low=-NEARLY_BUCKLED * load, high=STRONGEST * load, is_log=False),)

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Add geometric stiffness."""
        del location
        unit = geometric_stiffness(context.model)
        return lambda values: Change(stiffness=MatrixSum(((values[0], unit),)))

    def start_values(self, context: ModelContext, location: Location) -> FloatArray:
        """Both signs, from weak to strong."""
        del location
        load = buckling_load(context)
        return load * np.concatenate([-START_VALUES, START_VALUES, [1.2, 2.0, 3.5, 6.0]])[:, None]

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say how strong."""
        del context, location
        force = values["force_N"]
        kind = "tension" if force.value > 0 else "compression"
        size = force.in_words("N", 1.0 if force.value > 0 else -1.0)
        return f"The beam carries an axial {kind} of {size} that the model lacks."


@lru_cache(maxsize=2)  # a search asks for it with every hypothesis
def buckling_load(context: ModelContext) -> float:
    """Find the axial compression at which the beam buckles.

    Parameters
    ----------
    context : ModelContext
        A beam.

    Returns
    -------
    float
        N; of one that has rigid-body modes, of its first bending.
    """
    shapes = context.basis.modes.shapes
    everywhere = np.zeros((len(context.model.all_dofs), min(shapes.shape[1], 20)))
    everywhere[~context.model.fixed] = shapes[:, : everywhere.shape[1]]
    elastic = context.basis.modes.eigenvalues[: everywhere.shape[1]] > 0
    everywhere = everywhere[:, elastic]
    squares = context.basis.modes.eigenvalues[: len(elastic)][elastic]
    loaded_shapes = everywhere.T @ (geometric_stiffness(context.model) @ everywhere)
    return float(1 / linalg.eigh(np.asarray(loaded_shapes), np.diag(squares), eigvals_only=True)[-1])
