"""Peaks of FRFs, for a first look: within a fraction of a second, without the search that a fit makes.

Start poles of the polyreference method take residues by one linear fit. A pole stands for a peak where, summed over the
FRFs, its own term at its frequency stands out of noise and misfit, or is larger than all else that was measured there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.identification.likelihood.compression import response
from frf_ipz.identification.likelihood.refinement import refine_poles
from frf_ipz.identification.likelihood.smooth_terms import smooth_terms_of_band
from frf_ipz.identification.measured_lines import SIGNAL, measured_lines
from frf_ipz.identification.search.find_modes import FIXED_POLES
from frf_ipz.identification.search.goodness_of_fit import assess_fit, missing_poles
from frf_ipz.identification.stabilization import find_start_poles
from frf_ipz.numerics.one_thread import on_one_thread
from frf_ipz.rational import damping_ratio, natural_frequency_hz

if TYPE_CHECKING:
    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.options import FitOptions


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrfPeaks:
    """Modes that make a peak.

    Parameters
    ----------
    frequency_hz, damping_ratio : (n_modes,) array
        By ascending frequency, Hz.
    products : (n_modes, n_frfs) complex array
        ``phi_output phi_input``, 1/kg, with the signs of the labels taken out.
    deviations : (n_modes, n_frfs) array
        Of the products: from what noise and misfit at the peak make of them.
    band_hz : pair of float
        The band that was looked at.
    """

    frequency_hz: FloatArray
    damping_ratio: FloatArray
    products: ComplexArray
    deviations: FloatArray
    band_hz: tuple[float, float]


@on_one_thread
def find_peaks(frfs: FrfSet, options: FitOptions) -> FrfPeaks:
    """Find the modes that make a peak.

    Parameters
    ----------
    frfs : FrfSet
        Measured FRFs.
    options : FitOptions
        Band, and bands to leave out.

    Returns
    -------
    FrfPeaks
        None where nothing stands out.

    Raises
    ------
    InputError
        If too few lines remain in the band.
    """
    lines = measured_lines(frfs, options)
    start = find_start_poles(frfs, lines, max_order=options.max_order)
    data, terms = lines.weighted(shared=True), smooth_terms_of_band(lines.band_hz, lines.line_hz).first(FIXED_POLES)
    fit = refine_poles(data, start.poles, terms, iterations=0)
    if not len(fit.poles):  # short bands may give none: what stands out of the noise then begins as it does in the fit
        fit = refine_poles(data, missing_poles(assess_fit(data, fit, terms))[0], terms)
    poles, residues = fit.poles, fit.system.residues()
    at = np.argmin(np.abs(lines.s.imag[:, None] - poles.imag), axis=0)  # the line next to each pole
    distance = np.abs(lines.s[at] - poles)[:, None]
    own = residues / (lines.s[at] - poles)[:, None]
    misfit = np.abs(lines.receptance - response(fit.system, terms, lines.s))[at]
    error = np.hypot(misfit, np.sqrt(lines.variance[at]))
    rest = np.abs(lines.receptance[at] - own)
    is_peak = (_size(own) > SIGNAL * _size(error)) | (_size(own) > _size(rest))
    factors = np.array([label.sign for label in frfs.labels]) * 2j * poles.imag[:, None]
    selected = np.flatnonzero(is_peak)[np.argsort(natural_frequency_hz(poles[is_peak]))]
    return FrfPeaks(
        frequency_hz=natural_frequency_hz(poles[selected]),
        damping_ratio=damping_ratio(poles[selected]),
        products=(residues * factors)[selected],
        deviations=(error * distance * np.abs(factors))[selected],
        band_hz=lines.band_hz,
    )


def _size(values: ComplexArray | FloatArray) -> FloatArray:
    """Sum over the FRFs."""
    return np.asarray(np.linalg.norm(values, axis=1))
