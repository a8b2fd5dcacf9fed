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

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frf_ipz.identification.measured_lines import WeighedSums
from frf_ipz.numerics.line_sums import LineSums
from frf_ipz.numerics.partial_fractions import (
    pair_columns,
    pair_error_growth,
    pair_products,
    pair_rows,
    stacked,
)

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms
    from frf_ipz.identification.measured_lines import WeightedLines

MOST_GROWTH = 1e3  # of rounding in products of a pole's columns from sums: above, they are summed line by line
LINES_AT_ONCE = 2048  # whose columns are held at a time: with 1 to 300 FRFs about the fastest of 512 to 32768
BLOCK = 2048  # lines reduced at a time: the fastest of 512 to 8192
WORST_PIVOT = 1e-5  # of a unit column: below, the normal equations lose too many digits and QR is taken


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
    gram, right = _normal_equations(data, poles, terms)
    reduced = [
        _factorise(matrix, sides) or _reduce(*_weighted_columns(data, poles, terms, number))
        for number, (matrix, sides) in enumerate(zip(gram, right, strict=True))
    ]
    return CompressedSystem(
        poles=poles,
        n_smooth=terms.n_columns,
        real_modes=data.real_modes,
        U=np.stack([U for U, _ in reduced]),
        z=np.concatenate([z.T for _, z in reduced]),
        total=_line_sums(data, terms).of_squares,
        scale=data.gain if data.is_shared else np.ones(data.receptance.shape[1]),
    )


def _normal_equations(data: WeightedLines, poles: ComplexArray, terms: SmoothTerms) -> tuple[FloatArray, FloatArray]:
    """Give the products of the weighted columns with one another and with the FRFs: of all together, or of each."""
    weighed = _line_sums(data, terms)
    sums, of_powers = weighed.sums, weighed.of_powers
    every = np.concatenate([terms.poles, poles])
    n_powers, n_systems, n = len(terms.powers), len(of_powers), len(every)
    products = sums.products(every)
    n_shared = n_systems * (2 + n_powers)
    shared = products[..., :n_shared].reshape(4, n, n_systems, 2 + n_powers).transpose(2, 3, 0, 1)
    # the sum of a pole and its conjugate, and i times their difference
    alone: ComplexArray = np.asarray(shared[:, 0] + 1j * shared[:, 1])
    values, slopes = _at_poles(alone[:, :2]), _at_poles(alone[:, 2:])
    gram = np.empty((n_systems, n_powers + 4 * n, n_powers + 4 * n))
    gram[:, :n_powers, :n_powers] = of_powers[:, :, :n_powers]
    gram[:, :n_powers, n_powers:] = shared[:, 2:].reshape(n_systems, n_powers, 4 * n)
    gram[:, n_powers:, :n_powers] = gram[:, :n_powers, n_powers:].transpose(0, 2, 1)
    gram[:, n_powers:, n_powers:] = pair_products(every, values, slopes, float(data.s[0].real))
    growth = pair_error_growth(every, values, slopes, float(data.s[0].real)).max(axis=0)
    lossy = np.flatnonzero(growth > MOST_GROWTH)
    if len(lossy):  # narrow for the lines, or where lines weigh far less than others
        s, weights = sums.seen_from(every[lossy])
        rows = pair_rows(s[None], every[lossy], (1, 2)).swapaxes(0, 1).reshape(4 * len(lossy), 2 * len(s))
        places = (n_powers + n * np.arange(4)[:, None] + lossy).ravel()
        for system, squares in zip(gram, weights[:, 0, : n_shared : 2 + n_powers].T, strict=True):
            system[np.ix_(places, places)] = (rows * np.tile(squares, 2)) @ rows.T
    right = np.concatenate(
        [
            of_powers[:, :, n_powers:],
            products[..., n_shared:].reshape(4 * n, n_systems, -1).transpose(1, 0, 2),
        ],
        axis=1,
    )
    order = _column_order(n_powers, len(terms.poles), n, real_modes=data.real_modes)
    return gram[:, order[:, None], order], right[:, order]


def _at_poles(alone: ComplexArray) -> ComplexArray:
    """Give sums over lines at the poles, then at their conjugates, (n_systems, 2 n)."""
    together, apart = alone[:, 0], -1j * alone[:, 1]
    return np.asarray(np.concatenate([together + apart, together - apart], axis=1) / 2, np.complex128)


def _column_order(n_powers: int, n_fixed: int, n: int, *, real_modes: bool) -> IntArray:
    """Places of the columns of `model_columns` among powers and all poles' real parts, imaginary parts and slopes."""
    parts = n_powers + n * np.arange(4)[:, None] + np.arange(n)
    residues = parts[1:2, n_fixed:] if real_modes else parts[:2, n_fixed:]
    return np.concatenate(
        [np.arange(n_powers), parts[:2, :n_fixed].T.ravel(), residues.ravel(), parts[2:, n_fixed:].ravel()]
    )


