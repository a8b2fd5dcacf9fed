"""Motion of a location that nobody measured: by the model, and corrected by the sensors.

A law's force g at a location moves the location by u = -G_pp g and each sensor by (G_sp / G_pp) u. So u follows from
the excess of the sensors' motion over the linear response, line by line, as the mean of its posterior: errors of the
model on resonances do not enter, and where no sensor responds to the location, the prior is what remains. Force and law
need not be known.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import uniform_filter1d

from frf_ipz.arrays import ComplexArray, FloatArray

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.segments import SegmentSet

OVERSAMPLING = 4
FADE = (0.76, 0.86)  # part of the segment over which the end is faded out: exp(sigma t) amplifies errors there
SMOOTHED_LINES = 7  # over which sizes are averaged
CORRECTION = 0.3  # of the law's motion: standard deviation of its correction by the data
LINEAR_CORRECTION = 0.01  # of the linear motion, besides
HIGHEST = 0.45  # of the sampling rate: above, recordings hold nothing


@dataclass(frozen=True, slots=True, eq=False)
class NumericalLaplace:
    """Transforms between lines in the s-plane and times.

    Parameters
    ----------
    segments : SegmentSet
        Which lines.
    oversampling : int
        Times per sample.
    fades : bool
        The end is faded out: needed for signals from noisy lines, not for simulated ones.
    """

    segments: SegmentSet
    oversampling: int = OVERSAMPLING
    fades: bool = True

    @property
    def n_times(self) -> int:
        """Number of times."""
        return self.oversampling * self.segments.n_samples

    @property
    def step_s(self) -> float:
        """Step of the times, s."""
        return self.segments.step_s / self.oversampling

    def window(self) -> FloatArray:
        """(n_times,) exp(-sigma t), faded out at the end."""
        return np.asarray(np.exp(-self.segments.sigma_1_s * self.step_s * np.arange(self.n_times)) * self._fade())

    def at_times(self, lines: ComplexArray) -> FloatArray:
        """Signals, (n_segments, n_times), from their transforms, (n_segments, n_lines).

        A segment that starts in motion starts with a jump, of which a finite series gives half at time 0. It is
        subtracted before and added after.
        """
        signals = self._sum_series(lines)
        jumps = np.where(self.segments.moving, 2 * signals[:, 0], 0.0)[:, None]
        if jumps.any():
            signals = jumps * self._fade() + self._sum_series(lines - jumps / self.segments.s)
        return signals

    def _sum_series(self, lines: ComplexArray) -> FloatArray:
        recorded = np.where(self.segments.s.imag <= 2 * np.pi * HIGHEST / self.segments.step_s, lines, 0.0)
        padded = np.zeros((len(lines), self.n_times // 2 + 1), complex)
        padded[:, : lines.shape[-1]] = recorded
        growth = np.exp(self.segments.sigma_1_s * self.step_s * np.arange(self.n_times)) * self._fade()
        return np.asarray(np.fft.irfft(padded, self.n_times, axis=-1) * (growth / self.step_s))

    def at_lines(self, signals: FloatArray) -> ComplexArray:
        """Transform signals, (..., n_times), to (..., n_lines)."""
        window = self.window() * self.step_s
        window[0] /= 2  # a jump at the start counts by half; from rest there is nothing
        lines = np.fft.rfft(signals * window, axis=-1)
        return np.asarray(lines[..., : len(self.segments.s)])

    def velocity(self, signals: FloatArray) -> FloatArray:
        """Derive signals, (..., n_times), to the fourth order."""
        ahead, back = np.roll(signals, -1, -1), np.roll(signals, 1, -1)
        far = np.roll(signals, -2, -1) - np.roll(signals, 2, -1)
        slope = (8 * (ahead - back) - far) / (12 * self.step_s)
        slope[..., :2] = (signals[..., 1:3] - signals[..., :2]) / self.step_s
        slope[..., -2:] = 0.0
        return np.asarray(slope)

    def _fade(self) -> FloatArray:
        if not self.fades:
            return np.ones(self.n_times)
        part = np.arange(self.n_times) / self.n_times
        return np.clip((FADE[1] - part) / (FADE[1] - FADE[0]), 0.0, 1.0)


def estimate_motion(
    segments: SegmentSet,
    excess: ComplexArray,
    linear: ComplexArray,
    ratio: ComplexArray,
    by_law: ComplexArray | None = None,
) -> ComplexArray:
    """Estimate the motion of a location.

    Parameters
    ----------
    segments : SegmentSet
        The data.
    excess : (n_segments, n_sensors, n_lines) complex array
        Motion of the sensors minus the linear response, m s.
    linear : (n_segments, n_lines) complex array
        Linear motion of the location, m s.
    ratio : (n_sensors, n_lines) complex array
        Motion of the sensors over that of the location, for a force at the location.
    by_law : (n_segments, n_lines) complex array, optional
        Motion by the force of a law, where one is known already.

    Returns
    -------
    (n_segments, n_lines) complex array
        m s.
    """
    spread = _smooth_size(linear)
    start: ComplexArray | float = 0.0
    if by_law is not None:
        start = by_law
        excess = excess - ratio * by_law[:, None]
        spread = CORRECTION**2 * _smooth_size(by_law) + LINEAR_CORRECTION**2 * spread
    weight = 1 / segments.variance
    projection = np.sum(ratio.conj() * excess * weight, 1)
    precision = np.sum(np.abs(ratio) ** 2 * weight, 1) + 1 / np.maximum(spread, 1e-300)
    return np.asarray(linear + start + projection / precision)


def _smooth_size(lines: ComplexArray) -> FloatArray:
    return uniform_filter1d(np.abs(lines) ** 2, SMOOTHED_LINES, axis=-1, mode="nearest")
