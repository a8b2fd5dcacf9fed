"""The measuring chain: anti-alias filter, noise, quantisation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from frf_testbench.simulator.signals.laplace import LaplaceGrid

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class AntiAlias:
    """The filter of a sigma-delta converter, the same for all channels.

    Parameters
    ----------
    passband, stopband : float
        Edges, as fractions of the sampling rate.
    attenuation_db : float
        In the stopband.
    symmetric : bool
        Linear phase: it rings before an impact too. Otherwise the minimum-phase filter of the same gain.
    """

    passband: float = 0.42
    stopband: float = 0.5
    attenuation_db: float = 100.0
    symmetric: bool = True

    def taps(self, oversampling: int) -> FloatArray:
        """Return the impulse response at the oversampled rate; an odd number of taps."""
        width = 2 * (self.stopband - self.passband) / oversampling
        count, beta = signal.kaiserord(self.attenuation_db, width)
        cutoff = (self.passband + self.stopband) / oversampling
        taps = signal.firwin(2 * (count // 2) + 1, cutoff, window=("kaiser", beta))
        return np.asarray(taps if self.symmetric else signal.minimum_phase(taps, half=False))

    def gain(self, grid: LaplaceGrid) -> ComplexArray:
        """Return the (n_lines,) transfer function on the lines of a grid; without delay where it is symmetric."""
        taps = self.taps(grid.oversampling)
        steps = np.arange(taps.size) - (taps.size // 2 if self.symmetric else 0)
        delay = steps / (grid.rate_hz * grid.oversampling)
        impulse_response = np.zeros(grid.n_padded * grid.oversampling)
        impulse_response[steps] = taps * np.exp(-grid.sigma_1_s * delay)  # negative steps wrap to the end
        return np.fft.rfft(impulse_response)[: grid.n_padded // 2 + 1]


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """Noise of one channel.

    Parameters
    ----------
    rms : float
        In the channel's unit.
    pink_fraction : float
        Share of the power whose spectrum falls as 1/f.
    """

    rms: float
    pink_fraction: float = 0.0

    def draw(self, rng: np.random.Generator, n: int) -> FloatArray:
        """Draw (n,) noise."""
        white = rng.standard_normal(n)
        lines = np.fft.rfft(rng.standard_normal(n))
        lines /= np.sqrt(np.maximum(np.arange(lines.size), 1))
        pink = np.fft.irfft(lines, n)
        pink *= 1 / pink.std()
        mixed = np.sqrt(1 - self.pink_fraction) * white + np.sqrt(self.pink_fraction) * pink
        return np.asarray(self.rms * mixed)


def quantise(values: FloatArray, full_scale: float, bits: int) -> FloatArray:
    """Round a signal to the steps of a converter, and clip it at the ends of its range.

    Parameters
    ----------
    values : array
        Signal.
    full_scale : float
        Largest value that is not clipped.
    bits : int
        Resolution.

    Returns
    -------
    array
        Whole multiples of the step.
    """
    step = full_scale / 2 ** (bits - 1)
    return np.asarray(np.clip(np.round(values / step), -(2 ** (bits - 1)), 2 ** (bits - 1) - 1) * step)
