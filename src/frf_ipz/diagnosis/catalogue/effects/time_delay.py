"""A channel that is late: another converter, a filter, a wireless link."""

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

SHORTEST, LONGEST = 1e-4, 1.5  # periods of the band's upper edge
TRIED = np.array([0.003, 0.01, 0.03, 0.06, 0.1, 0.15, 0.2, 0.27, 0.35, 0.45, 0.6, 0.75, 0.95, 1.2])


class TimeDelay(Effect):
    """A channel is late, or all sensors together: what a controller, a recorder or a network adds."""

    name = "time_delay"
    imitators = ("sensor_dynamics",)

    def places(self, specimen: ModelContext) -> Sequence[Place]:
        """Every channel, and all sensors together."""
        sensors = tuple(dict.fromkeys(channel for channel, _ in specimen.layout.outputs))
        late = [(channel,) for channel in specimen.layout.channels]
        return [
            Place(key=channels, location={"channels": list(channels)}) for channels in dict.fromkeys([*late, sensors])
        ]

    def parameters(self, specimen: ModelContext, place: Place) -> tuple[Parameter, ...]:
        """Delay."""
        del place
        period = 1 / specimen.band_hz[1]
        return (Parameter(name="delay_s", low=SHORTEST * period, high=LONGEST * period),)

    def build(self, specimen: ModelContext, place: Place) -> Builder:
        """Turn the phase."""
        del specimen
        return self.chain(place)

    def chain(self, place: Place) -> Builder:
        """Do the same for any structure."""
        channels = [str(channel) for channel in place.key]

        def change(values: FloatArray) -> Change:
            return Change(channels=dict.fromkeys(channels, lambda s: np.exp(-s * values[0])))

        return change

    def starts(self, specimen: ModelContext, place: Place) -> FloatArray:
        """From little to much."""
        del place
        return TRIED[:, None] / specimen.band_hz[1]

    def statement(self, specimen: ModelContext, place: Place, values: Mapping[str, Estimate]) -> str:
        """Say which channel, and by how much."""
        del specimen
        delay = values["delay_s"]
        late = f"late by {1e6 * delay.value:.4g} us (+- {1e6 * delay.std:.2g} us)"
        if len(place.key) == 1:
            return f"The channel '{place.key[0]}' is {late}."
        return f"All sensors together are {late}."
