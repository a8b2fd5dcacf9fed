"""Units are read by pint; what is no unit of its quantity is refused."""

import math
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from frf_ipz.errors import QuantityError
from frf_ipz.ingest.units import (
    USUAL,
    _parse,
    frf_factor,
    is_unit,
    numerator_of,
    sensitivity_factor,
    si_unit,
    unit_factor,
    unit_ratio,
)
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
        *(
            (unit, "acceleration", 1.0)
            for unit in ("m/s2", "ms-2", "m.s-2", "m·s⁻²", "m s-2", "m/sec^2", "M/S2", "(m/s²)")
        ),
        *((unit, "acceleration", 1.0) for unit in ("ms⁻²", "m/s/s", "Meters/sec2", "[m/s2]")),
        *((unit, "acceleration", 1e-3) for unit in ("mm/s2", "mm/s²", "mm/sÂ²", "mm/sý", "MM/S2", "mms-2")),
        *((unit, "acceleration", GRAVITY) for unit in ("g", "gn", "G", "g_n", "gee")),
        ("mg", "acceleration", 1e-3 * GRAVITY),
        *((unit, "acceleration", 0.0254) for unit in ("in/s2", "IN/SEC2", "in./sec.^2", "inch/s²")),
        *((unit, "force", POUND_FORCE) for unit in ("lb", "lbs", "LBF", "pounds")),
        *((unit, "force", 1.0) for unit in ("Newton", "Newtons", "newton", "kg*m/s2")),
        *((unit, "velocity", 0.0254) for unit in ("ips", "in/s", "IPS")),
        *((unit, "velocity", 1.0) for unit in ("ms-1", "m.s-1")),
        ("μm", "displacement", 1e-6),
        ("mils", "displacement", 2.54e-5),
        *((unit, "time", 1.0) for unit in ("sec", "second", "Seconds", "SEC")),
        ("msec", "time", 1e-3),
    ],
)
def test_units_of_signals(unit, quantity, factor):
    assert unit_factor(unit, quantity) == pytest.approx(factor, rel=1e-12)


def test_units_that_are_known_without_pint_are_as_pint_gives_them():
    factors = {(quantity, unit): factor for quantity, units in USUAL.items() for unit, factor in units.items()}
    assert factors == {(quantity, unit): _parse(unit).to(si_unit(quantity)).magnitude for quantity, unit in factors}


def test_a_usual_unit_does_not_load_pint():
    code = "import sys, frf_ipz.ingest.units as u; u.unit_factor('g', 'acceleration'); print('pint' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_units_of_rotations():
    assert unit_factor("N mm", "force", rotational=True) == pytest.approx(1e-3, rel=1e-12)
    for unit in ("Nm", "N.m", "N-m"):
        assert unit_factor(unit, "force", rotational=True) == pytest.approx(1.0, rel=1e-12)
    assert unit_factor("deg/s2", "acceleration", rotational=True) == pytest.approx(0.017453292519943295, rel=1e-12)
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
        ("10 mV/g", "acceleration", GRAVITY / 10),
        ("10 mV/ms-2", "acceleration", 0.1),
        ("10 mV/m/s²", "acceleration", 0.1),
        ("2 mV/lb", "force", POUND_FORCE / 2),
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
        ("g/N", FrfQuantity.ACCELERANCE, "zz", GRAVITY),
        ("(1/N)*(g)", FrfQuantity.ACCELERANCE, "zz", GRAVITY),
        ("(1/N)*(mm/s²)", FrfQuantity.ACCELERANCE, "zz", 1e-3),
        ("(m/s²)/N", FrfQuantity.ACCELERANCE, "zz", 1.0),
        ("in/s2/lbf", FrfQuantity.ACCELERANCE, "zz", 0.0254 / POUND_FORCE),
        ("g/lb", FrfQuantity.ACCELERANCE, "zz", GRAVITY / POUND_FORCE),
        ("m.s-2.N-1", FrfQuantity.ACCELERANCE, "zz", 1.0),
        ("rad/s2/N", FrfQuantity.ACCELERANCE, ("ry", "z"), 1.0),
    ],
)
def test_units_of_frfs(unit, quantity, directions, factor):
    assert frf_factor(unit, quantity, *directions) == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: unit_factor("kg", "acceleration"), "'kg' is no unit of acceleration; expected is m/s.2 or g"),
        (lambda: unit_factor("10,5 N", "force"), "no unit that can be read.*decimal point"),
        (lambda: sensitivity_factor("10,2 mV/g", "acceleration"), "no unit that can be read"),
        (lambda: unit_factor("9**9**9**9 N", "force"), "no unit that can be read"),
        (lambda: unit_factor("((9*1)**9)**9**9 N", "force"), "no unit"),
        (lambda: unit_factor("m/s� ", "acceleration"), "no unit that can be read"),
        (lambda: unit_factor("g rms", "acceleration"), "no unit"),
        (lambda: unit_factor("EU", "force"), "no unit"),
        (lambda: unit_factor("m/s2", "acceleration", rotational=True), "no unit of acceleration"),
        (lambda: frf_factor("m/s2/N", FrfQuantity.ACCELERANCE, "ry", "z"), "a unit like rad/s.2/N"),
        (lambda: frf_factor("g/N", FrfQuantity.ACCELERANCE, "ry", "z"), "a unit like rad/s.2/N"),
        (lambda: frf_factor("dB", FrfQuantity.ACCELERANCE, "z", "z"), "no unit"),
        (
            lambda: unit_factor("mm", "velocity"),
            "'mm' is no unit of velocity; expected is m/s or mm/s, or quantity = \"displacement\"",
        ),
        (lambda: unit_factor("g", "displacement"), 'expected is m, mm or um, or quantity = "acceleration"'),
        (lambda: unit_factor("blub", "force"), "'blub' is no unit that can be read; write it as in N"),
        (lambda: unit_factor("m/", "force"), "no unit that can be read"),
        (lambda: sensitivity_factor("10 mV", "force"), "is no ratio of units"),
        (lambda: sensitivity_factor("0 mV/N", "force"), "is zero"),
        (lambda: sensitivity_factor("1e300 mV/N", "force"), "zero, NaN or absurdly large"),
        (lambda: unit_factor("1e-300 N", "force"), "zero, NaN or absurdly large"),
        (lambda: sensitivity_factor("10 mV/m", "force"), "is not per unit of force"),
        (lambda: frf_factor("m/N", FrfQuantity.ACCELERANCE, "z", "z"), "'m/N' is no unit of accelerance"),
    ],
)
def test_what_is_no_unit_is_refused(call, says):
    with pytest.raises(QuantityError, match=says):
        call()


def test_two_ways_to_write_a_unit_are_one():
    assert unit_ratio("m/s^2", "m s**-2") == 1.0
    assert unit_ratio("g_0", "standard_gravity") == 1.0
    assert unit_ratio("V", "mV") == pytest.approx(1000.0)
    assert math.isnan(unit_ratio("N", "m"))
    assert unit_ratio("N", "whatever") is None


@given(st.text(alphabet="mskgNinlbfVradeg0123456789.*/^()-+ ²eE,", max_size=14))
def test_any_text_is_a_unit_or_an_error_of_ours(text):
    for quantity in ("force", "acceleration"):
        try:
            assert math.isfinite(unit_factor(text, quantity))
        except QuantityError as error:
            assert "\n" not in str(error)  # noqa: PT017  both ends are right
    is_unit(text)
