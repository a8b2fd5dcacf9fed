"""Zeros of every fitted FRF, with their errors, and which of them the data support."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frf_ipz.identification.likelihood.covariance import FitErrors, model_rows
from frf_ipz.numerics.partial_fractions import pair_columns, unstacked
from frf_ipz.rational import ZeroSet

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.compression import Compressed
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms

BESIDE = (0.9, 1.1)  # of the band's edges: zeros beyond are not listed
POLISHING = 2  # Newton steps
MIRRORED = 0.5  # of a zero's distance from the axis: its mirror image must lie that close to make a quadruple
ON_AXIS = 1e-9  # of the modulus: a zero with a smaller imaginary part is real
ROUGH = 0.03  # relative standard deviation above which a zero is no number: it lies far from all lines
INSIDE = 3.0  # standard deviations by which a zero must lie inside the band
APART = 5.0  # standard deviations that must lie between a zero and the next root of its FRF, for errors to be linear


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundZeros:
    """Zeros and where their errors come from.

    Parameters
    ----------
    zeros : ZeroSet
        The zeros.
    own : tuple of (2 n, n_linear) arrays
        Per FRF: response of real and imaginary parts in turn to the FRF's own white errors.
    common : (2 n_zeros, 2 n_poles) array
        The same to the white errors behind the poles.
    """

    zeros: ZeroSet
    own: tuple[FloatArray, ...]
    common: FloatArray


def find_zeros(errors: FitErrors, s: ComplexArray) -> FoundZeros:
    """Find the zeros of every FRF in the band and beside it.

    Parameters
    ----------
    errors : FitErrors
        The fit and where its errors come from.
    s : (n_lines,) complex array
        The lines, rad/s.

    Returns
    -------
    FoundZeros
        By FRF, then by frequency.
    """
    system, terms = errors.system, errors.terms
    band = float(s.imag[0]), float(s.imag[-1])
    coefficients = system.coefficients()
    candidates, frf = _near_band(_eigenvalues(system, terms), coefficients, band)
    candidates = _polished(errors, candidates, coefficients[frf])
    named = [_kinds(np.unique(np.round(candidates[frf == number], 9))) for number in range(len(coefficients))]
    values = np.concatenate([one for one, _ in named])
    frf = np.repeat(np.arange(len(named)), [len(one) for one, _ in named])
    rows, slopes = model_rows(system, terms, values)
    change = -1 / _slope(errors, values, slopes, coefficients[frf])[:, None]
    rows, slopes = rows * change, slopes * change
    parts = []
    for number, (mine, kinds) in enumerate(named):
        own, common = errors.linear(rows[frf == number], slopes[frf == number], number)
        parts.append(_of_one(errors, mine, kinds, own, common, s, band))
    reasons = tuple(reason for part in parts for reason in part.reasons)
    return FoundZeros(
        zeros=ZeroSet(
            values=values,
            frf=frf.astype(np.int64),
            kind=tuple(kind for _, kinds in named for kind in kinds),
            identifiable=np.array([not reason for reason in reasons], bool),
            reason=reasons,
        ),
        own=tuple(part.own for part in parts),
        common=np.concatenate([part.common for part in parts]),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _OfOne:
    reasons: tuple[str, ...]
    own: FloatArray
    common: FloatArray


def _of_one(
    errors: FitErrors,
    values: ComplexArray,
    kinds: tuple[str, ...],
    own: ComplexArray,
    common: ComplexArray,
    s: ComplexArray,
    band: tuple[float, float],
) -> _OfOne:
    own_parts, common_parts = _in_turn(own), _in_turn(common)
    is_real = np.repeat(np.array(kinds, object) == "real", 2) & (np.arange(2 * len(values)) % 2 == 1)
    own_parts[is_real], common_parts[is_real] = 0.0, 0.0
    std = np.sqrt(np.sum(np.abs(own) ** 2, axis=1) + np.sum(np.abs(common) ** 2, axis=1))
    reasons = _reasons(values, std, errors.system.poles, s, band)
    return _OfOne(reasons=reasons, own=own_parts, common=common_parts)


def _near_band(
    eigenvalues: ComplexArray, coefficients: FloatArray, band: tuple[float, float]
) -> tuple[ComplexArray, IntArray]:
    """Choose the eigenvalues in the band and beside it, and say which FRF each belongs to."""
    modulus = np.abs(eigenvalues)
    near = (eigenvalues.imag > -ON_AXIS * band[1]) & (modulus > BESIDE[0] * band[0]) & (modulus < BESIDE[1] * band[1])
    has_signal: BoolArray = np.abs(coefficients).max(axis=1) > 0
    near &= has_signal[:, None]  # a channel without any has no zeros
    return eigenvalues[near], np.nonzero(near)[0]


def _eigenvalues(system: Compressed, terms: SmoothTerms) -> ComplexArray:
    """Zeros of ``d + c (s I - A)^-1 b``: eigenvalues of ``A - b c / d``, in real blocks of two."""
    coefficients = system.coefficients()
    scale = terms.scale_rad_s
    poles = np.concatenate([terms.poles, system.poles]) / scale
    count = 2 * len(poles) + 2
    A, b = np.zeros((count, count)), np.zeros(count)
    A[0, 1], b[1] = 1.0, 1.0
    place = 2 + 2 * np.arange(len(poles))
    A[place, place] = A[place + 1, place + 1] = poles.real
    A[place, place + 1], A[place + 1, place] = poles.imag, -poles.imag
    b[place] = 1.0
    residues = np.concatenate([_fixed_residues(coefficients, terms), system.residues().T], axis=1) / scale
    c = np.zeros((len(coefficients), count))
    c[:, 0] = coefficients[:, terms.powers.index(-2)]
    c[:, place], c[:, place + 1] = 2 * residues.real, 2 * residues.imag
    d = coefficients[:, terms.powers.index(0)]
    d = np.where(np.abs(d) > 0, d, np.finfo(float).tiny)
    return np.asarray(np.linalg.eigvals(A - b[:, None] * (c / d[:, None])[:, None, :]) * scale, complex)


def _fixed_residues(coefficients: FloatArray, terms: SmoothTerms) -> ComplexArray:
    parts = coefficients[:, len(terms.powers) : terms.n_columns].reshape(len(coefficients), len(terms.poles), 2)
    return np.asarray(parts[:, :, 0] + 1j * parts[:, :, 1])


def _polished(errors: FitErrors, values: ComplexArray, coefficients: FloatArray) -> ComplexArray:
    for _ in range(POLISHING):
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


def _kinds(values: ComplexArray) -> tuple[ComplexArray, tuple[str, ...]]:
    """Name the zeros, by modulus; of a quadruple one stands for all, of a real zero each for itself."""
    values = values[np.argsort(np.abs(values))]
    image = np.abs(values[:, None] + values.conj()).min(axis=1, initial=np.inf)
    mirrored = image < MIRRORED * np.abs(values.real)
    real = values.imag == 0
    kept = real | ~mirrored | (values.real <= 0)
    kinds = np.where(real, "real", np.where(mirrored, "quadruple", "complex"))
    return values[kept], tuple(kinds[kept].tolist())


def _in_turn(parts: ComplexArray) -> FloatArray:
    """Rows of real and imaginary parts in turn."""
    return np.asarray(np.stack([parts.real, parts.imag], axis=1).reshape(2 * len(parts), parts.shape[1]))


def _reasons(
    values: ComplexArray, std: FloatArray, poles: ComplexArray, s: ComplexArray, band: tuple[float, float]
) -> tuple[str, ...]:
    modulus = np.abs(values)
    outside = (modulus - INSIDE * std < band[0]) | (modulus + INSIDE * std > band[1])
    others = np.abs(values[:, None] - values) + np.where(np.eye(len(values), dtype=bool), np.inf, 0.0)
    next_zero = others.min(axis=1, initial=np.inf)
    next_pole = np.abs(values[:, None] - poles).min(axis=1, initial=np.inf)
    in_hole = _in_hole(values, s)
    return tuple(
        _reason(outside[k], in_hole[k], std[k], modulus[k], next_zero[k], next_pole[k]) for k in range(len(values))
    )


def _reason(
    outside: np.bool_, in_hole: np.bool_, std: float, modulus: float, next_zero: float, next_pole: float
) -> str:
    if outside:
        return "lies outside the fitted band, or may lie there"
    if in_hole:
        return "lies where lines were left out"
    if not std < ROUGH * modulus:
        return f"known to {std / modulus:.0%} only"
    if APART * std > next_pole:
        return "cannot be told from the pole beside it"
    if APART * std > next_zero:
        return "cannot be told from the zero beside it"
    return ""


def _in_hole(values: ComplexArray, s: ComplexArray) -> BoolArray:
    omega = s.imag
    line = float(np.median(np.diff(omega)))
    above: IntArray = np.clip(np.searchsorted(omega, values.imag), 1, len(omega) - 1)
    gap = omega[above] - omega[above - 1]
    return np.asarray((gap > 3 * line) & (gap > 2 * np.abs(values.real)) & (values.imag > 0))
