"""DC offsets of channels, read from the late part of records: whatever the structure is, it comes to rest there.

Where records disagree with any linear system, nothing that they share determines an offset; but velocities and
accelerations of a structure that vibrates and comes to rest have no mean. A structure that drifts in its soft
suspension shows by that the mean of the second half of a record is not that of the whole.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.measured.forces import isolate_pulse

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.observations import Observations, ObservedRecord

MIN_SAMPLES = 256  # after the start of a record for a mean
SURE = 3.0  # times the difference between the means of the whole record and of its second half


def remove_dc_offset(observations: Observations) -> Observations:
    """Subtract from velocities and accelerations what they show at rest.

    Parameters
    ----------
    observations : Observations
        Records from rest; others are returned unchanged.

    Returns
    -------
    Observations
        The same without dc offsets.
    """
    if not observations.start_at_rest:
        return observations
    is_hammer = observations.kind == "hammer"
    return replace(
        observations, records=tuple(_remove_from_record(record, is_hammer=is_hammer) for record in observations.records)
    )


def _remove_from_record(record: ObservedRecord, *, is_hammer: bool) -> ObservedRecord:
    start = isolate_pulse(record).start if is_hammer else 0
    if record.n_samples - start < MIN_SAMPLES:
        return record
    middle = (start + record.n_samples) // 2
    offsets = np.array(
        [
            _late_mean(response, start, middle) if sensor.quantity.power else 0.0
            for sensor, response in zip(record.sensors, record.responses, strict=True)
        ]
    )
    return replace(record, responses=record.responses - offsets[:, None])


def _late_mean(response: FloatArray, start: int, middle: int) -> float:
    """Mean of the late part; 0 where that of the whole differs, so that something still moves."""
    whole, late = (float(_smooth_weights(len(response) - first) @ response[first:]) for first in (start, middle))
    return late if abs(late) > SURE * abs(whole - late) else 0.0


def _smooth_weights(n: int) -> FloatArray:
    """Weights that sum to 1 and suppress everything that oscillates several times."""
    weights = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 4
    return np.asarray(weights / weights.sum())
