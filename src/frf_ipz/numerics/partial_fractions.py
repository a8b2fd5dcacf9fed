"""Partial fractions of conjugate pole pairs as real least-squares columns.

A response ``h(s) = sum_r R_r / (s - p_r) + conj(R_r) / (s - conj(p_r))`` is linear in the real and imaginary parts of
its residues, and to first order in a change of its poles. Complex rows are stacked as real parts above imaginary parts,
so that everything behind these columns is real algebra.
"""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray

SLOPES = 2  # power of a fraction that is its derivative with respect to the pole
AT_ONCE = 32768  # lines times poles whose intermediate results stay in the cache: the fastest of 2048 to 65536, nearly


def stacked(values: ComplexArray) -> FloatArray:
    """Stack real parts above imaginary parts.

    Parameters
    ----------
    values : (n, ...) complex array
        Any values.

    Returns
    -------
    (2 n, ...) array
        The same numbers.
    """
    return np.concatenate([values.real, values.imag])


def unstacked(rows: FloatArray) -> ComplexArray:
    """Undo `stacked`.

    Parameters
    ----------
    rows : (2 n, ...) array
        Real parts above imaginary parts.

    Returns
    -------
    (n, ...) complex array
        The complex values.
    """
    half = len(rows) // 2
    return np.asarray(rows[:half] + 1j * rows[half:])


def pair_columns(s: ComplexArray, p: ComplexArray, power: int = 1) -> FloatArray:
    """Columns that multiply the real and the imaginary parts of residues.

    Parameters
    ----------
    s : (n_lines,) complex array
        Where the response is evaluated.
    p : (n_poles,) complex array
        One pole of each conjugate pair, in the unit of `s`.
    power : int
        1 for the response itself; 2 for its derivative with respect to the poles.

    Returns
    -------
    (2 n_lines, 2 n_poles) array
        First all columns of real parts, then all of imaginary parts.
    """
    rows = pair_rows(s[None], p, (power,))
    return rows.swapaxes(0, 1).reshape(2 * len(p), 2 * len(s)).T


