"""Noise of all channels, read where nothing drives the structure: around impacts, or beside a shaker's band."""

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
    from frf_ipz.dofs import AnyDof

NOISE_QUANTILE = 0.3  # of a subband of lines: noise between resonances
QUANTILE_OF_MEAN = 0.42  # that quantile of the mean of a few exponential variables over their mean
UNDRIVEN = 1e-4  # of the force's energy in the band: lines that a shaker does not drive
MIN_LINES = 20
MEDIAN_OF_MEAN = 0.7  # of exponential variables
PINK = 1.0  # 1/f part over white part at the undriven lines, which do not show them separately: half of each
TRACE = 1e-6  # of the response's energy, where noise does not show at all


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChannelNoise:
    """Noise of all channels of a test.

    Parameters
    ----------
    is_hammer : bool
        The force is isolated before it is used, and its noise is that of the pulse alone.
    sensors : tuple of (str, Dof)
        Channels and their DOFs.
    force : Noise
        N^2 s.
    responses : tuple of Noise
        unit^2 s.
    pulse_s : float
        Length of the gate of an impact.
    """

    is_hammer: bool
    sensors: tuple[tuple[str, AnyDof], ...]
    force: Noise
    responses: tuple[Noise, ...]
    pulse_s: float

    def force_of(self, record: ObservedRecord) -> FloatArray:
        """(n_samples,) force, that of an impact without the noise outside its pulse."""
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
        Records of a hammer or a shaker.

    Returns
    -------
    ChannelNoise
        A trace where noise does not show at all.
    """
    is_hammer = observations.kind == "hammer"
    sensors = tuple({(s.channel, s.dof): None for record in observations.records for s in record.sensors})
    signals = [_responses_of(observations, sensor) for sensor in sensors]
    step = observations.records[0].step_s
    if is_hammer:
        pulses = tuple(isolate_pulse(record) for record in observations.records)
        length = float(np.median([pulse.stop - pulse.start for pulse in pulses])) * step
        responses = [
            estimate_decayed_noise([s[len(s) // 2 :] for s in of_sensor], step).rounded(of_sensor, step)
            for of_sensor in signals
        ]
        force, _ = estimate_force_noise(observations.records, pulses)
        return ChannelNoise(is_hammer=True, sensors=sensors, force=force, responses=tuple(responses), pulse_s=length)
    forces = [record.force for record in observations.records]
    lines = _find_undriven_lines(forces, step, observations.band_hz)
    return ChannelNoise(
        is_hammer=False,
        sensors=sensors,
        force=_undriven_noise(forces, lines, step),
        responses=tuple(_undriven_noise(of_sensor, lines, step) for of_sensor in signals),
        pulse_s=0.0,
    )


def estimate_decayed_noise(tails: list[FloatArray], step_s: float) -> Noise:
    """Estimate the noise of a channel between the resonances of signals that have nearly decayed.

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
    quiet = np.array([np.quantile(energy[a:b], NOISE_QUANTILE) for a, b in pairwise(edges)])
    quiet /= QUANTILE_OF_MEAN ** (1 / len(tails))
    white = float(np.median(np.sort(quiet)[: max(len(quiet) // 3, 1)]))
    pink = float(np.quantile(np.maximum(quiet - white, 0.0) * frequency, 0.4))
    return Noise(white=white, pink=pink)


def _responses_of(observations: Observations, sensor: tuple[str, AnyDof]) -> list[FloatArray]:
    return [
        row
        for record in observations.records
        for s, row in zip(record.sensors, record.responses, strict=True)
        if (s.channel, s.dof) == sensor
    ]


def _periodograms(signals: list[FloatArray], step_s: float) -> FloatArray:
    """(n_signals, n_lines) two-sided periodograms, unit^2 s."""
    n = min(len(signal) for signal in signals)
    hann = np.hanning(n)
    return np.array([np.abs(np.fft.rfft(signal[:n] * hann)) ** 2 for signal in signals]) * (step_s / np.sum(hann**2))


def _find_undriven_lines(forces: list[FloatArray], step_s: float, band_hz: tuple[float, float]) -> FloatArray:
    """Frequencies above the band that a shaker does not drive, (n,) array, Hz."""
    energy = _periodograms(forces, step_s).mean(0)
    frequency = np.fft.rfftfreq(min(len(force) for force in forces), step_s)
    inside = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    smooth = median_filter(energy, 31)
    return np.asarray(frequency[(smooth < UNDRIVEN * np.median(energy[inside])) & (frequency > band_hz[1])])


def _undriven_noise(signals: list[FloatArray], lines_hz: FloatArray, step_s: float) -> Noise:
    """Noise of a channel by the undriven lines of the quietest record."""
    if len(lines_hz) < MIN_LINES:
        return Noise(white=TRACE * step_s * float(np.mean([np.var(signal) for signal in signals])))
    n = min(len(signal) for signal in signals)
    rows = np.rint(lines_hz * n * step_s).astype(int)
    white = float(np.median(_periodograms(signals, step_s)[:, rows], axis=1).min()) / MEDIAN_OF_MEAN
    return Noise(white=white, pink=PINK * white * float(np.median(lines_hz)))
