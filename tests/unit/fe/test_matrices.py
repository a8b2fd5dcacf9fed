"""Models from exported matrices."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import io, sparse

from brick_plate import plate_matrices
from fe_models import beam, export
from frf_ipz.dofs import Dof
from frf_ipz.errors import FileFormatError
from frf_ipz.fe.eigen import solve_modes
from frf_ipz.fe.model_file import model_files, read_model
from frf_ipz.numerics import neighbours
from frf_ipz.numerics.definiteness import DENSE_ORDER
from frf_ipz.numerics.neighbours import lines_between_neighbours

PRINTED = 1e-12  # 17 digits are printed
GROUPS = """
[[matrices.group]]
name = "left"
stiffness = "K_left.mtx"
mass = "M_left.mtx"
[[matrices.group]]
name = "right"
stiffness = "K_right.mtx"
"""


def write_group(folder, model, name, elements):
    stiffness = np.zeros((len(model.all_dofs),) * 2)
    mass = np.zeros_like(stiffness)
    for part in model.parts[elements]:
        stiffness[np.ix_(part.indices, part.indices)] += part.stiffness
        mass[np.ix_(part.indices, part.indices)] += part.mass
    free = np.flatnonzero(~model.fixed)
    for what, matrix in (("K", stiffness), ("M", mass)):
        free_block = sparse.coo_array(matrix[np.ix_(free, free)])
        io.mmwrite(folder / f"{what}_{name}.mtx", free_block, symmetry="symmetric", precision=17)


def grouped(folder, model, first, second):
    path = export(folder, model)
    path.write_text(path.read_text(encoding="utf-8") + GROUPS, encoding="utf-8")
    write_group(folder, model, "left", first)
    write_group(folder, model, "right", second)
    return path


def test_an_exported_beam_is_the_same_beam(tmp_path):
    model = beam(left="clamped")
    exported = read_model(export(tmp_path, model))
    assert exported.dofs == model.dofs
    for name in ("mass", "stiffness"):
        matrix = getattr(model, name).toarray()
        assert_allclose(getattr(exported, name).toarray(), matrix, rtol=0, atol=PRINTED * np.abs(matrix).max())
    assert_allclose(exported.geometry.coordinates_m, model.geometry.coordinates_m[1:], rtol=0, atol=PRINTED)
    assert exported.geometry.lines.tolist() == model.geometry.lines[1:].tolist()


def test_node_numbers_may_have_gaps_and_any_order(tmp_path):
    numbers = {node: 1000 - 7 * node for node in range(1, 22)}
    exported = read_model(export(tmp_path, beam(left="clamped"), numbers=numbers))
    assert exported.dofs[0] == Dof(986, "z")
    assert exported.geometry.nodes.tolist() == sorted(exported.geometry.nodes.tolist())
    tip = int(np.flatnonzero(exported.geometry.nodes == 1000 - 7 * 21)[0])
    assert_allclose(exported.geometry.coordinates_m[tip, 0], 0.4995, rtol=PRINTED)


def test_columns_and_rows_stand_in_the_order_of_the_table(tmp_path):
    path = export(tmp_path, beam(left="clamped"))
    table = (tmp_path / "dofs.csv").read_text(encoding="utf-8").splitlines()
    swapped = ["z_m, direction ,x_m,y_m,node"] + [
        ",".join(line.split(",")[place] for place in (4, 1, 2, 3, 0)) for line in table[1:]
    ]
    (tmp_path / "dofs.csv").write_text("\ufeff" + "\r\n".join([*swapped, "", ""]), encoding="utf-8")
    assert read_model(path).dofs == beam(left="clamped").dofs


def test_a_free_structure_printed_with_few_digits_has_rigid_body_modes(tmp_path):
    model = beam(left="free")
    path = export(tmp_path, model)
    stiffness = sparse.coo_array(model.stiffness)
    stiffness.data = np.array([float(f"{value:.12e}") for value in stiffness.data])
    io.mmwrite(tmp_path / "K.mtx", stiffness, symmetry="symmetric")
    modes = solve_modes(read_model(path), n_modes=4)
    assert modes.natural_frequency_hz[:2].tolist() == [0.0, 0.0]
    assert modes.natural_frequency_hz[2] > 50


def test_groups_are_parts_with_their_own_rows(tmp_path):
    model = beam(left="clamped")
    exported = read_model(grouped(tmp_path, model, slice(0, 10), slice(10, 20)))
    first, second = exported.parts
    assert (first.kind, first.name, second.name) == ("group", "left", "right")
    assert first.nodes == tuple(range(2, 12))
    assert second.nodes == tuple(range(11, 22))
    whole = exported.stiffness.toarray()
    for part in exported.parts:
        whole[np.ix_(part.indices, part.indices)] -= part.stiffness.toarray()
    assert_allclose(whole, 0, rtol=0, atol=1e-9 * exported.stiffness.max())
    assert second.mass.nnz == 0


def test_groups_need_not_cover_the_model(tmp_path):
    parts = read_model(grouped(tmp_path, beam(left="clamped"), slice(0, 5), slice(12, 20))).parts
    assert [part.name for part in parts] == ["left", "right"]


def test_groups_that_add_up_to_more_than_the_whole_are_refused(tmp_path):
    path = grouped(tmp_path, beam(left="clamped"), slice(0, 12), slice(10, 20))
    with pytest.raises(FileFormatError, match=r"stiffness adds up to more than the whole at the DOF 1[123]:"):
        read_model(path)


def test_slight_asymmetry_of_printed_digits_is_averaged_out(tmp_path):
    model = beam(left="clamped")
    path = export(tmp_path, model)
    stiffness = model.stiffness.toarray()
    noise = 1 + 1e-8 * np.random.default_rng(1).standard_normal(stiffness.shape)
    io.mmwrite(tmp_path / "K.mtx", sparse.coo_array(stiffness * noise), symmetry="general", precision=17)
    exported = read_model(path).stiffness.toarray()
    assert (exported == exported.T).all()
    assert_allclose(exported, stiffness, rtol=1e-7)


def test_a_damping_matrix_is_taken_besides_modal_damping(tmp_path):
    model = beam(left="clamped")
    path = export(tmp_path, model)
    dashpot = sparse.coo_array(([5.0], ([38], [38])), shape=model.mass.shape)
    io.mmwrite(tmp_path / "B.mtx", dashpot, symmetry="symmetric")
    text = path.read_text(encoding="utf-8").replace('dofs = "', 'damping = "B.mtx"\ndofs = "')
    path.write_text(text + "[damping]\nmodal_ratio = [0.01, 0.02]\n", encoding="utf-8")
    exported = read_model(path)
    assert exported.damping.toarray()[38, 38] == 5.0
    assert exported.modal_damping.tolist() == [0.01, 0.02]
    assert model_files(path) == (path, *(tmp_path / name for name in ("M.mtx", "K.mtx", "B.mtx", "dofs.csv")))


def test_an_array_file_reads_like_a_coordinate_file(tmp_path):
    model = beam(left="clamped", elements=3)
    path = export(tmp_path, model)
    io.mmwrite(tmp_path / "K.mtx", model.stiffness.toarray(), symmetry="symmetric", precision=17)
    assert_allclose(read_model(path).stiffness.toarray(), model.stiffness.toarray(), rtol=PRINTED)


@pytest.mark.parametrize(
    ("name", "place", "value", "message"),
    [("M.mtx", 0, -1e-6, "has the mass"), ("K.mtx", 0, -1e3, "indefinite")],
)
def test_large_matrices_are_checked_by_their_pivots(tmp_path, name, place, value, message):
    model = beam(elements=DENSE_ORDER // 2 + 50)
    path = export(tmp_path, model)
    assert read_model(path).mass.shape[0] > DENSE_ORDER
    matrix = (model.mass if name == "M.mtx" else model.stiffness).tolil()
    matrix[place, place] = value
    io.mmwrite(tmp_path / name, sparse.coo_array(matrix), symmetry="symmetric", precision=17)
    with pytest.raises(FileFormatError, match=message):
        read_model(path)


def test_a_large_mass_matrix_without_negative_diagonal_is_checked_too(tmp_path):
    model = beam(elements=DENSE_ORDER // 2 + 50)
    path = export(tmp_path, model)
    mass = model.mass.tolil()
    mass[0, 2] = mass[2, 0] = 3 * mass[0, 0]
    io.mmwrite(tmp_path / "M.mtx", sparse.coo_array(mass), symmetry="symmetric", precision=17)
    with pytest.raises(FileFormatError, match="a negative mass"):
        read_model(path)


def test_a_stiffness_matrix_may_be_negative_by_rounding(tmp_path):
    """The limit is one of the matrix scaled to a diagonal of ones: N/m and N m/rad have no common size."""
    model = beam(left="clamped")
    path = export(tmp_path, model)
    size = np.sqrt(model.stiffness.diagonal())
    scaled = model.stiffness.toarray() / np.outer(size, size)
    largest = np.linalg.eigvalsh(scaled)
    for share, is_fine in ((0.9e-10, True), (1.2e-10, False)):
        lowered = scaled - (largest[0] + share * largest[-1]) * np.eye(40)
        lowered *= np.outer(size, size)
        io.mmwrite(tmp_path / "K.mtx", sparse.coo_array(lowered), symmetry="symmetric", precision=17)
        if is_fine:
            read_model(path)
        else:
            with pytest.raises(FileFormatError, match="indefinite"):
                read_model(path)


def brick_lines(counts):
    stiffness, _, corners = plate_matrices(counts, np.array(counts) * [5e-3, 4e-3, 1e-3])
    dofs = [Dof(node + 1, axis) for node in range(len(corners)) for axis in "xyz"]
    return lines_between_neighbours(stiffness, dofs, np.arange(1, len(corners) + 1), corners)


def test_of_bricks_the_edges_are_drawn():
    lines = brick_lines((4, 3, 2))
    assert len(lines) == 4 * 4 * 3 + 5 * 3 * 3 + 5 * 4 * 2
    assert [1, 2] in lines.tolist()
    assert [1, 7] not in lines.tolist()


def test_a_model_of_very_many_nodes_is_drawn_without_lines(monkeypatch):
    monkeypatch.setattr(neighbours, "MAX_NODES", 10)
    assert brick_lines((4, 3, 2)).shape == (0, 2)


def test_every_practice_model_reads(practice):
    paths = sorted(practice.glob("case_*/model.toml"))
    assert len(paths) == 14
    for path in paths:
        model = read_model(path)
        assert model.dofs
        assert all(file.is_file() for file in model_files(path))


def test_the_plate_of_full_matrices_is_drawn_as_a_grid(practice):
    geometry = read_model(practice / "case_14" / "model.toml").geometry
    assert len(geometry.nodes) == 42
    assert len(geometry.lines) == 71  # 7 x 6 nodes: 36 + 35


def test_coordinates_without_a_unit_are_said_to_be_taken_for_metres(tmp_path):
    path = export(tmp_path, beam())
    table = tmp_path / "dofs.csv"
    table.write_text(table.read_text(encoding="utf-8").replace("x_m,y_m,z_m", "x,y,z"), encoding="utf-8")
    (note,) = (note for note in read_model(path).notes if "metres" in note)
    assert "the structure is 0.4995 m long; call the columns x_m, y_m, z_m where that is right" in note
    path.write_text(path.read_text(encoding="utf-8").replace("[model]", '[model]\nunits = "mm-t-s"'), encoding="utf-8")
    assert not any("metres" in note for note in read_model(path).notes)


@pytest.mark.parametrize("units", ["", 'units = "mm-t-s"'])
@pytest.mark.parametrize(
    ("names", "unit_m"), [("x_mm,y_mm,z_mm", 1e-3), ("X [cm],Y [cm],Z [cm]", 1e-2), ("x_in,y_in,z_in", 0.0254)]
)
def test_coordinates_are_read_in_the_unit_of_their_names(tmp_path, names, unit_m, units):
    model = beam(left="clamped")
    path = export(tmp_path, model)
    _, *rows = (tmp_path / "dofs.csv").read_text(encoding="utf-8").splitlines()
    scaled = [
        ",".join([*row.split(",")[:2], *(repr(float(place) / unit_m) for place in row.split(",")[2:])]) for row in rows
    ]
    (tmp_path / "dofs.csv").write_text("\n".join([f"node,direction,{names}", *scaled]), encoding="utf-8")
    path.write_text(path.read_text(encoding="utf-8").replace("[model]", f"[model]\n{units}"), encoding="utf-8")
    exported = read_model(path)
    assert_allclose(exported.geometry.coordinates_m, model.geometry.coordinates_m[1:], rtol=0, atol=PRINTED)
    assert not any("metres" in note for note in exported.notes)


def test_coordinates_in_different_units_are_refused(tmp_path):
    path = export(tmp_path, beam())
    table = tmp_path / "dofs.csv"
    table.write_text(table.read_text(encoding="utf-8").replace("x_m,y_m,z_m", "x_mm,y_mm,z_m"), encoding="utf-8")
    with pytest.raises(
        FileFormatError, match=r"coordinates in different units: x_mm, y_mm, z_m; write all three in one"
    ):
        read_model(path)


def test_an_imaginary_part_that_is_not_symmetric_is_named_as_that(tmp_path):
    path = export(tmp_path, beam(left="clamped"))
    stiffness = io.mmread(tmp_path / "K.mtx").toarray().astype(complex) * (1 + 0.02j)
    stiffness[0, 2] += 0.01j * stiffness[0, 2].real
    io.mmwrite(tmp_path / "K.mtx", sparse.coo_array(stiffness), symmetry="general", precision=17)
    with pytest.raises(FileFormatError, match=r"K\.mtx: has an imaginary part that is not symmetric: .* rows 1 and 3"):
        read_model(path)
