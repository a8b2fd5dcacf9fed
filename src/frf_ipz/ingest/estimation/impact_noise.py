"""What is known of the errors of impacts beside their scatter, and the FRFs and variances that follow from all.

The noise of the force, of power N in each of n impacts, adds to the sum S of the force's squared moduli: H1 is too low
by (S - n N) / S. The noise is measured outside of the pulses, so its part is subtracted. Where S is what noise alone
gives (a gamma distribution of n degrees of freedom) nothing is known of the force, and the FRF has no variance.
Elsewhere, with v the unexplained power of one impact,

    var(H) = (v + |H|^2 N (n N / S)) S / (S - n N)^2

to the second order in the noise. Where the noise of impact k has the power v s_k (amplifiers that choose their range),
and h_k is its share of S, the scatter of n impacts has the expectation ``v sum s_k (1 - h_k)`` and the variance is
``v sum s_k h_k / S``. An impact whose record begins within the pulse lacks a part L of the force; its response is that
to F + L, but for what moved before: H is wrong by about L / F, and by L / F times the ratio of response and force while
the pulse lasts. What the end of a record cuts off of a mode is a part of it too, the same on all of its lines.

[Bendat2010]: J. S. Bendat, A. G. Piersol, Random Data, 4th ed., Wiley 2010 (doi:10.1002/9781118032428), section 6.1,
for the bias of H1.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.estimation.variance import frf_variance
from frf_ipz.ingest.signals.faults import MOST_MISSING
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy import special

    from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
    from frf_ipz.ingest.estimation.spectra import SpectrumSums
else:
    special = import_late("scipy.special")

CHANCE = 1e-6  # share of lines without a force that are taken for one with
SCATTER = 0.05  # share of estimates of a variance that are further above it
LEAST_FORCE = 1e-5  # of its largest power, 50 dB: a force that was cut to its pulse does not show its own noise


@dataclass(slots=True, kw_only=True, eq=False)
class ImpactNoise:
    """Sums over the impacts of each response.

    Parameters
    ----------
    response, force : (n_outputs, n_lines) array
        Noise power of the transforms of responses and force, measured in each impact itself.
    scaled_force : (n_outputs, n_lines) array
        Squared modulus of the force times the relative noise power s of the impact.
    scales : (n_outputs, 1) array
        Relative noise powers s.
    doubts : (n_outputs, 1) array
        Factors on the variance by the scatter: more than 1 where the impacts are two groups.
    missing_force : (n_outputs, n_lines) complex array
        What the record lacks of the force, times the conjugate of what it holds.
    missing_response : (n_outputs, n_lines) array
        The same of the response, as moduli.
    cut_off : (n_outputs, n_lines) array
        What would follow the end of the response, times the modulus of the force, as moduli.
    restored : (n_outputs, n_lines) array
        Deviation of what was restored of an overloaded response, times the modulus of the force.
    pulse : (n_outputs, n_lines) complex array
        Transform of the force from its impact on, times its modulus.
    """

    response: FloatArray
    force: FloatArray
    scaled_force: FloatArray
    scales: FloatArray
    doubts: FloatArray
    missing_force: ComplexArray
    missing_response: FloatArray
    cut_off: FloatArray
    restored: FloatArray
    pulse: ComplexArray

    def take(self, rows: Sequence[int]) -> ImpactNoise:
        """Take the sums of some responses.

        Parameters
        ----------
        rows : sequence of int
            Which responses.

        Returns
        -------
        ImpactNoise
            Theirs.
        """
        return ImpactNoise(**{field.name: getattr(self, field.name)[list(rows)] for field in fields(self)})


def empty_noise(n_lines: int, n_outputs: int) -> ImpactNoise:
    """Make sums to which nothing has been added.

    Parameters
    ----------
    n_lines : int
        Frequency lines.
    n_outputs : int
        Responses.

    Returns
    -------
    ImpactNoise
        Zeros.
    """
    lengths = {field.name: 1 if field.name in ("scales", "doubts") else n_lines for field in fields(ImpactNoise)}
    complex_sums = ("missing_force", "pulse")
    zeros = {name: np.zeros((n_outputs, n), complex if name in complex_sums else float) for name, n in lengths.items()}
    return ImpactNoise(**zeros)


def add_noise(parts: Sequence[ImpactNoise]) -> ImpactNoise:
    """Add up the sums of several set-ups.

    Parameters
    ----------
    parts : sequence of ImpactNoise
        Of the same responses.

    Returns
    -------
    ImpactNoise
        The sum.
    """
    names = [field.name for field in fields(ImpactNoise)]
    return ImpactNoise(**{name: np.sum([getattr(part, name) for part in parts], axis=0) for name in names})


def without_force_noise(sums: SpectrumSums, noise: ImpactNoise) -> FloatArray:
    """Subtract the noise of the force from its power.

    Parameters
    ----------
    sums : SpectrumSums
        Of the impacts.
    noise : ImpactNoise
        Theirs.

    Returns
    -------
    (n_outputs, n_lines) array
        Sum of the squared moduli of the force itself; 0 where it does not stand out from the noise.
    """
    counts = np.maximum(sums.counts, 1)[:, None]
    is_known = sums.force > noise.force * special.gammainccinv(counts, CHANCE) / counts
    return np.asarray(np.where(noise.force > 0.0, np.where(is_known, sums.force - noise.force, 0.0), sums.force))


def impact_variance(sums: SpectrumSums, noise: ImpactNoise, values: ComplexArray) -> FloatArray:
    """Give the variance of the FRFs of impacts.

    Parameters
    ----------
    sums : SpectrumSums
        Of the impacts.
    noise : ImpactNoise
        Theirs.
    values : (n_lines, n_outputs) complex array
        The FRFs.

    Returns
    -------
    (n_lines, n_outputs) array
        E of the squared modulus of their error; of a single impact it follows from the noise in its own record. NaN
        where there is no force, or none that stands out from its noise; from the first line on where records that begin
        within the pulse lack too much of it, or where a force without noise has no energy.
    """
    gain = np.abs(values) ** 2
    counts = np.maximum(sums.counts, 1)
    own_power = without_force_noise(sums, noise).T
    with np.errstate(divide="ignore", invalid="ignore"):  # lines without force become NaN
        power, scaled = sums.force.T, (noise.scaled_force / sums.force).T
        unequal = (counts - 1) * scaled / (noise.scales.T - scaled)
        scatter = frf_variance(sums, force_noise=(noise.force.T / counts).T) * power
        scatter *= np.where(counts < 3, 1.0, unequal) * (noise.doubts.T / counts)
        measured = noise.response.T + noise.force.T * gain
        unexplained = np.where(sums.counts == 1, measured, scatter)
        unexplained += gain * (noise.force.T / counts) * (noise.force.T / power)
        variance = unexplained * power / own_power**2 + (noise.restored.T / power) ** 2
        variance += gain_variance(sums, noise, values)
        is_recorded = MOST_MISSING * power >= np.abs(noise.missing_force).T
        is_recorded &= (noise.force.T > 0.0) | (power > LEAST_FORCE * power.max(axis=0))
    return np.asarray(np.where((own_power > 0.0) & _up_to_first_hole(is_recorded), variance, np.nan))


def gain_variance(sums: SpectrumSums, noise: ImpactNoise, values: ComplexArray) -> FloatArray:
    """Give the part of the variance that stems from what records lack of force and responses.

    Parameters
    ----------
    sums : SpectrumSums
        Of the impacts.
    noise : ImpactNoise
        Theirs.
    values : (n_lines, n_outputs) complex array
        The FRFs.

    Returns
    -------
    (n_lines, n_outputs) array
        Square of an error that is much the same on the lines of a mode, relative to it; 0 where there is no force.
    """
    square = np.abs(values) ** 2 * np.abs(noise.missing_force.T) ** 2
    square += noise.missing_response.T**2 + noise.cut_off.T**2
    power = sums.force.T
    return np.asarray(np.divide(square, power**2, out=np.zeros_like(square), where=power > 0.0))


def relative_force_noise(
    sums: SpectrumSums, noise: ImpactNoise, values: ComplexArray, variance: FloatArray
) -> ComplexArray:
    """Give the relative error that the noise of the force makes.

    It is the transform of noise that the force window has cut to a short time, over that of the force: lines share it.
    A variance that scatters as noise of the measured powers would is split in proportion to these; what goes beyond
    that is no noise of the force.

    Parameters
    ----------
    sums : SpectrumSums
        Of the impacts.
    noise : ImpactNoise
        Theirs.
    values : (n_lines, n_outputs) complex array
        The FRFs.
    variance : (n_lines, n_outputs) array
        Of the FRFs, by noise.

    Returns
    -------
    (n_lines, n_outputs) complex array
        Root of mean square, with the phase of one over the force; 0 where the FRF has no variance.
    """
    counts, own_power = np.maximum(sums.counts, 1), without_force_noise(sums, noise).T
    is_known = np.isfinite(variance) & (own_power > 0.0) & (values != 0.0)
    own_power, gain = np.where(is_known, own_power, 1.0), np.where(is_known, np.abs(values) ** 2, 1.0)
    by_force, by_response = (power.T / counts * sums.force.T / own_power**2 for power in (noise.force, noise.response))
    with np.errstate(divide="ignore", invalid="ignore"):
        over_measured = np.where(is_known, variance / (by_force * gain + by_response), 0.0)
    degrees = 2 * np.maximum(sums.counts - 1, 1)
    square = by_force * np.minimum(over_measured, special.gammainccinv(degrees / 2, SCATTER) * 2 / degrees)
    return np.where(is_known, np.sqrt(square) * np.exp(-1j * np.angle(noise.pulse.T)), 0.0)


def _up_to_first_hole(is_known: BoolArray) -> BoolArray:
    """Mark the lines up to the first, beside that at 0 Hz, where something is not known: (n_lines, n) arrays."""
    return np.asarray(np.logical_and.accumulate(is_known[1:], axis=0)[np.r_[0, : len(is_known) - 1]])
