"""Matrices with DOFs without mass, Lagrange multipliers, generalised DOFs, nodes' own axes, against dense algebra."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import linalg, sparse

from fe_models import beam, export
from frf_ipz.dofs import Dof
from frf_ipz.errors import InputError
from frf_ipz.fe import eigen, response
from frf_ipz.fe.eigen import solve_basis, solve_modes
from frf_ipz.fe.model_file import read_model
from frf_ipz.fe.reduction.options import ReduceOptions
from frf_ipz.fe.reduction.reduce import reduce_to_dofs
from frf_ipz.fe.response import compute_frfs, model_poles
from frf_ipz.frf import FrfLabel
from frf_ipz.numerics import factorization
from frf_ipz.numerics.constraints import solve_equations
from frf_ipz.quantities import FrfQuantity
from frf_ipz.structure import StructuralModel

ROUNDING = 1e-8  # of frequencies
FRF_ROUNDING = 1e-6  # of the largest value: the series of modes beyond is as right
LINES = 2j * np.pi * np.array([5.0, 31.0, 90.0, 260.0, 800.0])


def hertz(stiffness, mass):
    """Frequencies by dense algebra."""
    return np.sqrt(np.maximum(linalg.eigh(stiffness, mass, eigvals_only=True), 0)) / (2 * np.pi)


def receptance(mass, stiffness, output, force, *, damping=None):
    """Receptances by dense solves."""
    damping = np.zeros_like(mass) if damping is None else damping
    load = np.eye(len(mass))[:, force]
    return np.array([np.linalg.solve(s**2 * mass + s * damping + stiffness, load)[output] for s in LINES])


def frfs_of(model, output, force):
    return compute_frfs(model, [FrfLabel(output, force, FrfQuantity.RECEPTANCE)], LINES)[:, 0]


def lumped(model):
    """A beam's matrices with its masses at translations only."""
    mass = np.array([0.0 if dof.direction.startswith("r") else 1.0 for dof in model.dofs])
    return np.diag(mass * model.mass.toarray().sum(axis=1).max()), model.stiffness.toarray()


def positions(model):
    return dict(zip(model.geometry.nodes.tolist(), model.geometry.coordinates_m, strict=True))


def names(model):
    return [dof.name for dof in model.dofs]


@pytest.mark.parametrize("left", ["clamped", "free"])
@pytest.mark.parametrize("dense_order", [600, 4])
def test_rotations_without_mass_follow_statically(monkeypatch, left, dense_order):
    for module in (eigen, factorization, response):
        monkeypatch.setattr(module, "DENSE_ORDER", dense_order)
    source = beam(left=left)
    mass, stiffness = lumped(source)
    model = StructuralModel.from_matrices(
        mass, stiffness, dofs=names(source), coordinates=positions(source)
    )  # fmt: skip
    moving, still = np.diag(mass) > 0, np.diag(mass) == 0
    schur = stiffness[np.ix_(moving, moving)] - stiffness[np.ix_(moving, still)] @ np.linalg.solve(
        stiffness[np.ix_(still, still)], stiffness[np.ix_(still, moving)]
    )
    expected = hertz(schur, mass[np.ix_(moving, moving)])
    frequencies = solve_modes(model, n_modes=5).natural_frequency_hz
    n_rigid = 2 if left == "free" else 0
    assert_allclose(frequencies[n_rigid:], expected[n_rigid:5], rtol=ROUNDING)
    assert frequencies[:n_rigid].tolist() == [0] * n_rigid
    assert model.n_modes == int(moving.sum())
    assert "without mass" in model.notes[-1]


def test_frfs_at_rotations_without_mass_are_exact():
    """A moment there meets its own flexibility, which no mode holds."""
    source = beam(left="clamped")
    mass, stiffness = lumped(source)
    model = StructuralModel.from_matrices(mass, stiffness, dofs=names(source))
    output, force = Dof(9, "ry"), Dof(9, "ry")
    row = model.index(output)
    expected = receptance(mass, stiffness, row, row)
    assert_allclose(frfs_of(model, output, force), expected, rtol=FRF_ROUNDING)


