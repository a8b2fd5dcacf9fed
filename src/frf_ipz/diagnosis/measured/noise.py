"""Noise of the channels: a white and a 1/f part each, from what repeated records do not have in common.

The misfit of a record against the FRF of all records of its group is noise of the response and noise of the force times
the FRF. The force's noise is read from the force itself, where nothing touches; the response's is the rest. Lines at
which the misfit stands out of that model (resonances of something nonlinear) do not count.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy import special
from scipy.optimize import nnls

from frf_ipz.arrays import FloatArray

ROUNDS = 12
OUTLIER = 6.0  # times the modelled energy of a line: left out; of noise alone, 1 line in 400 at most
SMALLEST = 1e-12  # of the largest: keeps weights finite


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """Two-sided power spectral density of one channel's noise.

    Parameters
    ----------
    white : float
        unit^2 s.
    pink : float
        unit^2: density at the frequency f is ``white + pink / f``.
    """

    white: float
    pink: float = 0.0

    def density(self, frequency_hz: FloatArray) -> FloatArray:
        """Evaluate the density.

        Parameters
        ----------
        frequency_hz : (n,) array
            Hz, above 0.

        Returns
        -------
        (n,) array
            unit^2 s.
        """
        return self.white + self.pink / np.maximum(frequency_hz, 1e-9)

    def autocovariance(self, n_samples: int, step_s: float, longest_s: float) -> FloatArray:
        """Compute what neighbouring samples have in common.

        Parameters
        ----------
        n_samples : int
            How many.
        step_s : float
            Between samples, s.
        longest_s : float
            Longest period that counts: slower noise is an offset.

        Returns
        -------
        (n_samples,) array
            Covariance with the first sample, unit^2: the transform of the density up to half the rate.
        """
        lags = step_s * np.arange(n_samples)
        slowest, fastest = 1 / longest_s, 0.5 / step_s
        pink = np.full(n_samples, np.log(fastest / slowest))
        pink[1:] = special.sici(2 * np.pi * fastest * lags[1:])[1] - special.sici(2 * np.pi * slowest * lags[1:])[1]
        covariance = 2 * self.pink * pink
        covariance[0] += self.white / step_s
        return covariance

    def rounded(self, signals: Iterable[FloatArray], step_s: float) -> Noise:
        """Add the quantisation noise of a recorder: a channel that stays on one step seems to have no noise.

        Parameters
        ----------
        signals : iterable of (n_samples,) array
            Of the channel, unit.
        step_s : float
            Between samples, s.

        Returns
        -------
        Noise
            With at least the white noise of a rounding, a twelfth of the squared step.
        """
        step = min((np.diff(np.unique(signal)).min(initial=np.inf) for signal in signals), default=np.inf)
        return replace(self, white=max(self.white, float(step) ** 2 / 12 * step_s)) if np.isfinite(step) else self


def fit_noise(frequency_hz: FloatArray, energy: FloatArray, gain: FloatArray, known: FloatArray) -> Noise:
    """Fit white and 1/f noise to energies of lines.

    Parameters
    ----------
    frequency_hz : (n,) array
        Hz, above 0.
    energy : (n,) array
        Mean squared moduli of misfits.
    gain : (n,) array
        Energy that a density of 1 gives on each line.
    known : (n,) array
        Energy that is already explained.

    Returns
    -------
    Noise
        Not negative; at least a trace of white noise.
    """
    parts = _fit_parts(np.stack([gain, gain / frequency_hz], 1), energy, known)
    white = max(float(parts[0]), SMALLEST * float(np.median(energy / gain)))
    return Noise(white=white, pink=float(parts[1]))


def fit_force_noise(
    frequency_hz: FloatArray, energy: FloatArray, gain: FloatArray, squared_frf: FloatArray, known: FloatArray
) -> Noise:
    """Fit noise of the force that misfits of a response show through its FRF.

    Parameters
    ----------
    frequency_hz, energy, gain
        As for `fit_noise`.
    squared_frf : (n,) array
        Squared modulus of the FRF.
    known : (n,) array
        As for `fit_noise`.

    Returns
    -------
    Noise
        Of the force, white and 1/f.
    """
    of_response = np.stack([gain, gain / frequency_hz], 1)
    parts = _fit_parts(np.hstack([of_response, of_response * squared_frf[:, None]]), energy, known)
    return Noise(white=float(parts[2]), pink=float(parts[3]))


def _fit_parts(shapes: FloatArray, energy: FloatArray, known: FloatArray) -> FloatArray:
    """Fit energies by non-negative parts of shapes, (n_shapes,), weighted by the model and without outliers."""
    largest = float(energy.max(initial=0.0))
    if largest <= 0:
        return np.zeros(shapes.shape[1])
    energy, known = energy / largest, known / largest
    unknown = np.maximum(energy - known, 0.0)
    parts = np.zeros(shapes.shape[1])
    parts[0] = float(np.median(unknown / shapes[:, 0]))
    model = np.maximum(parts[0] * shapes[:, 0], SMALLEST)  # lines may differ by the ranges of a recorder
    for _ in range(ROUNDS):
        total = model + known
        use = energy < OUTLIER * total
        if use.sum() < max(10, len(energy) // 10):
            break
        weight = 1 / total[use]
        scale = shapes[use].max(0)
        parts = nnls(shapes[use] / scale * weight[:, None], (energy - known)[use] * weight)[0] / scale
        model = np.maximum(shapes @ parts, SMALLEST)
    return parts * largest
