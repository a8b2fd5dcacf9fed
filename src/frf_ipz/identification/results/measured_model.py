"""From receptances, in which everything is fitted, to a model of the FRFs as they were measured."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.identification.likelihood.covariance import FitErrors
from frf_ipz.rational import PoleResidueModel

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.compression import CompressedSystem
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms


def measured_model(
    system: CompressedSystem, terms: SmoothTerms, powers: IntArray, order: IntArray, delay_s: FloatArray
) -> PoleResidueModel:
    """Multiply a model of receptances by the powers of s that were measured.

    ``s^q R / (s - p) = p^q R / (s - p)`` plus a polynomial: ``R`` for a mobility, ``R (s + p)`` for an accelerance.

    Parameters
    ----------
    system : CompressedSystem
        The fit.
    terms : SmoothTerms
        What lies out of band; its fixed poles join the others at the end.
    powers : (n_frfs,) int array
        Power of s of each FRF's quantity.
    order : (n_poles,) int array
        Order of the poles.
    delay_s : (n_frfs,) array
        Fitted delays.

    Returns
    -------
    PoleResidueModel
        In the units of the FRFs.
    """
    coefficients = system.coefficients()
    count = len(terms.powers)
    fixed = coefficients[:, count : terms.n_columns].reshape(len(coefficients), len(terms.poles), 2)
    residues = np.concatenate([system.residues()[order], (fixed[:, :, 0] + 1j * fixed[:, :, 1]).T])
    poles = np.concatenate([system.poles[order], terms.poles])
    scale = terms.scale_rad_s
    exponents = sorted({int(power) + term for power in powers for term in (*terms.powers, *range(-int(power), 0))})
    rows = np.zeros((len(exponents), len(coefficients)))
    for frf, power in enumerate(powers):
        for term, value in zip(terms.powers, coefficients[frf], strict=False):
            rows[exponents.index(int(power) + term), frf] += value * scale**power
        for lower in range(int(power)):  # s^q / (s - p) = p^q / (s - p) + sum_k s^k p^(q - 1 - k)
            value = 2 * float(np.sum((residues[:, frf] * poles ** (power - 1 - lower)).real))
            rows[exponents.index(lower), frf] += value * scale**lower
    return PoleResidueModel(
        poles=poles,
        residues=np.asarray(residues * poles[:, None] ** powers, complex),
        powers=tuple(exponents),
        coefficients=rows,
        scale_rad_s=scale,
        delay_s=delay_s,
    )


def residue_covariance(errors: FitErrors, powers: IntArray, modes: IntArray) -> FloatArray:
    """Covariance of the residues of the FRFs as they were measured.

    Parameters
    ----------
    errors : FitErrors
        Where errors come from.
    powers : (n_frfs,) int array
        Power of s of each FRF's quantity.
    modes : (n_modes,) int array
        Indices of the modes among the poles.

    Returns
    -------
    (n_modes, n_frfs, 2, 2) array
        Of real and imaginary part.
    """
    system = errors.system
    count = system.n_poles
    poles = system.poles[modes]
    rows = np.zeros((len(modes), system.n_linear), complex)
    if not system.real_modes:
        rows[np.arange(len(modes)), system.n_smooth + modes] = 1.0
    rows[np.arange(len(modes)), system.n_linear - count + modes] = 1j
    slopes = np.zeros((len(modes), 2 * count), complex)
    covariance = np.empty((len(modes), len(powers), 2, 2))
    for frf, power in enumerate(powers):
        white, common = errors.linear_errors(rows, slopes, frf)
        factor = poles**power
        # the error of the factor itself is far smaller
        parts = np.concatenate([white, common], axis=1) * factor[:, None]
        stacked = np.stack([parts.real, parts.imag], axis=1)
        covariance[:, frf] = stacked @ stacked.transpose(0, 2, 1)
    return covariance
