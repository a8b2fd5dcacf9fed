"""SegmentSet of single blows, transformed along a line in the s-plane.

Force and responses of a stretch are multiplied by exp(-sigma t) before the transform: the ratio of a blow from rest is
then exactly the transfer function at sigma + i omega. A stretch that starts while the structure moves needs the motion
at its start besides, which is unknown (`moving`).
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len, prev_fast_len
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.signal import resample
from scipy.signal.windows import tukey

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frf_ipz.diagnosis.measured.forces import isolate_pulse
from frf_ipz.errors import InputError

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.linear.modal_model import ModalModel
    from frf_ipz.diagnosis.nonlinear.recorded.noise import ChannelNoise
    from frf_ipz.diagnosis.observations import Observations, ObservedRecord, Sensor

DECAYS = 8.0  # sigma times the stretch: its end counts for 3e-4
THIN = 2  # lines are closer than the window resolves: every second one is independent enough
EDGE = 40  # samples beside a stretch that moves: they are faded out
FINER = 8  # times as many samples, where a stretch starts with a jump
BEFORE = 4  # samples before the pulse
FIRST_SAMPLES, FIRST_PART = 8, 1e-3  # of a record: what is looked at to see whether it starts at rest
AT_REST = 0.05  # of a signal's size
AROUND = 5  # lines over which a response's size is averaged
EARLY = 0.08  # of a stretch: where its largest motion lies, after which it counts less and less
ABOUT = 0.04  # of a stretch: over which the largest motion is taken
FADED = 0.1  # of a record, both ends together
QUIETER = 0.8  # of the largest motion of a record: with less in its first part, a louder stretch is looked at besides
QUIET = 0.05  # of the largest motion of a record: with less, it has died away
LOW = 0.5  # of the bottom of the band: slower drift is no motion of the structure
OUTSIDE = 0.1  # of the response: how far the model is trusted above the band
SLOWER = 0.5  # of the damping that the model states: with less, more is left of a blow when the next comes
LEFT = 0.003  # of the motion after a blow: with less left at the next, that starts at rest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SegmentSet:
    """Transforms of stretches of the blows of a test; what is called a blow here is one stretch.

    Parameters
    ----------
    s : (n_lines,) complex array
        All lines up to half the sampling rate, rad/s.
    used : (n_used,) int array
        Lines of the band that are fitted.
    step_s : float
        Time step of the recordings, s.
    n_samples : int
        Of the stretch.
    force : (n_blows, n_lines) complex array
        N s.
    start_force : (n_blows, 2) array
        Force and its slope at the start of stretches that start in motion, N and N/s; else 0.
    fine_force : (n_blows, FINER * n_samples) array
        Force on finer times, N.
    motion : (n_blows, n_sensors, n_lines) complex array
        Responses as displacements, in the signs of the sensors, m s; 0 where a blow lacks a sensor.
    noise : (n_blows, n_sensors, n_lines) array
        Variance of `motion` by the noise of the channels, that of the force included.
    variance : (n_blows, n_sensors, n_lines) array
        With what the model cannot be expected to meet; infinite where a blow lacks a sensor.
    input_of : (n_blows,) int array
        Rows of `ModalModel.inputs`.
    blow_of : (n_blows,) int array
        Which of the observations' blows each stretch is of.
    moving : (n_blows,) bool array
        The structure moves at the start.
    pause_s : (n_blows,) array
        Time since the blow before of stretches that start in what that has left, about, s; 0 of all others.
    first_sample : (n_blows,) int array
        Of the recordings, at the start.
    window : Window
        How they were cut.
    """

    s: ComplexArray
    used: IntArray
    step_s: float
    n_samples: int
    force: ComplexArray
    start_force: FloatArray
    fine_force: FloatArray
    motion: ComplexArray
    noise: FloatArray
    variance: FloatArray
    input_of: IntArray
    record_of: IntArray
    moving: BoolArray
    pause_s: FloatArray
    first_sample: IntArray
    window: Window

    @property
    def n_records(self) -> int:
        """Number of blows."""
        return len(self.force)

    @property
    def duration_s(self) -> float:
        """Length of a stretch, s."""
        return self.n_samples * self.step_s

    @property
    def sigma_1_s(self) -> float:
        """Real part of the lines."""
        return float(self.s[0].real)


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Which part of the recordings is looked at, and how closely.

    Parameters
    ----------
    duration_s : float
        Length of the stretches; the whole records where they are shorter.
    start_s : float
        Where stretches of a hammer's blows start; 0 is at the blow.
    per_record : int
        SegmentSet of each record of a shaker.
    floor : float
        Misfit that the model is allowed, as a part of the response.
    loudest : bool
        A record from rest is looked at again where it is loudest.
    """

    duration_s: float
    start_s: float = 0.0
    per_record: int = 2
    floor: float = 0.01
    loudest: bool = True


