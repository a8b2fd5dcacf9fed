"""Numbers in text files: each is read whole, or refused with the reason.

Read are decimal numbers with an exponent after E or D, and FORTRAN's ``1.234-101`` without a letter. Anything else is
no number: thousands separators, hexadecimal digits, underscores, digits that are not ASCII.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import FloatArray

_MANTISSA = {".": r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)", ",": r"(?:[0-9]+,?[0-9]*|,[0-9]+)"}
_BROKEN = {".": r"(?:[0-9]+\.[0-9]*|\.[0-9]+)", ",": r"(?:[0-9]+,[0-9]*|,[0-9]+)"}  # with its decimal sign
_NUMBER = {
    decimal: re.compile(
        rf"(?P<mantissa>[+-]?{_MANTISSA[decimal]})(?:[eEdDqQ](?P<exponent>[+-]?[0-9]+))?"
        rf"|(?P<bare_mantissa>[+-]?{_BROKEN[decimal]})(?P<bare_exponent>[+-][0-9]+)"
    )
    for decimal in (".", ",")
}
_NOT_FINITE = re.compile(
    r"[+-]?(?:nan(?:\([a-z0-9]*\))?|inf(?:inity)?|[0-9]\.#(?:inf|qnan|snan|ind)[0-9]*)", re.IGNORECASE
)
_MISSING = {"", "null", "none", "na", "n/a", "#n/a", "#na", "missing", "-", "--", "---", "#div/0!", "#num!", "#value!"}
_SEPARATOR = r"(?P<sign>[ .,'_\u00a0\u2019\u202f])"
_THOUSANDS = re.compile(rf"[+-]?[0-9]{{1,3}}{_SEPARATOR}(?:[0-9]{{3}}(?P=sign))*[0-9]{{3}}(?:[.,][0-9]*)?")
_HEXADECIMAL = re.compile(r"[+-]?0[xX][0-9a-fA-F.]+(?:[pP][+-]?[0-9]+)?|(?=.*[0-9])(?=.*[a-fA-F])[0-9a-fA-F]{4,}[hH]?")
_ONLY_PLAIN = str.maketrans("", "", "0123456789+-.eE ")


class NumberError(InputError):
    """A text is no number.

    Parameters
    ----------
    message : str
        What stands there, and what to write.
    position : int
        Which one of several texts it is.
    """

    def __init__(self, message: str, position: int = 0) -> None:
        self.position = position
        super().__init__(message)


def parse_number(text: str, *, decimal: str = ".", finite: bool = True) -> float:
    """Read a number, all of it.

    Parameters
    ----------
    text : str
        A number, with blanks around it or without.
    decimal : str
        Point or comma.
    finite : bool
        Refuse infinity, NaN and what stands for a missing value; else infinities are given as such and the others as
        NaN.

    Returns
    -------
    float
        The number.

    Raises
    ------
    NumberError
        If it is no number, or none in double precision: says why.

    Examples
    --------
    >>> parse_number("1.0D-03"), parse_number("1.5-3"), parse_number("2,5", decimal=",")
    (0.001, 0.0015, 2.5)
    >>> parse_number("1,234.5")
    Traceback (most recent call last):
        ...
    frf_ipz.text_numbers.NumberError: '1,234.5' has a thousands separator; write it as 1234.5
    """
    stripped = text.strip(" \t\r\n")
    match = _NUMBER[decimal].fullmatch(stripped)
    if match is None:
        if not finite and is_not_finite(stripped):
            return _value_not_finite(stripped)
        raise NumberError(_explain(stripped, decimal))
    mantissa = match["mantissa"] or match["bare_mantissa"]
    exponent = match["exponent"] or match["bare_exponent"] or "0"
    value = float(f"{mantissa.replace(',', '.')}e{exponent}")
    if math.isinf(value):
        raise NumberError(f"'{stripped}' is larger than any number in double precision; correct it")
    return value


def parse_numbers(texts: Sequence[str], *, decimal: str = ".", finite: bool = True) -> FloatArray:
    """Read numbers, each whole; fast where they are many.

    Parameters
    ----------
    texts : sequence of str
        One number each.
    decimal, finite
        As in `parse_number`.

    Returns
    -------
    (n_texts,) array
        The numbers.

    Raises
    ------
    NumberError
        On the first that is no number: `position` says which.

    Examples
    --------
    >>> parse_numbers(["1", "2.5e3", "-3.D0"]).tolist()
    [1.0, 2500.0, -3.0]
    """
    if decimal == "." and not " ".join(texts).translate(_ONLY_PLAIN):
        try:
            values = np.array(texts, dtype=np.str_).astype(np.float64) if len(texts) else np.empty(0)
        except ValueError:  # 1.5-3, or no number at all: found below
            values = np.full(len(texts), np.nan)
        if np.isfinite(values).all():
            return np.asarray(values, np.float64)
    values = np.empty(len(texts))
    for position, text in enumerate(texts):
        try:
            values[position] = parse_number(text, decimal=decimal, finite=finite)
        except NumberError as error:
            raise NumberError(str(error), position) from None
    return values


def is_number(text: str, *, decimal: str = ".") -> bool:
    """Tell whether a text is a number that `parse_number` reads.

    Parameters
    ----------
    text : str
        The text.
    decimal : str
        Point or comma.

    Returns
    -------
    bool
        True for a number.
    """
    return _NUMBER[decimal].fullmatch(text.strip(" \t\r\n")) is not None


def is_not_finite(text: str) -> bool:
    """Tell whether a text stands for infinity, NaN or a missing value.

    Parameters
    ----------
    text : str
        The text.

    Returns
    -------
    bool
        True for ``NaN``, ``-inf``, ``1.#QNAN``, ``#N/A``, nothing, and the like.
    """
    stripped = text.strip()
    return stripped.lower() in _MISSING or _NOT_FINITE.fullmatch(stripped) is not None


def _value_not_finite(text: str) -> float:
    if "inf" not in text.lower():
        return math.nan
    return -math.inf if text.startswith("-") else math.inf


def _explain(text: str, decimal: str) -> str:
    """Say why a text is no number, and what to write."""
    other = "," if decimal == "." else "."
    has_other_sign, thousands = is_number(text, decimal=other), _THOUSANDS.fullmatch(text)
    plain = text.replace(thousands["sign"], "") if thousands else text
    written, meant = ("a decimal comma", "points") if decimal == "." else ("a decimal point", "commas")
    doubtful = f"may have {written} or a thousands separator; write it as {plain} or as {text.replace(other, decimal)}"
    reasons = (
        (is_not_finite(text), "is no finite number; correct it, or leave its line out"),
        (thousands and has_other_sign, doubtful),
        (thousands, f"has a thousands separator; write it as {plain}"),
        (has_other_sign, f"has {written} where numbers have decimal {meant}; write all numbers alike"),
        (
            any(sign.isdecimal() > sign.isascii() for sign in text),
            "has digits that are none of 0 to 9; write it with those",
        ),
        (is_number(text.replace("_", ""), decimal=decimal), f"has underscores; write it as {text.replace('_', '')}"),
        (_HEXADECIMAL.fullmatch(text), "is hexadecimal; write it as a decimal number"),
    )
    reason = next((reason for applies, reason in reasons if applies), "stands where a number is expected; correct it")
    return f"'{text}' {reason}" if text else "nothing stands where a number is expected; write it"
