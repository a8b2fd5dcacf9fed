"""Noise of the channels, read where nothing drives the structure: before and after blows, or beside a shaker's band."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import median_filter

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.measured.forces import estimate_force_noise, isolate_pulse
from frf_ipz.diagnosis.measured.noise import Noise

if TYPE_CHECKING:
    from frf_ipz.diagnosis.observations import Observations, ObservedRecord
    from frf_ipz.dofs import Dof

QUIET_PART = 0.3  # quantile of a band of lines that holds noise, between resonances
QUIET_MEDIAN = 0.42  # that quantile of the mean of a few exponential variables over their mean
UNDRIVEN = 1e-4  # of the force's energy in the band: lines that a shaker does not drive
LEAST_LINES = 20
MEDIAN_OF_MEAN = 0.7  # of exponential variables
PINK = 1.0  # 1/f part over white part at the undriven lines, where only these are seen: half of each
TRACE = 1e-6  # of the response's energy, where noise is not seen at all


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChannelNoise:
    """Noise of all channels of a test.

    Parameters
    ----------
    is_hammer : bool
        The force is isolated before it is used, and its noise is that of the pulse alone.
    sensors : tuple of (str, Dof)
        Channels and where they sat.
    force : Noise
        N^2 s.
    responses : tuple of Noise
        unit^2 s.
    pulse_s : float
        Length of the pulse that is kept of a hammer's blow.
    """

    is_hammer: bool
    sensors: tuple[tuple[str, Dof], ...]
    force: Noise
    responses: tuple[Noise, ...]
    pulse_s: float

    def force_of(self, record: ObservedRecord) -> FloatArray:
        """(n_samples,) force without what is noise for sure."""
        return isolate_pulse(record).record.force if self.is_hammer else record.force

    def force_energy(self, frequency_hz: FloatArray, duration_s: float) -> FloatArray:
        """Variance of the force's transform."""
        return self.force.density(frequency_hz) * (self.pulse_s if self.is_hammer else duration_s)

    def response_energy(self, row: int, frequency_hz: FloatArray, duration_s: float) -> FloatArray:
        """Variance of a response's transform."""
        return self.responses[row].density(frequency_hz) * duration_s


def read_noise(observations: Observations) -> ChannelNoise:
    """Read the noise of all channels.

    Parameters
    ----------
    observations : Observations
        Blows or records.

    Returns
    -------
    ChannelNoise
        A trace where noise is not seen at all.
    """
    is_hammer = observations.kind == "hammer"
    sensors = tuple({(s.channel, s.dof): None for record in observations.records for s in record.sensors})
    signals = [_signals(observations, sensor) for sensor in sensors]
    step = observations.records[0].step_s
    if is_hammer:
        pulses = tuple(isolate_pulse(record) for record in observations.records)
        length = float(np.median([pulse.stop - pulse.start for pulse in pulses])) * step
        found = [quiet_density([s[len(s) // 2 :] for s in mine], step).rounded(mine, step) for mine in signals]
        force = estimate_force_noise(observations.records, pulses)
        return ChannelNoise(is_hammer=True, sensors=sensors, force=force, responses=tuple(found), pulse_s=length)
    forces = [record.force for record in observations.records]
    lines = _undriven(forces, step, observations.band_hz)
    return ChannelNoise(
        is_hammer=False,
        sensors=sensors,
        force=_beside(forces, lines, step),
        responses=tuple(_beside(mine, lines, step) for mine in signals),
        pulse_s=0.0,
    )


def quiet_density(tails: list[FloatArray], step_s: float) -> Noise:
    """Read the noise of a channel between the resonances of signals that have nearly decayed.

    Parameters
    ----------
    tails : list of (n_samples,) array
        Ends of records.
    step_s : float
        s.

    Returns
    -------
    Noise
        White and 1/f part.
    """
    n = min(len(tail) for tail in tails)
    hann = np.hanning(n)
    energy = np.mean([np.abs(np.fft.rfft((tail[:n] - tail[:n].mean()) * hann)) ** 2 for tail in tails], 0)
    energy *= step_s / np.sum(hann**2)
    edges = np.unique(np.geomspace(3, len(energy), 25).astype(int))
    frequency = np.array([(a + b - 1) / 2 / (n * step_s) for a, b in pairwise(edges)])
    quiet = np.array([np.quantile(energy[a:b], QUIET_PART) for a, b in pairwise(edges)])
    quiet /= QUIET_MEDIAN ** (1 / len(tails))
    white = float(np.median(np.sort(quiet)[: max(len(quiet) // 3, 1)]))
    pink = float(np.quantile(np.maximum(quiet - white, 0.0) * frequency, 0.4))
    return Noise(white=white, pink=pink)


def _signals(observations: Observations, sensor: tuple[str, Dof]) -> list[FloatArray]:
    return [
        row
        for record in observations.records
        for s, row in zip(record.sensors, record.responses, strict=True)
        if (s.channel, s.dof) == sensor
    ]


def _energies(signals: list[FloatArray], step_s: float) -> FloatArray:
    """(n_signals, n_lines) two-sided periodograms, unit^2 s."""
    n = min(len(signal) for signal in signals)
    hann = np.hanning(n)
    return np.array([np.abs(np.fft.rfft(signal[:n] * hann)) ** 2 for signal in signals]) * (step_s / np.sum(hann**2))


def _undriven(forces: list[FloatArray], step_s: float, band_hz: tuple[float, float]) -> FloatArray:
    """Frequencies above the band that a shaker does not drive, and the number of all lines: (n, ) array, Hz."""
    energy = _energies(forces, step_s).mean(0)
    frequency = np.fft.rfftfreq(min(len(force) for force in forces), step_s)
    inside = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    smooth = median_filter(energy, 31)
    return np.asarray(frequency[(smooth < UNDRIVEN * np.median(energy[inside])) & (frequency > band_hz[1])])


def _beside(signals: list[FloatArray], lines_hz: FloatArray, step_s: float) -> Noise:
    """Noise of a channel by the quietest record's lines that are not driven."""
    if len(lines_hz) < LEAST_LINES:
        return Noise(white=TRACE * step_s * float(np.mean([np.var(signal) for signal in signals])))
    n = min(len(signal) for signal in signals)
    rows = np.rint(lines_hz * n * step_s).astype(int)
    white = float(np.median(_energies(signals, step_s)[:, rows], axis=1).min()) / MEDIAN_OF_MEAN
    return Noise(white=white, pink=PINK * white * float(np.median(lines_hz)))
