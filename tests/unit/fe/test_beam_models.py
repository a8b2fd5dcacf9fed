"""A beam by another theory, under axial force, and between its nodes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from exact_beams import exact_frequencies_hz, rectangle
from fe_models import ALUMINIUM, LUMPED_TEXT, beam, read_text_model
from frf_ipz.dofs import Dof
from frf_ipz.errors import InputError
from frf_ipz.fe.beam_models import (
    deflection_row,
    geometric_stiffness,
    shear_slope_at,
    slope_row,
    with_axial_force,
    with_formulation,
)
from frf_ipz.fe.changes import with_point_masses, with_released_supports
from frf_ipz.fe.eigen import solve_basis

LENGTH = ALUMINIUM["length_m"]
BENDING = 69e9 * 25.33e-3 * 5.1e-3**3 / 12
CONVERGED = 1e-6  # relative error of omega^2 of 40 elements in the first mode
STEP = 1e-6  # m, of central differences


def first_omega_squared(model, count=1):
    return solve_basis(model, n_modes=count).eigenvalues


@pytest.mark.parametrize("share", [0.5, 0.1, -0.3, -0.9])
def test_axial_force_changes_the_frequency_of_a_pinned_beam_as_euler_said(share):
    # omega^2 is that without force times 1 + N / N_critical
    plain = beam(elements=40, formulation="euler-bernoulli", left="pinned", right="pinned")
    critical = np.pi**2 * BENDING / LENGTH**2
    loaded = with_axial_force(plain, share * critical)
    ratio = first_omega_squared(loaded) / first_omega_squared(plain)
    assert_allclose(ratio, 1 + share, rtol=CONVERGED * 10)


def test_at_the_critical_load_the_stiffness_is_gone():
    plain = beam(elements=40, formulation="euler-bernoulli", left="pinned", right="pinned")
    critical = np.pi**2 * BENDING / LENGTH**2
    lowest = np.linalg.eigvalsh(with_axial_force(plain, -critical).stiffness.toarray())
    assert abs(lowest[0]) < 1e-5 * np.linalg.eigvalsh(plain.stiffness.toarray())[0]


@pytest.mark.parametrize("formulation", ["euler-bernoulli", "timoshenko"])
def test_tension_agrees_with_the_exact_frequencies(formulation):
    plain = beam(elements=120, thickness_m=0.03, formulation=formulation, left="clamped", right="clamped")
    poisson = ALUMINIUM["poisson_ratio"] if formulation == "timoshenko" else None
    segment = rectangle(LENGTH, 25.33e-3, 0.03, 69e9, 2690.0, poisson, tension=2e5)
    exact = exact_frequencies_hz([segment], "clamped", "clamped", 3, 100.0, 2e4)
    natural_hz = solve_basis(with_axial_force(plain, 2e5), n_modes=3).natural_frequency_hz
    assert_allclose(natural_hz, exact, rtol=1e-3 if formulation == "timoshenko" else 1e-6)


def test_geometric_stiffness_is_the_derivative_of_stiffness_by_force():
    plain = beam(elements=5)
    difference = (with_axial_force(plain, 1.0).stiffness_all - with_axial_force(plain, -1.0).stiffness_all).toarray()
    assert_allclose(difference / 2, geometric_stiffness(plain).toarray(), rtol=0, atol=1e-6)  # entries of K are 1e8


@pytest.mark.parametrize("to", ["euler-bernoulli", "timoshenko"])
def test_another_theory_equals_a_rebuilt_beam(to):
    initial = {"euler-bernoulli": "timoshenko", "timoshenko": "euler-bernoulli"}[to]
    changed = with_formulation(beam(formulation=initial, left="clamped"), to)
    rebuilt = beam(formulation=to, left="clamped")
    for name in ("mass_all", "stiffness_all"):
        expected = getattr(rebuilt, name).toarray()
        assert_allclose(getattr(changed, name).toarray(), expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    assert_allclose(changed.parts[2].stiffness, rebuilt.parts[2].stiffness, rtol=1e-12)


@pytest.mark.parametrize("to", ["euler-bernoulli", "timoshenko"])
def test_another_theory_is_the_one_that_holds_between_nodes(to):
    initial = {"euler-bernoulli": "timoshenko", "timoshenko": "euler-bernoulli"}[to]
    rebuilt = beam(formulation=to, thickness_m=0.05)
    changed = with_formulation(beam(formulation=initial, thickness_m=0.05), to)
    assert_allclose(slope_row(changed, 0.111), slope_row(rebuilt, 0.111), rtol=1e-12)


def test_a_force_bends_a_corner_into_a_stocky_beam():
    # in the middle of a clamped-clamped beam, the slope on one side of a static force is the shear's alone
    model = beam(elements=40, left="clamped", right="clamped", thickness_m=0.05)
    motion, loads = np.zeros(len(model.all_dofs)), np.zeros(len(model.dofs))
    loads[model.index(Dof(21, "z"))] = 1.0
    motion[~model.fixed] = np.linalg.solve(model.stiffness.toarray(), loads)
    slope = slope_row(model, LENGTH / 2) @ motion  # of the element to the right
    assert_allclose(shear_slope_at(model, LENGTH / 2), -slope, rtol=1e-6)
    assert shear_slope_at(with_formulation(model, "euler-bernoulli"), LENGTH / 2) == shear_slope_at(model, LENGTH / 2)


def test_another_theory_keeps_what_was_added():
    model = with_released_supports(with_point_masses(beam(left="clamped"), {21: 0.01}), {Dof(1, "ry"): 50.0})
    changed = with_formulation(model, "euler-bernoulli")
    rebuilt = beam(left="clamped", formulation="euler-bernoulli")
    rebuilt = with_released_supports(with_point_masses(rebuilt, {21: 0.01}), {Dof(1, "ry"): 50.0})
    assert_allclose(first_omega_squared(changed, 3), first_omega_squared(rebuilt, 3), rtol=1e-9)
    assert [part.name for part in changed.parts] == [part.name for part in rebuilt.parts]


def test_only_a_beam_can_be_rebuilt(tmp_path):
    model = read_text_model(tmp_path, LUMPED_TEXT)
    for change in (lambda: with_formulation(model, "timoshenko"), lambda: deflection_row(model, 0.1)):
        with pytest.raises(InputError, match="kind 'lumped'"):
            change()


@pytest.mark.parametrize("formulation", ["euler-bernoulli", "timoshenko"])
def test_at_nodes_the_deflection_is_that_of_the_node(formulation):
    model = beam(elements=7, formulation=formulation)
    for node, x in zip(model.geometry.nodes, model.geometry.coordinates_m[:, 0], strict=True):
        expected = np.zeros(16)
        expected[model.full_index(Dof(int(node), "z"))] = 1.0
        assert_allclose(deflection_row(model, float(x)), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("formulation", ["euler-bernoulli", "timoshenko"])
def test_straight_lines_and_parabolas_are_met_between_nodes(formulation):
    model = beam(elements=5, formulation=formulation, thickness_m=0.05)
    x = model.geometry.coordinates_m[:, 0]
    for polynomial in ([2.0, -3.0], [1.0, 0.5, 4.0]):  # constant curvature needs no shear, so ry is -dw/dx
        line = np.polynomial.Polynomial(polynomial)
        motion = np.stack([line(x), -line.deriv()(x)], 1).ravel()
        for at in (0.0, 0.03, 0.2, 0.4995):
            assert_allclose(deflection_row(model, at) @ motion, line(at), rtol=1e-12)
            assert_allclose(slope_row(model, at) @ motion, line.deriv()(at), rtol=1e-10)


def test_a_stocky_cantilever_under_a_tip_load_is_met_between_nodes():
    # the element's shapes are the static ones: w = P x^2 (3 L - x) / 6 E I + P x / kappa G A everywhere
    thick, load = 0.1, 1e3
    model = beam(elements=3, left="clamped", thickness_m=thick)
    bending, shear_modulus = 69e9 * 25.33e-3 * thick**3 / 12, 69e9 / (2 * 1.33)
    shear = 10 * 1.33 / (12 + 11 * 0.33) * shear_modulus * 25.33e-3 * thick
    motion = np.zeros(len(model.all_dofs))
    loads = np.zeros(len(model.dofs))
    loads[model.index(Dof(4, "z"))] = load
    motion[~model.fixed] = np.linalg.solve(model.stiffness.toarray(), loads)
    for x in (0.05, 0.2, 0.31, LENGTH):
        expected = load * x**2 * (3 * LENGTH - x) / (6 * bending) + load * x / shear
        assert_allclose(deflection_row(model, x) @ motion, expected, rtol=1e-9)


def test_the_slope_is_the_derivative_of_the_deflection():
    model = beam(elements=5, thickness_m=0.05)
    for at in (0.013, 0.111, 0.34):
        difference = (deflection_row(model, at + STEP) - deflection_row(model, at - STEP)) / (2 * STEP)
        assert_allclose(slope_row(model, at), difference, rtol=0, atol=1e-6 * np.abs(difference).max())


def test_a_mode_between_nodes_converges_with_the_fourth_power_of_the_step():
    errors = []
    for elements in (6, 12, 24):
        model = beam(elements=elements, formulation="euler-bernoulli", left="pinned", right="pinned")
        basis = solve_basis(model, n_modes=1)
        at = 0.5 * LENGTH / elements  # amid the first element
        whole = np.zeros(len(model.all_dofs))
        whole[~model.fixed] = basis.shapes[:, 0] / np.abs(
            deflection_row(model, LENGTH / 2)[~model.fixed] @ basis.shapes[:, 0]
        )
        errors.append(abs(abs(deflection_row(model, at) @ whole) - np.sin(np.pi * at / LENGTH)))
    assert min(np.log2(np.array(errors[:-1]) / errors[1:])) > 3.5


@pytest.mark.parametrize("at", [-1e-3, 0.6, np.nan])
def test_a_position_off_the_beam_is_refused(at):
    with pytest.raises(InputError, match="not on the beam"):
        deflection_row(beam(), at)
