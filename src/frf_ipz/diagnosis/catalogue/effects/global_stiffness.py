"""Another stiffness of the whole structure: a wrong Young's modulus, for one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Change
from frf_ipz.diagnosis.model.matrix_sum import MatrixSum

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

BOUNDS = 0.2, 5.0
START_VALUES = np.array([1.005, 1.01, 1.02, 1.04, 1.07, 1.12, 1.2, 1.35, 1.6, 2.2])


class GlobalStiffness(Effect):
    """All stiffness times a ratio."""

    name = "global_stiffness"

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Everywhere."""
        del context
        return [Location()]

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Real stiffness over the model's."""
        del location
        tolerance = context.options.stiffness_tolerance
        return (Parameter(name="stiffness_ratio", low=BOUNDS[0], high=BOUNDS[1], neutral=1.0, tolerance=tolerance),)

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Scale the matrix."""
        del location
        whole = context.model.stiffness_all
        return lambda values: Change(stiffness=MatrixSum(((values[0] - 1, whole),)))

    def start_values(self, context: ModelContext, location: Location) -> FloatArray:
        """Softer and stiffer, by little and by much."""
        del context, location
        return np.concatenate([START_VALUES, 1 / START_VALUES])[:, None]

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say by how much."""
        del context, location
        ratio = values["stiffness_ratio"]
        how = "stiffer" if ratio.value > 1 else "softer"
        return (
            f"The whole structure is {ratio.in_words('%', 100 if ratio.value > 1 else -100, less=1)} {how} than the "
            "model: a wrong Young's modulus, thickness or length."
        )
