"""Modes: rigid-body motion, small and large models, many and few modes, and what modes leave out."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import linalg, sparse

from brick_plate import plate_matrices
from fe_models import beam, structural_model
from frf_ipz.dofs import Dof
from frf_ipz.errors import ConvergenceError, IllConditionedError, InputError
from frf_ipz.fe import eigen
from frf_ipz.fe.eigen import solve_basis, solve_modes
from frf_ipz.numerics import block_lanczos
from frf_ipz.numerics.factorization import factorize

ROUNDING = 1e-12  # products of small well-conditioned matrices
EIGENVALUE = 1e-7  # relative, omega^2 of the first modes of a mesh with a condition number of 1e9


def plate(counts=(10, 10, 1), sides_m=(0.2, 0.2, 0.01), held=False):
    stiffness, mass, corners = plate_matrices(counts, sides_m)
    dofs = [Dof(node + 1, axis) for node in range(len(corners)) for axis in "xyz"]
    fixed = np.repeat(corners[:, 0] < 1e-9, 3) if held else None
    return structural_model(mass, stiffness, dofs, coordinates_m=corners, fixed=fixed)


@pytest.fixture(scope="module")
def free_plate():
    return plate()


def require_modes(model, basis, tolerance=1e-10):  # rounding of K phi, whose terms nearly cancel
    count = len(basis.eigenvalues)
    stiffness, mass = model.stiffness, model.mass
    assert_allclose(basis.shapes.T @ (mass @ basis.shapes), np.eye(count), rtol=0, atol=ROUNDING)
    misfit = stiffness @ basis.shapes - (mass @ basis.shapes) * basis.eigenvalues
    scale = np.linalg.norm(abs(stiffness) @ np.abs(basis.shapes), axis=0)
    assert (np.linalg.norm(misfit, axis=0) <= tolerance * scale).all()


@pytest.mark.parametrize(("right", "n_rigid"), [("free", 2), ("sliding", 1), ("pinned", 1), ("clamped", 0)])
def test_rigid_body_modes_of_a_beam(right, n_rigid):
    model = beam(elements=40, right=right)
    basis = solve_basis(model, n_modes=6)
    assert basis.n_rigid == n_rigid
    assert (basis.eigenvalues[:n_rigid] == 0).all()
    assert (basis.eigenvalues[n_rigid:] > 0).all()
    require_modes(model, basis)


@pytest.mark.parametrize("elements", [10, 258, 299, 700])
def test_first_elastic_mode_of_a_fine_mesh_keeps_its_digits(elements):
    # the stiffness of the finest mesh is 1e13 times that of the first mode
    model = beam(elements=elements, formulation="euler-bernoulli")
    basis = solve_basis(model, n_modes=4)
    second_moment, area = 25.33e-3 * 5.1e-3**3 / 12, 25.33e-3 * 5.1e-3
    exact = 4.730040744862704**4 * 69e9 * second_moment / (2690 * area * 0.4995**4)
    assert basis.n_rigid == 2
    assert_allclose(basis.eigenvalues[2], exact, rtol=1e-4 if elements == 10 else EIGENVALUE)


@pytest.mark.parametrize("elements", [60, 720])
def test_a_very_soft_suspension_is_no_rigid_body_motion(elements):
    model = beam(elements=elements)
    hung = model.stiffness_all.tolil()
    for node in (1 + elements // 5, 1 + 4 * elements // 5):
        hung[2 * node - 2, 2 * node - 2] += 1.0
    places = model.geometry.coordinates_m
    modes = solve_modes(structural_model(model.mass_all, hung, model.all_dofs, coordinates_m=places), n_modes=3)
    mass = 2690 * 0.4995 * 25.33e-3 * 5.1e-3
    assert_allclose(modes.natural_frequency_hz[0], np.sqrt(2.0 / mass) / (2 * np.pi), rtol=1e-3)
    assert modes.natural_frequency_hz[2] > 100


@pytest.mark.parametrize("digits", [10, 12])
def test_printed_positions_do_not_hide_the_modes_of_a_machine_on_mounts(digits):
    """Under a rotation a stiffness seems as rounded as the positions of the nodes are."""
    model = beam(elements=700)
    hung = model.stiffness_all.tolil()
    for node in (141, 561):
        hung[2 * node - 2, 2 * node - 2] += 50.0
    places = np.array([[float(f"{value:.{digits}g}") for value in place] for place in model.geometry.coordinates_m])
    basis = solve_basis(structural_model(model.mass_all, hung, model.all_dofs, coordinates_m=places), n_modes=4)
    exact = solve_basis(
        structural_model(model.mass_all, hung, model.all_dofs, coordinates_m=model.geometry.coordinates_m), n_modes=4
    )
    assert basis.n_rigid == 0
    assert_allclose(basis.natural_frequency_hz, exact.natural_frequency_hz, rtol=1e-4)
    free = structural_model(model.mass_all, model.stiffness_all, model.all_dofs, coordinates_m=places)
    assert solve_basis(free, n_modes=4).n_rigid == 2


def test_large_models_have_the_modes_of_small_ones(free_plate, monkeypatch):
    large = solve_basis(free_plate, n_modes=14)
    monkeypatch.setattr(eigen, "DENSE_ORDER", 10**6)
    small = solve_basis(free_plate, n_modes=14)
    assert large.n_rigid == small.n_rigid == 6
    assert_allclose(large.eigenvalues[6:], small.eigenvalues[6:], rtol=EIGENVALUE)
    require_modes(free_plate, large)
    require_modes(free_plate, small)


def test_a_loose_part_of_a_held_structure_is_found(free_plate):
    matrices = [
        sparse.block_diag([matrix] * 2, format="csr") for matrix in (free_plate.mass_all, free_plate.stiffness_all)
    ]
    corners = free_plate.geometry.coordinates_m
    above = np.vstack([corners, corners + np.array([0, 0, 0.1])])
    dofs = [Dof(node + 1, axis) for node in range(len(above)) for axis in "xyz"]
    fixed = np.concatenate([np.repeat(corners[:, 0] < 1e-9, 3), np.zeros(3 * len(corners), bool)])
    model = structural_model(*matrices, dofs, coordinates_m=above, fixed=fixed)
    basis = solve_basis(model, n_modes=9)
    assert basis.n_rigid == 6
    require_modes(model, basis)


def test_a_long_chain_of_masses_has_the_frequencies_of_the_formula():
    count, stiffness = 1000, 1e6
    springs = stiffness * sparse.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(count, count))
    model = structural_model(sparse.eye_array(count), springs, [Dof(place + 1, "x") for place in range(count)])
    exact = 2 * np.sqrt(stiffness) * np.sin(np.arange(1, 6) * np.pi / (2 * count + 2)) / (2 * np.pi)
    assert_allclose(solve_modes(model, n_modes=5).natural_frequency_hz, exact, rtol=1e-9)


def test_a_solve_that_does_not_converge_is_repeated_farther_from_zero(free_plate, monkeypatch):
    real, shifts = eigen._lanczos, []

    def reluctant(system, factor, shift, *limits):
        shifts.append(shift)
        if len(shifts) == 1:
            raise ConvergenceError("the eigensolver found 0 of 8 modes")
        return real(system, factor, shift, *limits)

    monkeypatch.setattr(eigen, "_lanczos", reluctant)
    assert solve_basis(free_plate, n_modes=8).n_rigid == 6
    assert_allclose(np.sqrt(shifts[1] / shifts[0]), eigen.SHIFT / eigen.HELD_SHIFT, rtol=ROUNDING)


def test_no_convergence_is_reported(free_plate, monkeypatch):
    monkeypatch.setattr(block_lanczos, "MOST_VECTORS", 0)
    with pytest.raises(ConvergenceError, match=r"found [0-7] of 8 modes"):
        solve_basis(free_plate, n_modes=8)


def test_more_copies_of_a_mode_than_a_block_has_vectors_are_found():
    # as many bodies that hang free, each with the same modes
    count, springs = 40, sparse.csr_array([[1.0, -1.0, 0.0], [-1.0, 3.0, -2.0], [0.0, -2.0, 2.0]])
    stiffness = sparse.csr_array(sparse.kron(sparse.eye_array(count), 1e6 * springs))
    dofs = [Dof(1 + place, "x") for place in range(3 * count)]
    model = structural_model(sparse.eye_array(3 * count), stiffness, dofs)
    system = eigen._System.of(model)
    shift = 1e4
    factor = factorize(stiffness + shift * model.mass, system.node_numbers)
    shapes = eigen._lanczos(system, factor, shift, 3 * count, 200.0)
    squares = np.sum(shapes * (stiffness @ shapes), 0)
    expected = np.repeat(linalg.eigvalsh(1e6 * springs.toarray()), count)
    within = expected < (2 * np.pi * 200.0) ** 2
    assert_allclose(squares[: within.sum()], expected[within], rtol=1e-9, atol=1e-3)
    assert len(squares) == within.sum() + 1


def test_double_modes_are_both_found(free_plate):
    frequency = solve_modes(free_plate, n_modes=12).natural_frequency_hz[6:]
    twins = np.flatnonzero(np.abs(np.diff(frequency)) < 1e-6 * frequency[:-1])
    assert len(twins) >= 1, "a square plate has two equal modes"


def test_one_factorization_serves_a_free_and_a_held_structure(free_plate, monkeypatch):
    shifts = []
    real = eigen.factorize
    monkeypatch.setattr(eigen, "factorize", lambda matrix, nodes: shifts.append(1) or real(matrix, nodes))
    solve_basis(free_plate, n_modes=12)
    assert len(shifts) == 1
    held = solve_basis(plate(held=True), n_modes=6)
    assert len(shifts) == 2
    assert held.n_rigid == 0
    require_modes(plate(held=True), held)


def test_a_bad_guess_of_the_shift_is_corrected(free_plate, monkeypatch):
    good = solve_basis(free_plate, n_modes=10)
    monkeypatch.setattr(eigen, "_first_shift_hz", lambda *_: 1e-3)
    mended = solve_basis(free_plate, n_modes=10)
    assert_allclose(mended.shift, (0.4 * 2 * np.pi * good.natural_frequency_hz[6]) ** 2, rtol=1e-6)
    assert_allclose(mended.eigenvalues[6:], good.eigenvalues[6:], rtol=EIGENVALUE)


@pytest.mark.parametrize("large", [False, True])
def test_modes_up_to_a_frequency(large, free_plate, monkeypatch):
    model = free_plate if large else beam(elements=60)
    monkeypatch.setattr(block_lanczos, "BLOCK", 3)
    known = solve_basis(model, n_modes=30).natural_frequency_hz
    for count in (7, 20, 26):
        apart = known[count] > 1.001 * known[count - 1]
        limit = (known[count - 1] + known[count]) / 2 if apart else known[count] * 1.0005
        natural_hz = solve_modes(model, up_to_hz=limit).natural_frequency_hz
        assert_allclose(natural_hz, known[known <= limit], rtol=EIGENVALUE, atol=1e-9 * limit)
    assert len(solve_modes(model, up_to_hz=limit, n_modes=9).natural_frequency_hz) == 9


def test_many_modes_of_a_large_model_are_all_there(monkeypatch):
    monkeypatch.setattr(eigen, "DENSE_ORDER", 50)
    assert len(solve_basis(beam(elements=60), n_modes=122).eigenvalues) == 122


def test_all_modes_of_a_small_model_are_orthonormal():
    model = beam(elements=60, left="clamped")
    basis = solve_basis(model)
    assert len(basis.eigenvalues) == 120
    require_modes(model, basis, tolerance=1e-7)  # 1 / (omega^2 + tau) has few digits for the highest modes
    assert_allclose(basis.shapes @ basis.shapes.T @ model.mass.toarray(), np.eye(120), rtol=0, atol=1e-6)


def test_a_single_dof_and_masses_without_springs():
    oscillator = structural_model([[2.0]], [[8.0]], [Dof(1, "x")])
    assert_allclose(solve_modes(oscillator).natural_frequency_hz, [2 / (2 * np.pi)], rtol=ROUNDING)
    loose = structural_model(np.diag([2.0, 3.0]), np.zeros((2, 2)), [Dof(1, "x"), Dof(2, "x")])
    assert solve_basis(loose).n_rigid == 2


def test_disconnected_bodies_have_a_rigid_body_mode_each():
    pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
    model = structural_model(np.eye(4), linalg.block_diag(pair, 5 * pair), [Dof(node, "x") for node in (1, 2, 3, 4)])
    assert solve_basis(model).n_rigid == 2


def test_residual_flexibility_is_that_of_the_further_modes(free_plate):
    rng = np.random.default_rng(0)
    for model in (beam(elements=30), beam(elements=30, left="clamped")):
        everything = solve_basis(model)
        elastic = slice(everything.n_rigid, None)
        loads = rng.standard_normal((len(everything.shapes), 3))
        for n_modes in (everything.n_rigid, 4, 9):
            further = slice(max(n_modes, elastic.start), None)
            participation = (everything.shapes[:, further].T @ loads) / everything.eigenvalues[further, None]
            expected = everything.shapes[:, further] @ participation
            if n_modes == 0:
                continue
            flexibility = solve_basis(model, n_modes=n_modes).residual_flexibility(loads)
            assert_allclose(flexibility, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    basis = solve_basis(free_plate, n_modes=8)
    load = np.zeros((len(basis.shapes), 1))
    load[200] = 1.0
    deflection = basis.residual_flexibility(load)
    balanced = load - basis.mass @ (basis.shapes @ (basis.shapes.T @ load))
    assert_allclose(basis.stiffness @ deflection, balanced, rtol=0, atol=1e-8)


def test_damping_ratios_of_modes():
    model = beam(elements=20, modal_ratio=0.01)
    assert_allclose(solve_modes(model, n_modes=4).damping_ratio, [0, 0, 0.01, 0.01], rtol=ROUNDING)
    several = structural_model(np.eye(3), np.diag([1.0, 4.0, 9.0]), DOFS_3, modal_damping=[0.01, 0.02])
    assert_allclose(solve_modes(several).damping_ratio, [0.01, 0.02, 0.02], rtol=ROUNDING)
    viscous = structural_model(np.eye(3), np.diag([1.0, 4.0, 9.0]), DOFS_3, damping=np.diag([0.2, 0.0, 0.0]))
    assert_allclose(solve_modes(viscous).damping_ratio, [0.1, 0.0, 0.0], rtol=ROUNDING, atol=ROUNDING)


DOFS_3 = [Dof(node, "x") for node in (1, 2, 3)]


def test_the_same_model_gives_the_same_digits(free_plate):
    first, second = (solve_basis(free_plate, n_modes=10) for _ in range(2))
    assert (first.shapes == second.shapes).all()


def test_invalid_limits_are_refused(free_plate):
    with pytest.raises(InputError, match="7 modes are requested; the model 'plain' has 3 free DOFs"):
        solve_modes(structural_model(np.eye(3), np.eye(3), DOFS_3), n_modes=7)
    with pytest.raises(InputError, match="above 0"):
        solve_modes(free_plate, up_to_hz=-1.0)
    with pytest.raises(InputError, match="say how many modes"):
        solve_modes(free_plate)
    with pytest.raises(InputError, match="every DOF"):
        solve_modes(structural_model(np.eye(3), np.eye(3), DOFS_3, fixed=np.ones(3, bool)))


def test_a_structure_that_is_not_stable_is_refused():
    with pytest.raises(IllConditionedError, match="indefinite"):
        solve_modes(structural_model(np.eye(3), np.diag([-1.0, 4.0, 9.0]), DOFS_3))


def test_a_large_structure_that_is_not_stable_is_refused(free_plate):
    stiffness = free_plate.stiffness_all + sparse.eye_array(len(free_plate.dofs)) * -1e5
    model = structural_model(
        free_plate.mass_all, stiffness, free_plate.dofs, coordinates_m=free_plate.geometry.coordinates_m
    )
    with pytest.raises(IllConditionedError):
        solve_modes(model, n_modes=8)
