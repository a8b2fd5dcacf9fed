"""Jumps in a response that no band-limited motion makes: a cable that is loose for a moment.

A decaying response under noise follows from its last samples but for an innovation, by linear prediction
[Makhoul1975]; a spike is an innovation far beyond those around it. A spike s(t) adds the prediction filter's output
of s to the innovations, so that s follows from these by least squares over the samples that it lasts. Just after the
force, motion is too large to be predicted to within the noise: nothing is said there.

A cable that moves leaves a charge, which decays in the amplifier: all jumps of a channel may have a tail exp(-t / tau).
It is too slow to stand out from sample to sample, but not in a sum over its length; tau is tried, and the tails are
taken off where they explain more than their number of coefficients asks for [Schwarz1978]. Coefficients of the
prediction are then those of the response without what was found.

[Schwarz1978]: G. Schwarz, Estimating the dimension of a model, Annals of Statistics 6 (1978) 461-464
(doi:10.1214/aos/1176344136).
[Makhoul1975]: J. Makhoul, Linear prediction: a tutorial review, Proceedings of the IEEE 63 (1975) 561-580
(doi:10.1109/PROC.1975.9792).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.signals.clipping import EQUAL
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.signal import lfilter

    from frf_ipz.arrays import BoolArray, FloatArray, IntArray
else:
    lfilter = import_late("scipy.signal", "lfilter")

ORDER = 24  # samples that predict the next: twelve modes; what further ones leave raises all innovations
SIGNIFICANT = 10.0  # standard deviations of the innovations around: sound recordings stay below 6
HALF = 0.6745  # of normal noise lies within so many standard deviations
N_BLOCKS = 32  # of a record, for the scale of the innovations: what lasts longer than one is no spike
ROUNDS = 2
N_DECAYS = 12  # of jumps that are tried, at equal ratios from what predicts a sample to the whole record
LEAST_TAIL = 0.03  # of the noise: what is left of a tail there is not seen in any sum over a record
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
    cleaned, outliers, jumps = response, np.empty(0, np.int64), list[Spike]()
    for _ in range(ROUNDS):
        prediction = _predict(cleaned)
        scale, is_outlier = _find_outliers(cleaned, prediction, _least_step(response))
        outliers = np.union1d(outliers, np.flatnonzero(is_outlier))
        bursts = [(first, last) for first, last in _bursts(outliers) if last - first < len(response) // N_BLOCKS]
        if not bursts:
            return []
        jumps = _fit_jumps(_innovations(response, prediction), prediction, scale, bursts)
        cleaned = response.copy()
        for jump in jumps:
            cleaned[jump.start : jump.start + len(jump.values)] -= jump.values
    return [replace(jump, output=output, start=start + jump.start) for jump in jumps]


def _find_outliers(response: FloatArray, prediction: FloatArray, step: float) -> tuple[FloatArray, BoolArray]:
    """Give the standard deviation of innovations around each, and which are far beyond it."""
    innovations = _innovations(response, prediction)
    scale = np.maximum(_local_scale(innovations), step * np.linalg.norm(prediction))
    is_outlier = np.abs(innovations) > SIGNIFICANT * scale
    is_outlier[: len(response) // N_BLOCKS] = False
    return scale, np.asarray(is_outlier)


def _fit_jumps(
    innovations: FloatArray, prediction: FloatArray, scale: FloatArray, bursts: Sequence[tuple[int, int]]
) -> list[Spike]:
    """Fit what bursts add to a response, with the decay that explains most, or none."""
    decays = np.geomspace(ORDER, len(innovations), N_DECAYS).tolist()
    fits = [_fit_bursts(innovations, prediction, scale, bursts, tau) for tau in (0.0, *decays)]
    demanded = (len(bursts) + 1) * np.log(len(innovations))
    costs = [cost + demanded * (number > 0) for number, (cost, _) in enumerate(fits)]
    return fits[int(np.argmin(costs))][1]


def _fit_bursts(
    innovations: FloatArray,
    prediction: FloatArray,
    scale: FloatArray,
    bursts: Sequence[tuple[int, int]],
    tau: float,
) -> tuple[float, list[Spike]]:
    """Fit one burst after the other, with tails or (0) without: what is left over the noise, and the jumps."""
    left, jumps = innovations.copy(), []
    ends = [*(first for first, _ in bursts[1:]), len(innovations)]
    for (first, last), end in zip(bursts, ends, strict=True):
        length = last - first + 1
        stop = end if tau else min(last + 1 + ORDER, len(innovations))
        shapes = np.eye(len(innovations) - first, length)
        if tau:
            tail = np.exp(-np.arange(1, len(shapes) - length + 1) / tau)
            shapes = np.column_stack([shapes, np.concatenate([np.zeros(length), tail])])
        effect = lfilter(prediction, [1.0], shapes, axis=0)
        inverse = np.linalg.pinv(effect[: stop - first])
        amplitudes = inverse @ left[first:stop]
        left[first:] -= effect @ amplitudes
        energy = np.sum(shapes**2, axis=0)
        error = float(scale[first] ** 2 * np.sum(energy * np.sum(inverse**2, axis=1)))
        values = shapes @ amplitudes
        lasts = np.flatnonzero(np.abs(values) > LEAST_TAIL * scale[first])
        count = max(length, int(lasts[-1]) + 1 if lasts.size else 0)
        jumps.append(Spike(0, first + ORDER, tuple(values[:count].tolist()), error))
    return float(np.sum((left / scale) ** 2)), jumps


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


def _predict(response: FloatArray) -> FloatArray:
    """Weights of a sample and of the `ORDER` before it, the newest first, whose sum is the innovation."""
    rows = np.lib.stride_tricks.sliding_window_view(response, ORDER + 1)
    before, sample = rows[:, :-1], rows[:, -1]
    normal = before.T @ before
    ridge = RIDGE * np.trace(normal) / ORDER + np.finfo(float).tiny
    coefficients = np.linalg.solve(normal + ridge * np.eye(ORDER), before.T @ sample)
    return np.concatenate([[1.0], -coefficients[::-1]])


def _innovations(response: FloatArray, prediction: FloatArray) -> FloatArray:
    return np.convolve(response, prediction, mode="valid")


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
    if not outliers.size:
        return []
    breaks = np.flatnonzero(np.diff(outliers) > ORDER)
    firsts, lasts = outliers[np.append(0, breaks + 1)], outliers[np.append(breaks, len(outliers) - 1)]
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))
