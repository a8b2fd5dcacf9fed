"""Noise of the channels: a white and a 1/f part each, from what blows at the same place do not share.

The residual of a blow against the FRF of all blows is noise of the response and noise of the force times the FRF. The
force's noise is read from the force itself, where nothing touches; the response's is what is left. Lines at which the
residual stands out of that model (resonances of something nonlinear) do not count.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls

from frf_ipz.arrays import FloatArray

ROUNDS = 12
OUTLIER = 6.0  # times the modelled energy of a line: left out; of noise alone, 1 line in 400 at most
SMALLEST = 1e-12  # of the largest: keeps weights finite


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """Two-sided power spectral density of one channel.

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
        """Give the density.

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

    def rounded(self, signals: Iterable[FloatArray], step_s: float) -> Noise:
        """Give what a recorder's steps leave: a channel that stays on one step seems to have no noise.

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
        Mean squared moduli of residuals.
    gain : (n,) array
        Energy that a density of 1 gives on each line.
    known : (n,) array
        Energy that is already explained.

    Returns
    -------
    Noise
        Not negative; at least a trace of white noise.
    """
    found = _fit(np.stack([gain, gain / frequency_hz], 1), energy, known)
    white = max(float(found[0]), SMALLEST * float(np.median(energy / gain)))
    return Noise(white=white, pink=float(found[1]))


def fit_force_noise(
    frequency_hz: FloatArray, energy: FloatArray, gain: FloatArray, squared_frf: FloatArray, known: FloatArray
) -> Noise:
    """Fit noise of the force that residuals of a response show through its FRF.

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
    own = np.stack([gain, gain / frequency_hz], 1)
    found = _fit(np.hstack([own, own * squared_frf[:, None]]), energy, known)
    return Noise(white=float(found[2]), pink=float(found[3]))


def _fit(shape: FloatArray, energy: FloatArray, known: FloatArray) -> FloatArray:
    largest = float(energy.max(initial=0.0))
    if largest <= 0:
        return np.zeros(shape.shape[1])
    energy, known = energy / largest, known / largest
    left = np.maximum(energy - known, 0.0)
    model = np.full(len(energy), max(float(np.median(left)), SMALLEST * float(energy.max(initial=1e-300))))
    found = np.zeros(shape.shape[1])
    found[0] = float(np.median(left / shape[:, 0]))
    for _ in range(ROUNDS):
        total = model + known
        use = energy < OUTLIER * total
        if use.sum() < max(10, len(energy) // 10):
            break
        weight = 1 / total[use]
        scale = shape[use].max(0)
        found = nnls(shape[use] / scale * weight[:, None], (energy - known)[use] * weight)[0] / scale
        model = np.maximum(shape @ found, SMALLEST)
    return found * largest
