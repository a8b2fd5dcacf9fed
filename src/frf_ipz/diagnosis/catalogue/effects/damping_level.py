"""Another damping ratio of all modes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter, Place
from frf_ipz.diagnosis.model.change import NOTHING, Change
from frf_ipz.diagnosis.model.modes import LEAST_RATIO, modify

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

BOUNDS = 1e-5, 0.5
TRIED = np.geomspace(1 / 16, 16, 17)
UNSTATED = 1e-3  # taken where the model states no damping


class DampingLevel(Effect):
    """The ratio of all modes."""

    name = "damping_level"
    imitators = ("structural_damping", "local_damper")

    def places(self, specimen: ModelContext) -> Sequence[Place]:
        """Everywhere."""
        del specimen
        return [Place(key=())]

    def parameters(self, specimen: ModelContext, place: Place) -> tuple[Parameter, ...]:
        """Damping ratio."""
        del place
        stated = _stated(specimen)
        return (
            Parameter(
                name="modal_ratio",
                low=BOUNDS[0],
                high=BOUNDS[1],
                neutral=stated,
                tolerance=specimen.options.damping_tolerance * stated,
            ),
        )

    def build(self, specimen: ModelContext, place: Place) -> Builder:
        """Give it to all modes."""
        del specimen, place
        return lambda values: Change(modal_ratio=float(values[0]))

    def starts(self, specimen: ModelContext, place: Place) -> FloatArray:
        """Less and more than stated."""
        del place
        return np.clip(_stated(specimen) * TRIED, *BOUNDS)[:, None]

    def statement(self, specimen: ModelContext, place: Place, values: Mapping[str, Estimate]) -> str:
        """Say how much."""
        del place
        ratio = values["modal_ratio"]
        return (
            f"All modes have a damping ratio of about {100 * ratio.value:.3g} % (+- {100 * ratio.std:.2g} %), not the "
            f"{100 * _stated(specimen):.3g} % of the model."
        )


def _stated(specimen: ModelContext) -> float:
    """Typical damping ratio of the nominal modes of the band, whichever way the model states it."""
    basis, low_high = specimen.basis, 2 * np.pi * np.array(specimen.band_hz)
    modified = modify(basis, NOTHING)
    omega, n_rigid = np.sqrt(np.abs(modified.squares)), basis.modes.n_rigid
    inside = (omega >= low_high[0]) & (omega <= low_high[1]) & (np.arange(len(omega)) >= n_rigid)
    stated = modified.stated_ratio[inside if inside.any() else slice(n_rigid, n_rigid + 1)]
    return float(np.median(stated)) if stated.size and np.median(stated) > LEAST_RATIO else UNSTATED
