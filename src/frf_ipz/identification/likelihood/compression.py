"""Thousands of measured lines compressed into a small triangular system with the same likelihood.

Around poles p every FRF f is linear: ``h_f = S c_f + Phi(p) R_f + D(p) T(R_f) dp``, with smooth columns S, partial
fractions Phi, and D their derivative. The weighted columns ``B = [S, Phi, D]`` are reduced to ``B = Q U``; then
``|y_f - B x|^2 = |z_f - U x|^2 + rest_f`` with ``z_f = Q' y_f`` for any x. Poles, residues, their structure and their
covariance all follow from U and z.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
from frf_ipz.numerics.partial_fractions import pair_columns, stacked, unstacked

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms
    from frf_ipz.identification.measured_lines import WeightedLines

WORST_PIVOT = 1e-6  # of a unit column: below, the normal equations lose too many digits and QR is taken


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CompressedSystem:
    """The triangular system around some poles.

    Parameters
    ----------
    poles : (n_poles,) complex array
        Poles around which the system is linear, rad/s.
    n_smooth : int
        Number of smooth columns; the columns of the residues follow, then 2 n_poles of the changes of the poles.
    real_modes : bool
        Residues have imaginary parts only: n_poles columns; otherwise 2 n_poles, real parts first.
    U : (n_systems, n, n) array
        Upper triangular; one system for all FRFs, or one an FRF.
    z : (n_frfs, n) array
        Right-hand sides.
    total : (n_frfs,) array
        Weighted sum of squares of the data.
    scale : (n_frfs,) array
        The systems hold for the coefficients times this: the weight of an FRF, where one system serves all.
    """

    poles: ComplexArray
    n_smooth: int
    real_modes: bool
    U: FloatArray
    z: FloatArray
    total: FloatArray
    scale: FloatArray

    @property
    def n_poles(self) -> int:
        """Number of poles, one a pair."""
        return len(self.poles)

    @property
    def n_linear(self) -> int:
        """Number of linear coefficients of an FRF."""
        return self.n_smooth + (1 if self.real_modes else 2) * self.n_poles

    @property
    def misfit(self) -> FloatArray:
        """Weighted sum of squares that the linear coefficients leave, (n_frfs,) array."""
        return np.asarray(self.total - np.sum(self.z[:, : self.n_linear] ** 2, axis=1))

    def scaled_coefficients(self) -> FloatArray:
        """Best linear coefficients at these poles, times `scale`.

        Returns
        -------
        (n_frfs, n_linear) array
            Smooth ones, real parts of the residues, imaginary parts.
        """
        n = self.n_linear
        return solve_upper(self.U[:, :n, :n], self.z[:, :n])

    def coefficients(self) -> FloatArray:
        """Best linear coefficients at these poles.

        Returns
        -------
        (n_frfs, n_linear) array
            Smooth ones, real parts of the residues (not of normal modes), imaginary parts.
        """
        return self.scaled_coefficients() / self.scale[:, None]

    def scaled_residues(self) -> ComplexArray:
        """Best residues at these poles, times `scale`.

        Returns
        -------
        (n_frfs, n_poles) complex array
            Of receptances.
        """
        parts = self.scaled_coefficients()[:, self.n_smooth :]
        real = np.zeros_like(parts) if self.real_modes else parts[:, : self.n_poles]
        return np.asarray(real + 1j * parts[:, -self.n_poles :]) if self.n_poles else np.zeros(parts.shape, complex)

    def residues(self) -> ComplexArray:
        """Best residues at these poles.

        Returns
        -------
        (n_poles, n_frfs) complex array
            Of receptances, m/N rad/s.
        """
        return np.asarray((self.scaled_residues() / self.scale[:, None]).T)


def compress(data: WeightedLines, poles: ComplexArray, terms: SmoothTerms) -> CompressedSystem:
    """Compress the data around poles.

    Parameters
    ----------
    data : WeightedLines
        Lines and weights.
    poles : (n_poles,) complex array
        rad/s.
    terms : SmoothTerms
        Terms for modes out of band.

    Returns
    -------
    CompressedSystem
        The small system.
    """
    columns = model_columns(data.s, poles, terms, real_modes=data.real_modes, with_slopes=True)
    if data.is_shared:
        columns *= np.tile(data.profile, 2)[:, None]
        rows = stacked(data.receptance * data.profile[:, None]) * data.gain
        U, z = _reduce(columns, rows)
        systems, right, total = U[None], z.T, np.einsum("lf,lf->f", rows, rows)
    else:
        reduced = [
            _reduce(columns * np.tile(weight, 2)[:, None], stacked(value * weight)[:, None])
            for weight, value in zip(data.weight.T, data.receptance.T, strict=True)
        ]
        systems = np.stack([U for U, _ in reduced])
        right = np.stack([z[:, 0] for _, z in reduced])
        total = np.sum(np.abs(data.receptance * data.weight) ** 2, axis=0)
    return CompressedSystem(
        poles=poles,
        n_smooth=terms.n_columns,
        real_modes=data.real_modes,
        U=systems,
        z=right,
        total=total,
        scale=data.gain if data.is_shared else np.ones(len(total)),
    )


def model_columns(
    s: ComplexArray, poles: ComplexArray, terms: SmoothTerms, *, real_modes: bool, with_slopes: bool = False
) -> FloatArray:
    """Columns of the model, not weighted.

    Parameters
    ----------
    s : (n,) complex array
        Where, rad/s.
    poles : (n_poles,) complex array
        rad/s.
    terms : SmoothTerms
        Terms for modes out of band.
    real_modes : bool
        Residues have imaginary parts only.
    with_slopes : bool
        Add the columns of the changes of the poles.

    Returns
    -------
    (2 n, n_columns) array
        Smooth columns, those of the residues, and slopes.
    """
    residues = pair_columns(s, poles)
    parts = [terms.columns(s), residues[:, len(poles) :] if real_modes else residues]
    return np.concatenate([*parts, pair_columns(s, poles, power=2)] if with_slopes else parts, axis=1)


def response(system: CompressedSystem, terms: SmoothTerms, s: ComplexArray) -> ComplexArray:
    """Evaluate the model.

    Parameters
    ----------
    system : CompressedSystem
        The fit.
    terms : SmoothTerms
        Terms for modes out of band.
    s : (n,) complex array
        Where, rad/s.

    Returns
    -------
    (n, n_frfs) complex array
        Receptances, m/N.
    """
    columns = model_columns(s, system.poles, terms, real_modes=system.real_modes)
    return unstacked(columns @ system.coefficients().T)


def column_gains(system: CompressedSystem, groups: list[list[int]]) -> FloatArray:
    """Find the part of each FRF's misfit that groups of linear coefficients take off.

    Parameters
    ----------
    system : CompressedSystem
        The fit.
    groups : list of list of int
        Which of the linear coefficients.

    Returns
    -------
    (n_groups, n_frfs) array
        Increase of minus twice the log likelihood where those of a group are zero, the poles being held.
    """
    n, coefficients = system.n_linear, system.scaled_coefficients()
    inverses = np.stack([linalg.solve_triangular(U[:n, :n], np.eye(n), check_finite=False) for U in system.U])
    gains = np.empty((len(groups), len(coefficients)))
    for number, columns in enumerate(groups):
        c, rows = coefficients[:, columns], inverses[:, columns]
        weight = np.linalg.inv(rows @ rows.transpose(0, 2, 1))
        gains[number] = np.einsum("fi,fij,fj->f", c, np.broadcast_to(weight, (len(c), *weight.shape[1:])), c)
    return gains


def without_lines(
    system: CompressedSystem, data: WeightedLines, terms: SmoothTerms, left_out: BoolArray
) -> CompressedSystem:
    """Take a few lines out of a system that serves all FRFs.

    Parameters
    ----------
    system : CompressedSystem
        Of all lines.
    data : WeightedLines
        Lines and weights.
    terms : SmoothTerms
        Terms for modes out of band.
    left_out : (n_lines,) bool array
        Which lines.

    Returns
    -------
    CompressedSystem
        Of the rest of the lines.
    """
    columns = model_columns(data.s[left_out], system.poles, terms, real_modes=system.real_modes, with_slopes=True)
    columns *= np.tile(data.profile[left_out], 2)[:, None]
    rows = stacked(data.receptance[left_out] * data.profile[left_out, None]) * data.gain
    U = system.U[0]
    length = np.sqrt(np.einsum("ij,ij->j", U, U))
    gram = (U.T @ U - columns.T @ columns) / length / length[:, None]
    try:
        rest = linalg.cholesky(gram, check_finite=False)
        is_accurate = bool(np.min(np.diag(rest)) > WORST_PIVOT)
    except linalg.LinAlgError:
        is_accurate = False
    if not is_accurate:
        kept = ~left_out
        some = replace(data, s=data.s[kept], receptance=data.receptance[kept], profile=data.profile[kept])
        return compress(some, system.poles, terms)
    right = (U.T @ system.z.T - columns.T @ rows) / length[:, None]
    z = linalg.solve_triangular(rest, right, trans="T", check_finite=False)
    total = system.total - np.einsum("lf,lf->f", rows, rows)
    return replace(system, U=(rest * length)[None], z=z.T, total=total)


def solve_upper(U: FloatArray, z: FloatArray) -> FloatArray:
    """Solve triangular systems, one for all right-hand sides or one for each.

    Parameters
    ----------
    U : (n_systems, n, n) array
        Upper triangular.
    z : (n_sides, n) array
        Right-hand sides.

    Returns
    -------
    (n_sides, n) array
        Solutions.
    """
    if len(U) == 1:
        return np.asarray(linalg.solve_triangular(U[0], z.T, check_finite=False).T)
    return np.stack(
        [linalg.solve_triangular(upper, side, check_finite=False) for upper, side in zip(U, z, strict=True)]
    )


def _reduce(columns: FloatArray, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Triangular factor of the columns, and the rows in its orthonormal basis."""
    length = np.sqrt(np.einsum("ij,ij->j", columns, columns))
    columns = columns / length
    try:
        U = linalg.cholesky(columns.T @ columns, check_finite=False)
        is_accurate = bool(np.min(np.diag(U)) > WORST_PIVOT)
    except linalg.LinAlgError:
        is_accurate = False
    if is_accurate:
        return U * length, linalg.solve_triangular(U, columns.T @ rows, trans="T", check_finite=False)
    Q, U = np.linalg.qr(columns)
    return U * length, Q.T @ rows
