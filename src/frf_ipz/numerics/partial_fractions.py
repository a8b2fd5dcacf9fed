"""Partial fractions of conjugate pole pairs as real least-squares columns.

A response ``h(s) = sum_r R_r / (s - p_r) + conj(R_r) / (s - conj(p_r))`` is linear in the real and imaginary parts of
its residues, and to first order in a change of its poles. Complex rows are stacked as real parts above imaginary parts,
so that everything behind these columns is real algebra.
"""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray

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
    return pair_rows(s[None], p, power).reshape(2 * len(p), 2 * len(s)).T


def pair_rows(s: ComplexArray, p: ComplexArray, power: int = 1) -> FloatArray:
    """Give the columns of `pair_columns` as rows, each pole on lines of its own.

    Parameters
    ----------
    s : (n_poles or 1, n_lines) complex array
        Where the response is evaluated: lines of each pole, or of all.
    p : (n_poles,) complex array
        One pole of each conjugate pair, in the unit of `s`.
    power : int
        1 for the response itself; 2 for its derivative with respect to the poles.

    Returns
    -------
    (2, n_poles, 2, n_lines) array
        For real and imaginary parts of residues; real and imaginary parts of the response.
    """
    rows = np.empty((2, len(p), 2, s.shape[1]))
    n_lines = -(-AT_ONCE // max(len(p), 1))
    for first in range(0, s.shape[1], n_lines):
        part = slice(first, first + n_lines)
        _fill_rows(rows[..., part], s[:, part], p, power)
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
    both = np.concatenate([p, p.conj()])
    inverse = 1 / (both + both.conj()[:, None] - 2 * real_part)
    sums = (values[..., None, :] + values.conj()[..., :, None]) * inverse
    after, before = slopes[..., None, :], slopes.conj()[..., :, None]
    n = len(p)
    products = np.empty((*values.shape[:-1], 2, 2, n, 2, 2, n))
    for row, column, block in (
        (0, 0, -sums),
        (0, 1, (sums - after) * inverse),
        (1, 0, (sums - before) * inverse),
        (1, 1, (after + before - 2 * sums) * inverse**2),
    ):
        a, b, c, d = block[..., :n, :n], block[..., :n, n:], block[..., n:, :n], block[..., n:, n:]
        part = products[..., row, :, :, column, :, :]
        part[..., 0, :, 0, :] = (a + b + c + d).real
        part[..., 0, :, 1, :] = -(a - b + c - d).imag
        part[..., 1, :, 0, :] = (a + b - c - d).imag
        part[..., 1, :, 1, :] = (a - b - c + d).real
    return products.reshape(*values.shape[:-1], 4 * n, 4 * n)


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


def _fill_rows(rows: FloatArray, s: ComplexArray, p: ComplexArray, power: int) -> None:
    # 1 / (s - p) is (a - i d) / (a^2 + d^2): real numbers, line after line in memory, take a fraction of the time
    a, d, e = s.real - p.real[:, None], s.imag - p.imag[:, None], s.imag + p.imag[:, None]
    upper, lower = 1.0 / (a * a + d * d), 1.0 / (a * a + e * e)
    if power == 1:
        upper_real, upper_imag, lower_real, lower_imag = a * upper, d * upper, a * lower, e * lower
    else:
        upper_real, lower_real = (a - d) * (a + d) * upper * upper, (a - e) * (a + e) * lower * lower
        upper_imag, lower_imag = 2 * a * d * upper * upper, 2 * a * e * lower * lower
    np.add(upper_real, lower_real, out=rows[0, :, 0])
    np.negative(upper_imag + lower_imag, out=rows[0, :, 1])
    np.subtract(upper_imag, lower_imag, out=rows[1, :, 0])
    np.subtract(upper_real, lower_real, out=rows[1, :, 1])
