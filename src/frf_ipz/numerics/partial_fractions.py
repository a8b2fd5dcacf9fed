"""Partial fractions of conjugate pole pairs as real least-squares columns.

A response ``h(s) = sum_r R_r / (s - p_r) + conj(R_r) / (s - conj(p_r))`` is linear in the real and imaginary parts of
its residues, and to first order in a change of its poles. Complex rows are stacked as real parts above imaginary parts,
so that everything behind these columns is real algebra.
"""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray

LINES_AT_ONCE = 512  # whose intermediate results stay in the cache


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
    rows = np.empty((2, len(p), 2, len(s)))
    for first in range(0, len(s), LINES_AT_ONCE):
        part = slice(first, first + LINES_AT_ONCE)
        _fill_rows(rows[..., part], s[part], p, power)
    return rows.reshape(2 * len(p), 2 * len(s)).T


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
