"""Another damping ratio of all modes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import NO_CHANGE, Change
from frf_ipz.diagnosis.model.modes import MIN_RATIO, modify_structure

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

BOUNDS = 1e-5, 0.5
START_VALUES = np.geomspace(1 / 16, 16, 17)
UNSTATED = 1e-3  # taken where the model states no damping


class DampingLevel(Effect):
    """The ratio of all modes."""

    name = "damping_level"

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Everywhere."""
        del context
        return [Location()]

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Damping ratio."""
        del location
        stated = _stated(context)
        return (
            Parameter(
                name="modal_ratio",
                low=BOUNDS[0],
                high=BOUNDS[1],
                neutral=stated,
                tolerance=context.options.damping_tolerance * stated,
            ),
        )

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Give it to all modes."""
        del context, location
        return lambda values: Change(modal_ratio=float(values[0]))

    def start_values(self, context: ModelContext, location: Location) -> FloatArray:
        """Less and more than stated."""
        del location
        return np.clip(_stated(context) * START_VALUES, *BOUNDS)[:, None]

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say how much."""
        del location
        ratio = values["modal_ratio"]
        return (
            f"All modes have a damping ratio of about {ratio.in_words('%', 100)}, not the "
            f"{100 * _stated(context):.3g} % of the model."
        )


def _stated(context: ModelContext) -> float:
    """Typical damping ratio of the nominal modes of the band, whichever way the model states it."""
    basis, low_high = context.basis, 2 * np.pi * np.array(context.band_hz)
    modified = modify_structure(basis, NO_CHANGE)
    omega, n_rigid = np.sqrt(np.abs(modified.squares)), basis.modes.n_rigid
    inside = (omega >= low_high[0]) & (omega <= low_high[1]) & (np.arange(len(omega)) >= n_rigid)
    stated = modified.stated_ratio[inside if inside.any() else slice(n_rigid, n_rigid + 1)]
    return float(np.median(stated)) if stated.size and np.median(stated) > MIN_RATIO else UNSTATED
