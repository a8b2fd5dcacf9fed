"""Constant parts of channels, read from the late part of records: whatever the structure is, it comes to rest there.

Where blows disagree with any linear system, nothing that they share tells a constant; but velocities and accelerations
of what vibrates and comes to rest have no mean. A structure that drifts in soft cords shows by that the mean of the
second half of a record is not that of the whole.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.measured.forces import isolate_pulse

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.observations import Observations, ObservedRecord

SHORTEST = 256  # samples after a blow that tell a mean
SURE = 3.0  # times the difference between the means of the whole record and of its second half


def remove_dc_offset(observations: Observations) -> Observations:
    """Take off what velocities and accelerations show where nothing moves.

    Parameters
    ----------
    observations : Observations
        Blows, or records from rest; others are given back as they are.

    Returns
    -------
    Observations
        The same without constants.
    """
    if not observations.are_from_rest:
        return observations
    is_hammer = observations.kind == "hammer"
    return replace(
        observations, records=tuple(_without(record, is_hammer=is_hammer) for record in observations.records)
    )


def _without(record: ObservedRecord, *, is_hammer: bool) -> ObservedRecord:
    start = isolate_pulse(record).start if is_hammer else 0
    if record.n_samples - start < SHORTEST:
        return record
    middle = (start + record.n_samples) // 2
    constants = np.array(
        [
            _mean(response, start, middle) if sensor.quantity.power else 0.0
            for sensor, response in zip(record.sensors, record.responses, strict=True)
        ]
    )
    return replace(record, responses=record.responses - constants[:, None])


def _mean(response: FloatArray, start: int, middle: int) -> float:
    """Mean of the late part; 0 where that of the whole is another one, so that something still moves."""
    whole, late = (float(_smooth(len(response) - first) @ response[first:]) for first in (start, middle))
    return late if abs(late) > SURE * abs(whole - late) else 0.0


def _smooth(n: int) -> FloatArray:
    """Weights that sum to 1 and take out all that turns several times."""
    weights = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 4
    return np.asarray(weights / weights.sum())
