"""Truth beams against closed formulas."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from frf_testbench.simulator.signals.receptance import solve_modes
from frf_testbench.simulator.structures.beams import BeamDrawing, PointPart, Section, build_beam
from frf_testbench.simulator.structures.reality import Reality
from frf_testbench.simulator.structures.structure import Point

CLOSED_FORM = 1e-7  # roots of the characteristic equations are given to 1e-9
MESH = 2e-6  # what doubling the number of splines still moves in the first six frequencies

DRAWING = BeamDrawing(
    length_m=0.5, elements=50, formulation="euler-bernoulli", youngs_modulus_pa=70e9, density_kg_m3=2700.0,
    poisson_ratio=0.33, width_m=0.025, thickness_m=0.005, left="clamped", right="free",
)  # fmt: skip
LINE_MASS = 2700.0 * 0.025 * 0.005
BENDING = 70e9 * 0.025 * 0.005**3 / 12

# roots of the characteristic equations, beta L
ROOTS = {
    ("clamped", "free"): [1.875104068712, 4.694091132974, 7.854757438238],
    ("pinned", "pinned"): [np.pi, 2 * np.pi, 3 * np.pi],
    ("clamped", "pinned"): [3.926602312048, 7.068582745629, 10.210176122813],
    ("clamped", "clamped"): [4.730040744863, 7.853204624096, 10.995607838002],
    ("pinned", "sliding"): [np.pi / 2, 3 * np.pi / 2, 5 * np.pi / 2],
    ("clamped", "sliding"): [2.365020372431, 5.497803919001, 8.639379828700],
}


def frequencies(drawing, reality=None, count=3):
    return solve_modes(build_beam(drawing, reality)).omega_rad_s[:count]


@pytest.mark.parametrize(("left", "right"), ROOTS)
def test_euler_beams_have_the_frequencies_of_the_characteristic_equation(left, right):
    expected = (np.array(ROOTS[left, right]) / 0.5) ** 2 * np.sqrt(BENDING / LINE_MASS)
    assert_allclose(frequencies(replace(DRAWING, left=left, right=right)), expected, rtol=CLOSED_FORM)


def test_a_free_beam_has_two_rigid_motions():
    omega = frequencies(replace(DRAWING, left="free", right="free"), count=3)
    expected = (4.730040744863 / 0.5) ** 2 * np.sqrt(BENDING / LINE_MASS)
    assert_allclose(omega[2], expected, rtol=CLOSED_FORM)
    assert (omega[:2] < 1e-3 * expected).all()


def test_pinned_timoshenko_beams_have_the_frequencies_of_the_quartic():
    thick = replace(DRAWING, formulation="timoshenko", left="pinned", right="pinned", thickness_m=0.05)
    area, second_moment = 0.025 * 0.05, 0.025 * 0.05**3 / 12
    shear = 10 * 1.33 / (12 + 11 * 0.33) * 70e9 / (2 * 1.33) * area
    beta = np.pi * np.arange(1, 4) / 0.5
    mass, rotary, bending = 2700 * area, 2700 * second_moment, 70e9 * second_moment
    # m J w^4 - (m (B b^2 + S) + J S b^2) w^2 + S B b^4 = 0
    linear = mass * (bending * beta**2 + shear) + rotary * shear * beta**2
    squares = (linear - np.sqrt(linear**2 - 4 * mass * rotary * shear * bending * beta**4)) / (2 * mass * rotary)
    assert_allclose(frequencies(thick), np.sqrt(squares), rtol=CLOSED_FORM)


def test_tension_raises_a_pinned_beam_as_the_formula_says():
    pinned = replace(DRAWING, left="pinned", right="pinned")
    beta = np.pi * np.arange(1, 4) / 0.5
    expected = np.sqrt((BENDING * beta**4 + 300.0 * beta**2) / LINE_MASS)
    assert_allclose(frequencies(pinned, Reality(axial_load_n=300.0)), expected, rtol=CLOSED_FORM)


def test_stiff_springs_hold_an_end_as_a_clamp_does():
    released = Reality(released={"left": (1e9, 1e13)})
    assert_allclose(frequencies(DRAWING, released), frequencies(DRAWING), rtol=1e-6)  # compliance of the springs


def test_a_sprung_end_has_the_frequencies_of_its_characteristic_equation():
    soft = Reality(released={"left": (BENDING / 0.5, None)})  # k L / EI = 1

    def equation(x):  # k L / EI (1 + cos x cosh x) = x (sin x cosh x - cos x sinh x)
        return 1 + np.cos(x) * np.cosh(x) - x * (np.sin(x) * np.cosh(x) - np.cos(x) * np.sinh(x))

    roots = np.array([brentq(equation, 1, 1.5), brentq(equation, 3.5, 4.6)])
    expected = (roots / 0.5) ** 2 * np.sqrt(BENDING / LINE_MASS)
    assert_allclose(frequencies(DRAWING, soft, 2), expected, rtol=CLOSED_FORM)


def test_static_compliance_of_the_tip_is_that_of_the_textbook():
    beam = build_beam(DRAWING)
    tip, turn = beam.row(Point(51)), beam.row(Point(51, "ry"))
    bent = np.linalg.solve(beam.stiffness, tip)
    assert_allclose(tip @ bent, 0.5**3 / (3 * BENDING), rtol=CLOSED_FORM)
    assert_allclose(turn @ bent, -(0.5**2) / (2 * BENDING), rtol=CLOSED_FORM)


def test_softened_elements_and_sections_agree():
    thinner = Section(first=11, last=20, width_m=0.025 * 0.8, thickness_m=0.005)
    drawn = build_beam(replace(DRAWING, sections=(thinner,)))
    real = build_beam(DRAWING, Reality(softened=(((11, 20), 0.8),)))
    load = np.array([drawn.row(Point(51)), real.row(Point(51))], dtype=object)
    compliance = [
        r.astype(float) @ np.linalg.solve(b.stiffness, r.astype(float))
        for r, b in zip(load, (drawn, real), strict=True)
    ]
    assert_allclose(compliance[0], compliance[1], rtol=CLOSED_FORM)
    assert_allclose(drawn.mass.shape, real.mass.shape)


def test_a_mass_in_the_drawing_is_the_same_as_one_that_is_added():
    parts = (PointPart(node=20, mass_kg=0.02, rotary_inertia_kgm2=1e-5),)
    known = build_beam(replace(DRAWING, parts=parts))
    added = build_beam(DRAWING, Reality(stations=(20,)))
    added = added.with_mass(Point(20), 0.02).with_mass(Point(20, "ry"), 1e-5)
    assert_allclose(solve_modes(known).omega_rad_s[:5], solve_modes(added).omega_rad_s[:5], rtol=1e-9)  # eigensolver


def test_more_splines_change_nothing():
    stepped = replace(
        DRAWING, formulation="timoshenko", sections=(Section(first=12, last=17, width_m=0.02, thickness_m=0.01),)
    )
    coarse, fine = (solve_modes(build_beam(stepped, intervals=n)).omega_rad_s[:6] for n in (26, 52))
    assert_allclose(coarse, fine, rtol=MESH)
