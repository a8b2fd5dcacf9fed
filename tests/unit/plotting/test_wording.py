"""Numbers as people read them."""

import numpy as np
import pytest

from frf_ipz.plotting.wording import listed, number, percent, small_percent, with_error
from frf_ipz.visible_text import counted


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0.0, 4, "0"),
        (16.0816, 4, "16.08"),
        (12345.6, 4, "12346"),
        (123456.0, 3, "1.23e5"),
        (-0.00012, 2, "-1.2e-4"),
        (np.inf, 4, "–"),
    ],
)
def test_number(value, digits, text):
    assert number(value, digits) == text


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (16.08312, 0.0041, "16.083 ± 0.004"),
        (1234.4, 20.0, "1234 ± 20"),
        (90224191.0, 1.1e7, "9.0e7 ± 1e7"),
        (0.36, np.nan, "0.36"),
        (0.36, np.inf, "0.36"),
        (284.951234, 1e-9, "284.951 ± 1e-9"),
    ],
)
def test_a_number_has_the_digits_its_deviation_supports(value, std, text):
    assert with_error(value, std) == text


def test_small_errors_do_not_claim_digits():
    assert small_percent(3e-8) == "< 0.001 %"
    assert small_percent(-0.05) == "-5 %"
    assert percent(float("nan")) == "–"


def test_lists_are_cut():
    assert listed(["a"]) == "a"
    assert listed(["a", "b", "c"]) == "a, b and c"
    assert listed(["a", "b", "c"], 2) == "a, b and 1 more"
    assert listed([]) == ""


def test_plurals():
    assert counted(1, "pole") == "1 pole"
    assert counted(2, "box", "boxes") == "2 boxes"
