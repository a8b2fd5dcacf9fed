"""Windows: a force window around the pulse, an exponential one that force and response share.

With both multiplied by exp(-sigma t) the ratio of their transforms is exactly the transfer function at sigma + i omega,
provided that the structure is at rest before the window starts and nothing is left at its end.
"""

from __future__ import annotations

import math

import numpy as np

from frf_ipz.arrays import FloatArray

TAPER = 0.25  # of the kept stretch, at each end, outside of it
SHORTEST_TAPER = 4  # samples


def force_window(n_samples: int, start: int, stop: int) -> FloatArray:
    """Make a window that keeps a stretch and falls to zero outside in half a cosine.

    Parameters
    ----------
    n_samples : int
        Length of the record.
    start, stop : int
        First sample that is kept whole, and the one after the last; may lie outside the record.

    Returns
    -------
    (n_samples,) array
        1 inside, 0 far outside.
    """
    taper = taper_length(start, stop)
    sample = np.arange(n_samples)
    outside = np.maximum(np.maximum(start - sample, sample - (stop - 1)), 0)
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.minimum(outside / (taper + 1), 1.0)))


def taper_length(start: int, stop: int) -> int:
    """Return how far a force window reaches beyond the stretch it keeps.

    Parameters
    ----------
    start, stop : int
        The stretch.

    Returns
    -------
    int
        Samples on each side.
    """
    return max(SHORTEST_TAPER, int(TAPER * (stop - start)))


def exponential_window(n_samples: int, step_s: float, decay_1_s: float, origin: int) -> FloatArray:
    """Make an exponential window that is 1 at the blow.

    Parameters
    ----------
    n_samples : int
        Length of the record.
    step_s : float
        Time step, s.
    decay_1_s : float
        Rate sigma.
    origin : int
        Sample at which it is 1.

    Returns
    -------
    (n_samples,) array
        exp(-sigma (t - t_origin)).
    """
    return np.asarray(np.exp(-decay_1_s * step_s * (np.arange(n_samples) - origin)))


def correlated_lines(decay: float) -> int:
    """Return over how many lines the noise is correlated by an exponential window: its noise bandwidth.

    Parameters
    ----------
    decay : float
        Rate times length of the record.

    Returns
    -------
    int
        At least 1. Of so many lines one is independent: whoever fits takes one in so many.
    """
    if decay < 1e-6:
        return 1
    return max(1, round(0.5 * decay / math.tanh(0.5 * decay)))
