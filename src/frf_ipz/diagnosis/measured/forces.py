"""Forces of hammer blows without the noise of the times at which nothing touches; and forces of shakers that sweep."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import periodogram

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.measured.noise import Noise, fit_noise
from frf_ipz.diagnosis.observations import ObservedRecord

LEAST_PART = 3e-3  # of the peak: what belongs to the pulse
ABOVE_NOISE = 6.0  # standard deviations
TAIL = 4.0  # standard deviations of means of stretches: below, what a high-pass leaves behind a pulse has died away
LEAST_STRETCHES = 8  # as long as a filter rings: with fewer the noise of their means is not known
STRETCHES = 16  # of what is quiet: a second touch, which falls into few of them, is no noise
RINGING, LEAST_RINGING = 25, 5  # samples before and after the pulse that are kept whole: a converter's filter rings
TAPER = 20  # samples over which the rest of the ringing, above the band, is faded out; fewer where less is kept
HEARD, ALIKE = 2.0, 4  # standard deviations of noise: what rings less is lost in it; samples that show how far it rings
MISSING_SAMPLES = (
    8  # samples of ringing that a record may lack before its first one, each as large as those that it has
)
FIRST = 3  # samples of a record that show how large
LATE = 0.05  # of the weight of a force that is alike all the time: a sweep comes to a part of the band too late
AROUND = 32  # lines over which a force's energy is averaged
QUIET = 200  # samples after the pulse that are left out when the force's noise is read


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pulse:
    """A blow with the noise outside its pulse taken away.

    Parameters
    ----------
    record : ObservedRecord
        The blow with the force that is left.
    start, stop : int
        Samples that are kept.
    """

    record: ObservedRecord
    start: int
    stop: int


def isolate_pulse(record: ObservedRecord) -> Pulse:
    """Take away what the force shows while nothing touches.

    Noise that is kept beside the pulse of a weak blow is a part of its impulse, drift above all: the ringing of the
    converter's filter is kept as far as it can be heard.

    Parameters
    ----------
    record : ObservedRecord
        A hammer blow.

    Returns
    -------
    Pulse
        The blow with a force that is zero outside the pulse and the ringing of the converter's filter.
    """
    size = np.abs(record.force)
    top = int(np.argmax(size))
    quiet = np.concatenate([record.force[: top // 2], record.force[(top + record.n_samples) // 2 :]])
    noise = _noise_of(quiet)
    above = np.flatnonzero(size >= min(max(ABOVE_NOISE * noise, LEAST_PART * size[top]), size[top]))
    first, last = int(above[0]), int(above[-1])
    last += _tail(record.force[last + 1 :], quiet)
    ringing = max(_rings(size[:first][::-1], noise), _rings(size[last + 1 :], noise))
    sample = np.arange(record.n_samples)
    outside = np.maximum(first - ringing - sample, sample - last - ringing)
    taper = round(TAPER * ringing / RINGING)
    window = np.cos(np.pi / 2 * np.clip(outside / taper, 0, 1)) ** 2
    kept = np.flatnonzero(window > 0.5)
    return Pulse(record=replace(record, force=record.force * window), start=int(kept[0]), stop=int(kept[-1]) + 1)


def _tail(after: FloatArray, quiet: FloatArray) -> int:
    """Count samples after a pulse in which the high-pass of a charge amplifier comes back: little each, but many."""
    if len(quiet) < LEAST_STRETCHES * RINGING:
        return 0
    usual = np.median(quiet)
    noise = _means(quiet - usual).std()
    back = np.flatnonzero(np.abs(_means(after - usual)) <= TAIL * noise)
    return int(back[0]) * RINGING if len(back) else 0


def _means(values: FloatArray) -> FloatArray:
    """Average stretches as long as a filter rings."""
    return np.asarray(values[: len(values) // RINGING * RINGING].reshape(-1, RINGING).mean(1))


def _rings(beside: FloatArray, noise: float) -> int:
    """Count samples beside a pulse in which its filter rings above the noise."""
    near = beside[:RINGING]
    whole = near[: len(near) // ALIKE * ALIKE].reshape(-1, ALIKE)
    lost = np.flatnonzero(np.sqrt(np.mean(whole**2, axis=1)) <= HEARD * noise)
    return int(np.clip(lost[0] * ALIKE, LEAST_RINGING, RINGING)) if len(lost) else RINGING


def missing_ringing(pulse: Pulse, responses: FloatArray) -> FloatArray:
    """Tell how much ringing of the converter's filter a record lacks because it begins too shortly before the blow.

    Parameters
    ----------
    pulse : Pulse
        The blow.
    responses : (n_sensors, n_samples) array
        Its responses.

    Returns
    -------
    (1 + n_sensors,) array
        Size of a sample of the force and of each response; 0 where the record begins before.
    """
    if pulse.start > 0:
        return np.zeros(1 + len(responses))
    first = np.vstack([pulse.record.force[:FIRST], responses[:, :FIRST]])
    return np.asarray(np.sqrt(np.mean(first**2, axis=1)))


def is_sweep(record: ObservedRecord, band_hz: tuple[float, float], decay_1_s: float) -> bool:
    """Tell whether a force comes to a part of the band so late that a window of decay forgets it.

    Parameters
    ----------
    record : ObservedRecord
        Record of a shaker.
    band_hz : pair of float
        Where to look.
    decay_1_s : float
        Of the window exp(-decay t).

    Returns
    -------
    bool
        False for a force that is alike all the time, and for bursts.
    """
    time = record.step_s * np.arange(record.n_samples)
    frequency = np.fft.rfftfreq(record.n_samples, record.step_s)
    used = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    whole, early = (
        uniform_filter1d(np.abs(np.fft.rfft(force)[used]) ** 2, AROUND, mode="nearest")
        for force in (record.force, record.force * np.exp(-decay_1_s * time))
    )
    alike = (1 - np.exp(-2 * decay_1_s * record.duration_s)) / (2 * decay_1_s * record.duration_s)
    return bool(np.any(early < LATE * alike * whole))


def _noise_of(quiet: FloatArray) -> float:
    """Read the standard deviation that most stretches show."""
    if not len(quiet):
        return 0.0
    squares = np.array_split((quiet - np.median(quiet)) ** 2, min(STRETCHES, len(quiet)))
    return float(np.sqrt(np.median([stretch.mean() for stretch in squares])))


def estimate_force_noise(records: tuple[ObservedRecord, ...], pulses: tuple[Pulse, ...]) -> Noise:
    """Read the noise of the force channel where nothing touches.

    Parameters
    ----------
    records : tuple of ObservedRecord
        As recorded.
    pulses : tuple of Pulse
        The same blows, isolated.

    Returns
    -------
    Noise
        N^2 s.
    """
    lines: list[FloatArray] = []
    energies: list[FloatArray] = []
    for record, pulse in zip(records, pulses, strict=True):
        quiet = record.force[pulse.stop + QUIET :]
        if len(quiet) < 64:
            continue
        frequency, density = periodogram(quiet, 1 / record.step_s, detrend=False)
        inside = (frequency > 0) & (frequency < 0.4 / record.step_s)
        lines.append(frequency[inside])
        energies.append(density[inside] / 2)
    if not lines:
        return Noise(white=0.0)
    frequency, energy = np.concatenate(lines), np.concatenate(energies)
    return fit_noise(frequency, energy, np.ones_like(energy), np.zeros_like(energy))


def gate_covariance(s: ComplexArray, pulse: Pulse) -> ComplexArray:
    """Give the covariance that noise of density 1 within the pulse's stretch has on lines.

    Parameters
    ----------
    s : (n_points,) complex array
        rad/s.
    pulse : Pulse
        Which stretch is kept.

    Returns
    -------
    (n_points, n_points) complex array
        s.
    """
    rate = s[:, None] + s[None, :].conj()
    first, last = pulse.start * pulse.record.step_s, pulse.stop * pulse.record.step_s
    return np.asarray((np.exp(-rate * first) - np.exp(-rate * last)) / rate)


def gate_variance(s: ComplexArray, pulse: Pulse) -> FloatArray:
    """Give the variance that noise of density 1 within the pulse's stretch has on lines.

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
