"""Natural frequencies of beams against transfer matrices, which know no elements."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from exact_beams import exact_frequencies_hz, rectangle
from fe_models import beam
from frf_ipz.fe.eigen import solve_modes
from frf_ipz.fe.kinds.beam import BeamPointMass, BeamPointSpring, BeamSection

LENGTH, WIDTH, THICK, MODULUS, DENSITY, POISSON = 0.6, 0.03, 0.06, 70e9, 2700.0, 0.33
STOCKY = {
    "length_m": LENGTH,
    "width_m": WIDTH,
    "thickness_m": THICK,
    "youngs_modulus_Pa": MODULUS,
    "density_kg_m3": DENSITY,
    "poisson_ratio": POISSON,
}
ENDS = [
    ("clamped", "free"),
    ("free", "clamped"),
    ("clamped", "clamped"),
    ("pinned", "pinned"),
    ("pinned", "sliding"),
    ("sliding", "clamped"),
    ("free", "free"),
    ("free", "pinned"),
    ("sliding", "sliding"),
    ("sliding", "free"),
]
FINE = 1e-6  # relative error of 120 elements in the third mode, by the observed order
COUNT = 4


def elastic_hz(model, count):
    frequency = solve_modes(model).natural_frequency_hz
    return frequency[frequency > 0][:count]


def exact_hz(left, right, poisson_ratio=None, count=COUNT):
    whole = rectangle(LENGTH, WIDTH, THICK, MODULUS, DENSITY, poisson_ratio)
    return exact_frequencies_hz([whole], left, right, count, 40.0, 3e4)


@pytest.mark.parametrize(("left", "right"), ENDS)
@pytest.mark.parametrize(("formulation", "poisson_ratio"), [("euler-bernoulli", None), ("timoshenko", POISSON)])
def test_frequencies_agree_with_the_exact_ones(left, right, formulation, poisson_ratio):
    model = beam(**STOCKY, elements=120, formulation=formulation, left=left, right=right)
    assert_allclose(elastic_hz(model, COUNT), exact_hz(left, right, poisson_ratio), rtol=FINE)


@pytest.mark.parametrize(
    ("left", "right", "roots"),
    [
        ("clamped", "free", [1.875104068711961, 4.694091132974175, 7.854757438237613]),
        ("pinned", "pinned", [np.pi, 2 * np.pi, 3 * np.pi]),
        ("free", "free", [4.730040744862704, 7.853204624095838, 10.995607838001671]),
    ],
)
def test_frequencies_agree_with_the_textbook(left, right, roots):
    second_moment, area = WIDTH * THICK**3 / 12, WIDTH * THICK
    expected = (np.array(roots) / LENGTH) ** 2 * np.sqrt(MODULUS * second_moment / (DENSITY * area)) / (2 * np.pi)
    model = beam(**STOCKY, elements=60, formulation="euler-bernoulli", left=left, right=right)
    assert_allclose(elastic_hz(model, 3), expected, rtol=FINE)


@pytest.mark.parametrize(("formulation", "poisson_ratio"), [("euler-bernoulli", None), ("timoshenko", POISSON)])
def test_frequencies_converge_with_the_fourth_power_of_the_elements_length(formulation, poisson_ratio):
    exact = exact_hz("clamped", "free", poisson_ratio)
    errors = []
    for elements in (8, 16, 32):
        model = beam(**STOCKY, elements=elements, formulation=formulation, left="clamped")
        errors.append(elastic_hz(model, COUNT) ** 2 / exact**2 - 1)
    observed = np.log2(np.array(errors[:-1]) / errors[1:])
    assert_allclose(observed[1], 4, atol=0.1)


def test_a_slender_beam_does_not_lock():
    slender = {**STOCKY, "thickness_m": 1e-4}
    sheared = elastic_hz(beam(**slender, elements=10, formulation="timoshenko", left="clamped"), COUNT)
    plain = elastic_hz(beam(**slender, elements=10, formulation="euler-bernoulli", left="clamped"), COUNT)
    assert_allclose(sheared, plain, rtol=1e-5)  # (thickness / length)^2 is 3e-8, times the square of the mode number


def test_sections_masses_and_springs_agree_with_the_exact_frequencies():
    model = beam(
        **STOCKY,
        elements=60,
        formulation="timoshenko",
        left="clamped",
        right="free",
        section=(BeamSection(elements=(21, 30), thickness_m=0.08, width_m=0.02),),
        point_mass=(BeamPointMass(node=21, mass_kg=0.4, rotary_inertia_kgm2=3e-4),),
        point_spring=(BeamPointSpring(node=46, stiffness_N_m=2e6, rotational_stiffness_Nm_rad=5e4),),
    )
    plain = (WIDTH, THICK, MODULUS, DENSITY, POISSON)
    segments = [
        rectangle(0.2, *plain, end_mass=0.4, end_rotary_inertia=3e-4),
        rectangle(0.1, 0.02, 0.08, MODULUS, DENSITY, POISSON),
        rectangle(0.15, *plain, end_spring=2e6, end_rotational_spring=5e4),
        rectangle(0.15, *plain),
    ]
    exact = exact_frequencies_hz(segments, "clamped", "free", COUNT, 40.0, 3e4)
    # 60 elements: the error at the point mass is of second order
    assert_allclose(elastic_hz(model, COUNT), exact, rtol=2e-5)


def test_a_section_as_thick_as_the_beam_changes_nothing():
    plain = beam(**STOCKY, left="clamped")
    same = beam(**STOCKY, left="clamped", section=(BeamSection(elements=(3, 5), width_m=WIDTH),))
    assert_allclose(elastic_hz(same, COUNT), elastic_hz(plain, COUNT), rtol=1e-12)
