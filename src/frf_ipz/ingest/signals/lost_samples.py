"""Samples that a recording lost: from there on it runs ahead of what is expected."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray

HALVINGS = 5  # of the end that is compared: motion may have decayed long before
LONGEST = 4  # part of a record that may be lost: a quarter


class LostSamples(NamedTuple):
    """Where and by how many samples a signal begins to run ahead of what is expected.

    Parameters
    ----------
    start, lost : int
        First sample that runs ahead, and by how many; negative where samples came in.
    share : float
        Of the power of the difference that remains when this is allowed for.
    before : float
        Power of the difference relative to what is expected, until there over from there on. What a wrong FRF makes of
        a force differs from its beginning on: this is near 1 then.
    """

    start: int
    lost: int
    share: float
    before: float


def find_lost_samples(measured: FloatArray, expected: FloatArray) -> LostSamples:
    """Find where and by how many samples a signal begins to run ahead of what is expected.

    Parameters
    ----------
    measured, expected : (n,) array
        Signal, and what it should be.

    Returns
    -------
    LostSamples
        That with the smallest share; none lost, and a share of 1, where nothing explains anything.

    Examples
    --------
    >>> expected = np.exp(-np.arange(2000.0) / 500) * np.sin(np.arange(2000.0) ** 1.1 / 7)
    >>> measured = np.concatenate([expected[:600], expected[630:], np.zeros(30)])
    >>> find_lost_samples(measured, expected)[:2]
    (600, 30)
    """
    n = len(measured)
    best = LostSamples(0, 0, 1.0, 1.0)
    before = np.concatenate([[0.0], np.cumsum((measured - expected) ** 2)])
    if not before[-1]:
        return best
    spectrum = np.fft.rfft(expected, 2 * n)
    energy = np.concatenate([[0.0], np.cumsum(expected**2)])
    for start in n >> np.arange(1, HALVINGS + 1):
        tail = np.concatenate([np.zeros(start), measured[start:]])
        similarity = np.fft.irfft(np.fft.rfft(tail, 2 * n).conj() * spectrum)
        shifts = np.arange(-(n // LONGEST), n // LONGEST + 1)
        compared = energy[np.minimum(n + shifts, n)] - energy[np.clip(start + shifts, 0, n)]
        lost = int(shifts[np.argmin(compared - 2 * similarity[shifts])])
        shifted = np.zeros(n)
        shifted[max(-lost, 0) : n - max(lost, 0)] = expected[max(lost, 0) : n - max(-lost, 0)]
        after = np.concatenate([[0.0], np.cumsum((measured - shifted) ** 2)])
        cost = before + after[-1] - after
        place = int(np.argmin(cost))
        if lost and cost[place] / before[-1] < best.share:
            after_it = before[-1] - before[place]
            until, from_there = before[place] * (energy[-1] - energy[place]), after_it * energy[place]
            best = LostSamples(place, lost, float(cost[place] / before[-1]), _ratio(until, from_there))
    return best


def _ratio(part: float, whole: float) -> float:
    return float(part / whole) if whole > 0 else float("inf")