def test_no_more_modes_are_given_than_dofs_with_mass():
    source = beam(left="clamped", elements=4)
    model = StructuralModel.from_matrices(*lumped(source), dofs=names(source))
    assert len(solve_modes(model).natural_frequency_hz) == 4
    with pytest.raises(InputError, match="4 free DOFs with a mass of their own"):
        solve_modes(model, n_modes=5)


def test_a_reduction_of_all_modes_has_no_residual_vectors():
    source = beam(left="clamped", elements=4)
    model = StructuralModel.from_matrices(*lumped(source), dofs=names(source))
    reduced = reduce_to_dofs(
        model,
        options=ReduceOptions(modes=4),
        actuators=[Dof(5, "z")],
        sensors=[Dof(3, "ry")],
        points=[],
        band_hz=(1.0, 1e4),
    )
    assert len(reduced.dofs) == 4
    expected = receptance(model.mass.toarray(), model.stiffness.toarray(), model.index(Dof(3, "ry")), 6)
    found = compute_frfs(reduced, [FrfLabel(Dof(3, "ry"), Dof(5, "z"), FrfQuantity.RECEPTANCE)], LINES)[:, 0]
    assert_allclose(np.abs(found - expected).max() / np.abs(expected).max(), 0, atol=0.02)  # by its default damping


