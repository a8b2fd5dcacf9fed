"""What is wrong with one blow or record: each check is a function from signals to a text, or nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.signals.clipping import digital_step, is_clipped
from frf_ipz.ingest.signals.decay import Decay, measure_decay
from frf_ipz.ingest.signals.pulses import find_pulse, pulse_extent
from frf_ipz.ingest.survey.record_info import RecordInfo
from frf_ipz.ingest.units import si_unit
from frf_ipz.quantities import RESPONSES

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.campaign import VibrationTest
    from frf_ipz.ingest.signals.pulses import Pulse
    from frf_ipz.ingest.survey.file_index import FileIndex

SECOND_PULSE = 0.04  # of the first: smaller ones are no second blow
CUT_OFF = 1e-3  # share of a mode's amplitude at the end of the record that is worth a window
WEAK_FORCE = 10.0  # times its noise
WEAK_DB = 0.0  # the response is below its noise
RESTLESS = 0.02  # of the highest response: motion before the blow
SURE = 5.0  # standard deviations of a mean
OFFSET = 0.01  # of the highest value: an offset that is worth a word
FEWEST_BEFORE = 16  # samples before the pulse that tell an offset


def check_impact(
    test: VibrationTest,
    index: FileIndex,
    name: str,
    rows: tuple[int, int],
    signals: FloatArray,
    *,
    offsets: tuple[float, ...] | None = None,
) -> RecordInfo:
    """Measure one blow and find what is wrong with it.

    Parameters
    ----------
    test : VibrationTest
        Its channels.
    index : FileIndex
        Its file.
    name : str
        What it is called.
    rows : pair of int
        Its rows in the file.
    signals : (1 + n_channels, n_samples) array
        Time, force, responses, SI.
    offsets : tuple of float, optional
        Constant part of each response, SI, where it is known; it is read before the blow where it is not.

    Returns
    -------
    RecordInfo
        Everything but what depends on other blows.
    """
    force, responses = signals[1], signals[2:]
    pulse = find_pulse(force, threshold=SECOND_PULSE)
    start, stop = pulse_extent(force, pulse)
    if pulse.bumps.size:
        stop = max(stop, int(pulse.bumps.max()) + stop - pulse.peak)
        start = min(start, int(pulse.bumps.min()) + start - pulse.peak)
    trigger = max(min(pulse.onset, *(int(bump) for bump in pulse.bumps), len(force) - 1), 0)
    if offsets is None:
        offsets = tuple(_offset(response[: max(start, 0)]) for response in responses)
    decays = _decays(test, index.step_s, responses - np.array(offsets)[:, None], trigger)
    worst = max(decays, key=lambda decay: decay.remaining_amplitude)
    snr_db = _snr_db(responses - np.array(offsets)[:, None], trigger, decays)
    return RecordInfo(
        name=name,
        setup=index.setup,
        path=index.path,
        start=rows[0],
        stop=rows[1],
        step_s=index.step_s,
        trigger=trigger,
        pulse=(start, stop),
        force_interval=(0, len(force)),
        offsets=(pulse.base, *offsets),
        peak_force=pulse.height,
        digital_force=digital_step(force) > 0.0,
        pulse_s=pulse.width * index.step_s,
        force_noise=pulse.noise,
        second_pulse_ratio=float(pulse.ratios.max(initial=0.0)),
        remaining_amplitude=worst.remaining_amplitude,
        slowest_mode_hz=worst.frequency_hz,
        snr_db=snr_db,
        faults=(*_double_hit(pulse, index.step_s), *_clipped(test, force, responses)),
        remarks=(
            *_cut_off(worst),
            *_weak(pulse, snr_db),
            *_restless(test, responses, offsets, start),
            *_shifted(test, signals[1:], (pulse.base, *offsets)),
        ),
    )


def check_record(
    test: VibrationTest, index: FileIndex, name: str, signals: FloatArray, *, starts_at_rest: bool
) -> RecordInfo:
    """Measure one record of a shaker and find what is wrong with it.

    Parameters
    ----------
    test : VibrationTest
        Its channels.
    index : FileIndex
        Its file.
    name : str
        What it is called.
    signals : (1 + n_channels, n_samples) array
        Time, force, responses, SI.
    starts_at_rest : bool
        It starts from rest.

    Returns
    -------
    RecordInfo
        Everything but what depends on other records.
    """
    force, responses = signals[1], signals[2:]
    means = signals[1:].mean(axis=1)
    spread = signals[1:].std(axis=1)
    offsets = np.where(np.abs(means) > 0.1 * spread, means, 0.0)
    return RecordInfo(
        name=name,
        setup=index.setup,
        path=index.path,
        start=0,
        stop=index.n_rows,
        step_s=index.step_s,
        trigger=0,
        pulse=(0, index.n_rows),
        force_interval=(0, index.n_rows),
        offsets=tuple(float(offset) for offset in offsets),
        peak_force=float(force[np.argmax(np.abs(force))]),
        digital_force=digital_step(force) > 0.0,
        pulse_s=float("nan"),
        force_noise=float("nan"),
        starts_at_rest=starts_at_rest,
        faults=_clipped(test, force, responses),
        remarks=_shifted(test, signals[1:], tuple(offsets)),
    )


def _double_hit(pulse: Pulse, step_s: float) -> tuple[str, ...]:
    if not pulse.bumps.size:
        return ()
    strongest = int(np.argmax(pulse.ratios))
    delay = (int(pulse.bumps[strongest]) - pulse.peak) * step_s
    side = "after" if delay > 0 else "before"
    return (f"double hit: {100 * pulse.ratios[strongest]:.0f} % of the pulse {1e3 * abs(delay):.3g} ms {side} it",)


def _clipped(test: VibrationTest, force: FloatArray, responses: FloatArray) -> tuple[str, ...]:
    found = [f"clipping of {test.input_channel.column}"] if is_clipped(force) else []
    found += [
        f"overload of {channel.column}"
        for channel, response in zip(test.output_channels, responses, strict=True)
        if is_clipped(response)
    ]
    return tuple(found)


def _decays(test: VibrationTest, step_s: float, responses: FloatArray, trigger: int) -> list[Decay]:
    return [
        measure_decay(response[trigger:], step_s, RESPONSES.index(channel.quantity))
        for channel, response in zip(test.output_channels, responses, strict=True)
    ]


def _cut_off(worst: Decay) -> tuple[str, ...]:
    if worst.remaining_amplitude <= CUT_OFF:
        return ()
    return (f"cut-off decay: {100 * worst.remaining_amplitude:.2g} % left at {worst.frequency_hz:.4g} Hz",)


def _snr_db(responses: FloatArray, trigger: int, decays: list[Decay]) -> float:
    power = np.mean(responses[:, trigger:] ** 2, axis=1)
    noise = np.array([decay.noise for decay in decays]) ** 2
    if not (noise > 0).any():
        return float("nan")
    signal = np.maximum(power - noise, 1e-12 * power)
    return float(10.0 * np.log10(np.median(signal[noise > 0] / noise[noise > 0])))


def _weak(pulse: Pulse, snr_db: float) -> tuple[str, ...]:
    if abs(pulse.height) < WEAK_FORCE * pulse.noise:
        return (f"weak blow: its peak is {abs(pulse.height) / pulse.noise:.1f} times the force's noise",)
    if snr_db < WEAK_DB:
        return (f"weak blow: its response is {-snr_db:.0f} dB below the noise",)
    return ()


def _offset(before: FloatArray) -> float:
    """Estimate a constant part from what is recorded before the blow; 0 where it could be chance."""
    if len(before) < FEWEST_BEFORE:
        return 0.0
    mean, spread = float(before.mean()), float(before.std())
    return mean if abs(mean) > SURE * spread / np.sqrt(len(before)) else 0.0


def _restless(test: VibrationTest, responses: FloatArray, offsets: tuple[float, ...], start: int) -> tuple[str, ...]:
    if start < FEWEST_BEFORE:
        return ()
    before = np.sqrt(np.mean((responses[:, :start] - np.array(offsets)[:, None]) ** 2, axis=1))
    share = before / np.maximum(np.abs(responses).max(axis=1), np.finfo(float).tiny)
    later = responses[:, -max(responses.shape[1] // 10, 1) :].std(axis=1)
    moving = (share > RESTLESS) & (before > 3.0 * later)
    if not moving.any():
        return ()
    worst = int(np.argmax(np.where(moving, share, 0.0)))
    return (f"not at rest before the blow: {100 * share[worst]:.2g} % of {test.output_channels[worst].column}",)


def _shifted(test: VibrationTest, signals: FloatArray, offsets: tuple[float, ...]) -> tuple[str, ...]:
    highest = np.abs(signals - np.array(offsets)[:, None]).max(axis=1)
    return tuple(
        f"DC offset of {channel.column}: {offset:.3g} {si_unit(channel.quantity)}, taken off"
        for channel, offset, top in zip(test.channels, offsets, highest, strict=True)
        if abs(offset) > OFFSET * top
    )
