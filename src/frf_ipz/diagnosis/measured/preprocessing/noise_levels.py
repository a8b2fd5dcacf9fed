"""How noisy each record is in each channel: recorders that choose their range have more noise in strong records.

The range is chosen channel by channel, in steps, for what the record needs: no power of the force's level says it. The
end of an impact's record does, above the band, where its response has decayed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
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
        The same with the levels of their noise; without them where a record shows too little of it.
    """
    powers = [_measure_powers(record, observations.band_hz[1]) for record in observations.records]
    if observations.kind != "hammer" or any(min(of_record.values(), default=0.0) <= 0 for of_record in powers):
        return observations
    names = dict.fromkeys(name for of_record in powers for name in of_record)
    mean = {name: np.mean([of_record[name] for of_record in powers if name in of_record]) for name in names}
    return replace(
        observations,
        records=tuple(
            replace(record, noise_levels={name: float(power / mean[name]) for name, power in of_record.items()})
            for record, of_record in zip(observations.records, powers, strict=True)
        ),
    )


def _measure_powers(record: ObservedRecord, highest_hz: float) -> dict[str, float]:
    """Median power of the lines above the band, at the end of a record; none where there are too few of them."""
    ends = np.vstack([record.force, record.responses])[:, record.n_samples // 2 :]
    above = np.fft.rfftfreq(ends.shape[1], record.step_s) > highest_hz
    if np.count_nonzero(above) < MIN_LINES:
        return {}
    energy: FloatArray = np.abs(np.fft.rfft(ends * np.hanning(ends.shape[1]))) ** 2
    names = (record.input_channel, *(sensor.channel for sensor in record.sensors))
    return dict(zip(names, np.median(energy[:, above], axis=1).tolist(), strict=True))
