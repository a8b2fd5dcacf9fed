"""Segments of records, transformed along a line in the s-plane.

Force and responses of a segment are multiplied by exp(-sigma t) before the transform: the ratio of a record from rest
is then exactly the transfer function at sigma + i omega. A segment that starts while the structure moves also needs the
state at its start, which is unknown (`SegmentSet.moving`).
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
from frf_ipz.diagnosis.measured.contour import WINDOW_DECAYS
from frf_ipz.diagnosis.measured.forces import isolate_pulse
from frf_ipz.diagnosis.nonlinear.model.modal_model import remaining_motion
from frf_ipz.errors import InputError

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.channel_noise import ChannelNoise
    from frf_ipz.diagnosis.nonlinear.model.modal_model import ModalModel
    from frf_ipz.diagnosis.observations import Observations, ObservedRecord, Sensor

LINE_STEP = 2  # lines are closer than the window resolves: every second one is independent enough
EDGE = 40  # samples beside a segment that starts in motion: they are faded out
REFINEMENT = 8  # times as many samples in time, where a segment starts with a jump
LEAD = 4  # samples before the pulse
REST_SAMPLES, REST_PART = 8, 1e-3  # of a record: its first samples, which show whether it starts at rest
AT_REST = 0.05  # of a signal's rms value
SMOOTHED_LINES = 5  # over which a response's size is averaged
EARLY = 0.08  # of a segment: where its largest motion lies, after which the window weighs it less
LOUD_WIDTH = 0.04  # of a segment: over which the largest motion is taken
FADED = 0.1  # of a record, both ends together
QUIETER = 0.8  # of the largest motion of a record: with less in its first part, a louder segment is added
QUIET = 0.05  # of the largest motion of a record: with less, it has decayed
DRIFT_PART = 0.5  # of the bottom of the band: slower drift is no motion of the structure
OUTSIDE_ERROR = 0.1  # of the response: model error above the band
RESTING = 0.003  # of the motion after an impact: with less left at the next, that starts at rest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SegmentSet:
    """Transforms of segments of the records of a test, all of one length.

    Parameters
    ----------
    s : (n_lines,) complex array
        All lines up to half the sampling rate, rad/s.
    used : (n_used,) int array
        Lines of the band that are fitted.
    step_s : float
        Time step of the recordings, s.
    n_samples : int
        Of a segment.
    force : (n_segments, n_lines) complex array
        N s.
    start_force : (n_segments, 2) array
        Force and its slope at the start of segments that start in motion, N and N/s; else 0.
    finest_force : (n_segments, REFINEMENT * n_samples) array
        Force at the shortest time steps of a simulation, N.
    motion : (n_segments, n_sensors, n_lines) complex array
        Responses as displacements, in the signs of the sensors, m s; 0 where a record has no such sensor.
    noise : (n_segments, n_sensors, n_lines) array
        Variance of `motion` by the noise of the channels, that of the force included.
    variance : (n_segments, n_sensors, n_lines) array
        With the expected error of the model; infinite where a record has no such sensor.
    input_of : (n_segments,) int array
        Rows of `ModalModel.inputs`.
    record_of : (n_segments,) int array
        Index of each segment's record in the observations.
    moving : (n_segments,) bool array
        The structure moves at the start.
    pause_s : (n_segments,) array
        Time since the previous impact of segments that start in its residual motion, about, s; 0 of all others.
    first_sample : (n_segments,) int array
        Of the record, at the start.
    window : SegmentWindow
        How they were cut.
    steps_per_sample : int
        Time steps of a simulation per sample of the recordings; a power of two up to REFINEMENT.
    """

    s: ComplexArray
    used: IntArray
    step_s: float
    n_samples: int
    force: ComplexArray
    start_force: FloatArray
    finest_force: FloatArray
    motion: ComplexArray
    noise: FloatArray
    variance: FloatArray
    input_of: IntArray
    record_of: IntArray
    moving: BoolArray
    pause_s: FloatArray
    first_sample: IntArray
    window: SegmentWindow
    steps_per_sample: int = REFINEMENT

    @property
    def n_segments(self) -> int:
        """Number of segments."""
        return len(self.force)

    @property
    def duration_s(self) -> float:
        """Length of a segment, s."""
        return self.n_samples * self.step_s

    @property
    def fine_force(self) -> FloatArray:
        """(n_segments, steps_per_sample * n_samples) force at the time steps of a simulation, N."""
        return self.finest_force[:, :: REFINEMENT // self.steps_per_sample]

    @property
    def sigma_1_s(self) -> float:
        """Real part of the lines."""
        return float(self.s[0].real)


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentWindow:
    """Which part of the records is fitted, and how closely.

    Parameters
    ----------
    duration_s : float
        Length of the segments; the whole records where they are shorter.
    start_s : float
        Where segments of impacts start; 0 is at the impact.
    per_record : int
        Segments of each record of a shaker.
    floor : float
        Expected error of the model, as a part of the response.
    loudest : bool
        A record from rest has a second segment where it is loudest.
    """

    duration_s: float
    start_s: float = 0.0
    per_record: int = 2
    floor: float = 0.01
    loudest: bool = True


def cut_segments(
    observations: Observations, modal_model: ModalModel, noise: ChannelNoise, window: SegmentWindow
) -> SegmentSet:
    """Cut records into segments and transform them.

    Parameters
    ----------
    observations : Observations
        Records of a hammer or a shaker.
    modal_model : ModalModel
        Names the sensors and inputs.
    noise : ChannelNoise
        Of these observations.
    window : SegmentWindow
        Which part.

    Returns
    -------
    SegmentSet
        Of all records, with one length.

    Raises
    ------
    InputError
        If recordings differ in their time step.
    """
    step = common_step(observations)
    cuts, n = _choose_cuts(observations, window, step, modal_model)
    sigma = WINDOW_DECAYS / (n * step)
    s = np.asarray(sigma + 2j * np.pi * np.fft.rfftfreq(n, step))
    force = np.zeros((len(cuts), len(s)), complex)
    start_force, fine_force = np.zeros((len(cuts), 2)), np.zeros((len(cuts), REFINEMENT * n))
    motion = np.zeros((len(cuts), len(modal_model.sensors), len(s)), complex)
    present = np.zeros(motion.shape[:2], bool)
    for number, cut in enumerate(cuts):
        rows = [_sensor_row(modal_model, sensor.channel, sensor.dof) for sensor in cut.record.sensors]
        fine = _resample_finer(cut, n)
        fine_force[number] = fine[0]
        lines, start_force[number] = _transform(cut, fine, sigma)
        force[number], motion[number, rows] = lines[0], lines[1:]
        present[number, rows] = True
    motion /= s ** np.array([sensor.quantity.power for sensor in modal_model.sensors])[:, None]
    frequency = np.maximum(s.imag, s[1].imag) / (2 * np.pi)
    floor = np.where(frequency <= observations.band_hz[1], window.floor, OUTSIDE_ERROR)
    known, of_force = _noise_variance(modal_model, noise, s, sigma)
    size = uniform_filter1d(np.abs(motion) ** 2, SMOOTHED_LINES, axis=2, mode="nearest")
    noisy = known + np.minimum(of_force / np.maximum(np.abs(force) ** 2, 1e-300), 1.0)[:, None] * size
    variance = np.where(present[..., None], noisy + floor**2 * size, np.inf)
    return SegmentSet(
        s=s,
        used=np.flatnonzero(observations.mask_band(frequency, sigma / (2 * np.pi)))[::LINE_STEP],
        step_s=step,
        n_samples=n,
        force=force,
        start_force=start_force,
        finest_force=fine_force,
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


def _noise_variance(
    modal_model: ModalModel, noise: ChannelNoise, s: ComplexArray, sigma: float
) -> tuple[FloatArray, FloatArray]:
    """Variances of `SegmentSet.motion`, (n_sensors, n_lines), and of `SegmentSet.force`, (n_lines,), by noise.

    Zero for sensors that no record has.
    """
    frequency = np.maximum(s.imag, s[1].imag) / (2 * np.pi)
    energy = (1 - np.exp(-2 * WINDOW_DECAYS)) / (2 * sigma)
    of_sensors = np.zeros((len(modal_model.sensors), len(s)))
    for row, sensor in enumerate(modal_model.sensors):
        if (sensor.channel, sensor.dof) in noise.sensors:  # else no record has it
            energies = noise.response_energy(_noise_row(noise, sensor), frequency, energy)
            of_sensors[row] = energies / np.abs(s) ** (2 * sensor.quantity.power)
    return of_sensors, noise.force_energy(frequency, energy)


@dataclass(frozen=True, slots=True, eq=False)
class _Cut:
    number: int
    record: ObservedRecord
    start: int
    _: KW_ONLY
    is_moving: bool
    pause_s: float = 0.0


def _choose_cuts(
    observations: Observations, window: SegmentWindow, step: float, modal_model: ModalModel
) -> tuple[list[_Cut], int]:
    """Choose where segments start: at the impact, or, of a shaker, spread over the record; and their length."""
    records, requested = observations.records, round(window.duration_s / step)
    if observations.kind == "hammer" and not window.start_s:
        pulses = [isolate_pulse(record) for record in records]
        starts = [max(int(np.argmax(np.abs(pulse.record.force) > 0)) - LEAD, 0) for pulse in pulses]
        n = min(requested, *(record.n_samples - start for record, start in zip(records, starts, strict=True)))
        pauses = [
            record.duration_s if record.has_predecessor and _still_moves(modal_model, record.duration_s) else 0.0
            for record in records
        ]
        return [
            _Cut(i, pulse.record, start, is_moving=pause > 0, pause_s=pause)
            for i, (pulse, start, pause) in enumerate(zip(pulses, starts, pauses, strict=True))
        ], _fast_length(n)
    shortest = min(record.n_samples for record in records)
    n = _fast_length(min(requested, shortest - 2 * EDGE))
    if observations.kind == "hammer":
        start = min(EDGE + round(window.start_s / step), shortest - n - EDGE)
        return [_Cut(i, isolate_pulse(record).record, start, is_moving=True) for i, record in enumerate(records)], n
    room, count, cuts = shortest - n - 2 * EDGE, window.per_record, []
    sizes = _motion_sizes(observations, n)
    for i, (record, size) in enumerate(zip(records, sizes, strict=True)):
        loudest = EDGE + min(max(int(np.argmax(size[EDGE:])) - round(EARLY * n), 0), max(room, 0))
        if starts_at_rest(record):  # no state is unknown then: one segment holds more than two that start in motion
            cuts.append(_Cut(i, record, 0, is_moving=False))
            if window.loudest and size[: n // 4].max() < QUIETER * size.max():
                cuts.append(_Cut(i, record, loudest, is_moving=True))
            continue
        last_start = _last_start(size, n, room)
        parts = [EDGE + round(last_start * (part + 0.5) / count) for part in range(count)]
        parts[int(np.argmin([abs(part - loudest) for part in parts]))] = loudest
        cuts += [_Cut(i, record, start, is_moving=True) for start in parts]
    return cuts, n


def _still_moves(modal_model: ModalModel, pause_s: float) -> bool:
    """Tell whether the structure still moves at the next impact."""
    return bool(remaining_motion(modal_model, np.array([pause_s]))[:, modal_model.n_rigid :].max() > RESTING)


def _last_start(size: FloatArray, n: int, room: int) -> int:
    """Give the last sample at which a segment may start: not where the motion has decayed."""
    inside = size[EDGE:-EDGE]
    loud = np.flatnonzero(inside >= QUIET * inside.max())
    return min(room, max(int(loud[-1]) - n // 4, 0))


def _motion_sizes(observations: Observations, n: int) -> list[FloatArray]:
    """Largest displacement around each sample of each record: stops and stiffening springs respond to displacement."""
    low, sizes = observations.band_hz[0], []
    for record in observations.records:
        frequency = np.fft.rfftfreq(record.n_samples, record.step_s)
        s = 2j * np.pi * np.maximum(frequency, low)
        powers = np.array([sensor.quantity.power for sensor in record.sensors])[:, None]
        faded = record.responses * tukey(record.n_samples, FADED)  # a jump from the end to the start would ring
        lines = np.fft.rfft(faded) * (frequency >= DRIFT_PART * low) / s**powers
        motion = np.fft.irfft(lines, record.n_samples)
        motion /= np.maximum(motion.std(1, keepdims=True), 1e-300)
        sizes.append(maximum_filter1d(np.abs(motion).max(0), max(round(LOUD_WIDTH * n), 1)))
    return sizes


def starts_at_rest(record: ObservedRecord) -> bool:
    """Tell whether nothing moves yet at the first samples.

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
    first = max(REST_SAMPLES, round(REST_PART * record.n_samples))
    size = np.sqrt(np.mean(signals**2, 1))
    return bool(np.all(np.sqrt(np.mean(signals[:, :first] ** 2, 1)) < AT_REST * size))


