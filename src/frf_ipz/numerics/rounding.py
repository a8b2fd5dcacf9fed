"""How many digits numbers were printed with."""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import FloatArray

EPS = float(np.finfo(float).eps)
FEWEST_DIGITS, MOST_DIGITS = 4, 14  # fewer are plain numbers that a person has written; more are all there are
FEWEST_NUMBERS = 4  # different ones, from which digits can be told
FULL = 0.5  # of them use the last digit; of rounded ones nine in ten do


def printed_rounding(values: FloatArray) -> float:
    """Estimate the relative rounding of numbers that were read from a text.

    Parameters
    ----------
    values : (n,) array
        The numbers.

    Returns
    -------
    float
        Half a unit of the last digit of the smallest mantissa, 1; that of double precision where numbers have all their
        digits, or so few that they may be exact: 0.1, 1.3e6.

    Examples
    --------
    >>> printed_rounding(np.array([1.23457e5, -6.1329e4, 7.77778e6, 2.71828]))
    5e-06
    >>> printed_rounding(np.array([1e5, -1e5, 100010.0, 2.5e4])) == EPS
    True
    """
    sizes = np.unique(np.abs(values[np.isfinite(values) & (values != 0)]))
    if len(sizes) < FEWEST_NUMBERS:
        return EPS
    mantissas = sizes / 10.0 ** np.floor(np.log10(sizes))
    digits = np.full(len(sizes), MOST_DIGITS + 1)
    for count in range(MOST_DIGITS, 0, -1):
        scaled = mantissas * 10.0 ** (count - 1)
        digits[np.abs(scaled - np.rint(scaled)) <= 4 * EPS * scaled] = count
    printed = int(digits.max())
    if not FEWEST_DIGITS <= printed <= MOST_DIGITS or np.mean(digits == printed) < FULL:
        return EPS
    return float(0.5 * 10.0 ** (1 - printed))


def printed_decimals(lengths: FloatArray) -> float:
    """Estimate the rounding of lengths that were printed with a fixed number of decimals.

    Parameters
    ----------
    lengths : array
        The lengths.

    Returns
    -------
    float
        Half a unit of the last decimal; 0 where lengths have all their digits, or so few that they may be exact.

    Examples
    --------
    >>> printed_decimals(np.array([0.33333, 0.66667, 1.41421, 0.12345, 1.0]))
    5e-06
    >>> printed_decimals(np.array([0.0, 0.25, 0.5, 0.75, 1.0]))
    0.0
    """
    sizes = np.unique(np.abs(lengths))
    decimals = np.full(len(sizes), MOST_DIGITS + 1)
    for count in range(MOST_DIGITS, -1, -1):
        scaled = sizes * 10.0**count
        decimals[np.abs(scaled - np.rint(scaled)) <= 4 * EPS * scaled] = count
    printed = int(decimals.max(initial=0))
    uses_all = len(sizes) >= FEWEST_NUMBERS and np.mean(decimals == printed) >= FULL
    return float(0.5 * 10.0**-printed) if uses_all and FEWEST_DIGITS <= printed <= MOST_DIGITS else 0.0
