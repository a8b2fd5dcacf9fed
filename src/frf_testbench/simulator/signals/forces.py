"""Forces: hammer pulses, double hits, random shaker forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

RISE, FALL = 1.7, 2.1  # exponents of u^RISE (1 - u)^FALL: a hammer's pulse rises faster than it falls


@dataclass(frozen=True, slots=True, kw_only=True)
class Impact:
    """One impact of a hammer.

    Parameters
    ----------
    peak_n : float
        Largest force.
    start_s : float
        When the tip touches.
    contact_s : float
        How long it touches.
    rebound : tuple of float
        Delay, s, and size, as a fraction, of a second contact; empty for a clean impact.
    """

    peak_n: float
    start_s: float
    contact_s: float
    rebound: tuple[float, ...] = ()

    def force(self, time_s: FloatArray) -> FloatArray:
        """Return the (n,) force, N."""
        force = self.peak_n * _pulse((time_s - self.start_s) / self.contact_s)
        if self.rebound:
            delay, size = self.rebound
            late = (time_s - self.start_s - delay) / (1.25 * self.contact_s)  # a slower touch lasts longer
            force += size * self.peak_n * _pulse(late)
        return force


def _pulse(u: FloatArray) -> FloatArray:
    inside = np.clip(u, 0, 1)
    top = RISE / (RISE + FALL)
    return np.asarray(inside**RISE * (1 - inside) ** FALL / (top**RISE * (1 - top) ** FALL))


def draw_impacts(
    rng: np.random.Generator, count: int, *, peak_n: float, spread: float, contact_s: float, start_s: float
) -> tuple[Impact, ...]:
    """Draw the impacts of one person at one point: different levels, nearly the same pulse.

    Parameters
    ----------
    rng : Generator
        Of the case.
    count : int
        How many.
    peak_n : float
        The strongest.
    spread : float
        Strongest over weakest.
    contact_s : float
        Contact time of the strongest; weaker ones last longer, as in Hertz's contact.
    start_s : float
        When the tip touches, within half a contact time.

    Returns
    -------
    tuple of Impact
        In random order of level.
    """
    levels = spread ** -np.linspace(0, 1, count) if count > 1 else np.ones(1)
    levels = rng.permutation(levels * np.exp(0.05 * rng.standard_normal(count)))
    levels /= levels.max()
    return tuple(
        Impact(
            peak_n=peak_n * level,
            start_s=start_s + contact_s * rng.uniform(-0.5, 0.5),
            contact_s=contact_s * level**-0.1 * float(np.exp(0.02 * rng.standard_normal())),
        )
        for level in levels.tolist()
    )


def draw_random_force(
    rng: np.random.Generator, time_s: FloatArray, band_hz: tuple[float, float], *, taper_s: float, burst: float = 1.0
) -> FloatArray:
    """Draw a band-limited random force of unit RMS, from rest to rest.

    Parameters
    ----------
    rng : Generator
        Of the case.
    time_s : (n,) array
        Uniform times.
    band_hz : tuple of float
        Edges of the band that is excited.
    taper_s : float
        Length of the rise and of the fall.
    burst : float
        Fraction of the record that is excited.

    Returns
    -------
    (n,) array
        Force over its RMS.
    """
    n, step = time_s.size, float(time_s[1] - time_s[0])
    frequencies = np.fft.rfftfreq(n, step)
    excited = np.flatnonzero((frequencies >= band_hz[0]) & (frequencies <= band_hz[1]))
    lines = np.zeros(frequencies.size, dtype=complex)  # the same force at any oversampling
    lines[excited] = rng.standard_normal(excited.size) + 1j * rng.standard_normal(excited.size)
    force = np.fft.irfft(lines, n)
    end = burst * time_s[-1]
    rise = np.clip(np.minimum(time_s, end - time_s) / taper_s, 0, 1)
    return np.asarray(force / force.std() * np.sin(np.pi / 2 * rise) ** 2)
