"""Faults of one signal that show in itself: it begins within the pulse, samples dropped out, an amplifier drifts.

A run of equal samples is a dropout where chance does not make it: with the share of equal neighbours around it, a run
as long has a probability below `CHANCE` anywhere in the record. A signal at rest, at the end of its range, or in
digital steps has such runs too: they reach an end of the record, lie at an extreme value, or are left by one step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.signals.clipping import EQUAL, digital_step
from frf_ipz.ingest.signals.pulses import RINGING, pulse_extent, quiet_length

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.signals.pulses import Pulse

CHANCE = 1e-6  # probability with which a good record is marked
STEPS = 1.5  # digital steps: a smooth signal leaves a plateau by one
SIGNIFICANT = 5.0  # standard deviations: 6e-7 of normal values lie beyond
FEWEST_BEFORE = 16  # samples before the pulse from which a drift can be told
MOST_MISSING = 0.5  # of the recorded force: where a record lacks more, the error turns the FRF, as poles do
LOUD = 4.0  # standard deviations of the noise that a sample of the pulse exceeds


def find_missing_force(force: FloatArray, pulse: Pulse) -> tuple[float, ...]:
    """Find what a record lacks of a pulse within which it begins, taking its flanks as mirror images.

    Parameters
    ----------
    force : (n,) array
        The force.
    pulse : Pulse
        Its pulse.

    Returns
    -------
    tuple of float
        The samples before the first one; 0 where the record begins before the pulse.

    Examples
    --------
    >>> from frf_ipz.ingest.signals.pulses import find_pulse
    >>> force = np.concatenate([[3.0, 4.0, 3.0, 2.0, 1.0], np.zeros(200)])
    >>> find_missing_force(force, find_pulse(force, threshold=0.04))
    (1.0, 2.0)
    """
    upward = (force - pulse.base) * np.sign(pulse.height)
    floor = max(LOUD * pulse.noise, 1e-5 * abs(pulse.height))
    if not np.all(upward[: pulse.peak + 1] > floor):
        return (0.0,)
    falling = upward[pulse.peak :]
    length = int(np.argmin(falling > floor)) + 1
    below = int(np.argmax(falling < falling[0])) if pulse.peak == 0 else int(np.argmax(falling <= upward[0]))
    before, after = falling[below - 1], falling[below]
    crossing = below - 1 + (before - upward[0]) / (before - after) if before > after else float(below)
    samples = np.interp(np.arange(crossing + 1.0, length), np.arange(length), falling[:length])
    missing = np.sign(pulse.height) * samples[samples > floor][::-1]
    return tuple(float(value) for value in missing) or (0.0,)


def find_missing_ringing(force: FloatArray, pulse: Pulse) -> tuple[float, ...]:
    """Find what a filter may have rung before a record that begins just before its pulse.

    A filter without distortion of phase, as analysers have, rings before a pulse as it does after it. Fewer quiet
    samples before the pulse than show that it has ended do not show that nothing has been cut off. What a force does
    after its pulse for other reasons (a slow return to zero, a hammer that swings) is not before it: the samples
    that are there tell by how much less.

    Parameters
    ----------
    force : (n,) array
        The force.
    pulse : Pulse
        Its pulse.

    Returns
    -------
    tuple of float
        The samples before the first one, a mirror image of those after the pulse, as much smaller as the first
        samples are than theirs; 0 where there is nothing.

    Examples
    --------
    >>> from frf_ipz.ingest.signals.pulses import find_pulse
    >>> force = np.concatenate([[3.0, 4.0, 3.0, -0.2, 0.1], np.zeros(200)])
    >>> find_missing_ringing(force, find_pulse(force, threshold=0.04))
    (0.1, -0.2)
    >>> force = np.concatenate([np.zeros(20), force])
    >>> find_missing_ringing(force, find_pulse(force, threshold=0.04))
    (0.0,)
    """
    start, stop = pulse_extent(force, pulse)
    quiet = quiet_length(pulse)
    around = force - pulse.base
    mirrored = around[2 * pulse.peak + 1 : stop][:quiet]
    if start >= quiet or not len(mirrored):
        return (0.0,)
    first = around[: min(RINGING, pulse.peak)]
    after = around[2 * pulse.peak + 1 - len(first) : 2 * pulse.peak + 1]
    share = min(1.0, float(np.linalg.norm(first)) / max(float(np.linalg.norm(after)), np.finfo(float).tiny))
    return tuple((share * mirrored[::-1]).tolist())


def find_dropout(signal: FloatArray) -> tuple[int, int]:
    """Find the longest run of equal samples that no chance explains.

    Parameters
    ----------
    signal : (n,) array
        As recorded.

    Returns
    -------
    start, length : int
        Of the run; its length is 0 where there is none.

    Examples
    --------
    >>> signal = np.sin(np.arange(400.0))
    >>> signal[100:140] = 0.0
    >>> find_dropout(signal)
    (100, 40)
    """
    is_equal = np.diff(signal) == 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_equal, [False]]).astype(np.int8))).reshape(-1, 2)
    smallest = max(STEPS * digital_step(signal), EQUAL * float(np.ptp(signal))) if len(edges) else 0.0
    extremes = float(signal.max()), float(signal.min())
    for first, last in sorted(edges.tolist(), key=lambda run: run[0] - run[1]):  # the longest first
        length = last - first + 1
        if first == 0 or last == len(signal) - 1 or float(signal[first]) in extremes:
            continue
        around = np.concatenate([is_equal[max(first - length, 0) : first], is_equal[last : last + length]])
        share = (np.count_nonzero(around) + 1) / (len(around) + 1)
        if len(signal) * share ** (length - 1) > CHANCE:
            continue
        jump = max(abs(signal[first] - signal[first - 1]), abs(signal[last + 1] - signal[last]))
        if jump > smallest:
            return int(first), int(length)
    return 0, 0


def is_settling(response: FloatArray, n_before: int) -> bool:
    """Tell whether an acceleration drifts before the impact, and on to the end: the structure rests at both.

    Parameters
    ----------
    response : (n,) array
        As recorded.
    n_before : int
        Samples before the pulse.

    Returns
    -------
    bool
        True where the drift stands out from the noise before the impact, and from what remains at the end.
    """
    if n_before < FEWEST_BEFORE:
        return False
    slope, level, noise = _fit_line(response[:n_before])
    deviation = noise / np.sqrt(np.sum((np.arange(n_before) - 0.5 * (n_before - 1)) ** 2))
    _, end, noise_at_end = _fit_line(response[-max(len(response) // 10, FEWEST_BEFORE) :])
    drift = (end - level) * np.sign(slope)
    return bool(
        abs(slope) > SIGNIFICANT * deviation
        and drift > SIGNIFICANT * max(noise_at_end, noise)
        and drift > abs(slope) * n_before
    )


def _fit_line(values: FloatArray) -> tuple[float, float, float]:
    """Slope a sample, mean, and standard deviation of the remainder."""
    position = np.arange(len(values)) - 0.5 * (len(values) - 1)
    slope, mean = float(position @ values / (position @ position)), float(values.mean())
    return slope, mean, float(np.sqrt(np.sum((values - mean - slope * position) ** 2) / (len(values) - 2)))
