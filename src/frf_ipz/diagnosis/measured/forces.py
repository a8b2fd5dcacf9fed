"""Forces of impacts without the noise of the times at which nothing touches; and forces of shakers that sweep."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import periodogram

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.measured.noise import Noise, fit_noise
from frf_ipz.diagnosis.measured.noise_growth import STEADY, MeasuredNoise, RecordNoise, growth_of_levels
from frf_ipz.diagnosis.observations import ObservedRecord

PULSE_PART = 3e-3  # of the peak: above, a sample belongs to the pulse
PULSE_STDS = 6.0  # standard deviations of noise above which a sample belongs to the pulse
TAIL_STDS = 4.0  # standard deviations of block means: below, the undershoot of a high-pass has died away
MIN_BLOCKS = 8  # as long as a filter rings: with fewer the noise of their means is not known
NOISE_BLOCKS = 16  # of the samples outside the pulse: a second contact, which falls into few of them, is no noise
RINGING, MIN_RINGING = 25, 5  # samples before and after the pulse that stay whole: a converter's filter rings
TAPER = 20  # samples over which the rest of the ringing, above the band, is faded out; fewer after less ringing
RINGING_STDS, RINGING_BLOCK = (
    2.0,
    4,
)  # noise in which ringing is lost; samples that are averaged to find how far it goes
MISSING_SAMPLES = 8  # samples of ringing that may be missing before a record, each as large as its first ones
FIRST_SAMPLES = 3  # of a record, which show how large the missing ones are
LATE = 0.05  # of the energy of a stationary force under the window: with less, a sweep comes to a subband too late
SMOOTHED_LINES = 32  # over which a force's energy is averaged
NOISE_DELAY = 200  # samples after the pulse that are left out when the force's noise is estimated


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pulse:
    """A record whose force is zero outside its pulse.

    Parameters
    ----------
    record : ObservedRecord
        With the gated force.
    start, stop : int
        Samples inside the gate.
    """

    record: ObservedRecord
    start: int
    stop: int


def isolate_pulse(record: ObservedRecord) -> Pulse:
    """Remove the force signal of the times at which nothing touches.

    Noise that stays beside the pulse of a weak impact is a part of its impulse, drift above all: the ringing of the
    converter's filter stays as far as it stands out of the noise.

    Parameters
    ----------
    record : ObservedRecord
        One impact.

    Returns
    -------
    Pulse
        With a force that is zero outside the pulse and the ringing of the converter's filter.
    """
    size = np.abs(record.force)
    top = int(np.argmax(size))
    quiet = np.concatenate([record.force[: top // 2], record.force[(top + record.n_samples) // 2 :]])
    noise = _noise_std(quiet)
    above = np.flatnonzero(size >= min(max(PULSE_STDS * noise, PULSE_PART * size[top]), size[top]))
    first, last = int(above[0]), int(above[-1])
    last += _tail_length(record.force[last + 1 :], quiet)
    ringing = max(_ringing_length(size[:first][::-1], noise), _ringing_length(size[last + 1 :], noise))
    sample = np.arange(record.n_samples)
    outside = np.maximum(first - ringing - sample, sample - last - ringing)
    taper = round(TAPER * ringing / RINGING)
    window = np.cos(np.pi / 2 * np.clip(outside / taper, 0, 1)) ** 2
    gate = np.flatnonzero(window > 0.5)
    return Pulse(record=replace(record, force=record.force * window), start=int(gate[0]), stop=int(gate[-1]) + 1)


def _tail_length(after: FloatArray, quiet: FloatArray) -> int:
    """Count samples of undershoot by a charge amplifier's high-pass after a pulse: each is small, but they are many."""
    if len(quiet) < MIN_BLOCKS * RINGING:
        return 0
    median = np.median(quiet)
    noise = _block_means(quiet - median).std()
    back = np.flatnonzero(np.abs(_block_means(after - median)) <= TAIL_STDS * noise)
    return int(back[0]) * RINGING if len(back) else 0


