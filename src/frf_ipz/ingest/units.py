"""Units at the edge: what a column is in, as one factor to SI.

pint reads units here and nowhere else; behind this module every value is SI. Before pint sees it, a text is brought
from the ways of analysers to that of pint: ``m/s2``, ``ms-2``, ``(1/N)*(g)``. In tests of vibrations ``g`` is the
acceleration of gravity and ``lb`` the pound of force: no gram and no mass is measured.

To load pint and its registry takes a third of a second: units that most recordings are in are known without it.
"""

from __future__ import annotations

import math
import re
from functools import cache
from tokenize import TokenError
from typing import TYPE_CHECKING

from frf_ipz.errors import QuantityError
from frf_ipz.late_imports import import_late
from frf_ipz.quantities import FrfQuantity, frf_quantity_of

if TYPE_CHECKING:
    import pint
else:
    pint = import_late("pint")

EXAMPLES = {
    "force": "N, kN or lbf",
    "acceleration": "m/s^2 or g",
    "velocity": "m/s or mm/s",
    "displacement": "m, mm or um",
    "time": "s or ms",
}
USUAL = {  # the factors that pint gives
    "force": {"N": 1.0, "kN": 1000.0},
    "acceleration": {"m/s^2": 1.0, "m/s2": 1.0, "m/s**2": 1.0, "m/s²": 1.0, "g": 9.80665},
    "velocity": {"m/s": 1.0},
    "displacement": {"m": 1.0},
    "time": {"s": 1.0},
}
LARGEST_FACTOR = 1e100  # of a number that is written into a unit: squares of it may overflow
MOTIONS = ("acceleration", "velocity", "displacement")
UNREADABLE = (  # beside pint's own
    ArithmeticError,
    AssertionError,
    AttributeError,
    KeyError,
    RecursionError,
    SyntaxError,
    TokenError,
    TypeError,
    ValueError,
)
RECORDED = ("s", "N", "N m", "m", "m/s", "m/s^2", "rad/s", "rad/s^2", "V", "C", "V/N", "C/N")
LONGEST = 80  # letters of a unit
NUMBER = re.compile(r"^\s*[+-]?[0-9.]*([eE][+-]?[0-9]+)?")
SAME = 1e-9  # relative: two factors that differ by less are one unit, written in two ways
FREQUENCIES = {
    **dict.fromkeys(("hz", "hertz", "1/s", "cps"), 1.0),
    "khz": 1e3,
    **dict.fromkeys(("rad/s", "rad/sec", "radians/s"), 1.0 / (2.0 * math.pi)),
    **dict.fromkeys(("rpm", "cpm", "1/min"), 1.0 / 60.0),
}
NOT_STATED = {"", "-", "--", "?", "none", "null", "n/a", "unknown", "no unit", "unitless"}

# What stands in files, and what pint reads. The second line: UTF-8 taken for Latin-1, and the code page of DOS.
LETTERS = str.maketrans({"µ": "u", "μ": "u", "·": "*", "⋅": "*", "∙": "*", "•": "*", "×": "*", "−": "-", "°": "deg"})
MANGLED = (("Â²", "²"), ("Â³", "³"), ("Âµ", "µ"), ("Â·", "·"), ("ý", "²"), ("æ", "µ"), ("^", "**"), ("g's", "g"))
SUPERSCRIPTS = re.compile(r"[⁻⁺]?[¹²³⁴]")
DIGITS_OF_SUPERSCRIPTS = str.maketrans("⁻⁺¹²³⁴", "-+1234")
LENGTH_PER_TIME = re.compile(r"(?<![A-Za-z])([kmcdun]?m|in|ft)s(?:\*\*)?(-[12])(?![0-9])")  # ms-2 is m s-2
EXPONENT = re.compile(r"(?<![A-Za-z0-9_.])([A-Za-z]+)(-[1-4]|[2-4])(?![A-Za-z0-9_.])")  # s2, s-2
INTEGER = re.compile(r"(?<![\w.])(?<![0-9.][eE][+-])([0-9]+)(?![\w.])")
POWER = re.compile(r"(?:[A-Za-z)]|g_0)\s*\*\*\s*\(?[+-]?[1-9]\)?(?![0-9.\s]*\*\*)")
MOST_POWERS = 6
WORD = re.compile(r"[A-Za-z_][A-Za-z_0-9]*")
WORDS = {
    **dict.fromkeys(("g", "G", "gn", "Gn", "g_n", "g0", "gs", "Gs", "gee"), "g_0"),
    **dict.fromkeys(("mg", "mG", "mgn"), "(1e-3*g_0)"),
    **dict.fromkeys(("ug", "ugn"), "(1e-6*g_0)"),
    "KN": "kN",
    **{f"{prefix}N{length}": f"({prefix}N*{length})" for prefix in ("", "k", "m") for length in ("m", "mm", "cm")},
    "Kgf": "kgf",
}
WORDS_IN_ANY_CASE = {
    **dict.fromkeys(("newton", "newtons"), "N"),
    **dict.fromkeys(("lb", "lbs", "lbf", "lbsf", "pound", "pounds"), "lbf"),
    **dict.fromkeys(("volt", "volts"), "V"),
    **dict.fromkeys(("sec", "secs", "second", "seconds", "sek"), "s"),
    **dict.fromkeys(("msec", "msecs", "millis", "millisecond", "milliseconds"), "ms"),
    **dict.fromkeys(("usec", "micros", "microsecond", "microseconds"), "us"),
    **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("inch", "inches"), "inch"),
    **dict.fromkeys(("mil", "mils", "thou"), "(1e-3*inch)"),
    "in": "inch",
    "ips": "(inch/s)",
    "kp": "kgf",
}
CAPITALS = re.compile(r"[A-Z0-9/*()\-. ]+")  # units as programs write them that know no small letters
WORDS_IN_CAPITALS = {"M": "m", "MM": "mm", "CM": "cm", "FT": "ft", "S": "s", "RAD": "rad", "DEG": "deg"}


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
        Anything pint reads, and what analysers write.
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
    if not rotational and unit in USUAL.get(quantity, {}):
        return USUAL[quantity][unit]
    return _convert(
        _parse(unit), si_unit(quantity, rotational=rotational), f"'{unit}' is no unit of {quantity}", quantity
    )


