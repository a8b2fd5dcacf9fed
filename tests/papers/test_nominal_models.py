"""The nominal models of [Dorosti2018] (doi:10.1016/j.conengprac.2017.11.002), before any updating.

Section 4 is in rad/s, section 5 in Hz. The printed digits are cut off, not rounded.
"""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

import frf_testbench.updating
from fe_models import beam
from frf_ipz.dofs import parse_dof
from frf_ipz.fe.kinds.beam import BeamSection
from frf_ipz.fe.reduction.options import ReduceOptions
from frf_ipz.fe.reduction.reduce import reduce_to_dofs
from frf_ipz.fe.response import compute_frfs, model_poles
from frf_ipz.frf import FrfLabel
from frf_ipz.numerics.pencils import damped_zeros
from frf_ipz.quantities import FrfQuantity
from printed_digits import cut

DATA = Path(frf_testbench.updating.__file__).parent / "paper_tables"
# The first pole is printed as 16.6 and comes out as 16.7 Hz, the third as 292 and 293.05: the paper's own beam is up to
# 0.2 % off the properties of its table 4. The impact is one node closer to the clamp than its text says.
SECTION_5 = 0.008


def table(number):
    return pd.read_csv(DATA / f"dorosti2018_table{number}.csv", comment="#")


def properties(number):
    values = table(number).set_index("property")["value"]
    return {
        "youngs_modulus_Pa": float(values["youngs_modulus"]),
        "density_kg_m3": float(values["mass_density"]),
        "thickness_m": float(values["thickness"]),
        "width_m": float(values["width"]),
        "length_m": float(values["length"]),
        "modal_ratio": 0.001,
    }


def reduced(model, dofs, residual, actuator, sensor, point, band_hz):
    options = ReduceOptions(modes=5, dofs=tuple(dofs), residual_flexibility=(residual,))
    ends = {"actuators": [parse_dof(actuator)], "sensors": [parse_dof(sensor)], "points": [parse_dof(point)]}
    return reduce_to_dofs(model, options=options, band_hz=band_hz, **ends)


def zeros(model, output, excited):
    roots = damped_zeros(
        model.mass, model.damping, model.stiffness, model.row(parse_dof(output)), model.row(parse_dof(excited))
    ).values
    seen = roots[(roots.imag > 0) & (np.abs(roots.real) < 0.1 * np.abs(roots))]
    return seen[np.argsort(seen.imag)]


@pytest.fixture(scope="module")
def pinned_sliding():
    return beam(**properties(1), elements=12, formulation="euler-bernoulli", left="pinned", right="sliding")


@pytest.fixture(scope="module")
def section_4(pinned_sliding):
    dofs = [f"{node}:z" for node in (3, 4, 5, 7, 9, 11)]
    return reduced(pinned_sliding, dofs, "3:z", "3:z", "4:z", "7:z", (40 / (2 * np.pi), 5000 / (2 * np.pi)))


@pytest.fixture(scope="module")
def cantilever():
    return beam(**properties(4), poisson_ratio=0.33, elements=100, formulation="timoshenko", left="clamped")


@pytest.fixture(scope="module")
def section_5(cantilever):
    dofs = [f"{node}:z" for node in (9, 29, 49, 69, 89, 101)]
    return reduced(cantilever, dofs, "101:z", "89:z", "101:z", "49:z", (10.0, 700.0))


def test_poles_of_section_4_to_the_printed_digits(section_4):
    printed = table(2).query("kind == 'pole'")["numerical_imag"].to_numpy()
    assert_allclose(cut(model_poles(section_4)[:4].imag), printed, rtol=1e-9)


def test_zeros_of_section_4_to_the_printed_digits(section_4):
    printed = table(2).query("kind == 'zero'")["numerical_imag"].to_numpy()
    assert_allclose(cut(zeros(section_4, "4:z", "3:z")[:3].imag), printed, rtol=1e-9)


def test_the_changed_beam_of_section_4_has_the_experimental_poles():
    changed = BeamSection(elements=(12, 12), thickness_m=3.0e-2, width_m=1.333e-2)
    model = beam(
        **properties(1), elements=12, formulation="euler-bernoulli", left="pinned", right="sliding", section=(changed,)
    )
    printed = table(2).query("kind == 'pole'")["experimental_imag"].to_numpy()
    assert_allclose(cut(model_poles(model)[:4].imag), printed, rtol=1e-9)


def test_reduced_frf_of_section_4_is_that_of_the_whole_beam(section_4, pinned_sliding):
    label = FrfLabel(parse_dof("7:z"), parse_dof("3:z"), FrfQuantity.RECEPTANCE)
    s = 1j * np.linspace(40.0, 5000.0, 800)
    whole, few = (compute_frfs(model, [label], s) for model in (pinned_sliding, section_4))
    assert np.linalg.norm(few - whole) < 1e-3 * np.linalg.norm(whole)


def test_poles_and_zeros_of_section_5(section_5):
    rows = table(5)
    printed = rows.query("kind == 'pole'")["numerical_imag"].to_numpy()
    assert_allclose(model_poles(section_5)[:4].imag / (2 * np.pi), printed, rtol=SECTION_5)
    zeros_hz = zeros(section_5, "101:z", "88:z")[:3].imag / (2 * np.pi)
    assert_allclose(zeros_hz, rows.query("kind == 'zero'")["numerical_imag"].to_numpy(), rtol=SECTION_5)


def test_reduced_poles_and_zeros_of_section_5_are_those_of_the_whole_beam(cantilever, section_5):
    assert_allclose(model_poles(section_5)[:5], model_poles(cantilever)[:5], rtol=1e-9)
    dofs = [f"{node}:z" for node in (9, 29, 49, 69, 89, 101)]
    whole = reduce_to_dofs(
        cantilever,
        options=ReduceOptions(modes=40),
        actuators=[parse_dof("89:z")],
        sensors=[parse_dof("101:z")],
        points=[parse_dof(dof) for dof in dofs],
        band_hz=(10.0, 700.0),
    )
    # the third zero lies at 610 of 700 Hz, and the first mode beyond at 1411 Hz
    assert_allclose(zeros(section_5, "101:z", "89:z")[:3], zeros(whole, "101:z", "89:z")[:3], rtol=3e-3)