def test_a_loose_dof_without_mass_is_named():
    stiffness = np.array([[2.0, -1.0, -1.0], [-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
    stiffness = np.pad(stiffness, (0, 2))
    stiffness[3:, 3:] = [[1.0, -1.0], [-1.0, 1.0]]
    with pytest.raises(InputError, match=r"without any force, the DOF [45]:x"):
        StructuralModel.from_matrices(
            np.diag([1.0, 1, 1, 0, 0]), stiffness, dofs=[f"{node}:x" for node in (1, 2, 3, 4, 5)]
        )


EQUATIONS = {  # between motions of the nodes of a beam: u = sum of weights
    "a rigid link": {"12:z": {"9:z": 1.0, "9:ry": -0.075}, "12:ry": {"9:ry": 1.0}},
    "a mean": {"7:z": {"6:z": 0.5, "8:z": 0.5}},
    "a hinge to the ground": {"5:z": {}},
}


@pytest.mark.parametrize("doubled", [False, True], ids=["single", "as Code_Aster does"])
@pytest.mark.parametrize("equations", EQUATIONS.values(), ids=EQUATIONS)
def test_multipliers_are_the_equations_that_they_stand_for(equations, doubled):
    source = beam(left="clamped")
    mass, stiffness = source.mass.toarray(), source.stiffness.toarray()
    order = len(mass)
    rows = np.zeros((len(equations), order))
    labels = names(source)
    for number, (solved, weights) in enumerate(equations.items()):
        rows[number, labels.index(solved)] = 1.0
        for label, weight in weights.items():
            rows[number, labels.index(label)] = -weight
    basis = linalg.null_space(rows)
    expected = hertz(basis.T @ stiffness @ basis, basis.T @ mass @ basis)
    scaled, count = 3e5 * rows, len(rows)
    zero, one = np.zeros((count, count)), 1e4 * np.eye(count)
    saddle = np.block([[stiffness, scaled.T], [scaled, zero]])
    if doubled:
        saddle = np.block([[stiffness, scaled.T, scaled.T], [scaled, -one, one], [scaled, one, -one]])
    multipliers = [f"{900 + number}:q" for number in range(len(saddle) - order)]
    padded = np.pad(mass, (0, len(multipliers)))
    model = StructuralModel.from_matrices(padded, saddle, dofs=[*labels, *multipliers])
    assert_allclose(solve_modes(model).natural_frequency_hz[:8], expected[:8], rtol=ROUNDING)
    assert model.dofs == source.dofs
    assert model.geometry.nodes.max() < 900
    for force in (Dof(12, "z"), Dof(7, "z"), Dof(5, "z")):  # of which some follow from others
        at, to = model.index(force), model.index(Dof(21, "z"))
        dense = (basis @ np.linalg.solve(basis.T @ (s**2 * mass + stiffness) @ basis, basis.T[:, [at]]) for s in LINES)
        exact = np.array([column[to, 0] for column in dense])
        assert_allclose(
            frfs_of(model, Dof(21, "z"), force), exact, rtol=0, atol=FRF_ROUNDING * np.abs(exact).max() + 1e-25
        )


def test_a_large_constrained_model_is_solved_sparsely(monkeypatch):
    for module in (eigen, factorization, response):
        monkeypatch.setattr(module, "DENSE_ORDER", 4)
    source = beam(left="free")
    mass, stiffness = source.mass.toarray(), source.stiffness.toarray()
    rows = np.zeros((1, len(mass)))
    rows[0, [names(source).index("3:z"), names(source).index("1:z")]] = 1.0, -1.0
    saddle = np.block([[stiffness, rows.T], [rows, np.zeros((1, 1))]])
    model = StructuralModel.from_matrices(
        np.pad(mass, (0, 1)), saddle, dofs=[*names(source), "99:0"],
        coordinates={**positions(source), 99: (0, 0, 0)},
    )  # fmt: skip
    basis = linalg.null_space(rows)
    expected = hertz(basis.T @ stiffness @ basis, basis.T @ mass @ basis)
    frequencies = solve_modes(model, n_modes=5).natural_frequency_hz
    assert_allclose(frequencies[1:], expected[1:5], rtol=ROUNDING)
    assert frequencies[0] == 0


def test_equations_are_solved_for_slaves_and_not_for_the_master():
    rows = np.zeros((3, 5))
    for number, slave in enumerate((1, 2, 4)):
        rows[number, [0, slave]] = -1.0, 1.0
    motions = solve_equations(sparse.csr_array(np.vstack([rows, rows[:1]])))  # one is there twice
    assert motions.independent.tolist() == [0, 3]
    assert_allclose(motions.matrix.toarray()[:, 0], [1, 1, 1, 0, 1], atol=1e-12)


def test_generalised_dofs_of_a_super_element_keep_its_modes(tmp_path):
    """Craig-Bampton: ends that move, and fixed-interface modes as rows without direction."""
    source = beam(left="free")
    mass, stiffness = source.mass.toarray(), source.stiffness.toarray()
    ends = np.array([dof.node in {1, 21} for dof in source.dofs])
    within = stiffness[np.ix_(~ends, ~ends)]
    static = -np.linalg.solve(within, stiffness[np.ix_(~ends, ends)])
    _, modes = linalg.eigh(within, mass[np.ix_(~ends, ~ends)])
    basis = np.zeros((len(mass), 4 + 10))
    basis[np.ix_(ends, range(4))] = np.eye(4)
    basis[np.ix_(~ends, range(4))] = static
    basis[np.ix_(~ends, range(4, 14))] = modes[:, :10]
    export(tmp_path, beam(left="free", elements=1))
    for name, matrix in (("M", mass), ("K", stiffness)):
        reduced = basis.T @ matrix @ basis
        values = "\n".join(repr(float(value)) for value in reduced.ravel())
        (tmp_path / f"{name}.mtx").write_text(f"%%MatrixMarket matrix array real general\n14 14\n{values}\n")
    table = "node,direction,x_m,y_m,z_m\n1,z,0,0,0\n1,ry,0,0,0\n21,z,0.4995,0,0\n21,ry,0.4995,0,0\n"
    rows = "".join(f"{100 + number},{'q' if number % 2 else '0'},,,\n" for number in range(10))
    (tmp_path / "dofs.csv").write_text(table + rows, encoding="utf-8")
    model = read_model(tmp_path / "model.toml")
    frequencies = solve_modes(model, n_modes=7).natural_frequency_hz
    assert frequencies[:2].tolist() == [0, 0]
    assert_allclose(frequencies[2:], hertz(stiffness, mass)[2:7], rtol=2e-3)  # ten fixed-interface modes
    assert_allclose(model.geometry.coordinates_m[2:], [[0.4995 / 2, 0, 0]] * 10)
    reduced_model = reduce_to_dofs(
        model, options=None, actuators=[Dof(1, "z")], sensors=[Dof(21, "z")], points=[], band_hz=(10.0, 300.0)
    )
    assert all(dof.direction in {"z", "ry"} for dof in (*reduced_model.dofs, *reduced_model.expanded_dofs))


def own_axes(folder, held=()):
    """Three springs of a node along axes of its own, as a file says it; and the axes."""
    rng = np.random.default_rng(4)
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    axes[2] = np.cross(axes[0], axes[1])
    directions = [name for name in "xyz" if name not in held]
    cells = ",".join(repr(float(value)) for value in axes[:2].ravel())
    rows = "".join(f"1,{name},0,0,0,{cells}\n" for name in directions) + "2,x,1,0,0,,,,,,\n"
    header = "node,direction,x_m,y_m,z_m,e1x,e1y,e1z,e2x,e2y,e2z\n"
    (folder / "dofs.csv").write_text(header + rows, encoding="utf-8")
    springs = {"x": 1e4, "y": 4e4, "z": 9e4}
    stiffness = np.diag([*(springs[name] for name in directions), 3e4])
    stiffness[0, -1] = stiffness[-1, 0] = -5e3
    for name, matrix in (("M", np.diag([2.0] * len(directions) + [1.0])), ("K", stiffness)):
        text = "\n".join(repr(float(value)) for value in matrix.ravel())
        order = len(matrix)
        (folder / f"{name}.mtx").write_text(f"%%MatrixMarket matrix array real general\n{order} {order}\n{text}\n")
    (folder / "model.toml").write_text(
        '[model]\nkind = "matrices"\n[matrices]\nmass = "M.mtx"\nstiffness = "K.mtx"\ndofs = "dofs.csv"\n'
    )
    return folder / "model.toml", axes


def test_axes_of_a_node_are_turned_to_those_of_the_whole(tmp_path):
    path, axes = own_axes(tmp_path)
    model = read_model(path)
    turn = linalg.block_diag(axes, 1.0)
    local = np.diag([1e4, 4e4, 9e4, 3e4])
    local[0, 3] = local[3, 0] = -5e3
    assert [dof.name for dof in model.dofs] == ["1:x", "1:y", "1:z", "2:x"]
    assert_allclose(model.stiffness.toarray(), turn.T @ local @ turn, rtol=1e-9, atol=1e-6)


def test_a_node_that_is_held_along_one_of_its_axes_moves_in_the_plane_of_the_others(tmp_path):
    path, axes = own_axes(tmp_path, held="z")
    model = read_model(path)
    assert [dof.name for dof in model.dofs] == ["1:x", "1:y", "1:z", "2:x"]
    modes = solve_modes(model)
    local = np.array([[1e4, 0, -5e3], [0, 4e4, 0], [-5e3, 0, 3e4]])
    assert_allclose(modes.natural_frequency_hz, hertz(local, np.diag([2.0, 2.0, 1.0])), rtol=ROUNDING)
    assert_allclose(axes[2] @ modes.shapes[:3].real, 0, atol=1e-9)


@pytest.mark.parametrize("cells", ["1,0,0,1,0,0", "2,0,0,0,1,0", "1,0,0,0,1,"])
def test_axes_that_are_none_are_refused(tmp_path, cells):
    path, _ = own_axes(tmp_path)
    lines = (tmp_path / "dofs.csv").read_text(encoding="utf-8").splitlines()
    lines[1] = "1,x,0,0,0," + cells
    (tmp_path / "dofs.csv").write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InputError, match=r"dofs\.csv.*line 2.*axes"):
        read_model(path)


MAGNETS = np.array([[5e4, -6e4], [-6e4, 6e4]])  # a spring of -1e4 N/m to the ground


@pytest.mark.parametrize("dense_order", [600, 4])
def test_negative_stiffness_that_is_meant_has_real_poles(monkeypatch, dense_order):
    for module in (eigen, factorization, response):
        monkeypatch.setattr(module, "DENSE_ORDER", dense_order)
    source = beam(left="free")
    mass, stiffness = source.mass.toarray(), source.stiffness.toarray()
    for label in ("5:z", "17:z"):
        stiffness[names(source).index(label), names(source).index(label)] -= 800.0
    squares = linalg.eigh(stiffness, mass, eigvals_only=True)
    assert (squares[:2] < -1).all()
    model = StructuralModel.from_matrices(
        mass, stiffness, dofs=names(source), allow_negative_stiffness=True, modal_damping=0.01,
        coordinates=positions(source),
    )  # fmt: skip
    basis = solve_basis(model, n_modes=4)
    assert_allclose(basis.eigenvalues, squares[:4], rtol=ROUNDING)
    assert basis.n_rigid == 2
    poles = model_poles(model, up_to_hz=100.0)
    real = np.sort(poles[poles.imag == 0].real)
    assert_allclose(real, np.sort([sign * root for root in np.sqrt(-squares[:2]) for sign in (1, -1)]), rtol=1e-7)
    output, force = Dof(21, "z"), Dof(1, "z")
    row, column = model.index(output), model.index(force)
    undamped = StructuralModel.from_matrices(mass, stiffness, dofs=names(source), allow_negative_stiffness=True)
    exact = receptance(mass, stiffness, row, column)
    assert_allclose(frfs_of(undamped, output, force), exact, rtol=1e-6)
    reduced = reduce_to_dofs(
        model, options=None, actuators=[force], sensors=[output], points=[], band_hz=(1.0, 300.0)
    )  # fmt: skip
    lowest = linalg.eigh(reduced.stiffness, reduced.mass, eigvals_only=True)[:2]
    assert_allclose(lowest, squares[:2], rtol=1e-6)
    assert reduced.rigid.size == 0


def test_negative_stiffness_that_is_not_said_to_be_meant_is_refused():
    with pytest.raises(InputError, match=r"indefinite.*allow_negative_stiffness"):
        StructuralModel.from_matrices(np.eye(2), MAGNETS, dofs=["1:x", "2:x"])


def test_a_loss_factor_is_half_a_damping_ratio_of_all_modes(tmp_path):
    path = export(tmp_path, beam(left="clamped", elements=5))
    path.write_text(path.read_text(encoding="utf-8") + "[damping]\nloss_factor = 0.03\n", encoding="utf-8")
    assert_allclose(solve_modes(read_model(path)).damping_ratio, 0.015)


def test_a_complex_stiffness_damps_each_mode_by_what_it_loses_there():
    """Two materials: eta of 2 % and of 20 %; exact at each resonance, to the order of eta."""
    source = beam(left="clamped", elements=20)
    mass, stiffness = source.mass.toarray(), source.stiffness.toarray()
    lossy = np.zeros_like(stiffness)
    for part in source.parts[12:]:
        free = np.flatnonzero(~source.fixed)
        whole = np.zeros((len(source.all_dofs),) * 2)
        whole[np.ix_(part.indices, part.indices)] = part.stiffness
        lossy += whole[np.ix_(free, free)]
    complex_stiffness = stiffness + 1j * (2e-3 * (stiffness - lossy) + 2e-2 * lossy)
    model = StructuralModel.from_matrices(mass, complex_stiffness, dofs=names(source))
    share = np.abs(complex_stiffness.imag).sum() / np.abs(stiffness).sum()
    assert f"imaginary part of the stiffness, {share:.2g} of the real one, is structural damping" in model.notes[-1]
    modes = solve_modes(model, n_modes=4)
    roots = np.sqrt(linalg.eigvals(complex_stiffness, mass))
    roots = roots[np.argsort(roots.real)][:4]
    assert_allclose(modes.damping_ratio, roots.imag / roots.real, rtol=1e-3)
    assert np.ptp(modes.damping_ratio) > 5e-4
    resonance = 2j * np.pi * modes.natural_frequency_hz
    label = FrfLabel(Dof(21, "z"), Dof(15, "z"), FrfQuantity.RECEPTANCE)
    found = compute_frfs(model, [label], resonance)[:, 0]
    row, column = model.index(Dof(21, "z")), model.index(Dof(15, "z"))
    exact = [np.linalg.solve(complex_stiffness + s**2 * mass, np.eye(len(mass))[:, column])[row] for s in resonance]
    assert_allclose(found, exact, rtol=0.02)
    reduced = reduce_to_dofs(
        model, options=None, actuators=[Dof(21, "z")], sensors=[Dof(15, "z")], points=[], band_hz=(10.0, 300.0)
    )
    assert_allclose(compute_frfs(reduced, [label], resonance[:2])[:, 0], found[:2], rtol=1e-3)


def test_a_negative_imaginary_stiffness_is_refused():
    with pytest.raises(InputError, match="imaginary part of the stiffness"):
        StructuralModel.from_matrices(np.eye(2), np.array([[2, -1], [-1, 1]]) * (1 - 0.02j), dofs=["1:x", "2:x"])
