"""What is wrong with one record: each check is a function from signals to a text, or nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.signals.clipping import digital_step, is_clipped
from frf_ipz.ingest.signals.decay import Decay, measure_decay
from frf_ipz.ingest.signals.faults import (
    MOST_MISSING,
    find_dropout,
    find_missing_force,
    find_missing_ringing,
    is_settling,
)
from frf_ipz.ingest.signals.periods import find_period
from frf_ipz.ingest.signals.pulses import find_pulse, force_band, pulse_extent
from frf_ipz.ingest.signals.spikes import find_spikes, in_one_response
from frf_ipz.ingest.survey.record_info import STANDS_STILL, RecordInfo
from frf_ipz.ingest.units import si_unit
from frf_ipz.quantities import RESPONSES

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.campaign import VibrationTest
    from frf_ipz.ingest.signals.pulses import Pulse
    from frf_ipz.ingest.signals.spikes import Spike
    from frf_ipz.ingest.survey.file_index import FileIndex

SECOND_PULSE = 0.04  # of the first: smaller ones are no second hit
CUT_OFF = 1e-3  # share of a mode's amplitude at the end of the record that is worth a window
WEAK_FORCE = 10.0  # times its noise
WEAK_DB = 0.0  # the response is below its noise
INITIAL_MOTION = 0.02  # of the highest response: motion before the impact
SIGNIFICANT = 5.0  # standard deviations of a mean
OFFSET = 0.01  # of the highest value: an offset that is reported
STD_OF_MEDIAN = 1.4826  # standard deviation of normal values over the median of their moduli
FEWEST_BEFORE = 16  # samples before the pulse from which an offset can be estimated


def check_impact(
    test: VibrationTest,
    index: FileIndex,
    name: str,
    rows: tuple[int, int],
    signals: FloatArray,
    *,
    offsets: tuple[float, ...] | None = None,
) -> RecordInfo:
    """Measure one impact and find what is wrong with it.

    Parameters
    ----------
    test : VibrationTest
        Its channels.
    index : FileIndex
        Its file.
    name : str
        Its name.
    rows : pair of int
        Its rows in the file.
    signals : (1 + n_channels, n_samples) array
        Time, force, responses, SI.
    offsets : tuple of float, optional
        DC offset of each response, SI, where it is known; where it is not, it is estimated from the samples before the
        impact.

    Returns
    -------
    RecordInfo
        Everything but what depends on other impacts.
    """
    force, responses = signals[1], signals[2:]
    pulse = find_pulse(force, threshold=SECOND_PULSE)
    start, stop = pulse_extent(force, pulse)
    band_hz = force_band(force[max(start, 0) : stop] - pulse.base) / index.step_s
    if pulse.bumps.size:
        stop = max(stop, int(pulse.bumps.max()) + stop - pulse.peak)
        start = min(start, int(pulse.bumps.min()) + start - pulse.peak)
    trigger = max(min(pulse.onset, *(int(bump) for bump in pulse.bumps), len(force) - 1), 0)
    missing_force = find_missing_force(force, pulse) if start <= 0 else (0.0,)
    recorded = abs(float(np.sum(force[max(start, 0) : stop] - pulse.base)))
    lacks_most = any(missing_force) and (pulse.peak == 0 or abs(sum(missing_force)) > MOST_MISSING * recorded)
    if offsets is None:
        offsets = tuple(_estimate_offset(response[: max(start, 0)]) for response in responses)
    decays = _measure_decays(test, index.step_s, responses - np.array(offsets)[:, None], trigger)
    slowest = max(decays, key=lambda decay: decay.remaining_amplitude)
    cut_off = max(decays, key=lambda decay: decay.cut_off_ratio)
    snr_db = _measure_snr_db(responses - np.array(offsets)[:, None], trigger, decays)
    channel_faults = _find_bad_channels(test, index.step_s, responses, max(start, 0))
    bad_outputs = {output for output, _ in channel_faults}
    spikes = in_one_response(
        [
            spike
            for output, response in enumerate(responses)
            if output not in bad_outputs
            for spike in find_spikes(response, output, stop)
        ]
    )
    return RecordInfo(
        name=name,
        setup=index.setup,
        path=index.path,
        start=rows[0],
        stop=rows[1],
        step_s=index.step_s,
        trigger=trigger,
        pulse_interval=(start, stop),
        force_interval=(0, len(force)),
        offsets=(pulse.base, *offsets),
        peak_force=pulse.height,
        has_coarse_force=digital_step(force) > 0.0,
        pulse_s=pulse.width * index.step_s,
        force_noise=pulse.noise,
        force_band_hz=band_hz,
        second_pulse_ratio=float(pulse.ratios.max(initial=0.0)),
        remaining_amplitude=slowest.remaining_amplitude,
        slowest_mode_hz=slowest.frequency_hz,
        cut_off_ratio=cut_off.cut_off_ratio,
        cut_off_amplitude=cut_off.cut_off_amplitude,
        cut_off_hz=cut_off.cut_off_hz,
        snr_db=snr_db,
        faults=(
            *_find_late_start(force, pulse, missing_force, lacks_most=lacks_most),
            *_find_double_hit(pulse, index.step_s),
            *_find_clipping(test, force),
        ),
        channel_faults=channel_faults,
        missing_force=missing_force,
        missing_ringing=find_missing_ringing(force, pulse),
        lacks_most=lacks_most,
        spikes=spikes,
        remarks=(
            *_find_jumps(test, spikes, rows[0], index.step_s),
            *_find_cut_off_decay(slowest),
            *_find_weak_impact(pulse, snr_db),
            *_find_initial_motion(test, responses, offsets, start),
            *_find_offsets(test, signals[1:], (pulse.base, *offsets)),
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
        Its name.
    signals : (1 + n_channels, n_samples) array
        Time, force, responses, SI.
    starts_at_rest : bool
        The structure was at rest at its first sample.

    Returns
    -------
    RecordInfo
        Everything but what depends on other records.
    """
    force, responses = signals[1], signals[2:]
    means = signals[1:].mean(axis=1)
    spread = signals[1:].std(axis=1)
    offsets = np.where(np.abs(means) > 0.1 * spread, means, 0.0)
    period = find_period(force)
    # what comes again, with either sign, has its highest value again, which is no end of a range
    once = slice(-find_period(np.abs(force)), None)
    return RecordInfo(
        name=name,
        setup=index.setup,
        path=index.path,
        start=0,
        stop=index.n_rows,
        step_s=index.step_s,
        trigger=0,
        pulse_interval=(0, index.n_rows),
        force_interval=(0, index.n_rows),
        offsets=tuple(float(offset) for offset in offsets),
        peak_force=float(force[np.argmax(np.abs(force))]),
        has_coarse_force=digital_step(force) > 0.0,
        pulse_s=float("nan"),
        force_noise=float("nan"),
        starts_at_rest=starts_at_rest,
        faults=_find_clipping(test, force[once]),
        channel_faults=_find_bad_channels(test, index.step_s, responses[:, once], 0),
        remarks=_find_offsets(test, signals[1:], tuple(offsets)),
        period=period,
    )


