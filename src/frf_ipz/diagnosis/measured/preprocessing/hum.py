"""Hum: steady tones at multiples of the mains' frequency, which are no response to an impact.

An impact's response has decayed where its record ends, and a tone has not: the last half of a record shows its
frequency and, channel by channel, its amplitude and phase, and it is subtracted from the whole. The frequency wanders
from record to record, within what the grid's operators promise [EN50160], and is the same in all channels of one. What
stands there and decays is a mode. Without that, a tone of a thousandth of the recorder's range, under a window as short
as the decay of a resonance, exceeds the noise a thousandfold, and records seem to disagree. Under such a window a tone
reaches far: the first multiple above the band is one of those that show in it.

[EN50160] EN 50160:2010, Voltage characteristics of electricity supplied by public electricity networks, 4.2.1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize_scalar

from frf_ipz.ingest.signals.decay import MAINS_HZ, STEADY

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray
    from frf_ipz.diagnosis.observations import Observations, ObservedRecord

WANDER = 0.01  # of the mains' frequency: EN 50160
PADDING = 8  # lines for each one of a record's end: the top of a window's lobe is read to some thousandths
LOBE_LINES, FLOOR_LINES = 3, 24  # on either side: what a tone reaches under the window; what shows the noise beside it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _End:
    """The last half of a record.

    Parameters
    ----------
    time_s : (n,) array
        From the start of the record.
    signals : (n_channels, n) array
        SI, the force first.
    energy : (n_channels, n_lines) array
        Of the transform under a Hann window, on `PADDING` times as many lines as it has.
    """

    time_s: FloatArray
    signals: FloatArray
    energy: FloatArray

    @classmethod
    def of(cls, record: ObservedRecord) -> _End:
        start = record.n_samples // 2
        signals = np.vstack([record.force[start:], record.responses[:, start:]])
        signals = signals - signals.mean(1, keepdims=True)
        n = signals.shape[1]
        energy = np.abs(np.fft.rfft(signals * np.hanning(n), PADDING * n)) ** 2
        time = np.asarray(record.step_s * np.arange(start, record.n_samples))
        return cls(time_s=time, signals=signals, energy=np.asarray(energy))

    @property
    def line_hz(self) -> float:
        """Distance of the lines."""
        return 1 / (PADDING * len(self.time_s) * float(self.time_s[1] - self.time_s[0]))

    @property
    def highest_hz(self) -> float:
        """Highest tone whose wandering the lines hold."""
        return float(self.line_hz * (self.energy.shape[1] - 1) / (1 + WANDER))

    def over_floor(self, frequency_hz: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Energy over that of the noise beside, (n_frequencies, n_channels), and that of the noise, (n_channels,)."""
        lines = np.rint(frequency_hz / self.line_hz).astype(int)
        reach, lobe = PADDING * FLOOR_LINES, PADDING * LOBE_LINES
        first, last = int(lines.min()), int(lines.max())
        beside = [
            self.energy[:, max(first - reach, 0) : max(first - lobe, 0)],
            self.energy[:, last + lobe :][:, :reach],
        ]
        floor = np.median(np.hstack(beside), axis=1) / np.log(2)  # the median of exponential variables over their mean
        floor = np.maximum(floor, np.finfo(float).tiny)
        return self.energy[:, lines].T / floor, floor

    def amplitudes(self, frequency_hz: FloatArray, part: slice = slice(None)) -> ComplexArray:
        """Amplitudes of tones at time zero, (n_channels, n_frequencies), under a Hann window on a part."""
        time = self.time_s[part]
        window = np.hanning(len(time))
        turning = np.exp(-2j * np.pi * np.outer(time, frequency_hz)) * window[:, None]
        return np.asarray(2 / window.sum() * (self.signals[:, part] @ turning))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Hum:
    """The tones of one mains' frequency.

    Parameters
    ----------
    mains_hz : (n_records,) array
        Its frequency in each record.
    orders : (n_tones,) int array
        Multiples of it.
    shows : (n_tones, n_channels) bool array
        Channels that show each, the force first.
    strength : float
        Energy over that of the noise, summed over these.
    """

    mains_hz: FloatArray
    orders: IntArray
    shows: BoolArray
    strength: float


