"""A channel of another sensitivity, or of the other sign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter, Place
from frf_ipz.diagnosis.model.change import Change

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

BOUNDS = 0.02, 50.0
TRIED = np.array(
    [0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.95, 0.98, 1.02, 1.05, 1.1, 1.25, 1.5, 2.0, 3.0, 5.0, 10.0]
)


class SensorGain(Effect):
    """The recorded channel is the true signal times a ratio."""

    name = "sensor_gain"
    imitators = ("global_stiffness",)

    def places(self, specimen: ModelContext) -> Sequence[Place]:
        """Every channel, with either sign."""
        return [
            Place(key=(channel, sign), location={"channels": [channel]})
            for channel in specimen.layout.channels
            for sign in (1, -1)
        ]

    def parameters(self, specimen: ModelContext, place: Place) -> tuple[Parameter, ...]:
        """Give the size of the ratio."""
        neutral = 1.0 if place.key[1] == 1 else 0.0
        tolerance = specimen.options.gain_tolerance
        return (Parameter(name="gain_ratio", low=BOUNDS[0], high=BOUNDS[1], neutral=neutral, tolerance=tolerance),)

    def build(self, specimen: ModelContext, place: Place) -> Builder:
        """Multiply the channel."""
        del specimen
        return self.chain(place)

    def chain(self, place: Place) -> Builder:
        """Do the same for any structure."""
        channel, sign = str(place.key[0]), float(str(place.key[1]))
        return lambda values: Change(channels={channel: lambda s: np.full(len(s), sign * values[0] + 0j)})

    def starts(self, specimen: ModelContext, place: Place) -> FloatArray:
        """From much less to much more."""
        del specimen, place
        return TRIED[:, None]

    def reported(self, place: Place, name: str, value: float) -> float:
        """Give the ratio its sign."""
        del name
        return value * float(str(place.key[1]))

    def statement(self, specimen: ModelContext, place: Place, values: Mapping[str, Estimate]) -> str:
        """Say which channel, and by how much."""
        del specimen
        ratio = values["gain_ratio"]
        sign = " and has the wrong sign" if ratio.value < 0 else ""
        size = f"{abs(ratio.value):.4g} (+- {ratio.std:.2g})"
        return f"The channel '{place.key[0]}' shows {size} times the true signal{sign}."