def find_record_faults(test: VibrationTest, step_s: float, signals: FloatArray) -> tuple[str, ...]:
    """Find what is wrong with a record of several forces at once, as in one with a single force.

    Parameters
    ----------
    test : VibrationTest
        Its channels.
    step_s : float
        Time step, s.
    signals : (n_inputs + n_outputs, n_samples) array
        Forces, then responses, SI.

    Returns
    -------
    tuple of str
        Overload, dropout and dead channels; empty where there is none.
    """
    n_inputs = len(test.input_channels)
    faults: list[str] = []
    for channel, force in zip(test.input_channels, signals[:n_inputs], strict=True):
        once = force[-find_period(np.abs(force)) :]
        if not np.ptp(force):
            faults.append(f"{channel.column} {STANDS_STILL} {force[0]:z.4g}")
        elif is_clipped(once):
            faults.append(f"clipping of {channel.column}")
    once = slice(-find_period(np.abs(signals[0])), None)
    return (*faults, *(text for _, text in _find_bad_channels(test, step_s, signals[n_inputs:, once], 0)))


def _find_double_hit(pulse: Pulse, step_s: float) -> tuple[str, ...]:
    if not pulse.bumps.size:
        return ()
    strongest = int(np.argmax(pulse.ratios))
    delay = (int(pulse.bumps[strongest]) - pulse.peak) * step_s
    side = "after" if delay > 0 else "before"
    return (f"double hit: {100 * pulse.ratios[strongest]:.0f} % of the pulse {1e3 * abs(delay):.3g} ms {side} it",)


def _find_late_start(
    force: FloatArray, pulse: Pulse, missing_force: tuple[float, ...], *, lacks_most: bool
) -> tuple[str, ...]:
    if not any(missing_force):
        return ()
    if pulse.peak == 0:
        return ("begins at the peak of the impact or after it: the force before its first sample is not known",)
    if lacks_most:
        return ("begins within the impact, and lacks more of its force than half of what it holds",)
    return (f"begins within the impact, at {100 * (force[0] - pulse.base) / pulse.height:.2g} % of its peak",)


def _find_clipping(test: VibrationTest, force: FloatArray) -> tuple[str, ...]:
    return (f"clipping of {test.input_channel.column}",) if is_clipped(force, goes_one_way=True) else ()


