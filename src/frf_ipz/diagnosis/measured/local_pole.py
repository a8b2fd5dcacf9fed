"""The pole of one resonance: around it an FRF is a quotient (c0 + c1 s + c2 s^2) / (s - p).

Without c2, other modes and the mode's own conjugate bend the width: 3 % of a damping ratio of 1 %.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frf_ipz.arrays import ComplexArray, IntArray
from frf_ipz.numerics.least_squares import scale_columns, solve_scaled_columns

WIDTH = 3.0  # half-widths of a resonance on each side of it whose lines are fitted
ROUNDS = 4  # of weights
UNWINDOWED = 1e-9  # decay of the energy of a window over a record: there is none
MAX_RELATIVE_STD = 0.08  # of a frequency: a pole that is known less well drowns in noise


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalPole:
    """A pole with its standard deviation.

    Parameters
    ----------
    pole : complex
        rad/s.
    std_rad_s : float
        Of its real and of its imaginary part.
    """

    pole: complex
    std_rad_s: float


def lines_around_pole(s: ComplexArray, pole: complex) -> IntArray:
    """Choose the lines that determine a pole.

    Parameters
    ----------
    s : (n_lines,) complex array
        Lines of one window, rad/s: it widens the resonance by their real part.
    pole : complex
        About where it is, rad/s.

    Returns
    -------
    (n,) int array
        Those around the resonance.
    """
    return np.flatnonzero(np.abs(s.imag - pole.imag) <= WIDTH * (s[0].real - pole.real))


def lines_of_one_number(s: ComplexArray, duration_s: float) -> float:
    """Count the lines that tell as much as a single independent one.

    Squares summed over lines ``d`` apart are ``2 pi / d`` times the energy of a motion under the window
    ``exp(-sigma t)`` (Parseval), and noise has on each its density times ``(1 - exp(-2 sigma T)) / (2 sigma)``. What a
    motion is known by is its energy over the density; so each is counted ``2 pi / d`` over that fraction times.

    Parameters
    ----------
    s : (n_lines,) complex array
        Neighbouring lines, ``sigma + i omega``, rad/s.
    duration_s : float
        Of the record, ``T``; lines of a record that was padded are nearer than its inverse.

    Returns
    -------
    float
        At least 1. A motion that does not die out under the window is known up to 1.4 times better than that.

    Examples
    --------
    >>> import numpy as np
    >>> round(lines_of_one_number(2j * np.pi * np.arange(10.0, 20.0, 0.25), 1.0), 6)
    4.0
    """
    distance, rate = float(np.median(np.diff(s.imag))), 2 * float(s.real[0])
    energy = -np.expm1(-rate * duration_s) / rate if rate * duration_s > UNWINDOWED else duration_s
    return float(max(2 * np.pi / (distance * energy), 1.0))


def fit_local_pole(s: ComplexArray, values: ComplexArray, start: complex, *, duration_s: float) -> LocalPole | None:
    """Fit a local quotient to an FRF.

    Parameters
    ----------
    s : (n,) complex array
        Lines around the resonance, rad/s.
    values : (n,) complex array
        The FRF there.
    start : complex
        About where the pole is, rad/s.
    duration_s : float
        Of the record that the lines are of.

    Returns
    -------
    LocalPole or None
        None where noise or other modes hide it.
    """
    pole = start
    middle, scale = s.mean(), np.ptp(s.imag)
    offset = (s - middle) / scale
    std = 0.0
    for _ in range(ROUNDS):
        weight = 1 / np.abs(s - pole)
        columns = np.asarray(
            np.column_stack([values, np.ones_like(s), offset, offset**2]) * weight[:, None], np.complex128
        )
        coefficients = solve_scaled_columns(columns, np.asarray(s * values * weight, np.complex128))
        misfit = s * values * weight - columns @ coefficients
        variance = float(np.vdot(misfit, misfit).real) / (len(s) - columns.shape[1])
        scaled, sizes = scale_columns(columns)
        covariance = np.linalg.pinv(scaled.conj().T @ scaled)[0, 0].real * variance
        pole, std = complex(coefficients[0]), float(np.sqrt(max(covariance, 0.0) / 2) / sizes[0])
    std *= float(np.sqrt(lines_of_one_number(s, duration_s)))
    size = abs(pole)
    is_inside = np.abs(pole.imag - middle.imag) < scale / 2
    if not np.isfinite(size) or not is_inside or pole.real >= 0 or std > MAX_RELATIVE_STD * size:
        return None
    return LocalPole(pole=pole, std_rad_s=std)
