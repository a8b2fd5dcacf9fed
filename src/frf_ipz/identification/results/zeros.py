"""Zeros of every fitted FRF, with their errors, and whether the data determine them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frf_ipz.identification.likelihood.covariance import FitErrors, model_rows
from frf_ipz.numerics.partial_fractions import pair_columns, unstacked
from frf_ipz.rational import ZeroSet

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.compression import CompressedSystem
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms

LISTED_BAND = (0.9, 1.1)  # of the band's edges: zeros beyond are not listed
NEWTON_STEPS = 2
MIRRORED = 0.5  # of a zero's distance from the axis: its mirror image must lie that close in a quadruple
ON_AXIS = 1e-9  # of the modulus: a zero with a smaller imaginary part is real
MAX_STD = 0.03  # relative standard deviation above which a zero is not identifiable: it lies far from all lines
BAND_MARGIN = 3.0  # standard deviations by which a zero must lie inside the band
SEPARATION = (
    5.0  # standard deviations that must lie between a zero and the next root of its FRF, for errors to be linear
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ZerosWithErrors:
    """Zeros and where their errors come from.

    Parameters
    ----------
    zeros : ZeroSet
        The zeros.
    white : tuple of (2 n, n_linear) arrays
        Per FRF: response of real and imaginary parts in turn to the white errors of that FRF.
    common : (2 n_zeros, 2 n_poles) array
        The same to the white errors behind the poles.
    """

    zeros: ZeroSet
    white: tuple[FloatArray, ...]
    common: FloatArray


def find_zeros(errors: FitErrors, s: ComplexArray) -> ZerosWithErrors:
    """Find the zeros of every FRF in the band and beside it.

    Parameters
    ----------
    errors : FitErrors
        The fit and where its errors come from.
    s : (n_lines,) complex array
        The lines, rad/s.

    Returns
    -------
    ZerosWithErrors
        By FRF, then by frequency.
    """
    system, terms = errors.system, errors.terms
    band = float(s.imag[0]), float(s.imag[-1])
    coefficients = system.coefficients()
    candidates, frf = _near_band(_eigenvalues(system, terms), coefficients, band)
    candidates = _newton_refined(errors, candidates, coefficients[frf])
    by_frf = [_with_kinds(np.unique(np.round(candidates[frf == number], 9))) for number in range(len(coefficients))]
    values = np.concatenate([zeros for zeros, _ in by_frf])
    frf = np.repeat(np.arange(len(by_frf)), [len(zeros) for zeros, _ in by_frf])
    rows, slopes = model_rows(system, terms, values)
    change = -1 / _slope(errors, values, slopes, coefficients[frf])[:, None]
    rows, slopes = rows * change, slopes * change
    parts = []
    for number, (zeros, kinds) in enumerate(by_frf):
        white, common = errors.linear_errors(rows[frf == number], slopes[frf == number], number)
        parts.append(_frf_zeros(errors, zeros, kinds, white, common, s, band))
    reasons = tuple(reason for part in parts for reason in part.reasons)
    return ZerosWithErrors(
        zeros=ZeroSet(
            values=values,
            frf=frf.astype(np.int64),
            kind=tuple(kind for _, kinds in by_frf for kind in kinds),
            identifiable=np.array([not reason for reason in reasons], bool),
            reason=reasons,
        ),
        white=tuple(part.white for part in parts),
        common=np.concatenate([part.common for part in parts]),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _FrfZeros:
    reasons: tuple[str, ...]
    white: FloatArray
    common: FloatArray


def _frf_zeros(
    errors: FitErrors,
    values: ComplexArray,
    kinds: tuple[str, ...],
    white: ComplexArray,
    common: ComplexArray,
    s: ComplexArray,
    band: tuple[float, float],
) -> _FrfZeros:
    white_parts, common_parts = _interleaved(white), _interleaved(common)
    is_real = np.repeat(np.array(kinds, object) == "real", 2) & (np.arange(2 * len(values)) % 2 == 1)
    white_parts[is_real], common_parts[is_real] = 0.0, 0.0
    std = np.sqrt(np.sum(np.abs(white) ** 2, axis=1) + np.sum(np.abs(common) ** 2, axis=1))
    reasons = _reasons(values, std, errors.system.poles, s, band)
    return _FrfZeros(reasons=reasons, white=white_parts, common=common_parts)


def _near_band(
    eigenvalues: ComplexArray, coefficients: FloatArray, band: tuple[float, float]
) -> tuple[ComplexArray, IntArray]:
    """Select the eigenvalues in the band and beside it, with the FRF of each."""
    modulus = np.abs(eigenvalues)
    is_listed = (
        (eigenvalues.imag > -ON_AXIS * band[1])
        & (modulus > LISTED_BAND[0] * band[0])
        & (modulus < LISTED_BAND[1] * band[1])
    )
    has_signal: BoolArray = np.abs(coefficients).max(axis=1) > 0
    is_listed &= has_signal[:, None]  # a channel without any has no zeros
    return eigenvalues[is_listed], np.nonzero(is_listed)[0]


def _eigenvalues(system: CompressedSystem, terms: SmoothTerms) -> ComplexArray:
    """Zeros of ``d + c (s I - A)^-1 b``: eigenvalues of ``A - b c / d``, in real blocks of two."""
    coefficients = system.coefficients()
    scale = terms.scale_rad_s
    poles = np.concatenate([terms.poles, system.poles]) / scale
    count = 2 * len(poles) + 2
    A, b = np.zeros((count, count)), np.zeros(count)
    A[0, 1], b[1] = 1.0, 1.0
    first = 2 + 2 * np.arange(len(poles))
    A[first, first] = A[first + 1, first + 1] = poles.real
    A[first, first + 1], A[first + 1, first] = poles.imag, -poles.imag
    b[first] = 1.0
    residues = np.concatenate([_fixed_residues(coefficients, terms), system.residues().T], axis=1) / scale
    c = np.zeros((len(coefficients), count))
    c[:, 0] = coefficients[:, terms.powers.index(-2)]
    c[:, first], c[:, first + 1] = 2 * residues.real, 2 * residues.imag
    d = coefficients[:, terms.powers.index(0)]
    d = np.where(np.abs(d) > 0, d, np.finfo(float).tiny)
    return np.asarray(np.linalg.eigvals(A - b[:, None] * (c / d[:, None])[:, None, :]) * scale, complex)


def _fixed_residues(coefficients: FloatArray, terms: SmoothTerms) -> ComplexArray:
    parts = coefficients[:, len(terms.powers) : terms.n_columns].reshape(len(coefficients), len(terms.poles), 2)
    return np.asarray(parts[:, :, 0] + 1j * parts[:, :, 1])


def _newton_refined(errors: FitErrors, values: ComplexArray, coefficients: FloatArray) -> ComplexArray:
    for _ in range(NEWTON_STEPS):
        rows, slopes = model_rows(errors.system, errors.terms, values)
        step = np.einsum("ij,ij->i", rows, coefficients) / _slope(errors, values, slopes, coefficients)
        values = values - np.where(np.abs(step) < 0.01 * np.abs(values), step, 0.0)
    real = np.abs(values.imag) < ON_AXIS * np.abs(values)
    return np.asarray(np.where(real, values.real, values.real + 1j * np.abs(values.imag)))


def _slope(errors: FitErrors, values: ComplexArray, slopes: ComplexArray, coefficients: FloatArray) -> ComplexArray:
    """Differentiate the response by s."""
    terms, system = errors.terms, errors.system
    scaled = values / terms.scale_rad_s
    powers = [power * scaled ** (power - 1) / terms.scale_rad_s for power in terms.powers]
    fixed = [-unstacked(pair_columns(values, pole[None], power=2)) for pole in terms.poles]
    pairs = -slopes[:, system.n_poles :] if system.real_modes else -slopes
    rows = np.concatenate([np.stack(powers, axis=1), *fixed, pairs], axis=1)
    return np.asarray(np.einsum("ij,ij->i", rows, coefficients))


def _with_kinds(values: ComplexArray) -> tuple[ComplexArray, tuple[str, ...]]:
    """Sort zeros by modulus, with the kind of each; one zero of a quadruple stands for all four."""
    values = values[np.argsort(np.abs(values))]
    image = np.abs(values[:, None] + values.conj()).min(axis=1, initial=np.inf)
    mirrored = image < MIRRORED * np.abs(values.real)
    real = values.imag == 0
    stands_for_all = real | ~mirrored | (values.real <= 0)
    kinds = np.where(real, "real", np.where(mirrored, "quadruple", "complex"))
    return values[stands_for_all], tuple(kinds[stands_for_all].tolist())


def _interleaved(parts: ComplexArray) -> FloatArray:
    """Rows of real and imaginary parts in turn."""
    return np.asarray(np.stack([parts.real, parts.imag], axis=1).reshape(2 * len(parts), parts.shape[1]))


def _reasons(
    values: ComplexArray, std: FloatArray, poles: ComplexArray, s: ComplexArray, band: tuple[float, float]
) -> tuple[str, ...]:
    modulus = np.abs(values)
    outside = (modulus - BAND_MARGIN * std < band[0]) | (modulus + BAND_MARGIN * std > band[1])
    distances = np.abs(values[:, None] - values) + np.where(np.eye(len(values), dtype=bool), np.inf, 0.0)
    next_zero = distances.min(axis=1, initial=np.inf)
    next_pole = np.abs(values[:, None] - poles).min(axis=1, initial=np.inf)
    in_gap = _in_gap(values, s)
    return tuple(
        _reason(outside[k], in_gap[k], std[k], modulus[k], next_zero[k], next_pole[k]) for k in range(len(values))
    )


def _reason(outside: np.bool_, in_gap: np.bool_, std: float, modulus: float, next_zero: float, next_pole: float) -> str:
    if outside:
        return "lies outside the fitted band, or may lie there"
    if in_gap:
        return "lies where lines were left out"
    if not std < MAX_STD * modulus:
        return f"its deviation is {100 * std / modulus:.2g} % of it"
    if SEPARATION * std > next_pole:
        return "cannot be distinguished from the nearest pole"
    if SEPARATION * std > next_zero:
        return "cannot be distinguished from the nearest zero"
    return ""


def _in_gap(values: ComplexArray, s: ComplexArray) -> BoolArray:
    omega = s.imag
    line = float(np.median(np.diff(omega)))
    upper: IntArray = np.clip(np.searchsorted(omega, values.imag), 1, len(omega) - 1)
    gap = omega[upper] - omega[upper - 1]
    return np.asarray((gap > 3 * line) & (gap > 2 * np.abs(values.real)) & (values.imag > 0))
