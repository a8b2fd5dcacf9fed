"""Periodic excitation: over a whole number of periods a transform has no leakage."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from scipy import fft

    from frf_ipz.arrays import FloatArray
else:
    fft = import_late("scipy.fft")

DIFFERENT = 0.01  # of the mean square: the same force again differs by noise and by the shaker's own distortion
CHANGED = 0.5  # of the mean square
SHORTEST = 16  # samples


def find_period(force: FloatArray) -> int:
    """Find after how many samples a force comes again and again.

    Parameters
    ----------
    force : (n,) array
        As recorded; its start may be that of a switched-on generator.

    Returns
    -------
    int
        Samples of a period; 0 where it does not repeat at least once, as noise and sweeps do not.

    Examples
    --------
    >>> noise = np.random.default_rng(1).standard_normal(100)
    >>> find_period(np.tile(noise, 4)), find_period(np.random.default_rng(2).standard_normal(400))
    (100, 0)
    """
    signal = force - force.mean()
    n_samples = len(signal)
    lags = np.arange(SHORTEST, n_samples // 2 + 1)
    if not len(lags) or not np.any(signal):
        return 0
    padded = fft.next_fast_len(2 * n_samples, real=True)
    correlation = fft.irfft(np.abs(fft.rfft(signal, padded)) ** 2, padded)[lags]
    power = np.concatenate([[0.0], np.cumsum(signal**2)])
    both = power[n_samples - lags] + power[-1] - power[lags]  # of the signal without its end, and without its start
    difference = 1.0 - 2.0 * correlation / np.where(both > 0.0, both, np.inf)
    has_changed = np.maximum.accumulate(difference) > CHANGED  # a force with few high frequencies begins by being alike
    again = np.flatnonzero(has_changed & (difference < DIFFERENT))
    if not len(again):
        return 0
    end = int(again[0])
    while end + 1 < len(lags) and difference[end + 1] < difference[end]:
        end += 1
    period = int(lags[end])
    last = n_samples // 2 // period * period  # noise in a narrow band is alike after one cycle, and not after many
    return period if difference[last - SHORTEST] < DIFFERENT else 0
