"""A channel that is late: another converter, a filter, a wireless link."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter, Place
from frf_ipz.diagnosis.physics.change import Change

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.specimen import Specimen
    from frf_ipz.diagnosis.finding import Estimate

SHORTEST, LONGEST = 1e-4, 0.5  # periods of the band's upper edge
TRIED = np.array([0.003, 0.01, 0.03, 0.06, 0.1, 0.15, 0.2, 0.27, 0.35, 0.45])


class TimeDelay(Effect):
    """The channel is late."""

    name = "time_delay"
    imitators = ("sensor_dynamics",)

    def places(self, specimen: Specimen) -> Sequence[Place]:
        """Every channel."""
        return [Place(key=(channel,), location={"channels": [channel]}) for channel in specimen.layout.channels]

    def parameters(self, specimen: Specimen, place: Place) -> tuple[Parameter, ...]:
        """Delay."""
        del place
        period = 1 / specimen.band_hz[1]
        return (Parameter(name="delay_s", low=SHORTEST * period, high=LONGEST * period),)

    def build(self, specimen: Specimen, place: Place) -> Builder:
        """Turn the channel's phase."""
        del specimen
        return self.chain(place)

    def chain(self, place: Place) -> Builder:
        """Do the same for any structure."""
        channel = str(place.key[0])
        return lambda values: Change(channels={channel: lambda s: np.exp(-s * values[0])})

    def starts(self, specimen: Specimen, place: Place) -> FloatArray:
        """From little to much."""
        del place
        return TRIED[:, None] / specimen.band_hz[1]

    def statement(self, specimen: Specimen, place: Place, values: Mapping[str, Estimate]) -> str:
        """Say which channel, and by how much."""
        del specimen
        delay = values["delay_s"]
        return f"The channel '{place.key[0]}' is late by {1e6 * delay.value:.4g} us (+- {1e6 * delay.std:.2g} us)."