def pair_rows(s: ComplexArray, p: ComplexArray, powers: tuple[int, ...]) -> FloatArray:
    """Give the columns of `pair_columns` as rows, each pole on lines of its own.

    Parameters
    ----------
    s : (n_poles or 1, n_lines) complex array
        Where the response is evaluated: lines of each pole, or of all.
    p : (n_poles,) complex array
        One pole of each conjugate pair, in the unit of `s`.
    powers : tuple of int
        1 for the response itself, 2 for its derivative with respect to the poles.

    Returns
    -------
    (n_poles, 2 n_powers, 2, n_lines) array
        For real and imaginary parts of residues, of each power in turn; real and imaginary parts of the response.
    """
    rows = np.empty((len(p), 2 * len(powers), 2, s.shape[1]))
    n_lines = -(-AT_ONCE // max(len(p), 1))
    for first in range(0, s.shape[1], n_lines):
        part = slice(first, first + n_lines)
        _fill_rows(rows[..., part], s[:, part], p, powers)
    return rows


def pair_products(p: ComplexArray, values: ComplexArray, slopes: ComplexArray, real_part: float) -> FloatArray:
    """Products of the columns of poles with one another, from what each pole has in common with a constant.

    With the weights w of lines and ``F(x) = sum w / (s - x)``, the fractions of two poles have the product
    ``sum w conj(1 / (s - p)) / (s - q) = -(F(q) + conj(F(p))) / (q + conj(p) - 2 Re(s))``: so all products cost as much
    as one column of each pole, however many lines there are.

    Parameters
    ----------
    p : (n_poles,) complex array
        One pole of each conjugate pair.
    values, slopes : (..., 2 n_poles) complex array
        ``F`` at the poles, then at their conjugates, and its derivative.
    real_part : float
        Of all lines.

    Returns
    -------
    (..., 4 n_poles, 4 n_poles) array
        Columns of real parts of residues, of imaginary parts, and of the slopes of both.
    """
    both, n = np.concatenate([p, p.conj()]), len(p)
    inverse = 1 / (both + both.conj()[:, None] - 2 * real_part)
    sums = (values[..., None, :] + values.conj()[..., :, None]) * inverse
    mixed = (sums - slopes[..., None, :]) * inverse
    products = np.empty((*values.shape[:-1], 4 * n, 4 * n))
    _fill_products(products[..., : 2 * n, : 2 * n], -sums)
    _fill_products(products[..., : 2 * n, 2 * n :], mixed)
    products[..., 2 * n :, : 2 * n] = products[..., : 2 * n, 2 * n :].swapaxes(-1, -2)
    _fill_products(products[..., 2 * n :, 2 * n :], -(mixed + mixed.conj().swapaxes(-1, -2)) * inverse)
    return products


def _fill_products(products: FloatArray, block: ComplexArray) -> None:
    """Turn products of the fractions of poles and conjugates into those of the columns of residues."""
    n = block.shape[-1] // 2
    (a, b), (c, d) = ((block[..., rows, :n], block[..., rows, n:]) for rows in (slice(n), slice(n, None)))
    alike, crossed = a.real + d.real, b.real + c.real
    alike_imag, crossed_imag = a.imag - d.imag, b.imag - c.imag
    np.add(alike, crossed, out=products[..., :n, :n])
    np.subtract(alike, crossed, out=products[..., n:, n:])
    np.subtract(crossed_imag, alike_imag, out=products[..., :n, n:])
    np.add(crossed_imag, alike_imag, out=products[..., n:, :n])


def pair_error_growth(p: ComplexArray, values: ComplexArray, slopes: ComplexArray, real_part: float) -> FloatArray:
    """Give the factor by which `pair_products` makes rounding grow, in the products of each pole with itself.

    Parameters
    ----------
    p : (n_poles,) complex array
        One pole of each conjugate pair.
    values, slopes : (..., 2 n_poles) complex array
        As for `pair_products`.
    real_part : float
        Of all lines.

    Returns
    -------
    (..., n_poles) array
        What is subtracted, over what is left.
    """
    distance = 2 * np.abs(p.real - real_part)
    value, slope = values[..., : len(p)], slopes[..., : len(p)]
    real = 2 * np.abs(value.real) / distance
    remaining = 2 * np.abs(slope.real - np.sign(p.real - real_part) * real) / distance**2
    subtracted = 2 * (np.abs(slope) + 2 * np.abs(value) / distance) / distance**2
    terms = [(2 * np.abs(value) / distance, real), (subtracted, remaining)]
    rounding, tiny = np.finfo(float).eps, np.finfo(float).tiny
    return np.asarray(np.max([term / np.maximum(rest, rounding * term + tiny) for term, rest in terms], axis=0))


def pair_values(s: ComplexArray, p: ComplexArray, residues: ComplexArray) -> ComplexArray:
    """Sum of partial fractions of conjugate pairs.

    Parameters
    ----------
    s : (n_lines,) complex array
        Where to evaluate.
    p : (n_poles,) complex array
        One pole of each pair.
    residues : (n_poles, n_frfs) complex array
        Their residues.

    Returns
    -------
    (n_lines, n_frfs) complex array
        The responses.
    """
    return np.asarray((1.0 / (s[:, None] - p)) @ residues + (1.0 / (s[:, None] - p.conj())) @ residues.conj())


def _fill_rows(rows: FloatArray, s: ComplexArray, p: ComplexArray, powers: tuple[int, ...]) -> None:
    # 1 / (s - p) is (a - i d) / (a^2 + d^2): real numbers, line after line in memory, take a fraction of the time
    a, d, e = s.real - p.real[:, None], s.imag - p.imag[:, None], s.imag + p.imag[:, None]
    upper, lower = 1.0 / (a * a + d * d), 1.0 / (a * a + e * e)
    upper_real, upper_imag, lower_real, lower_imag = a * upper, d * upper, a * lower, e * lower
    for number, power in enumerate(powers):
        if power == SLOPES:
            upper_real, upper_imag = _squared(upper_real, upper_imag)
            lower_real, lower_imag = _squared(lower_real, lower_imag)
        np.add(upper_real, lower_real, out=rows[:, 2 * number, 0])
        np.negative(upper_imag + lower_imag, out=rows[:, 2 * number, 1])
        np.subtract(upper_imag, lower_imag, out=rows[:, 2 * number + 1, 0])
        np.subtract(upper_real, lower_real, out=rows[:, 2 * number + 1, 1])


def _squared(real: FloatArray, imag: FloatArray) -> tuple[FloatArray, FloatArray]:
    return (real - imag) * (real + imag), 2 * real * imag
