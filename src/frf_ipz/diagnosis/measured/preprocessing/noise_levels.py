"""How noisy each record is in each channel: recorders that choose their range have more noise in strong records.

The range is chosen channel by channel, in steps, for what the record needs: no power of the force's level says it. The
end of an impact's record does, above the band, where its response has decayed: what is less in the last quarter than in
the one before, and not by chance, is a response. Under a Hann window the powers of neighbouring lines are correlated by
4/9, and those of the next by 1/36: as many lines hold 18/35 as many independent powers, and the median of n independent
ones, which are exponential variables, has a standard deviation of 1 / (ln 2 sqrt n) of itself.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri

from frf_ipz.ingest.signals.decay import STEADY

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import BoolArray
    from frf_ipz.diagnosis.observations import Observations, ObservedRecord

MIN_LINES = 20  # that show the noise: the median of fewer is uncertain by more than a quarter
INDEPENDENT = 18 / 35  # of lines under a Hann window
CHANCE = 1e-3  # that steady noise of any channel seems to decay


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
    n_lines = min(
        int(np.count_nonzero(_lines_above(record, observations.band_hz[1]))) for record in observations.records
    )
    if any(
        _decays([of_record[name] for of_record in powers if name in of_record], n_lines, len(names)) for name in names
    ):
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


def _decays(powers: Sequence[tuple[float, float]], n_lines: int, n_channels: int) -> bool:
    """Whether the medians of so many lines in the last two quarters of records fall, and not by chance."""
    earlier, later = np.array(powers).T
    std = float(np.sqrt(np.sum(earlier**2 + later**2) / (INDEPENDENT * n_lines))) / np.log(2)
    fall = float(np.sum(earlier - later))
    return bool(fall > (1 - STEADY) * np.sum(earlier) and fall > -float(ndtri(CHANCE / n_channels)) * std)


def _lines_above(record: ObservedRecord, highest_hz: float) -> BoolArray:
    """Lines above the band of a quarter of a record."""
    return np.asarray(np.fft.rfftfreq(record.n_samples // 4, record.step_s) > highest_hz)


def _measure_powers(record: ObservedRecord, highest_hz: float) -> dict[str, tuple[float, float]]:
    """Median power of the lines above the band, in the last two quarters of a record; none where they are few."""
    n, above = record.n_samples // 4, _lines_above(record, highest_hz)
    if np.count_nonzero(above) < MIN_LINES:
        return {}
    signals, window = np.vstack([record.force, record.responses]), np.hanning(n)
    earlier, later = (
        np.median(np.abs(np.fft.rfft(quarter * window)[:, above]) ** 2, axis=1).tolist()
        for quarter in (signals[:, -2 * n : -n], signals[:, -n:])
    )
    names = (record.input_channel, *(sensor.channel for sensor in record.sensors))
    return dict(zip(names, zip(earlier, later, strict=True), strict=True))