def transform(observations: Observations, modal_model: ModalModel, noise: ChannelNoise, window: Window) -> SegmentSet:
    """Cut stretches and transform them.

    Parameters
    ----------
    observations : Observations
        Blows or records.
    modal_model : ModalModel
        Names the sensors and blows.
    noise : ChannelNoise
        Of these observations.
    window : Window
        Which part.

    Returns
    -------
    SegmentSet
        Of all blows, with one length.

    Raises
    ------
    InputError
        If recordings differ in their time step.
    """
    step = common_step(observations)
    cuts, n = _cuts(observations, window, step, modal_model)
    sigma = DECAYS / (n * step)
    s = np.asarray(sigma + 2j * np.pi * np.fft.rfftfreq(n, step))
    force = np.zeros((len(cuts), len(s)), complex)
    start_force, fine_force = np.zeros((len(cuts), 2)), np.zeros((len(cuts), FINER * n))
    motion = np.zeros((len(cuts), len(modal_model.sensors), len(s)), complex)
    present = np.zeros(motion.shape[:2], bool)
    for number, cut in enumerate(cuts):
        rows = [_row(modal_model, sensor.channel, sensor.dof) for sensor in cut.record.sensors]
        finer = _finer(cut, n)
        fine_force[number] = finer[0]
        lines, start_force[number] = _lines(cut, finer, sigma)
        force[number], motion[number, rows] = lines[0], lines[1:]
        present[number, rows] = True
    motion /= s ** np.array([sensor.quantity.power for sensor in modal_model.sensors])[:, None]
    frequency = np.maximum(s.imag, s[1].imag) / (2 * np.pi)
    floor = np.where(frequency <= observations.band_hz[1], window.floor, OUTSIDE)
    known, of_force = _noise(modal_model, noise, s, sigma)
    size = uniform_filter1d(np.abs(motion) ** 2, AROUND, axis=2, mode="nearest")
    noisy = known + np.minimum(of_force / np.maximum(np.abs(force) ** 2, 1e-300), 1.0)[:, None] * size
    variance = np.where(present[..., None], noisy + floor**2 * size, np.inf)
    return SegmentSet(
        s=s,
        used=np.flatnonzero(observations.mask_band(frequency, sigma / (2 * np.pi)))[::THIN],
        step_s=step,
        n_samples=n,
        force=force,
        start_force=start_force,
        fine_force=fine_force,
        motion=motion,
        noise=noisy,
        variance=variance,
        input_of=np.array([modal_model.inputs.index(cut.record.input_dof) for cut in cuts]),
        record_of=np.array([cut.number for cut in cuts]),
        moving=np.array([cut.is_moving for cut in cuts]),
        pause_s=np.array([cut.pause_s for cut in cuts]),
        first_sample=np.array([cut.start for cut in cuts]),
        window=window,
    )


def _noise(
    modal_model: ModalModel, noise: ChannelNoise, s: ComplexArray, sigma: float
) -> tuple[FloatArray, FloatArray]:
    """Variances of `SegmentSet.motion`, (n_sensors, n_lines), and of `SegmentSet.force`, (n_lines,), by noise."""
    frequency = np.maximum(s.imag, s[1].imag) / (2 * np.pi)
    energy = (1 - np.exp(-2 * DECAYS)) / (2 * sigma)
    own = [
        noise.response_energy(_noise_row(noise, sensor), frequency, energy) / np.abs(s) ** (2 * sensor.quantity.power)
        for sensor in modal_model.sensors
    ]
    return np.array(own), noise.force_energy(frequency, energy)