def _transform(cut: _Cut, fine: FloatArray, sigma: float) -> tuple[ComplexArray, FloatArray]:
    """Transform force and responses, and read the force and its slope at the start.

    A signal that jumps at the start is not band-limited: the sum over samples is off by half the first one, and, on
    finer samples, by little more.
    """
    step = cut.record.step_s
    n = fine.shape[1] // REFINEMENT
    if not cut.is_moving:
        signals = np.vstack([cut.record.force, cut.record.responses])[:, cut.start : cut.start + n]
        return np.fft.rfft(signals * np.exp(-sigma * step * np.arange(n)) * step, axis=1), np.zeros(2)
    fine_step = step / REFINEMENT
    decay = np.exp(-sigma * fine_step * np.arange(REFINEMENT * n)) * fine_step
    decay[0] /= 2
    slope = (fine[0, 1] - fine[0, 0]) / fine_step - fine[0, :3] @ np.array([1, -2, 1]) / (2 * fine_step)
    return np.fft.rfft(fine * decay, axis=1)[:, : n // 2 + 1], np.array([fine[0, 0], slope])


def _resample_finer(cut: _Cut, n: int) -> FloatArray:
    """Force and responses on finer times, (1 + n_sensors, REFINEMENT n)."""
    signals = np.vstack([cut.record.force, cut.record.responses])
    padded = np.pad(signals, ((0, 0), (EDGE, EDGE)))[:, cut.start : cut.start + n + 2 * EDGE]
    fine = resample(_fade_ends(padded), REFINEMENT * padded.shape[1], axis=1)
    return np.asarray(fine[:, REFINEMENT * EDGE : REFINEMENT * (EDGE + n)])


def _fade_ends(signals: FloatArray) -> FloatArray:
    """Fade both ends, which are outside the segment, so that the periodic interpolation does not ring."""
    ramp = np.sin(np.pi / 2 * np.arange(EDGE // 2) / (EDGE // 2)) ** 2
    window = np.ones(signals.shape[1])
    window[: EDGE // 2] = ramp
    window[-(EDGE // 2) :] = ramp[::-1]
    return signals * window


def common_step(observations: Observations) -> float:
    """Give the time step of all recordings.

    Parameters
    ----------
    observations : Observations
        Records of a hammer or a shaker.

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
            f"the record {odd.name} has a time step of {odd.step_s:g} s, the others of {np.median(steps):g} s; the "
            "search for nonlinear laws needs records of one sampling rate: leave it out"
        )
    return float(steps.mean())


def _fast_length(n: int) -> int:
    return int(prev_fast_len(n, real=True)) if n > 64 else int(next_fast_len(n, real=True))


def _noise_row(noise: ChannelNoise, sensor: Sensor) -> int:
    return noise.sensors.index((sensor.channel, sensor.dof))


def _sensor_row(modal_model: ModalModel, channel: str, dof: object) -> int:
    return next(i for i, s in enumerate(modal_model.sensors) if (s.channel, s.dof) == (channel, dof))
