"""A channel of another sensitivity, or of the other sign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Change

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

BOUNDS = 0.02, 50.0
START_VALUES = np.array(
    [0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.95, 0.98, 1.02, 1.05, 1.1, 1.25, 1.5, 2.0, 3.0, 5.0, 10.0]
)


class SensorGain(Effect):
    """The recorded channel is the true signal times a ratio."""

    name = "sensor_gain"

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Every channel, with either sign."""
        return [Location.on_channel(channel, sign=sign) for channel in context.layout.channels for sign in (1, -1)]

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Give the size of the ratio."""
        neutral = 1.0 if location.sign == 1 else 0.0
        tolerance = context.options.gain_tolerance
        return (Parameter(name="gain_ratio", low=BOUNDS[0], high=BOUNDS[1], neutral=neutral, tolerance=tolerance),)

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Multiply the channel."""
        del context
        return self.chain(location)

    def chain(self, location: Location) -> Builder:
        """Do the same for any structure."""
        return lambda values: Change(
            channels={location.channel: lambda s: np.full(len(s), location.sign * values[0] + 0j)}
        )

    def start_values(self, context: ModelContext, location: Location) -> FloatArray:
        """From much less to much more."""
        del context, location
        return START_VALUES[:, None]

    def report_value(self, location: Location, name: str, value: float) -> float:
        """Give the ratio its sign."""
        del name
        return value * location.sign

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say which channel, and by how much."""
        del context
        ratio = values["gain_ratio"]
        sign = " and has the wrong sign" if ratio.value < 0 else ""
        size = ratio.in_words("times", -1.0 if ratio.value < 0 else 1.0)
        return f"The channel '{location.channel}' shows {size} the true signal{sign}."
