"""What holds for every beam and every chain of masses."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fe_models import ALUMINIUM, beam, structural_model
from frf_ipz.dofs import Dof
from frf_ipz.fe.changes import with_point_masses, with_springs
from frf_ipz.fe.eigen import solve_basis
from frf_ipz.fe.kinds.beam import BeamSection
from frf_ipz.fe.reduction.options import ReduceOptions
from frf_ipz.fe.reduction.reduce import reduce_to_dofs
from frf_ipz.fe.response import compute_frfs, model_poles
from frf_ipz.frf import FrfLabel
from frf_ipz.quantities import FrfQuantity

ENDS = st.sampled_from(["clamped", "pinned", "sliding", "free"])
ROUNDING = 1e-7  # relative, of frequencies and FRFs: condition numbers reach 1e9 for the most slender of these beams

EXAMPLES = settings(max_examples=40, deadline=None)  # an example solves several eigenproblems


@st.composite
def beams(draw):
    """Beams of any proportions, supports and theory, with another section somewhere."""
    elements = draw(st.integers(4, 25))
    first = draw(st.integers(1, elements))
    section = BeamSection(elements=(first, draw(st.integers(first, elements))), thickness_m=draw(st.floats(2e-3, 2e-2)))
    return beam(
        modal_ratio=draw(st.floats(0.002, 0.05)),
        elements=elements,
        formulation=draw(st.sampled_from(["timoshenko", "euler-bernoulli"])),
        length_m=draw(st.floats(0.1, 2.0)),
        thickness_m=draw(st.floats(2e-3, 3e-2)),
        left=draw(ENDS),
        right=draw(ENDS),
        section=(section,) if draw(st.booleans()) else (),
    )


def translations(model):
    return [dof for dof in model.dofs if dof.direction == "z"]


def label(output, excited, quantity=FrfQuantity.RECEPTANCE):
    return FrfLabel(output, excited, quantity)


def band(model):
    """Frequencies from below the first to above the third elastic mode, off the axis."""
    basis = solve_basis(model, n_modes=min(6, len(model.dofs)))
    omega = np.sqrt(basis.eigenvalues[basis.n_rigid :][:3])
    return np.linspace(0.3 * omega[0], 1.2 * omega[-1], 15) * (1j + 0.02)


@EXAMPLES
@given(beams(), st.data())
def test_the_response_is_reciprocal_and_real_in_time(model, data):
    first, second = (data.draw(st.sampled_from(model.dofs)) for _ in range(2))
    s = band(model)
    there, back = compute_frfs(model, [label(first, second), label(second, first)], s).T
    scale = np.abs(there).max()
    assert_allclose(back, there, rtol=0, atol=ROUNDING * scale)
    mirrored = compute_frfs(model, [label(first, second)], s.conj())[:, 0]
    assert_allclose(mirrored, there.conj(), rtol=0, atol=ROUNDING * scale)


@EXAMPLES
@given(beams(), st.floats(0.2, 5.0))
def test_a_stiffer_material_scales_the_frequencies(model, factor):
    stiffer = model.source.beam.youngs_modulus_Pa * factor
    options = {name: getattr(model.source.beam, name) for name in ALUMINIUM}
    options |= {name: getattr(model.source.beam, name) for name in ("left", "right", "section")}
    other = beam(**{**options, "youngs_modulus_Pa": stiffer})
    before, after = (solve_basis(one, n_modes=4).eigenvalues for one in (model, other))
    assert_allclose(after, factor * before, rtol=ROUNDING, atol=ROUNDING * before[-1])


@EXAMPLES
@given(beams(), st.data())
def test_a_mass_lowers_and_a_spring_raises_every_frequency(model, data):
    dof = data.draw(st.sampled_from(translations(model)))
    plain = solve_basis(model, n_modes=5).eigenvalues
    heavier = solve_basis(with_point_masses(model, {dof.node: 0.05}), n_modes=5).eigenvalues
    stiffer = solve_basis(with_springs(model, {dof: 1e4}), n_modes=5).eigenvalues
    slack = ROUNDING * plain[-1]
    assert (heavier <= plain + slack).all()
    assert (stiffer >= plain - slack).all()


@EXAMPLES
@given(beams(), st.data())
def test_a_reduced_model_keeps_modes_symmetry_and_the_band(model, data):
    dofs = translations(model)
    actuator, sensor, point = (data.draw(st.sampled_from(dofs)) for _ in range(3))
    s = band(model)
    highest = float(np.abs(s).max()) / (2 * np.pi)
    few = reduce_to_dofs(
        model,
        options=ReduceOptions(),
        actuators=[actuator],
        sensors=[sensor],
        points=[point],
        band_hz=(0.1 * highest, highest),
    )
    for matrix in (few.mass, few.damping, few.stiffness):
        assert (matrix == matrix.T).all()
    poles, whole = model_poles(few), model_poles(model, up_to_hz=highest)
    assert_allclose(poles[: len(whole)], whole, rtol=0, atol=1e-6 * np.abs(whole).max(initial=1.0))
    labels = [label(sensor, actuator), label(point, actuator)]
    exact = compute_frfs(model, labels, s)
    assert (np.linalg.norm(compute_frfs(few, labels, s) - exact, axis=0) < 0.02 * np.linalg.norm(exact, axis=0)).all()


@EXAMPLES
@given(st.lists(st.floats(0.1, 10.0), min_size=2, max_size=6), st.lists(st.floats(1e2, 1e6), min_size=6, max_size=6))
def test_a_free_chain_of_masses_has_one_rigid_body_mode(masses, springs):
    order = len(masses)
    ends = np.diff(np.eye(order), axis=0)
    stiffness = ends.T @ np.diag(springs[: order - 1]) @ ends
    dofs = [Dof(node + 1, "x") for node in range(order)]
    basis = solve_basis(structural_model(np.diag(masses), stiffness, dofs))
    assert basis.n_rigid == 1
    assert_allclose(basis.shapes[:, 0], 1 / np.sqrt(sum(masses)), rtol=1e-6)
    assert_allclose(np.sum(basis.eigenvalues), np.trace(stiffness / masses), rtol=1e-9)