def sensitivity_factor(sensitivity: str, quantity: str, *, rotational: bool = False) -> float:
    """Return the factor to SI of a column that holds the output of a sensor.

    Parameters
    ----------
    sensitivity : str
        Output over measured quantity, such as ``10.2 mV/g``; the column is in the unit of the numerator.
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
        If it cannot be read, is zero or absurdly large, or measures something else.

    Examples
    --------
    >>> round(sensitivity_factor("10 mV/N", "force"), 3)
    0.1
    """
    problem = f"the sensitivity '{sensitivity}' is not per unit of {quantity}"
    si = si_unit(quantity, rotational=rotational)
    column_unit = _parse(numerator_of(sensitivity))
    readings = [_parse(sensitivity)]
    numerator, _, denominator = sensitivity.partition("/")
    if "/" in denominator and "(" not in denominator:  # mV/m/s^2
        readings.append(_parse(f"{numerator}/({denominator})"))
    if any(output.magnitude == 0 for output in readings):
        raise QuantityError(f"the sensitivity '{sensitivity}' is zero")
    measured = [column_unit / output for output in readings]
    return _convert(
        next((unit for unit in measured if unit.is_compatible_with(si)), measured[0]), si, problem, quantity
    )


def numerator_of(sensitivity: str) -> str:
    """Return the unit that a column is in whose sensitivity is given.

    Parameters
    ----------
    sensitivity : str
        Such as ``10.2 mV/g``.

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
    >>> numerator_of("10.2 mV/g")
    'mV'
    """
    numerator, slash, _ = sensitivity.partition("/")
    unit = NUMBER.sub("", numerator).strip()
    if not slash or not unit:
        raise QuantityError(f"the sensitivity '{sensitivity}' is no ratio of units; write it as in '10.2 mV/g'")
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
    if unit == si:
        return 1.0
    return _convert(_parse(unit), si, f"'{unit}' is no unit of {quantity.value}", "")


def frequency_factor(unit: str) -> float:
    """Return the factor from frequencies in a unit to Hz.

    Parameters
    ----------
    unit : str
        ``Hz``, ``rad/s``, ``rpm`` and the like; nothing stated is Hz.

    Returns
    -------
    float
        The factor.

    Raises
    ------
    QuantityError
        If it is none of them.

    Examples
    --------
    >>> frequency_factor("kHz"), frequency_factor("cpm") * 60
    (1000.0, 1.0)
    """
    if not is_frequency_unit(unit) and is_stated(unit):
        raise QuantityError(f"'{unit}' is no unit of frequency; expected is {', '.join(FREQUENCIES)}")
    return FREQUENCIES.get(_frequency_name(unit), 1.0)


def is_frequency_unit(text: str) -> bool:
    """Tell whether a text is a unit of frequency.

    Parameters
    ----------
    text : str
        What may be one.

    Returns
    -------
    bool
        True for ``Hz``, ``rad/s``, ``rpm`` and the like.
    """
    return _frequency_name(text) in FREQUENCIES


def _frequency_name(unit: str) -> str:
    return unit.strip(" []()").lower()


