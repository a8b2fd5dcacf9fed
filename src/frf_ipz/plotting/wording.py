"""Numbers as people read them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

NOTHING = "–"


def number(value: float, digits: int = 4) -> str:
    """Write a number.

    Parameters
    ----------
    value : float
        The number.
    digits : int
        Significant digits.

    Returns
    -------
    str
        A dash where it is not finite.

    Examples
    --------
    >>> number(1234.5678), number(0.00012345), number(float("nan"))
    ('1235', '1.234e-4', '–')
    """
    if not math.isfinite(value):
        return NOTHING
    if value != 0 and not 1e-3 <= abs(value) < 1e5:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa}e{int(exponent)}"
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e" in text else text


def percent(ratio: float, digits: int = 3) -> str:
    """Write a ratio in percent.

    Parameters
    ----------
    ratio : float
        1 is 100 %.
    digits : int
        Significant digits.

    Returns
    -------
    str
        With the sign for percent.

    Examples
    --------
    >>> percent(0.0123)
    '1.23 %'
    """
    return f"{number(100 * ratio, digits)} %" if math.isfinite(ratio) else NOTHING


def small_percent(ratio: float) -> str:
    """Write a small ratio in percent, without digits that nobody needs.

    Parameters
    ----------
    ratio : float
        1 is 100 %.

    Returns
    -------
    str
        Two digits, or that it is below 0.001 %.

    Examples
    --------
    >>> small_percent(0.0123), small_percent(1e-9)
    ('1.2 %', '< 0.001 %')
    """
    return "< 0.001 %" if abs(ratio) < 1e-5 else percent(ratio, 2)


def with_error(value: float, std: float, digits: int = 6) -> str:
    """Write a number with its standard deviation, to the digits that the latter supports.

    Parameters
    ----------
    value, std : float
        Number and standard deviation.
    digits : int
        At most so many.

    Returns
    -------
    str
        For example ``16.083 ± 0.004``; the number alone where the deviation is unknown.

    Examples
    --------
    >>> with_error(16.08312, 0.0041)
    '16.083 ± 0.004'
    >>> with_error(-0.01, 0.2), with_error(111.99432, 3.1e-4, 7)
    ('0.0 ± 0.2', '111.9943 ± 0.0003')
    """
    if not (math.isfinite(std) and std > 0 and math.isfinite(value)):
        return number(value, digits)
    decimals = max(-math.floor(math.log10(std)), 0)
    size = max(math.floor(math.log10(abs(value))), 0) if value else 0
    if std >= 10:
        return f"{number(value, max(size - math.floor(math.log10(std)), 0) + 2)} ± {number(std, 1)}"
    if decimals + size >= digits + 4 or decimals > digits + 3:
        return f"{number(value, digits)} ± {number(std, 1)}"
    rounded = round(value, decimals) + 0.0  # no minus before a zero
    return f"{rounded:.{decimals}f} ± {std:.{decimals}f}"


def listed(items: Sequence[str], n_listed: int = 6) -> str:
    """Join a few items into a phrase.

    Parameters
    ----------
    items : sequence of str
        The items.
    n_listed : int
        Further ones are only counted.

    Returns
    -------
    str
        For example ``a, b and 3 more``.
    """
    names = list(items[:n_listed])
    if len(items) > n_listed:
        return f"{', '.join(names)} and {len(items) - n_listed} more"
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))
