"""Records as a faultless measuring chain would have made them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.model.change import place_sensor

if TYPE_CHECKING:
    from frf_ipz.diagnosis.model.change import Change
    from frf_ipz.diagnosis.observations import Observations, ObservedRecord, Sensor

MIN_GAIN = 0.05  # of a channel's largest gain: where it has less, the record stays as it is


def undo_chain_effects(observations: Observations, change: Change) -> Observations:
    """Undo the effect of a change of the measuring chain on records.

    Parameters
    ----------
    observations : Observations
        Records that start at rest.
    change : Change
        Its channels and moved sensors count, nothing else.

    Returns
    -------
    Observations
        As the nominal measuring chain would have recorded them.
    """
    if not (change.channels or change.moved):
        return observations
    return replace(observations, records=tuple(_undo_in_record(record, change) for record in observations.records))


def _undo_in_record(record: ObservedRecord, change: Change) -> ObservedRecord:
    channels = [sensor.channel for sensor in record.sensors]
    responses = [
        _filter_inversely(record, values, name, change) for values, name in zip(record.responses, channels, strict=True)
    ]
    return replace(
        record,
        force=_filter_inversely(record, record.force, record.input_channel, change),
        responses=np.stack(responses),
        sensors=tuple(_sensor_at_true_node(sensor, change) for sensor in record.sensors),
    )


def _filter_inversely(record: ObservedRecord, values: FloatArray, channel: str, change: Change) -> FloatArray:
    if channel not in change.channels:
        return values
    padded = next_fast_len(2 * len(values), real=True)  # zeros after the end: no circular convolution
    s = np.asarray(2j * np.pi * np.fft.rfftfreq(padded, record.step_s), np.complex128)
    gain = change.channels[channel](s)
    faint = np.abs(gain) < MIN_GAIN * np.abs(gain).max()
    spectrum = np.fft.rfft(values, padded) / np.where(faint, 1.0, gain)
    return np.asarray(np.fft.irfft(spectrum, padded)[: len(values)])


def _sensor_at_true_node(sensor: Sensor, change: Change) -> Sensor:
    return replace(sensor, dof=place_sensor(sensor.dof, change.moved.get(sensor.channel)))
