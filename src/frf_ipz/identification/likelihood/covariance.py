"""Errors of poles, residues and whatever follows from them, to first order.

At the optimum the coefficients x and poles p of an FRF err by ``dx = U11^-1 (e - U12 T dp)``, with white errors e of
this FRF alone and dp common to all FRFs; ``T dp`` are the slopes' coefficients. A quantity that depends on x and p
inherits both parts, the white and the common one, which are independent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.identification.likelihood.compression import CompressedSystem, model_columns
from frf_ipz.identification.likelihood.refinement import RefinedPoles
from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms
from frf_ipz.numerics.partial_fractions import pair_columns, unstacked

LINES_AT_ONCE = 64
NEAREST_POLES = 6  # poles whose errors a block of lines shows: those far away add nothing that could be seen


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FitErrors:
    """Where errors of a fit come from.

    Parameters
    ----------
    system : CompressedSystem
        At the optimum.
    terms : SmoothTerms
        Terms for modes out of band.
    pole_root : (2 n_poles, 2 n_poles) array
        A root of the covariance of the poles: all real parts, then all imaginary parts, rad/s.
    level : float
        Factor on the standard deviation of the coefficients, where errors of neighbouring lines are correlated.
    residues : (n_frfs, n_poles) complex array
        Of receptances, times the system's `scale`.
    """

    system: CompressedSystem
    terms: SmoothTerms
    pole_root: FloatArray
    level: float
    residues: ComplexArray

    def linear_errors(self, rows: ComplexArray, slopes: ComplexArray, frf: int) -> tuple[ComplexArray, ComplexArray]:
        """Errors of numbers that are linear in coefficients and slopes of an FRF.

        Parameters
        ----------
        rows : (n, n_linear) complex array
            Derivatives by the coefficients.
        slopes : (n, 2 n_poles) complex array
            Derivatives by the slopes' coefficients.
        frf : int
            Which FRF.

        Returns
        -------
        white : (n, n_linear) complex array
            Response to the white errors of this FRF.
        common : (n, 2 n_poles) complex array
            Response to the white errors behind the poles.
        """
        n = self.system.n_linear
        U = self.system.U[frf if len(self.system.U) > 1 else 0]
        white = linalg.solve_triangular(U[:n, :n], rows.T, trans="T", check_finite=False).T
        common = (slopes - white @ U[:n, n:]) @ self.slope_errors(frf)
        return white * (self.level / self.system.scale[frf]), common / self.system.scale[frf]

    def slope_errors(self, frf: int) -> FloatArray:
        """Errors of the slopes' coefficients, times `scale`.

        Parameters
        ----------
        frf : int
            Which FRF.

        Returns
        -------
        (2 n_poles, 2 n_poles) array
            Response to the white errors behind the poles.
        """
        residues = self.residues[frf]
        real, imag = np.split(self.pole_root, 2)
        a, b = residues.real[:, None], residues.imag[:, None]
        return np.concatenate([a * real - b * imag, b * real + a * imag])


def fit_errors(
    fit: RefinedPoles, terms: SmoothTerms, level: FloatArray, shift: FloatArray, *, pole_factors: FloatArray
) -> FitErrors:
    """Find where errors of a fit come from.

    Parameters
    ----------
    fit : RefinedPoles
        The fit.
    terms : SmoothTerms
        Terms for modes out of band.
    level : (2 n_poles,) array
        Factor on the variance of each pole's real part, then imaginary part, where lines or FRFs have errors in
        common.
    shift : (2 n_poles,) array
        Standard deviation of the same that does not come from noise, rad/s.
    pole_factors : (2 n_poles,) array
        Factor on the variance of the poles alone, where lines share a part of the noise.

    Returns
    -------
    FitErrors
        Poles, residues, and the system they follow from.
    """
    root = np.linalg.pinv(np.linalg.cholesky(_regularised(fit.information))).T
    stated = np.maximum(np.einsum("ij,ij->i", root, root), np.finfo(float).tiny)
    return FitErrors(
        system=fit.system,
        terms=terms,
        pole_root=root * np.sqrt(level * pole_factors + shift**2 / stated)[:, None],
        level=float(np.sqrt(np.median(level))),
        residues=fit.system.scaled_residues(),
    )


def model_rows(system: CompressedSystem, terms: SmoothTerms, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Differentiate responses anywhere in the plane.

    Parameters
    ----------
    system : CompressedSystem
        The fit.
    terms : SmoothTerms
        Terms for modes out of band.
    s : (n,) complex array
        rad/s.

    Returns
    -------
    rows : (n, n_linear) complex array
        By the coefficients.
    slopes : (n, 2 n_poles) complex array
        By the slopes' coefficients.
    """
    pairs = pair_columns(s, system.poles)
    residue_columns = pairs[:, system.n_poles :] if system.real_modes else pairs
    rows = np.concatenate([terms.columns(s), residue_columns], axis=1)
    return unstacked(rows), unstacked(pair_columns(s, system.poles, power=2))


def value_std(errors: FitErrors, s: ComplexArray) -> FloatArray:
    """Give the standard deviation of the fitted responses on the lines.

    Parameters
    ----------
    errors : FitErrors
        Where errors come from.
    s : (n_lines,) complex array
        rad/s.

    Returns
    -------
    (n_lines, n_frfs) array
        Of the complex value's modulus, as receptance, m/N.
    """
    system = errors.system
    n, n_frfs = system.n_linear, len(system.z)
    roots = np.stack([errors.slope_errors(frf) for frf in range(n_frfs)])
    slope_covariance = roots @ roots.transpose(0, 2, 1)
    columns = model_columns(s, system.poles, errors.terms, real_modes=system.real_modes, with_slopes=True)
    squares = np.empty((len(s), n_frfs))
    for number, U in enumerate(system.U):
        frfs = np.arange(n_frfs) if len(system.U) == 1 else np.array([number])
        white = linalg.solve_triangular(U[:n, :n], columns[:, :n].T, trans="T", check_finite=False)
        slopes = (columns[:, n:] - white.T @ U[:n, n:]).reshape(2, len(s), -1)
        squares[:, frfs] = _variance_by_poles(slopes, slope_covariance[frfs], system.poles, s)
        squares[:, frfs] += errors.level**2 * np.einsum("nkl,nkl->l", *2 * [white.reshape(n, 2, -1)])[:, None]
    return np.asarray(np.sqrt(squares) / system.scale)


def _variance_by_poles(
    slopes: FloatArray, slope_covariance: FloatArray, poles: ComplexArray, s: ComplexArray
) -> FloatArray:
    """Variance of responses by the errors of the poles near them, (n_lines, n_frfs)."""
    squares = np.empty((len(s), len(slope_covariance)))
    for first in range(0, len(s), LINES_AT_ONCE):
        part = slice(first, first + LINES_AT_ONCE)
        nearest = _nearest_poles(poles, s[part])
        rows = slopes[:, part, nearest]
        covariant = rows @ slope_covariance[:, nearest[:, None], nearest][:, None]
        squares[part] = np.einsum("fpln,pln->lf", covariant, rows)
    return squares


def _nearest_poles(poles: ComplexArray, s: ComplexArray) -> IntArray:
    middle = s[len(s) // 2]
    indices = np.sort(np.argsort(np.abs(poles - middle))[:NEAREST_POLES])
    return np.concatenate([indices, indices + len(poles)])


def _regularised(information: FloatArray) -> FloatArray:
    """Regularise the information, so that an undetermined pole has a large variance instead of a failure."""
    least = np.finfo(float).eps * len(information)
    return np.asarray(information + np.diag(least * np.diag(information) + np.finfo(float).tiny))
