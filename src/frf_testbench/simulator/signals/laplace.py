"""Exact linear responses by transforms along a line parallel to the imaginary axis.

A signal is multiplied by exp(-sigma t) before the transform and the result by exp(sigma t) after it. The transfer
function is evaluated at s = sigma + i omega, so that no step size and no interpolation enters, and with the padding no
wrap-around: what comes out is the response of the continuous system, filtered and sampled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

PADDING = 2  # the period of the transforms over the length of the record
WRAP_DECAY = 12.0  # what comes round is smaller by exp(-12) = 6e-6, besides its own decay


@dataclass(frozen=True, slots=True, kw_only=True)
class LaplaceGrid:
    """Sampling of a record, and the lines in the s-plane that belong to it.

    Parameters
    ----------
    n_samples : int
        Length of the record.
    rate_hz : float
        Its sampling rate.
    oversampling : int
        Inputs are given at this multiple of the rate.
    """

    n_samples: int
    rate_hz: float
    oversampling: int = 8

    @property
    def n_padded(self) -> int:
        """Period of the transforms, samples at the rate of the record."""
        return 2 * ((PADDING * self.n_samples + 1) // 2)

    @property
    def sigma_1_s(self) -> float:
        """Real part of the lines."""
        return WRAP_DECAY * self.rate_hz / self.n_padded

    @property
    def fine_time_s(self) -> FloatArray:
        """Times of the oversampled record."""
        return np.arange(self.n_samples * self.oversampling) / (self.rate_hz * self.oversampling)

    @property
    def s(self) -> ComplexArray:
        """(n_lines,) lines from zero to half the sampling rate."""
        lines = np.arange(self.n_padded // 2 + 1) * self.rate_hz / self.n_padded
        return np.asarray(self.sigma_1_s + 2j * np.pi * lines, np.complex128)

    @property
    def fine_s(self) -> ComplexArray:
        """Lines from zero to half the oversampled rate."""
        n = self.n_padded * self.oversampling
        lines = np.arange(n // 2 + 1)
        return np.asarray(self.sigma_1_s + 2j * np.pi * lines * self.rate_hz / self.n_padded, np.complex128)

    def spectrum(self, fine: FloatArray, *, all_lines: bool = False) -> ComplexArray:
        """Transform of a signal at the oversampled rate.

        Parameters
        ----------
        fine : (..., n_fine) array
            From time zero on.
        all_lines : bool
            Up to half the oversampled rate instead of half the rate.

        Returns
        -------
        (..., n_lines) complex array
            On `s`, or on `fine_s`.
        """
        n = self.n_padded * self.oversampling
        step = 1 / (self.rate_hz * self.oversampling)
        damped = fine * np.exp(-self.sigma_1_s * step * np.arange(fine.shape[-1]))
        lines = np.fft.rfft(damped, n, axis=-1)
        return np.asarray((lines if all_lines else lines[..., : self.n_padded // 2 + 1]) / self.oversampling)

    def signal(self, spectrum: ComplexArray) -> FloatArray:
        """(..., n_samples) signal at the rate of the record, of a spectrum on `s`."""
        damped = np.fft.irfft(spectrum, self.n_padded, axis=-1)[..., : self.n_samples]
        return np.asarray(damped * np.exp(self.sigma_1_s * np.arange(self.n_samples) / self.rate_hz))

    def fine_signal(self, spectrum: ComplexArray) -> FloatArray:
        """(..., n_fine) signal at the oversampled rate, of a spectrum on `fine_s`."""
        n = self.n_padded * self.oversampling
        damped = np.fft.irfft(spectrum * self.oversampling, n, axis=-1)[..., : self.n_samples * self.oversampling]
        return np.asarray(damped * np.exp(self.sigma_1_s * self.fine_time_s))