def unit_ratio(first: str, second: str) -> float | None:
    """Return how many of a second unit a first one is.

    Parameters
    ----------
    first, second : str
        Units.

    Returns
    -------
    float or None
        1 for one unit that is written in two ways; NaN for units of different quantities; None where one of them
        cannot be read: an analyser's own way of writing it says nothing.

    Examples
    --------
    >>> unit_ratio("V", "mV"), unit_ratio("m/s2", "m s**-2"), unit_ratio("N", "m"), unit_ratio("N", "channel 1")
    (1000.0, 1.0, nan, None)
    """
    try:
        ratio = float((_parse(first) / _parse(second)).to("").magnitude)
    except QuantityError:
        return None
    except pint.PintError:
        return math.nan
    return 1.0 if abs(ratio - 1.0) < SAME else ratio


def is_unit(text: str) -> bool:
    """Tell whether a text is a unit of what recordings hold: of time, force, motion, voltage or charge.

    Parameters
    ----------
    text : str
        Such as ``mm/s2``.

    Returns
    -------
    bool
        True for a unit, False for a number, a word, or nothing.

    Examples
    --------
    >>> is_unit("mm/s2"), is_unit("Volt"), is_unit("force"), is_unit("1")
    (True, True, False, False)
    """
    if any(text in units for units in USUAL.values()):
        return True
    try:
        unit = _parse(text) if is_stated(text) else None
    except QuantityError:
        return False
    return unit is not None and any(unit.is_compatible_with(known) for known in RECORDED)


def is_stated(text: str) -> bool:
    """Tell whether a text of a file claims to be a unit.

    Parameters
    ----------
    text : str
        What stands where the unit should.

    Returns
    -------
    bool
        False for nothing, ``NONE``, ``unknown`` and the like.
    """
    return text.strip().lower() not in NOT_STATED


@cache
def _registry() -> pint.UnitRegistry[float]:
    return pint.UnitRegistry()


@cache
def _parse(text: str) -> pint.Quantity[float]:
    expression = _expression(text)
    try:
        value: pint.Quantity[float] = _registry().Quantity(_registry().parse_expression(expression)) * 1.0
        value.to_base_units()
    except (pint.PintError, *UNREADABLE):
        comma = "; write its number with a decimal point" if "," in text else ""
        examples = "write it as in N, m/s^2, g, mm/s or um"
        raise QuantityError(f"'{text}' is no unit that can be read; {examples}{comma}") from None
    return value


def _expression(text: str) -> str:
    """Bring a unit to pint's way of writing; empty for what cannot be one, as pint skips what it does not know."""
    for mangled, right in MANGLED:
        text = text.replace(mangled, right)
    text = SUPERSCRIPTS.sub(lambda match: f"**{match[0].translate(DIGITS_OF_SUPERSCRIPTS)}", text.translate(LETTERS))
    text = text.strip(" \t[]{}'\"")
    if len(text) > LONGEST or not text.isascii() or set(text) & set(",#$!?&|=<>@~%;:\\"):
        return "("
    text = re.sub(r"(?<=[A-Za-z0-9])\.(?=[A-Za-z])|(?<=[A-Za-z])-(?=[A-Za-z])", "*", text)  # N.m, lbf-in
    text = re.sub(r"(?<=[A-Za-z])\.", "", text)  # in./sec.
    text = EXPONENT.sub(r"\1**\2", LENGTH_PER_TIME.sub(r"(\1*s**\2)", text))
    words = WORDS_IN_CAPITALS if CAPITALS.fullmatch(text) else {}
    text = WORD.sub(lambda match: _word(match[0], words), text)
    if len(POWER.findall(text)) != text.count("**") or text.count("**") > MOST_POWERS:  # 9**9**9 never ends
        return "("
    return INTEGER.sub(r"\1.0", text)  # a power of floats overflows


def _word(word: str, words: dict[str, str]) -> str:
    return words.get(word) or WORDS.get(word) or WORDS_IN_ANY_CASE.get(word.lower()) or word


def _convert(value: pint.Quantity[float], si: str, problem: str, quantity: str) -> float:
    try:
        factor = float(value.to(si).magnitude)
    except pint.PintError:
        hint = EXAMPLES.get(quantity) or f"a unit like {si}"
        other = [name for name in MOTIONS if quantity in MOTIONS and value.is_compatible_with(si_unit(name))]
        instead = f', or quantity = "{other[0]}"' if other else ""
        if quantity and value.is_compatible_with("V"):
            instead = f', or what the sensor gives, as in sensitivity = "10 mV/{f"({si})" if "/" in si else si}"'
        raise QuantityError(f"{problem}; expected is {hint}{instead}") from None
    if not 1.0 / LARGEST_FACTOR < abs(factor) < LARGEST_FACTOR:  # NaN is neither
        advice = "write a unit, without a number that is zero, NaN or absurdly large or small"
        raise QuantityError(f"{problem}: it is {factor:g} {si}; {advice}")
    return factor
