"""A channel with a corner within or near the band: a charge amplifier's high-pass, an amplifier's low-pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter, Place
from frf_ipz.diagnosis.model.change import Change

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

HIGHPASS, LOWPASS = "highpass", "lowpass"
BOUNDS = {HIGHPASS: (1e-3, 10.0), LOWPASS: (0.1, 1e3)}  # over the lower edge, over the upper edge of the band
TRIED = {HIGHPASS: np.geomspace(0.03, 5, 10), LOWPASS: np.geomspace(0.2, 30, 10)}


class SensorDynamics(Effect):
    """A first-order filter in a channel."""

    name = "sensor_dynamics"
    imitators = ("time_delay", "sensor_gain")

    def places(self, specimen: ModelContext) -> Sequence[Place]:
        """Every channel, with a high-pass or a low-pass."""
        return [
            Place(key=(channel, kind), location={"channels": [channel]}, text={"kind": kind})
            for channel in specimen.layout.channels
            for kind in (HIGHPASS, LOWPASS)
        ]

    def parameters(self, specimen: ModelContext, place: Place) -> tuple[Parameter, ...]:
        """Corner."""
        low, high = (bound * _edge(specimen, place) for bound in BOUNDS[str(place.key[1])])
        neutral = 0.0 if place.key[1] == HIGHPASS else np.inf
        return (Parameter(name="corner_hz", low=low, high=high, neutral=neutral),)

    def build(self, specimen: ModelContext, place: Place) -> Builder:
        """Filter the channel."""
        del specimen
        return self.chain(place)

    def chain(self, place: Place) -> Builder:
        """Do the same for any structure."""
        channel, kind = str(place.key[0]), str(place.key[1])
        return lambda values: Change(channels={channel: lambda s: first_order(s, kind, values[0])})

    def starts(self, specimen: ModelContext, place: Place) -> FloatArray:
        """From outside the band to within."""
        return TRIED[str(place.key[1])][:, None] * _edge(specimen, place)

    def statement(self, specimen: ModelContext, place: Place, values: Mapping[str, Estimate]) -> str:
        """Say which channel, which filter."""
        del specimen
        corner = values["corner_hz"]
        return (
            f"The channel '{place.key[0]}' has a {place.key[1]} with its corner at {corner.value:.4g} Hz "
            f"(+- {corner.std:.2g} Hz)."
        )


def first_order(s: ComplexArray, kind: str, corner_hz: float) -> ComplexArray:
    """Evaluate a first-order filter.

    Parameters
    ----------
    s : (n_points,) complex array
        rad/s.
    kind : str
        ``highpass`` or ``lowpass``.
    corner_hz : float
        Hz.

    Returns
    -------
    (n_points,) complex array
        1.
    """
    corner = 2 * np.pi * corner_hz
    return np.asarray((s if kind == HIGHPASS else corner) / (s + corner))


def _edge(specimen: ModelContext, place: Place) -> float:
    return specimen.band_hz[0] if place.key[1] == HIGHPASS else specimen.band_hz[1]
