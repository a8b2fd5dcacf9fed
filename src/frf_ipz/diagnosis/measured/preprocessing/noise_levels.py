"""How noisy each record is in each channel: recorders that choose their range have more noise in strong records.

The range is chosen channel by channel, in steps, for what the record needs: no power of the force's level says it. The
end of an impact's record does, above the band, where its response has decayed: what is less in the last quarter than in
the one before is a response.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.signals.decay import STEADY

if TYPE_CHECKING:
    from frf_ipz.diagnosis.observations import Observations, ObservedRecord

MIN_LINES = 20  # that show the noise: the median of fewer is uncertain by more than a quarter


def measure_noise_levels(observations: Observations) -> Observations:
    """Compare the noise power of each record with the mean of all records, channel by channel.

    Parameters
    ----------
    observations : Observations
        Records of a hammer; others are returned unchanged.

    Returns
    -------
    Observations
        The same with the levels of their noise; without them where records do not show it.
    """
    if observations.kind != "hammer":
        return observations
    powers = [_measure_powers(record, observations.band_hz[1]) for record in observations.records]
    if any(min(map(min, of_record.values()), default=0) <= 0 for of_record in powers):
        return observations
    names = dict.fromkeys(name for of_record in powers for name in of_record)
    earlier, later = (
        {name: float(np.mean([of_record[name][end] for of_record in powers if name in of_record])) for name in names}
        for end in (0, 1)
    )
    if any(later[name] < STEADY * earlier[name] for name in names):
        return observations
    return replace(
        observations,
        records=tuple(
            replace(
                record,
                noise_levels={name: sum(power) / (earlier[name] + later[name]) for name, power in of_record.items()},
            )
            for record, of_record in zip(observations.records, powers, strict=True)
        ),
    )


def _measure_powers(record: ObservedRecord, highest_hz: float) -> dict[str, tuple[float, float]]:
    """Median power of the lines above the band, in the last two quarters of a record; none where they are few."""
    n = record.n_samples // 4
    above = np.fft.rfftfreq(n, record.step_s) > highest_hz
    if np.count_nonzero(above) < MIN_LINES:
        return {}
    signals, window = np.vstack([record.force, record.responses]), np.hanning(n)
    earlier, later = (
        np.median(np.abs(np.fft.rfft(quarter * window)[:, above]) ** 2, axis=1).tolist()
        for quarter in (signals[:, -2 * n : -n], signals[:, -n:])
    )
    names = (record.input_channel, *(sensor.channel for sensor in record.sensors))
    return dict(zip(names, zip(earlier, later, strict=True), strict=True))
