"""Units are read by pint; what is no unit of its quantity is refused."""

import pytest

from frf_ipz.errors import QuantityError
from frf_ipz.ingest.units import frf_factor, numerator_of, same_unit, sensitivity_factor, si_unit, unit_factor
from frf_ipz.quantities import FrfQuantity

POUND_FORCE, GRAVITY = 4.4482216152605, 9.80665  # by definition


@pytest.mark.parametrize(
    ("unit", "quantity", "factor"),
    [
        ("N", "force", 1.0),
        ("kN", "force", 1e3),
        ("lbf", "force", POUND_FORCE),
        ("m/s^2", "acceleration", 1.0),
        ("m/s**2", "acceleration", 1.0),
        ("m/s²", "acceleration", 1.0),
        ("g_0", "acceleration", GRAVITY),
        ("mm/s", "velocity", 1e-3),
        ("in/s", "velocity", 0.0254),
        ("um", "displacement", 1e-6),
        ("µm", "displacement", 1e-6),
        ("ms", "time", 1e-3),
    ],
)
def test_units_of_signals(unit, quantity, factor):
    assert unit_factor(unit, quantity) == pytest.approx(factor, rel=1e-12)


def test_units_of_rotations():
    assert unit_factor("N mm", "force", rotational=True) == pytest.approx(1e-3, rel=1e-12)
    assert unit_factor("mrad/s^2", "acceleration", rotational=True) == pytest.approx(1e-3, rel=1e-12)
    assert si_unit("velocity", rotational=True) == "rad/s"


@pytest.mark.parametrize(
    ("sensitivity", "quantity", "factor"),
    [
        ("10.2 mV/g_0", "acceleration", GRAVITY / 10.2),
        ("2.25 mV/N", "force", 1 / 2.25),
        ("10 mV/lbf", "force", POUND_FORCE / 10),
        ("100 mV/(m/s^2)", "acceleration", 0.01),
        ("50 pC/N", "force", 0.02),
        ("-4 mV/N", "force", -0.25),
        ("1e-3 V/N", "force", 1e3),
    ],
)
def test_sensitivities_turn_the_numerators_unit_into_si(sensitivity, quantity, factor):
    assert sensitivity_factor(sensitivity, quantity) == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "unit"), [("10.2 mV/g_0", "mV"), ("1e-3 V/N", "V"), ("mV/N", "mV"), ("-4 mV/N", "mV")]
)
def test_the_numerator_is_the_columns_unit(text, unit):
    assert numerator_of(text) == unit


@pytest.mark.parametrize(
    ("unit", "quantity", "directions", "factor"),
    [
        ("g_0/N", FrfQuantity.ACCELERANCE, "zz", GRAVITY),
        ("mm/s/lbf", FrfQuantity.MOBILITY, "zz", 1e-3 / POUND_FORCE),
        ("um/N", FrfQuantity.RECEPTANCE, "zx", 1e-6),
        ("1/kg", FrfQuantity.ACCELERANCE, "zz", 1.0),
    ],
)
def test_units_of_frfs(unit, quantity, directions, factor):
    assert frf_factor(unit, quantity, *directions) == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: unit_factor("g", "acceleration"), "'g' is the gram, the acceleration of gravity is 'g_0'"),
        (lambda: unit_factor("mm", "velocity"), "'mm' is no unit of velocity; expected is m/s or mm/s"),
        (lambda: unit_factor("blub", "force"), "'blub' is no unit that can be read; write it as in N"),
        (lambda: unit_factor("m/", "force"), "no unit that can be read"),
        (lambda: sensitivity_factor("10 mV", "force"), "is no ratio of units"),
        (lambda: sensitivity_factor("0 mV/N", "force"), "is zero"),
        (lambda: sensitivity_factor("10 mV/m", "force"), "is not per unit of force"),
        (lambda: frf_factor("m/N", FrfQuantity.ACCELERANCE, "z", "z"), "'m/N' is no unit of accelerance"),
    ],
)
def test_what_is_no_unit_is_refused(call, says):
    with pytest.raises(QuantityError, match=says):
        call()


def test_two_ways_to_write_a_unit_are_one():
    assert same_unit("m/s^2", "m s**-2") is True
    assert same_unit("g_0", "standard_gravity") is True
    assert same_unit("N", "kN") is False
    assert same_unit("N", "m") is False
    assert same_unit("N", "whatever") is None
