"""A channel with a corner within or near the band: a charge amplifier's high-pass, an amplifier's low-pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Change

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

HIGHPASS, LOWPASS = "highpass", "lowpass"
BOUNDS = {HIGHPASS: (1e-3, 10.0), LOWPASS: (0.1, 1e3)}  # over the lower edge, over the upper edge of the band
START_VALUES = {HIGHPASS: np.geomspace(0.03, 5, 10), LOWPASS: np.geomspace(0.2, 30, 10)}


class SensorDynamics(Effect):
    """A first-order filter in a channel."""

    name = "sensor_dynamics"

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Every channel, with a high-pass or a low-pass."""
        return [
            Location.on_channel(channel, form=kind)
            for channel in context.layout.channels
            for kind in (HIGHPASS, LOWPASS)
        ]

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Corner."""
        low, high = (bound * _edge(context, location) for bound in BOUNDS[location.form])
        neutral = 0.0 if location.form == HIGHPASS else np.inf
        return (Parameter(name="corner_hz", low=low, high=high, neutral=neutral),)

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Filter the channel."""
        del context
        return self.chain(location)

    def chain(self, location: Location) -> Builder:
        """Do the same for any structure."""
        return lambda values: Change(channels={location.channel: lambda s: first_order(s, location.form, values[0])})

    def texts(self, location: Location) -> Mapping[str, str]:
        """Give the kind of the filter."""
        return {"kind": location.form}

    def start_values(self, context: ModelContext, location: Location) -> FloatArray:
        """From outside the band to within."""
        return START_VALUES[location.form][:, None] * _edge(context, location)

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say which channel, which filter."""
        del context
        corner = values["corner_hz"]
        return f"The channel '{location.channel}' has a {location.form} with its corner at {corner.in_words('Hz')}."


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


def _edge(context: ModelContext, location: Location) -> float:
    return context.band_hz[0] if location.form == HIGHPASS else context.band_hz[1]
