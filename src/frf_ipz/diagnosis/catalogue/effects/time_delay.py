"""A channel that is late: another converter, a filter, a wireless link."""

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

SHORTEST, LONGEST = 1e-4, 1.5  # periods of the band's upper edge
START_VALUES = np.array([0.003, 0.01, 0.03, 0.06, 0.1, 0.15, 0.2, 0.27, 0.35, 0.45, 0.6, 0.75, 0.95, 1.2])


class TimeDelay(Effect):
    """A channel is late, or all sensors together: what a controller, a recorder or a network adds."""

    name = "time_delay"

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Every channel, and all sensors together."""
        sensors = tuple(dict.fromkeys(channel for channel, _ in context.layout.outputs))
        late = [(channel,) for channel in context.layout.channels]
        return [Location(channels=channels) for channels in dict.fromkeys([*late, sensors])]

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Delay."""
        del location
        period = 1 / context.band_hz[1]
        return (Parameter(name="delay_s", low=SHORTEST * period, high=LONGEST * period),)

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Turn the phase."""
        del context
        return self.chain(location)

    def chain(self, location: Location) -> Builder:
        """Do the same for any structure."""

        def change(values: FloatArray) -> Change:
            return Change(channels=dict.fromkeys(location.channels, lambda s: np.exp(-s * values[0])))

        return change

    def start_values(self, context: ModelContext, location: Location) -> FloatArray:
        """From little to much."""
        del location
        return START_VALUES[:, None] / context.band_hz[1]

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say which channel, and by how much."""
        del context
        delay = values["delay_s"]
        late = f"late by {delay.in_words('us', 1e6)}"
        if len(location.channels) == 1:
            return f"The channel '{location.channel}' is {late}."
        return f"All sensors together are {late}."
