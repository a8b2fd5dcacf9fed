"""Units at the edge: what a column is in, as one factor to SI.

pint reads units here and nowhere else; behind this module every value is SI.
"""

from __future__ import annotations

import math
import re
from functools import cache
from tokenize import TokenError

import pint

from frf_ipz.errors import QuantityError
from frf_ipz.quantities import FrfQuantity, frf_quantity_of

EXAMPLES = {
    "force": "N, kN or lbf",
    "acceleration": "m/s^2 or g_0",
    "velocity": "m/s or mm/s",
    "displacement": "m, mm or um",
    "time": "s or ms",
}
UNREADABLE = (pint.PintError, ValueError, TypeError, AttributeError, AssertionError, TokenError, ZeroDivisionError)
NUMBER = re.compile(r"^\s*[+-]?[\d.]*([eE][+-]?\d+)?")
SAME = 1e-9  # relative: two factors that differ by less are one unit, written in two ways
GRAVITY_SYMBOLS = {"g": "g_0", "G": "g_0", "gn": "g_0"}  # how analysers write the acceleration of gravity


def si_unit(quantity: str, *, rotational: bool = False) -> str:
    """Return the SI unit of a signal.

    Parameters
    ----------
    quantity : str
        ``force``, ``acceleration``, ``velocity``, ``displacement`` or ``time``.
    rotational : bool
        Along a rotation: a moment, an angle and its derivatives.

    Returns
    -------
    str
        For example ``m/s^2``.

    Examples
    --------
    >>> si_unit("acceleration")
    'm/s^2'
    """
    if quantity == "time":
        return "s"
    if quantity == "force":
        return "N m" if rotational else "N"
    return frf_quantity_of(quantity).response_unit("rx" if rotational else "x")


def unit_factor(unit: str, quantity: str, *, rotational: bool = False) -> float:
    """Return the factor from values in a unit to SI.

    Parameters
    ----------
    unit : str
        Anything pint reads.
    quantity : str
        As in `si_unit`.
    rotational : bool
        As in `si_unit`.

    Returns
    -------
    float
        The factor.

    Raises
    ------
    QuantityError
        If the unit cannot be read or is none of this quantity.

    Examples
    --------
    >>> unit_factor("g_0", "acceleration")
    9.80665
    """
    return _convert(
        _parse(unit), si_unit(quantity, rotational=rotational), f"'{unit}' is no unit of {quantity}", quantity
    )


def sensitivity_factor(sensitivity: str, quantity: str, *, rotational: bool = False) -> float:
    """Return the factor to SI of a column that holds the output of a sensor.

    Parameters
    ----------
    sensitivity : str
        Output over measured quantity, such as ``10.2 mV/g_0``; the column is in the unit of the numerator.
    quantity : str
        What is measured.
    rotational : bool
        As in `si_unit`.

    Returns
    -------
    float
        The factor.

    Raises
    ------
    QuantityError
        If it cannot be read, is zero, or measures something else.

    Examples
    --------
    >>> round(sensitivity_factor("10 mV/N", "force"), 3)
    0.1
    """
    output = _parse(sensitivity)
    if output.magnitude == 0:
        raise QuantityError(f"the sensitivity '{sensitivity}' is zero")
    measured_unit = _parse(numerator_of(sensitivity)) / output
    problem = f"the sensitivity '{sensitivity}' is not per unit of {quantity}"
    return _convert(measured_unit, si_unit(quantity, rotational=rotational), problem, quantity)


def numerator_of(sensitivity: str) -> str:
    """Return the unit that a column is in whose sensitivity is given.

    Parameters
    ----------
    sensitivity : str
        Such as ``10.2 mV/g_0``.

    Returns
    -------
    str
        Such as ``mV``.

    Raises
    ------
    QuantityError
        If there is no numerator and denominator.

    Examples
    --------
    >>> numerator_of("10.2 mV/g_0")
    'mV'
    """
    numerator, slash, _ = sensitivity.partition("/")
    unit = NUMBER.sub("", numerator).strip()
    if not slash or not unit:
        raise QuantityError(f"the sensitivity '{sensitivity}' is no ratio of units; write it as in '10.2 mV/g_0'")
    return unit


def frf_factor(unit: str, quantity: FrfQuantity, output_direction: str, input_direction: str) -> float:
    """Return the factor to SI of FRF values.

    Parameters
    ----------
    unit : str
        Such as ``g_0/lbf``.
    quantity : FrfQuantity
        What the FRF is.
    output_direction, input_direction : str
        ``x`` to ``rz``.

    Returns
    -------
    float
        The factor.

    Raises
    ------
    QuantityError
        If the unit cannot be read or is none of this quantity.

    Examples
    --------
    >>> round(frf_factor("mm/s/N", FrfQuantity.MOBILITY, "z", "z"), 6)
    0.001
    """
    si = quantity.unit(output_direction, input_direction)
    return _convert(_parse(unit), si, f"'{unit}' is no unit of {quantity.value}", "")


def same_unit(first: str, second: str) -> bool | None:
    """Tell whether two texts mean the same unit.

    Parameters
    ----------
    first, second : str
        Units.

    Returns
    -------
    bool or None
        None where one of them cannot be read: an analyser's own way of writing it says nothing.
    """
    try:
        ratio = float((_parse(first) / _parse(second)).to("").magnitude)
    except QuantityError:
        return None
    except pint.PintError:
        return False
    return abs(ratio - 1.0) < SAME


@cache
def _registry() -> pint.UnitRegistry[float]:
    return pint.UnitRegistry()


@cache
def _parse(text: str) -> pint.Quantity[float]:
    try:
        value: pint.Quantity[float] = _registry().Quantity(_registry().parse_expression(text)) * 1.0
    except UNREADABLE:
        raise QuantityError(f"'{text}' is no unit that can be read; write it as in N, m/s^2, g_0, mm/s or um") from None
    return value


def _convert(value: pint.Quantity[float], si: str, problem: str, quantity: str) -> float:
    try:
        factor = float(value.to(si).magnitude)
    except pint.PintError:
        hint = EXAMPLES.get(quantity, "")
        gram = "; 'g' is the gram, the acceleration of gravity is 'g_0'" if quantity == "acceleration" else ""
        expected = f"expected is {hint}" if hint else f"expected is a unit like {si}"
        raise QuantityError(f"{problem}; {expected}{gram}") from None
    if not math.isfinite(factor) or factor == 0.0:
        raise QuantityError(f"{problem}: it is {factor:g} {si}; write a unit, without a number that is zero or NaN")
    return factor