def _line_sums(data: WeightedLines, terms: SmoothTerms) -> WeighedSums:
    """Give what does not depend on the poles; it is made once for lines and terms."""
    key = terms.powers, terms.scale_rad_s
    if key not in data.sums:
        profiles = _profiles(data)
        powers = terms.powers_of(data.s)
        rows = np.concatenate([np.ones((len(powers), 1)), np.full((len(powers), 1), 1j), powers], axis=1)
        of_systems = profiles[:, :, None] ** 2 * rows[:, None]
        frfs = data.receptance * profiles**2 * (data.gain if data.is_shared else 1.0)
        sides = frfs.reshape(len(frfs), profiles.shape[1], -1)
        with_powers = np.concatenate([of_systems[:, :, 2:], sides], axis=2)
        of_powers = np.einsum("lp,lgr->gpr", powers.conj(), with_powers).real
        weighted = np.concatenate([of_systems.reshape(len(frfs), -1), frfs], axis=1)
        data.sums[key] = WeighedSums(
            sums=LineSums.of_lines(data.s, weighted),
            of_powers=of_powers,
            of_squares=np.sum(np.abs(data.receptance * data.weight) ** 2, axis=0),
        )
    return data.sums[key]


def _profiles(data: WeightedLines) -> FloatArray:
    """Weights of the lines in each system, (n_lines, n_systems)."""
    return data.profile[:, None] if data.is_shared else data.weight


def _weighted_columns(
    data: WeightedLines, poles: ComplexArray, terms: SmoothTerms, number: int
) -> tuple[FloatArray, FloatArray]:
    """Columns and FRFs of one system line by line, where products of columns lose too many digits."""
    weight = data.profile if data.is_shared else data.weight[:, number]
    rows = data.receptance * data.gain if data.is_shared else data.receptance[:, [number]]
    columns = model_columns(data.s, poles, terms, real_modes=data.real_modes, with_slopes=True)
    return columns * np.tile(weight, 2)[:, None], stacked(rows * weight[:, None])


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
    coefficients, n_powers = system.coefficients(), len(terms.powers)
    poles = np.concatenate([terms.poles, system.poles])
    # real and imaginary part of each residue in turn
    residues = np.ascontiguousarray(system.residues().T).view(float)
    of_poles = np.concatenate([coefficients[:, n_powers : terms.n_columns], residues], axis=1)
    values = np.empty((len(s), len(coefficients)), complex)
    for first in range(0, len(s), LINES_AT_ONCE):
        lines = slice(first, first + LINES_AT_ONCE)
        parts = of_poles @ pair_rows(s[None, lines], poles, (1,)).reshape(2 * len(poles), -1)
        real, imag = np.split(parts, 2, axis=1)
        values[lines] = (real + 1j * imag).T + terms.powers_of(s[lines]) @ coefficients[:, :n_powers].T
    return values


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
    asked = np.unique(np.array([column for columns in groups for column in columns], np.int64))
    units = np.eye(n)[:, asked]
    inverses = np.stack([linalg.solve_triangular(U[:n, :n], units, trans="T", check_finite=False).T for U in system.U])
    gains = np.empty((len(groups), len(coefficients)))
    sizes = np.array([len(columns) for columns in groups], np.int64)
    for size in np.unique(sizes).tolist():
        numbers = np.flatnonzero(sizes == size)
        columns = np.array([groups[number] for number in numbers.tolist()], np.int64)
        c, rows = coefficients[:, columns], inverses[:, np.searchsorted(asked, columns)]
        weight = np.linalg.inv(rows @ rows.swapaxes(2, 3))
        gains[numbers] = np.einsum("fgi,fgij,fgj->gf", c, np.broadcast_to(weight, (len(c), *weight.shape[1:])), c)
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
    rest = _factorise(U.T @ U - columns.T @ columns, U.T @ system.z.T - columns.T @ rows)
    if rest is None:
        kept = ~left_out
        some = replace(data, s=data.s[kept], receptance=data.receptance[kept], profile=data.profile[kept])
        return compress(some, system.poles, terms)
    total = system.total - np.einsum("lf,lf->f", rows, rows)
    return replace(system, U=rest[0][None], z=rest[1].T, total=total)


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


def _factorise(gram: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Triangular factor of normal equations and their right-hand sides; None where too many digits are lost."""
    squares = np.diagonal(gram)
    if not np.all(squares > 0):
        return None
    length = np.sqrt(squares)
    try:
        U = linalg.cholesky(gram / length / length[:, None], check_finite=False)
    except linalg.LinAlgError:
        return None
    if not np.min(np.diag(U)) > WORST_PIVOT:
        return None
    return U * length, linalg.solve_triangular(U, right / length[:, None], trans="T", check_finite=False)


def _reduce(columns: FloatArray, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Triangular factor of the columns, and the rows in its orthonormal basis.

    Blocks of lines are reduced one by one, then what is left of all (Demmel, Grigori, Hoemmen, Langou 2012, section 2):
    a block stays in the processor's cache, and no orthonormal basis is formed.
    """
    length, n = np.sqrt(np.einsum("ij,ij->j", columns, columns)), columns.shape[1]
    together = np.concatenate([columns / length, rows], axis=1)
    blocks = [np.asarray(np.linalg.qr(together[k : k + BLOCK], mode="r")) for k in range(0, len(together), BLOCK)]
    R = np.asarray(np.linalg.qr(np.concatenate(blocks), mode="r"))
    return R[:n, :n] * length, R[:n, n:]
