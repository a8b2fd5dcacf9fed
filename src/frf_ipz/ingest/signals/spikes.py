"""Jumps in a response that no band-limited motion makes: a cable that is loose for a moment.

A decaying response under noise follows from its last samples but for an innovation, by linear prediction
[Makhoul1975]; a spike is an innovation far beyond those around it. A spike s(t) adds the prediction filter's output
of s to the innovations, so that s follows from these by least squares over the samples that it lasts. Just after the
force, motion is too large to be predicted to within the noise: nothing is said there.

[Makhoul1975]: J. Makhoul, Linear prediction: a tutorial review, Proceedings of the IEEE 63 (1975) 561-580
(doi:10.1109/PROC.1975.9792).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.signals.clipping import EQUAL
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.linalg import toeplitz

    from frf_ipz.arrays import FloatArray, IntArray
else:
    toeplitz = import_late("scipy.linalg", "toeplitz")

ORDER = 24  # samples that predict the next: twelve modes; what further ones leave raises all innovations
SIGNIFICANT = 10.0  # standard deviations of the innovations around: sound recordings stay below 6
HALF = 0.6745  # of normal noise lies within so many standard deviations
N_BLOCKS = 32  # of a record, for the scale of the innovations: what lasts longer than one is no spike
RIDGE = 1e-14  # of the mean power: a response without noise is predicted without error


@dataclass(frozen=True, slots=True)
class Spike:
    """A jump in a response that no band-limited motion makes.

    Parameters
    ----------
    output : int
        The response, by its place in the set-up.
    start : int
        Its first sample.
    values : tuple of float
        Its samples, SI.
    error : float
        Expected sum of the squares of their errors.
    """

    output: int
    start: int
    values: tuple[float, ...]
    error: float


def find_spikes(response: FloatArray, output: int, start: int) -> list[Spike]:
    """Find the spikes of a response that decays freely.

    Parameters
    ----------
    response : (n,) array
        SI.
    output : int
        Its place in the set-up.
    start : int
        Where the force has ended.

    Returns
    -------
    list of Spike
        Ascending.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> time = np.arange(4000.0)
    >>> response = 100.0 * np.exp(-time / 800) * np.sin(0.2 * time) + rng.standard_normal(4000)
    >>> response[1500] += 40.0
    >>> [(spike.start, bool(35.0 < spike.values[0] < 45.0)) for spike in find_spikes(response, 0, 100)]
    [(1500, True)]
    """
    response = response[start:]
    if len(response) < N_BLOCKS * ORDER:
        return []
    coefficients, innovations = _predict(response)
    prediction = np.concatenate([[1.0], -coefficients[::-1]])
    floor = _least_step(response) * np.linalg.norm(prediction)
    scale = np.maximum(_local_scale(innovations), floor)
    is_outlier = np.abs(innovations) > SIGNIFICANT * scale
    is_outlier[: len(response) // N_BLOCKS] = False
    outliers = np.flatnonzero(is_outlier)
    if not outliers.size:
        return []
    spikes = []
    for first, last in _bursts(outliers):
        length, stop = last - first + 1, min(last + 1 + ORDER, len(innovations))
        if length > len(response) // N_BLOCKS:
            continue
        column = np.zeros(stop - first)
        column[: len(prediction)] = prediction[: stop - first]
        effect = toeplitz(column, np.zeros(length))
        values = np.linalg.lstsq(effect, innovations[first:stop], rcond=None)[0]
        error = float(scale[first] ** 2 * np.trace(np.linalg.pinv(effect.T @ effect)))
        spikes.append(Spike(output, start + first + ORDER, tuple(values.tolist()), error))
    return spikes


def in_one_response(spikes: Sequence[Spike]) -> tuple[Spike, ...]:
    """Leave out spikes that several responses have at once: samples that were lost, or another force.

    Parameters
    ----------
    spikes : sequence of Spike
        Of one recording.

    Returns
    -------
    tuple of Spike
        Those of one cable.
    """
    return tuple(
        spike
        for spike in spikes
        if not any(other.output != spike.output and abs(other.start - spike.start) <= ORDER for other in spikes)
    )


def _predict(response: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coefficients, the oldest sample first, and innovations of the samples from `ORDER` on."""
    rows = np.lib.stride_tricks.sliding_window_view(response, ORDER + 1)
    before, sample = rows[:, :-1], rows[:, -1]
    normal = before.T @ before
    ridge = RIDGE * np.trace(normal) / ORDER + np.finfo(float).tiny
    coefficients = np.linalg.solve(normal + ridge * np.eye(ORDER), before.T @ sample)
    return np.asarray(coefficients), np.asarray(sample - before @ coefficients)


def _least_step(response: FloatArray) -> float:
    """Give the smallest step between readings; steps that are smaller than what is told apart count as that."""
    steps, least = np.diff(np.unique(response)), EQUAL * float(np.ptp(response))
    return float(np.min(steps[steps > least], initial=np.ptp(response))) if least else 0.0


def _local_scale(innovations: FloatArray) -> FloatArray:
    """Give the standard deviation around each sample, the largest of the median ones of three blocks."""
    blocks = np.array_split(np.abs(innovations), N_BLOCKS)
    medians = np.array([np.median(block) for block in blocks]) / HALF
    edges = np.concatenate([medians[:1], medians, medians[-1:]])
    around = np.max([edges[:-2], edges[1:-1], edges[2:]], axis=0)
    return np.repeat(around, [len(block) for block in blocks])


def _bursts(outliers: IntArray) -> list[tuple[int, int]]:
    """First and last of those that lie within a prediction of one another."""
    breaks = np.flatnonzero(np.diff(outliers) > ORDER)
    firsts, lasts = outliers[np.append(0, breaks + 1)], outliers[np.append(breaks, len(outliers) - 1)]
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))