def remove_hum(observations: Observations) -> Observations:
    """Subtract the tones of the mains from the force and the responses of impacts.

    Parameters
    ----------
    observations : Observations
        Records of a hammer; others are returned unchanged.

    Returns
    -------
    Observations
        The same without hum, where there is some.
    """
    layouts = {tuple(sensor.channel for sensor in record.sensors) for record in observations.records}
    if observations.kind != "hammer" or len(layouts) != 1:
        return observations
    ends = [_End.of(record) for record in observations.records]
    highest = min(end.highest_hz for end in ends)
    hum = max(
        (_find_hum(ends, mains, min(observations.band_hz[1] + mains, highest)) for mains in MAINS_HZ),
        key=lambda hum: hum.strength,
    )
    if not hum.shows.any():
        return observations
    records = zip(observations.records, ends, hum.mains_hz.tolist(), strict=True)
    return replace(observations, records=tuple(_subtract(record, end, hum, hz) for record, end, hz in records))


def _find_hum(ends: Sequence[_End], mains_hz: float, highest_hz: float) -> _Hum:
    """Find the frequency in each record, and the tones that stand out of the noise and do not decay."""
    orders = np.arange(1, int(highest_hz / mains_hz) + 1)
    if not orders.size:
        nowhere = np.zeros((0, len(ends[0].signals)), bool)
        return _Hum(mains_hz=np.full(len(ends), mains_hz), orders=orders, shows=nowhere, strength=0.0)
    steps = int(np.ceil(WANDER * mains_hz * orders[-1] / ends[0].line_hz))
    grid = mains_hz * (1 + WANDER * np.linspace(-1, 1, 2 * steps + 1))
    found, energies, floors = np.zeros(len(ends)), [], []
    for number, end in enumerate(ends):
        over, floor = zip(*(end.over_floor(order * grid) for order in orders.tolist()), strict=True)
        best = int(np.argmax(np.sum(over, axis=(0, 2))))  # of (order, grid, channel)
        found[number] = grid[best]
        energies.append(np.array(over)[:, best])
        floors.append(np.array(floor))
    mean = np.mean(energies, axis=0)
    shows = mean > np.log(mean.size * len(grid))  # the largest of so many lines of noise
    if not shows.any():
        return _Hum(mains_hz=found, orders=orders, shows=shows, strength=0.0)
    found = np.array(
        [
            _refine(end, hz, orders, shows / floor, grid[1] - grid[0])
            for end, hz, floor in zip(ends, found, floors, strict=True)
        ]
    )
    shows &= _is_steady(ends, found, orders)
    return _Hum(mains_hz=found, orders=orders, shows=shows, strength=float(mean[shows].sum()))


def _refine(end: _End, mains_hz: float, orders: IntArray, weights: FloatArray, step_hz: float) -> float:
    """Find the frequency between the steps of a grid."""
    shown = weights.any(axis=1)

    def faintness(hz: float) -> float:
        return -float(np.sum(np.abs(end.amplitudes(np.asarray(hz * orders[shown]))) ** 2 * weights[shown].T))

    low, high, exact = mains_hz - 2 * step_hz, mains_hz + 2 * step_hz, 1e-4 * step_hz
    return float(minimize_scalar(faintness, bounds=(low, high), method="bounded", options={"xatol": exact}).x)


def _is_steady(ends: Sequence[_End], mains_hz: FloatArray, orders: IntArray) -> BoolArray:
    """Whether tones are as strong in the last quarter of the records as in the one before, (n_tones, n_channels)."""
    energy = np.zeros((2, len(ends[0].signals), len(orders)))
    for end, hz in zip(ends, mains_hz.tolist(), strict=True):
        middle = len(end.time_s) // 2
        for row, part in enumerate((slice(None, middle), slice(middle, None))):
            energy[row] += np.abs(end.amplitudes(np.asarray(hz * orders), part)) ** 2
    return np.asarray(energy[1] > STEADY * energy[0]).T


def _subtract(record: ObservedRecord, end: _End, hum: _Hum, mains_hz: float) -> ObservedRecord:
    frequency = np.asarray(mains_hz * hum.orders)
    amplitudes = end.amplitudes(frequency) * hum.shows.T
    turning = np.exp(2j * np.pi * np.outer(frequency, record.step_s * np.arange(record.n_samples)))
    tones = (amplitudes @ turning).real
    return replace(record, force=record.force - tones[0], responses=record.responses - tones[1:])
