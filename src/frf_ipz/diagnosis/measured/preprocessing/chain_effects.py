"""Recordings as a faultless measuring chain would have made them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len

from frf_ipz.arrays import FloatArray
from frf_ipz.dofs import Dof

if TYPE_CHECKING:
    from frf_ipz.diagnosis.model.change import Change
    from frf_ipz.diagnosis.observations import Observations, ObservedRecord, Sensor

LEAST_SHOWN = 0.05  # of what a channel shows at other frequencies: what it shows less of is left as it is


def undo_chain_effects(observations: Observations, change: Change) -> Observations:
    """Take out of recordings what a change of the measuring chain has done to them.

    Parameters
    ----------
    observations : Observations
        Blows or records that start at rest.
    change : Change
        Its channels and moved sensors count, nothing else.

    Returns
    -------
    Observations
        The same where the measuring chain is as it should be.
    """
    if not (change.channels or change.moved):
        return observations
    return replace(observations, records=tuple(_restored(record, change) for record in observations.records))


def _restored(record: ObservedRecord, change: Change) -> ObservedRecord:
    channels = [sensor.channel for sensor in record.sensors]
    shown = [_unfiltered(record, values, name, change) for values, name in zip(record.responses, channels, strict=True)]
    return replace(
        record,
        force=_unfiltered(record, record.force, record.input_channel, change),
        responses=np.stack(shown),
        sensors=tuple(_where_it_is(sensor, change) for sensor in record.sensors),
    )


def _unfiltered(record: ObservedRecord, values: FloatArray, channel: str, change: Change) -> FloatArray:
    if channel not in change.channels:
        return values
    padded = next_fast_len(2 * len(values), real=True)  # zeros beyond the end: nothing comes round to the start
    s = np.asarray(2j * np.pi * np.fft.rfftfreq(padded, record.step_s), np.complex128)
    shown = change.channels[channel](s)
    faint = np.abs(shown) < LEAST_SHOWN * np.abs(shown).max()
    spectrum = np.fft.rfft(values, padded) / np.where(faint, 1.0, shown)
    return np.asarray(np.fft.irfft(spectrum, padded)[: len(values)])


def _where_it_is(sensor: Sensor, change: Change) -> Sensor:
    node = change.moved.get(sensor.channel)
    return sensor if node is None else replace(sensor, dof=Dof(node, sensor.dof.direction, sensor.dof.sign))
