"""Windows: a force window around the pulse, an exponential one on force and response, Hann windows on segments.

With force and response multiplied by exp(-sigma t) the ratio of their transforms is exactly the transfer function at
sigma + i omega, provided that the structure is at rest before the window starts and again at its end.

[Welch1967]: P. D. Welch, The use of fast Fourier transform for the estimation of power spectra, IEEE Transactions on
Audio and Electroacoustics 15(2) (1967) 70-73 (doi:10.1109/TAU.1967.1161901).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray

if TYPE_CHECKING:
    from collections.abc import Iterator

TAPER = 0.25  # of the length of the interval, at each end, outside of it
SHORTEST_TAPER = 4  # samples
PARTS = 16  # of a signal whose levels of noise are compared: more than a pulse fills, and enough for a trend
HANN_HALF_OVERLAP = 1.0 / 18.0  # twice the squared correlation of segments that overlap by half, [Welch1967]


def force_window(n_samples: int, start: int, stop: int) -> FloatArray:
    """Make a window that is 1 on an interval and falls to zero outside in half a cosine.

    Parameters
    ----------
    n_samples : int
        Length of the record.
    start, stop : int
        First sample of the interval, and the one after the last; may lie outside the record.

    Returns
    -------
    (n_samples,) array
        1 inside, 0 far outside.
    """
    taper = taper_length(start, stop)
    sample = np.arange(n_samples)
    distance = np.maximum(np.maximum(start - sample, sample - (stop - 1)), 0)
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.minimum(distance / (taper + 1), 1.0)))


def taper_length(start: int, stop: int) -> int:
    """Return how far a force window reaches beyond its interval.

    Parameters
    ----------
    start, stop : int
        The interval.

    Returns
    -------
    int
        Samples on each side.
    """
    return max(SHORTEST_TAPER, int(TAPER * (stop - start)))


def noise_decays(signal: FloatArray, exponent: FloatArray) -> bool:
    """Tell whether the noise of a signal decays as under an exponential window, rather than staying the same.

    Parameters
    ----------
    signal : (n_samples,) array
        A force: a short pulse, and noise.
    exponent : (n_samples,) array
        Minus the logarithm of the window.

    Returns
    -------
    bool
        Of levels in equal parts of the signal, the logarithms scatter less with the window taken off; false where
        most parts hold no noise.

    Examples
    --------
    >>> noise = np.random.default_rng(0).standard_normal(1024)
    >>> exponent = np.linspace(0, 2, 1024)
    >>> noise_decays(noise, exponent), noise_decays(noise * np.exp(-exponent), exponent)
    (False, True)
    """
    count = len(signal) // PARTS * PARTS
    bends = np.diff(signal[:count], 2, prepend=0.0, append=0.0)  # offsets and slow drifts are no noise
    levels = np.median(bends.reshape(PARTS, -1) ** 2, axis=1)
    is_noise = levels > 0.0
    if np.count_nonzero(is_noise) <= PARTS / 2:
        return False
    steady = np.log(levels[is_noise])
    windowed = steady + 2 * np.mean(exponent[:count].reshape(PARTS, -1), axis=1)[is_noise]
    return bool(_scatter(windowed) < _scatter(steady))


def _scatter(values: FloatArray) -> float:
    return float(np.mean(np.abs(values - np.median(values))))


def exponential_window(n_samples: int, step_s: float, decay_1_s: float, origin: int) -> FloatArray:
    """Make an exponential window that is 1 at the impact.

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


def impact_windows(
    n_samples: int, force_interval: tuple[int, int], decay: float, trigger: int
) -> tuple[FloatArray, FloatArray]:
    """Make the windows of an impact: one of its force, one of its responses.

    What precedes the pulse is noise, and what moves still from before. An exponential window would magnify both, the
    more the further they are from the pulse, so it begins with the force window.

    Parameters
    ----------
    n_samples : int
        Length of the record.
    force_interval : pair of int
        First sample of the force that is kept, and the one after the last.
    decay : float
        Rate of the exponential window times the time step; 0 for none.
    trigger : int
        Sample at which the exponential window is 1.

    Returns
    -------
    pair of (n_samples,) array
        Of the force, of the responses.

    Examples
    --------
    >>> force, responses = impact_windows(40, (12, 20), 0.1, 12)
    >>> bool((responses[:7] == 0.0).all()), bool(np.isclose(responses[8], np.exp(0.4), rtol=1e-12, atol=0.0))
    (True, True)
    """
    of_force, of_responses = force_window(n_samples, *force_interval), np.ones(n_samples)
    if decay:
        of_responses = exponential_window(n_samples, 1.0, decay, trigger) * (np.cumsum(of_force) > 0.0)
    return of_force * of_responses, of_responses


def window_impact(
    signals: FloatArray, n_samples: int, force_interval: tuple[int, int], decay: float, trigger: int
) -> FloatArray:
    """Give the force within its pulse and the responses, under a window, filled up with zeros to a common length.

    Parameters
    ----------
    signals : (1 + n_outputs, n) array
        The force first.
    n_samples : int
        The common length, at least n.
    force_interval : pair of int
        First sample of the force that is kept, and the one after the last.
    decay : float
        Rate of the exponential window times the time step; 0 for none.
    trigger : int
        Sample at which the window is 1.

    Returns
    -------
    (1 + n_outputs, n_samples) array
        The force first.
    """
    of_force, of_responses = impact_windows(n_samples, force_interval, decay, trigger)
    windowed = np.zeros((len(signals), n_samples))
    windowed[:, : signals.shape[1]] = signals
    windowed[0] *= of_force
    windowed[1:] *= of_responses
    return windowed


def correlated_lines(decay: float) -> int:
    """Return over how many lines the noise is correlated by an exponential window: its noise bandwidth.

    Parameters
    ----------
    decay : float
        Rate times length of the record.

    Returns
    -------
    int
        At least 1. One in so many lines is independent: a fit takes one in so many, where they are enough.
    """
    if decay < 1e-6:
        return 1
    return max(1, round(0.5 * decay / math.tanh(0.5 * decay)))


def cut_segments(signals: FloatArray, length: int) -> Iterator[FloatArray]:
    """Cut signals into segments that overlap by half, under Hann windows, [Welch1967].

    Parameters
    ----------
    signals : (n_signals, n_samples) array
        Force and responses.
    length : int
        Samples of a segment.

    Yields
    ------
    (n_signals, length) array
        One segment after the other.
    """
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    for start in range(0, signals.shape[1] - length + 1, max(length // 2, 1)):
        yield signals[:, start : start + length] * window


def count_independent_segments(count: int) -> float:
    """Return how many independent segments half-overlapping ones under Hann windows are worth, [Welch1967].

    Parameters
    ----------
    count : int
        Segments.

    Returns
    -------
    float
        A little less than `count`.
    """
    return count / (1.0 + HANN_HALF_OVERLAP * (count - 1) / count) if count else 0.0
