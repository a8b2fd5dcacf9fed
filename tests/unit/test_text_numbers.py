"""A number of a text file is read whole or refused."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frf_ipz.text_numbers import NumberError, is_number, parse_number, parse_numbers

READ = {
    "1": 1.0,
    "-0.5": -0.5,
    "+.5": 0.5,
    "5.": 5.0,
    "1e3": 1e3,
    "1.0D-03": 1e-3,
    "1.0d+3": 1e3,
    "-2.5-3": -2.5e-3,
    "1.+2": 100.0,
    "1.234-101": 1.234e-101,
    " 7 ": 7.0,
    "1e-400": 0.0,
}
REFUSED = {
    "": "nothing stands",
    "2,5": "decimal comma",
    "1,234": "thousands separator",
    "1,234.5": "write it as 1234.5",
    "1'234.5": "write it as 1234.5",
    "1 234": "write it as 1234",
    "1_000": "write it as 1000",
    "0x1F": "hexadecimal",
    "0x1p3": "hexadecimal",
    "3FA0": "hexadecimal",
    "nan": "no finite number",
    "-Inf": "no finite number",
    "1.#QNAN": "no finite number",
    "1e999": "larger than any number",
    "٣": "none of 0 to 9",
    "１２": "none of 0 to 9",
    "12.5 m/s²": "stands where a number is expected",
    "1-3": "is expected",
    "1.0e": "is expected",
    "1..2": "is expected",
    "1.5abc": "is expected",
    "--1": "is expected",
    "1e3.5": "is expected",
    "True": "is expected",
    "12:30": "is expected",
    "1\x00": "is expected",
}


@pytest.mark.parametrize(("text", "value"), READ.items())
def test_a_number_is_read_whole(text, value):
    assert parse_number(text) == value
    assert parse_numbers(["1", text]).tolist() == [1.0, value]


@pytest.mark.parametrize(("text", "reason"), REFUSED.items())
def test_what_is_no_number_is_refused_with_the_reason(text, reason):
    with pytest.raises(NumberError, match=reason):
        parse_number(text)
    with pytest.raises(NumberError) as info:
        parse_numbers(["1", text])
    assert info.value.position == 1


def test_a_decimal_comma_is_read_where_it_is_expected():
    assert parse_number("-2,5D1", decimal=",") == -25.0
    with pytest.raises(NumberError, match="decimal point"):
        parse_number("2.5", decimal=",")
    with pytest.raises(NumberError, match="thousands separator"):
        parse_number("1.234,5", decimal=",")


def test_missing_values_are_given_where_they_are_allowed():
    values = parse_numbers(["inf", "-Infinity", "NaN", "", "#N/A", "1.#IND"], finite=False)
    assert values[0] == math.inf
    assert values[1] == -math.inf
    assert np.isnan(values[2:]).all()


@given(st.text(max_size=12))
def test_any_text_is_read_as_python_reads_it_or_refused(text):
    """Python's own reader is the second opinion wherever it reads plain numbers."""
    try:
        value = parse_number(text)
    except NumberError as error:
        assert not is_number(text) or "larger" in str(error)  # noqa: PT017  both ends are right
    else:
        exponent = text.strip().lower().replace("d", "e").replace("q", "e")
        if "e" in exponent or not any(sign in exponent[1:] for sign in "+-"):
            assert value == float(exponent)


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), max_size=20))
def test_printed_numbers_come_back(values):
    assert parse_numbers([repr(value) for value in values]).tolist() == values
