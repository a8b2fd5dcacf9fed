"""Partial fractions of conjugate pole pairs as real least-squares columns.

A response ``h(s) = sum_r R_r / (s - p_r) + conj(R_r) / (s - conj(p_r))`` is linear in the real and imaginary parts of
its residues, and to first order in a change of its poles. Complex rows are stacked as real parts above imaginary parts,
so that everything behind these columns is real algebra.
"""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray


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
    upper, lower = 1.0 / (s[:, None] - p), 1.0 / (s[:, None] - p.conj())
    if power > 1:
        upper, lower = upper**power, lower**power
    n_lines, n_poles = upper.shape
    columns = np.empty((2, n_lines, 2, n_poles))
    np.add(upper.real, lower.real, out=columns[0, :, 0])
    np.add(upper.imag, lower.imag, out=columns[1, :, 0])
    np.subtract(lower.imag, upper.imag, out=columns[0, :, 1])
    np.subtract(upper.real, lower.real, out=columns[1, :, 1])
    return columns.reshape(2 * n_lines, 2 * n_poles)


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
