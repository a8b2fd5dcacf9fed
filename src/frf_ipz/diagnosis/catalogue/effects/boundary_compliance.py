"""A compliant support: an end of a beam that the model holds rigidly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter, grid
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Change
from frf_ipz.diagnosis.model.matrix_sum import MatrixSum
from frf_ipz.dofs import Dof
from frf_ipz.fe.kinds.beam import BeamFile

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

ROTATION, TRANSLATION = "rotational_stiffness_Nm_rad", "translational_stiffness_N_m"
SUPPORTED = {"clamped": ("ry", "z"), "pinned": ("z",), "sliding": ("ry",), "free": ()}
BOUNDS = {"ry": (0.05, 3e4), "z": (0.5, 1e7)}  # over EI/L and EI/L^3
NAMES = {"ry": ROTATION, "z": TRANSLATION}
ONE_ALONE, OF_TWO = 14, 7  # values to start from along each stiffness


class BoundaryCompliance(Effect):
    """The motion that the support of an end blocks is held by a spring instead."""

    name = "boundary_compliance"

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Each supported end of a beam: its rotation, its translation, or both."""
        source = context.model.source
        if not isinstance(source, BeamFile):
            return []
        locations = []
        for end, node in (("left", 1), ("right", source.beam.elements + 1)):
            supported = SUPPORTED[getattr(source.beam, end)]
            ways = [supported] if len(supported) < 2 else [(supported[0],), (supported[1],), supported]
            locations += [Location(end=end, nodes=(node,), directions=way) for way in ways if way]
        return locations

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Stiffness of each spring."""
        stiffness, length = _bending(context)
        scale = {"ry": stiffness / length, "z": stiffness / length**3}
        return tuple(
            Parameter(
                name=NAMES[way], low=BOUNDS[way][0] * scale[way], high=BOUNDS[way][1] * scale[way], neutral=np.inf
            )
            for way in location.directions
        )

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Release the fixed DOFs and put springs there."""
        model = context.model
        released = tuple(model.full_index(Dof(location.node, way)) for way in location.directions)
        size = len(model.all_dofs)
        units = [sparse.csr_array(([1.0], ([row], [row])), shape=(size, size)) for row in released]
        return lambda values: Change(
            released=released, stiffness=MatrixSum(tuple(zip(values.tolist(), units, strict=True)))
        )

    def start_values(self, context: ModelContext, location: Location) -> FloatArray:
        """Spread a grid, finer where there is one spring."""
        parameters = self.parameters(context, location)
        return grid(parameters, ONE_ALONE if len(parameters) == 1 else OF_TWO)

    def neighbours(self, context: ModelContext, location: Location) -> Sequence[Location]:
        """Give the other motions in which that support may be compliant."""
        return [
            alternative
            for alternative in self.locations(context)
            if alternative.end == location.end and alternative != location
        ]

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say which support is compliant, and how much."""
        del context
        ways = {ROTATION: ("N m/rad", "in rotation"), TRANSLATION: ("N/m", "in translation")}
        springs = " and ".join(f"{value.in_words(ways[name][0])} {ways[name][1]}" for name, value in values.items())
        return f"The {location.end} end is not rigidly held: its support has a stiffness of {springs}."


def _bending(context: ModelContext) -> tuple[float, float]:
    source = context.model.source
    if not isinstance(source, BeamFile):
        raise TypeError("only a beam has ends")
    beam = source.beam
    return beam.youngs_modulus_Pa * beam.width_m * beam.thickness_m**3 / 12, beam.length_m