@dataclass(frozen=True, slots=True, eq=False)
class _Cut:
    number: int
    record: ObservedRecord
    start: int
    _: KW_ONLY
    is_moving: bool
    pause_s: float = 0.0


def decayed(modal_model: ModalModel, pause_s: FloatArray) -> FloatArray:
    """Give how much of each mode is left after a pause, (n, n_modes), at most: damping may be less than is stated."""
    return np.asarray(np.exp(-SLOWER * np.outer(pause_s, modal_model.damping_ratio * modal_model.omega_rad_s)))


def _cuts(observations: Observations, window: Window, step: float, modal_model: ModalModel) -> tuple[list[_Cut], int]:
    """Where stretches start: at the blow, or, of a shaker, spread over the record."""
    records, wanted = observations.records, round(window.duration_s / step)
    if observations.kind == "hammer" and not window.start_s:
        pulses = [isolate_pulse(record) for record in records]
        starts = [max(int(np.argmax(np.abs(pulse.record.force) > 0)) - BEFORE, 0) for pulse in pulses]
        n = min(wanted, *(record.n_samples - start for record, start in zip(records, starts, strict=True)))
        pauses = [
            record.duration_s if record.has_predecessor and _is_left(modal_model, record.duration_s) else 0.0
            for record in records
        ]
        return [
            _Cut(i, pulse.record, start, is_moving=pause > 0, pause_s=pause)
            for i, (pulse, start, pause) in enumerate(zip(pulses, starts, pauses, strict=True))
        ], _fast_length(n)
    shortest = min(record.n_samples for record in records)
    n = _fast_length(min(wanted, shortest - 2 * EDGE))
    if observations.kind == "hammer":
        start = min(EDGE + round(window.start_s / step), shortest - n - EDGE)
        return [_Cut(i, isolate_pulse(record).record, start, is_moving=True) for i, record in enumerate(records)], n
    room, count, cuts = shortest - n - 2 * EDGE, window.per_record, []
    sizes = _sizes(observations, n)
    for i, (record, size) in enumerate(zip(records, sizes, strict=True)):
        loudest = EDGE + min(max(int(np.argmax(size[EDGE:])) - round(EARLY * n), 0), max(room, 0))
        if starts_at_rest(record):  # nothing is unknown then, and one stretch says more than two that move
            cuts.append(_Cut(i, record, 0, is_moving=False))
            if window.loudest and size[: n // 4].max() < QUIETER * size.max():
                cuts.append(_Cut(i, record, loudest, is_moving=True))
            continue
        alive = _alive(size, n, room)
        parts = [EDGE + round(alive * (place + 0.5) / count) for place in range(count)]
        parts[int(np.argmin([abs(part - loudest) for part in parts]))] = loudest
        cuts += [_Cut(i, record, start, is_moving=True) for start in parts]
    return cuts, n


def _is_left(modal_model: ModalModel, pause_s: float) -> bool:
    """Tell whether the structure still moves when the next blow comes."""
    return bool(decayed(modal_model, np.array([pause_s]))[:, modal_model.n_rigid :].max() > LEFT)


def _alive(size: FloatArray, n: int, room: int) -> int:
    """Tell how far into a record stretches may start: not where what a shaker shook up has died away."""
    inside = size[EDGE:-EDGE]
    loud = np.flatnonzero(inside >= QUIET * inside.max())
    return min(room, max(int(loud[-1]) - n // 4, 0))


def _sizes(observations: Observations, n: int) -> list[FloatArray]:
    """How far the structure moves in each record at each time: what a stop or a stiffening spring answers to."""
    low, found = observations.band_hz[0], []
    for record in observations.records:
        frequency = np.fft.rfftfreq(record.n_samples, record.step_s)
        s = 2j * np.pi * np.maximum(frequency, low)
        powers = np.array([sensor.quantity.power for sensor in record.sensors])[:, None]
        faded = record.responses * tukey(record.n_samples, FADED)  # what jumps from the end to the start would ring
        lines = np.fft.rfft(faded) * (frequency >= LOW * low) / s**powers
        motion = np.fft.irfft(lines, record.n_samples)
        motion /= np.maximum(motion.std(1, keepdims=True), 1e-300)
        found.append(maximum_filter1d(np.abs(motion).max(0), max(round(ABOUT * n), 1)))
    return found


def starts_at_rest(record: ObservedRecord) -> bool:
    """Look whether nothing moves yet at the first samples.

    Parameters
    ----------
    record : ObservedRecord
        Of a shaker.

    Returns
    -------
    bool
        True at rest.
    """
    signals = np.vstack([record.force, record.responses])
    first = max(FIRST_SAMPLES, round(FIRST_PART * record.n_samples))
    size = np.sqrt(np.mean(signals**2, 1))
    return bool(np.all(np.sqrt(np.mean(signals[:, :first] ** 2, 1)) < AT_REST * size))


def _lines(cut: _Cut, finer: FloatArray, sigma: float) -> tuple[ComplexArray, FloatArray]:
    """Transform force and responses, and read the force and its slope at the start.

    A signal that jumps at the start is not band-limited: the sum over samples is off by half the first one, and, on
    finer samples, by little more.
    """
    step = cut.record.step_s
    n = finer.shape[1] // FINER
    if not cut.is_moving:
        signals = np.vstack([cut.record.force, cut.record.responses])[:, cut.start : cut.start + n]
        return np.fft.rfft(signals * np.exp(-sigma * step * np.arange(n)) * step, axis=1), np.zeros(2)
    fine = step / FINER
    decay = np.exp(-sigma * fine * np.arange(FINER * n)) * fine
    decay[0] /= 2
    slope = (finer[0, 1] - finer[0, 0]) / fine - finer[0, :3] @ np.array([1, -2, 1]) / (2 * fine)
    return np.fft.rfft(finer * decay, axis=1)[:, : n // 2 + 1], np.array([finer[0, 0], slope])


def _finer(cut: _Cut, n: int) -> FloatArray:
    """Force and responses on finer times, (1 + n_sensors, FINER n)."""
    signals = np.vstack([cut.record.force, cut.record.responses])
    padded = np.pad(signals, ((0, 0), (EDGE, EDGE)))[:, cut.start : cut.start + n + 2 * EDGE]
    return np.asarray(resample(_tapered(padded), FINER * padded.shape[1], axis=1)[:, FINER * EDGE : FINER * (EDGE + n)])


def _tapered(signals: FloatArray) -> FloatArray:
    """Fade both ends, which are outside the stretch, so that the periodic interpolation does not ring."""
    ramp = np.sin(np.pi / 2 * np.arange(EDGE // 2) / (EDGE // 2)) ** 2
    window = np.ones(signals.shape[1])
    window[: EDGE // 2] = ramp
    window[-(EDGE // 2) :] = ramp[::-1]
    return signals * window


def common_step(observations: Observations) -> float:
    """Time step of all recordings.

    Parameters
    ----------
    observations : Observations
        Blows or records.

    Returns
    -------
    float
        s.

    Raises
    ------
    InputError
        If recordings differ in it.
    """
    steps = np.array([record.step_s for record in observations.records])
    if np.ptp(steps) > 1e-4 * steps[0]:
        odd = observations.records[int(np.argmax(np.abs(steps - np.median(steps))))]
        raise InputError(
            f"the blow {odd.name} has a time step of {odd.step_s:g} s, the others of {np.median(steps):g} s; "
            "what depends on level is looked for in recordings of one sampling rate: leave it out"
        )
    return float(steps.mean())


def _fast_length(n: int) -> int:
    return int(prev_fast_len(n, real=True)) if n > 64 else int(next_fast_len(n, real=True))


def _noise_row(noise: ChannelNoise, sensor: Sensor) -> int:
    return noise.sensors.index((sensor.channel, sensor.dof))


def _row(modal_model: ModalModel, channel: str, dof: object) -> int:
    return next(i for i, s in enumerate(modal_model.sensors) if (s.channel, s.dof) == (channel, dof))
