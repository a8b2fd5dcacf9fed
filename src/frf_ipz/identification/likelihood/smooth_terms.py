"""The part of modes outside the band inside it: smooth terms, linear in their coefficients.

In receptance these are ``1/s^2`` of rigid-body motion and modes far below, a constant of modes far above, and for modes
that are not so far pairs of fixed poles beside the band. A rational function with poles on both sides of the band takes
the shape of any modes there [Levin1964], and unlike a power series it can be exported as a state space.

[Levin1964] A. L. Levin, E. B. Saff, Potential theoretic tools in polynomial and rational approximation, in: Harmonic
Analysis and Rational Approximation, LNCIS 327, Springer, 2006, doi:10.1007/11601609_5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.numerics.partial_fractions import pair_columns, stacked

ABOVE = (1.3, 1.08, 2.0)  # fixed poles above the band, in the order in which they are taken, by its highest frequency
BELOW = (0.5, 0.9)  # the same below, by its lowest frequency
FIXED_DAMPING = (
    0.02  # damping ratio of a fixed pole: its residue is complex, so that it takes damping out of band as well
)
POWERS = (0, -2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SmoothTerms:
    """Smooth terms of a band.

    Parameters
    ----------
    powers : tuple of int
        Powers of s in receptance.
    poles : (n_fixed,) complex array
        Fixed poles beside the band, rad/s.
    scale_rad_s : float
        s is divided by this before it is raised to a power.
    """

    powers: tuple[int, ...]
    poles: ComplexArray
    scale_rad_s: float

    @property
    def n_columns(self) -> int:
        """Number of real coefficients of an FRF."""
        return len(self.powers) + 2 * len(self.poles)

    def columns(self, s: ComplexArray) -> FloatArray:
        """Stacked columns of the terms.

        Parameters
        ----------
        s : (n_lines,) complex array
            rad/s.

        Returns
        -------
        (2 n_lines, n_columns) array
            Powers first, then real and imaginary part of each fixed pole's residue in turn.
        """
        in_turn = np.arange(2 * len(self.poles)).reshape(2, -1).T.ravel()
        return np.concatenate([stacked(self.powers_of(s)), pair_columns(s, self.poles)[:, in_turn]], axis=1)

    def powers_of(self, s: ComplexArray) -> ComplexArray:
        """Give the powers of s.

        Parameters
        ----------
        s : (n_lines,) complex array
            rad/s.

        Returns
        -------
        (n_lines, n_powers) complex array
            Of s over `scale_rad_s`.
        """
        ratio = s / self.scale_rad_s
        inverse = 1 / ratio  # a power of -2 takes NumPy many times as long as a square
        return np.stack([(inverse if power < 0 else ratio) ** abs(power) for power in self.powers], axis=1)

    def first(self, n_fixed: int) -> SmoothTerms:
        """Select the first fixed poles.

        Parameters
        ----------
        n_fixed : int
            Number of fixed poles.

        Returns
        -------
        SmoothTerms
            With these fixed poles.
        """
        return SmoothTerms(powers=self.powers, poles=self.poles[:n_fixed], scale_rad_s=self.scale_rad_s)


def smooth_terms_of_band(band_hz: tuple[float, float], spacing_hz: float) -> SmoothTerms:
    """All the smooth terms that a band may need, the most useful first.

    Parameters
    ----------
    band_hz : pair of float
        Lowest and highest fitted frequency, Hz.
    spacing_hz : float
        Distance of lines, Hz: a band that starts within a few of 0 has nothing below.

    Returns
    -------
    SmoothTerms
        Powers of s and fixed poles.
    """
    low, high = band_hz
    below = BELOW if low > 10 * spacing_hz else ()
    frequencies = [high * ABOVE[0], *(low * ratio for ratio in below[:1]), high * ABOVE[1]]
    frequencies += [*(low * ratio for ratio in below[1:]), high * ABOVE[2]]
    omega = 2 * np.pi * np.array(frequencies)
    poles = omega * (-FIXED_DAMPING + 1j * np.sqrt(1 - FIXED_DAMPING**2))
    return SmoothTerms(powers=POWERS, poles=poles, scale_rad_s=2 * np.pi * high)