def _find_bad_channels(
    test: VibrationTest, step_s: float, responses: FloatArray, n_before: int
) -> tuple[tuple[int, str], ...]:
    """Find responses that are no measurement, which says nothing against the force and the other responses."""
    faults: list[tuple[int, str]] = []
    for output, (channel, response) in enumerate(zip(test.output_channels, responses, strict=True)):
        if not np.ptp(response):
            faults.append((output, f"{channel.column} {STANDS_STILL} {response[0]:z.4g}"))
            continue
        if is_clipped(response):
            faults.append((output, f"overload of {channel.column}"))
        start, length = find_dropout(response[n_before:])  # at rest, a coarse converter shows one value for long
        if length:
            where = f"{length} samples of one value, {(n_before + start) * step_s:.4g} s after its beginning"
            faults.append((output, f"dropout of {channel.column}: {where}"))
        if channel.quantity == "acceleration" and is_settling(response, n_before):
            faults.append((output, f"{channel.column} is settling: it drifts before the impact and on to the end"))
    return tuple(faults)


def _measure_decays(test: VibrationTest, step_s: float, responses: FloatArray, trigger: int) -> list[Decay]:
    return [
        measure_decay(response[trigger:], step_s, RESPONSES.index(channel.quantity))
        for channel, response in zip(test.output_channels, responses, strict=True)
    ]


def _find_jumps(test: VibrationTest, spikes: tuple[Spike, ...], start: int, step_s: float) -> tuple[str, ...]:
    texts = []
    for output, channel in enumerate(test.output_channels):
        times_s = [(start + spike.start) * step_s for spike in spikes if spike.output == output]
        if times_s:
            others = f", and {len(times_s) - 1} times more" if len(times_s) > 1 else ""
            texts.append(
                f"{channel.column} jumps {times_s[0]:.4g} s after the beginning of its recording{others}, as no "
                "structure moves (a loose cable?): taken off"
            )
    return tuple(texts)


def _find_cut_off_decay(slowest: Decay) -> tuple[str, ...]:
    if slowest.remaining_amplitude <= CUT_OFF:
        return ()
    return (f"cut-off decay: {100 * slowest.remaining_amplitude:.2g} % remains at {slowest.frequency_hz:.4g} Hz",)


def _measure_snr_db(responses: FloatArray, trigger: int, decays: list[Decay]) -> float:
    power = np.mean(responses[:, trigger:] ** 2, axis=1)
    noise = np.array([decay.noise for decay in decays]) ** 2
    if not (noise > 0).any():
        return float("nan")
    signal = np.maximum(power - noise, 1e-12 * power)
    return float(10.0 * np.log10(np.median(signal[noise > 0] / noise[noise > 0])))


def _find_weak_impact(pulse: Pulse, snr_db: float) -> tuple[str, ...]:
    if abs(pulse.height) < WEAK_FORCE * pulse.noise:
        return (f"weak impact: its peak is {abs(pulse.height) / pulse.noise:.1f} times the force's noise",)
    if snr_db < WEAK_DB:
        return (f"weak impact: its response is {-snr_db:.0f} dB below the noise",)
    return ()


def _estimate_offset(before: FloatArray) -> float:
    """Estimate a constant part from what is recorded before the impact; 0 where it could be chance.

    Just before a strong impact the filter of a converter rings by far more than the noise: those samples do not count.
    Of a coarse converter half of the samples may be one reading, which hides noise below its digital step.
    """
    if len(before) < FEWEST_BEFORE:
        return 0.0
    deviation = np.abs(before - np.median(before))
    noise = max(STD_OF_MEDIAN * float(np.median(deviation)), digital_step(before))
    quiet = before[deviation <= SIGNIFICANT * noise]
    mean, spread = float(quiet.mean()), float(quiet.std())
    return mean if abs(mean) > SIGNIFICANT * spread / np.sqrt(len(quiet)) else 0.0


def _find_initial_motion(
    test: VibrationTest, responses: FloatArray, offsets: tuple[float, ...], start: int
) -> tuple[str, ...]:
    if start < FEWEST_BEFORE:
        return ()
    before = np.sqrt(np.mean((responses[:, :start] - np.array(offsets)[:, None]) ** 2, axis=1))
    share = before / np.maximum(np.abs(responses).max(axis=1), np.finfo(float).tiny)
    at_end = responses[:, -max(responses.shape[1] // 10, 1) :].std(axis=1)
    is_moving = (share > INITIAL_MOTION) & (before > 3.0 * at_end)
    if not is_moving.any():
        return ()
    worst = int(np.argmax(np.where(is_moving, share, 0.0)))
    return (f"not at rest before the impact: {100 * share[worst]:.2g} % of {test.output_channels[worst].column}",)


def _find_offsets(test: VibrationTest, signals: FloatArray, offsets: tuple[float, ...]) -> tuple[str, ...]:
    highest = np.abs(signals - np.array(offsets)[:, None]).max(axis=1)
    return tuple(
        f"DC offset of {channel.column}: {offset:.3g} {si_unit(channel.quantity)}, removed"
        for channel, offset, height in zip(test.channels, offsets, highest, strict=True)
        if abs(offset) > OFFSET * height
    )