def _block_means(values: FloatArray) -> FloatArray:
    """Average blocks as long as a filter rings."""
    return np.asarray(values[: len(values) // RINGING * RINGING].reshape(-1, RINGING).mean(1))


def _ringing_length(beside: FloatArray, noise: float) -> int:
    """Count samples beside a pulse in which its filter rings above the noise."""
    nearest = beside[:RINGING]
    blocks = nearest[: len(nearest) // RINGING_BLOCK * RINGING_BLOCK].reshape(-1, RINGING_BLOCK)
    lost = np.flatnonzero(np.sqrt(np.mean(blocks**2, axis=1)) <= RINGING_STDS * noise)
    return int(np.clip(lost[0] * RINGING_BLOCK, MIN_RINGING, RINGING)) if len(lost) else RINGING


def missing_ringing(pulse: Pulse, responses: FloatArray) -> FloatArray:
    """Estimate the ringing of the converter's filter that is missing where a record begins too shortly before a pulse.

    Parameters
    ----------
    pulse : Pulse
        The impact.
    responses : (n_sensors, n_samples) array
        Its responses.

    Returns
    -------
    (1 + n_sensors,) array
        Size of a missing sample of the force and of each response; 0 where the record begins before the ringing.
    """
    if pulse.start > 0:
        return np.zeros(1 + len(responses))
    first = np.vstack([pulse.record.force[:FIRST_SAMPLES], responses[:, :FIRST_SAMPLES]])
    return np.asarray(np.sqrt(np.mean(first**2, axis=1)))


def is_sweep(record: ObservedRecord, band_hz: tuple[float, float], decay_1_s: float) -> bool:
    """Tell whether a force comes to a part of the band so late that an exponential window hides it.

    Parameters
    ----------
    record : ObservedRecord
        Of a shaker.
    band_hz : pair of float
        Hz.
    decay_1_s : float
        Of the window exp(-decay t).

    Returns
    -------
    bool
        False for a stationary force, and for bursts.
    """
    time = record.step_s * np.arange(record.n_samples)
    frequency = np.fft.rfftfreq(record.n_samples, record.step_s)
    used = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    whole, early = (
        uniform_filter1d(np.abs(np.fft.rfft(force)[used]) ** 2, SMOOTHED_LINES, mode="nearest")
        for force in (record.force, record.force * np.exp(-decay_1_s * time))
    )
    stationary_part = (1 - np.exp(-2 * decay_1_s * record.duration_s)) / (2 * decay_1_s * record.duration_s)
    return bool(np.any(early < LATE * stationary_part * whole))


def _noise_std(quiet: FloatArray) -> float:
    """Give the standard deviation of the median block."""
    if not len(quiet):
        return 0.0
    squares = np.array_split((quiet - np.median(quiet)) ** 2, min(NOISE_BLOCKS, len(quiet)))
    return float(np.sqrt(np.median([block.mean() for block in squares])))


def estimate_force_noise(records: tuple[ObservedRecord, ...], pulses: tuple[Pulse, ...]) -> tuple[Noise, RecordNoise]:
    """Estimate the noise of the force channel where nothing touches.

    Parameters
    ----------
    records : tuple of ObservedRecord
        As recorded.
    pulses : tuple of Pulse
        Of the same records.

    Returns
    -------
    noise : Noise
        N^2 s, of a record of relative power 1.
    growth : RecordNoise
        How much of it each record has.
    """
    frequencies: list[FloatArray] = []
    energies: list[FloatArray] = []
    quiet_records: list[ObservedRecord] = []
    for record, pulse in zip(records, pulses, strict=True):
        quiet = record.force[pulse.stop + NOISE_DELAY :]
        if len(quiet) < 64:
            continue
        quiet_records.append(record)
        frequency, density = periodogram(quiet, 1 / record.step_s, detrend=False)
        inside = (frequency > 0) & (frequency < 0.4 / record.step_s)
        frequencies.append(frequency[inside])
        energies.append(density[inside] / 2)
    if not frequencies:
        return Noise(white=0.0), STEADY
    growth: RecordNoise = growth_of_levels(quiet_records, np.array([np.median(energy) for energy in energies]))
    if MeasuredNoise.is_known(records):
        growth = MeasuredNoise(channel=records[0].input_channel)
    frequency = np.concatenate(frequencies)
    scaled = zip(energies, growth.scales(quiet_records), strict=True)
    energy = np.concatenate([of_record / scale for of_record, scale in scaled])
    return fit_noise(frequency, energy, np.ones_like(energy), np.zeros_like(energy)), growth


def gate_covariance(s: ComplexArray, pulse: Pulse) -> ComplexArray:
    """Compute the covariance on lines of noise of density 1 inside the gate of a pulse.

    Parameters
    ----------
    s : (n_points,) complex array
        rad/s.
    pulse : Pulse
        With its gate.

    Returns
    -------
    (n_points, n_points) complex array
        s.
    """
    rate = s[:, None] + s[None, :].conj()
    first, last = pulse.start * pulse.record.step_s, pulse.stop * pulse.record.step_s
    return np.asarray((np.exp(-rate * first) - np.exp(-rate * last)) / rate)


def gate_variance(s: ComplexArray, pulse: Pulse) -> FloatArray:
    """Compute the variance on lines of noise of density 1 inside the gate of a pulse.

    Parameters
    ----------
    s, pulse
        As for `gate_covariance`.

    Returns
    -------
    (n_points,) array
        s.
    """
    rate = 2 * s.real
    first, last = pulse.start * pulse.record.step_s, pulse.stop * pulse.record.step_s
    return np.asarray((np.exp(-rate * first) - np.exp(-rate * last)) / rate)
