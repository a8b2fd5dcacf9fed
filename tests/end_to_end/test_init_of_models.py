"""`init` finds the model of an FE program in a folder, and the model file that it writes is read."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io
from scipy import sparse

from fe_models import beam
from frf_ipz.dofs import DIRECTIONS
from frf_ipz.errors import FileFormatError
from frf_ipz.fe.model_file import read_model
from frf_ipz.pipeline.init.folder_contents import look_into
from frf_ipz.pipeline.init.model_draft import draft_model
from frf_ipz.pipeline.init.starting_files import write_starting_files


def lower(matrix):
    rows, columns = np.nonzero(np.tril(matrix))
    return "".join(f"{i + 1} {j + 1} {matrix[i, j]:.16e}\n" for i, j in zip(rows, columns, strict=True))


def write_calculix(folder, model):
    (folder / "job.sti").write_text(lower(model.stiffness.toarray()))
    (folder / "job.mas").write_text(lower(model.mass.toarray()))
    numbers = {"z": 3, "ry": 5}
    (folder / "job.dof").write_text("".join(f"{dof.node}.{numbers[dof.direction]}\n" for dof in model.dofs))
    places = zip(model.geometry.nodes, model.geometry.coordinates_m, strict=True)
    (folder / "job.inp").write_text("*NODE\n" + "".join(f"{node}, {x}, {y}, {z}\n" for node, (x, y, z) in places))


def write_numpy(folder, model):
    for name, matrix in (("K", model.stiffness), ("M", model.mass)):
        sparse.save_npz(folder / f"{name}.npz", matrix)
    places = dict(zip(model.geometry.nodes.tolist(), model.geometry.coordinates_m.tolist(), strict=True))
    rows = "".join(f"{dof.node},{dof.direction},{','.join(map(str, places[dof.node]))}\n" for dof in model.dofs)
    (folder / "dofs.csv").write_text("node,direction,x_m,y_m,z_m\n" + rows)


def write_matlab(folder, model):
    write_numpy(folder, model)
    scipy.io.savemat(folder / "fem.mat", {name: sparse.load_npz(folder / f"{name}.npz") for name in "KM"})
    for name in "KM":
        (folder / f"{name}.npz").unlink()


def write_named_rows(folder, model):
    places = dict(zip(model.geometry.nodes.tolist(), model.geometry.coordinates_m.tolist(), strict=True))
    rows = {"dofs": [dof.name for dof in model.dofs], "coordinates": [places[dof.node] for dof in model.dofs]}
    np.savez(folder / "fem.npz", K=model.stiffness.toarray(), M=model.mass.toarray(), **rows)


def library(name, extra):
    """Load a reader's library; pyyeti would set NumPy's print options for all tests after this one."""
    with np.printoptions():
        return pytest.importorskip(name, reason=f"the extra '{extra}' is not installed")


def pairs(model):
    return [(dof.node, DIRECTIONS.index(dof.direction) + 1) for dof in model.dofs]


def write_bdf(folder, model):
    bulk = library("pyyeti.nastran.bulk", "nastran")
    with (folder / "plate.bdf").open("w") as stream:
        bulk.wtgrids(stream, model.geometry.nodes, xyz=model.geometry.coordinates_m)
        stream.writelines(f"CBAR    {n:8d}{1:8d}{n:8d}{n + 1:8d}\n" for n in model.geometry.nodes[:-1])


def write_mapped(folder, model):
    """Harwell-Boeing files by SciPy, the mapping and the archive of the mesh as Ansys writes them."""
    for name, matrix in (("beam_stiff", model.stiffness), ("beam_mass", model.mass)):
        scipy.io.hb_write(folder / f"{name}.matrix", sparse.csc_array(matrix))
    names = {3: "UZ", 5: "ROTY"}
    rows = "".join(f"{row:8d}{node:8d}  {names[number]}\n" for row, (node, number) in enumerate(pairs(model), start=1))
    (folder / "beam_stiff.mapping").write_text("  Matrix Eqn    Node   DOF\n" + rows)
    write_gmsh(folder, model)


def write_titled(folder, model):
    write_mapped(folder, model)
    for name, title in (("stiff", "Stiffness matrix"), ("mass", "Mass matrix")):
        text = (folder / f"beam_{name}.matrix").read_text()
        (folder / f"beam_{name}.matrix").unlink()
        (folder / f"{name[0]}1.hb").write_text(f"{title:<72}" + text[72:])


def write_gmsh(folder, model):
    meshio = library("meshio", "mesh")
    lines = np.array([(n, n + 1) for n in range(len(model.geometry.nodes) - 1)])
    points = model.geometry.coordinates_m
    meshio.write_points_cells(folder / "beam.msh", points, [("line", lines)], file_format="gmsh")


def write_op4(folder, model, names=("KAA", "MAA")):
    matrices = dict(zip(names, (model.stiffness, model.mass), strict=True))
    library("pyyeti.nastran.op4", "nastran").write(
        str(folder / "plate.op4"), {name: matrix.toarray() for name, matrix in matrices.items()}
    )
    write_numpy(folder, model)
    for name in "KM":
        (folder / f"{name}.npz").unlink()
    write_bdf(folder, model)


def write_odd_op4(folder, model):
    write_op4(folder, model, names=("A1", "A2"))


def write_dmig(folder, model, names=("KAAX", "MAAX")):
    index = pd.MultiIndex.from_tuples(pairs(model))
    frames = {
        name: pd.DataFrame(matrix.toarray(), index, index)
        for name, matrix in zip(names, (model.stiffness, model.mass), strict=True)
    }
    library("pyyeti.nastran.bulk", "nastran").wtdmig(str(folder / "plate.pch"), frames)
    write_bdf(folder, model)


def write_odd_dmig(folder, model):
    write_dmig(folder, model, names=("K2GG", "M2GG"))


def write_abaqus(folder, model, names=("job_STIF1", "job_MASS1")):
    labels = pairs(model)
    for name, matrix in zip(names, (model.stiffness, model.mass), strict=True):
        entries = sparse.coo_array(sparse.tril(matrix))
        (folder / f"{name}.mtx").write_text(
            "".join(
                f"{labels[i][0]},{labels[i][1]}, {labels[j][0]},{labels[j][1]}, {value:.16e}\n"
                for i, j, value in zip(entries.row, entries.col, entries.data, strict=True)
            )
        )
    write_calculix(folder, model)
    for suffix in ("sti", "mas", "dof"):
        (folder / f"job.{suffix}").unlink()


def write_unnamed_abaqus(folder, model):
    write_abaqus(folder, model, names=("first", "second"))


def write_frf(folder):
    lines = "".join(f"{hertz},6:+z,6:+z,1.0,0.1\n" for hertz in range(10, 60))
    (folder / "frf.csv").write_text("frequency_hz,output_dof,input_dof,real,imag\n" + lines)


@pytest.mark.parametrize(
    ("write", "marks"),
    [
        (write_matlab, ['mass = "fem.mat"']),
        (write_named_rows, ['mass = "fem.npz"']),
        (write_calculix, ['units = "SI"', 'nodes = "job.inp"\n']),
        (write_numpy, ['mass = "M.npz"']),
        (write_op4, ['units = "SI"', 'mass = "plate.op4"\n', 'dofs = "dofs.csv"', 'nodes = "plate.bdf"\n']),
        (write_odd_op4, ["told by its size   CHECK", 'variables = { stiffness = "a1", mass = "a2" }']),
        (write_dmig, ['units = "SI"', 'mass = "plate.pch"\n', 'nodes = "plate.bdf"\n']),
        (write_odd_dmig, ['variables = { stiffness = "k2gg", mass = "m2gg" }']),
        (write_abaqus, ['units = "SI"', "told by the name of the file   CHECK", 'nodes = "job.inp"\n']),
        (write_unnamed_abaqus, ['stiffness = "first.mtx"', "CHECK", 'nodes = "job.inp"\n']),
        (write_mapped, ['dofs = "beam_stiff.mapping"', 'nodes = "beam.msh"', "in the file's order   CHECK"]),
        (write_titled, ['stiffness = "s1.hb"\n', 'mass = "m1.hb"\n']),
    ],
)
def test_a_model_in_the_folder_is_found_and_read(tmp_path, write, marks):
    model = beam(left="clamped", elements=5)
    write(tmp_path, model)
    write_frf(tmp_path)
    contents = look_into(tmp_path)
    assert [path.name for path in contents.frfs] == ["frf.csv"]
    assert not contents.recordings
    text = draft_model(contents)
    for mark in marks:
        assert mark in text
    (tmp_path / "model.toml").write_text(text)
    found = read_model(tmp_path / "model.toml")
    assert found.dofs == model.dofs
    np.testing.assert_allclose(np.ptp(found.geometry.coordinates_m[:, 0]), 0.8 * 0.4995, rtol=1e-9)


def found_in(folder):
    """The model that `init` writes, and what it says."""
    write_frf(folder)
    taken_for = write_starting_files(folder).taken_for
    return (folder / "model.toml").read_text(), "\n".join(taken_for)


def nastran_file(name):
    folder = Path(library("pyyeti", "nastran").__file__).parent / "tests" / "nas2cam_extseout"
    if not folder.is_dir():
        pytest.skip("this pyyeti came without its files of Nastran")
    return folder / name


def test_rows_of_an_external_super_element_are_found(tmp_path):
    for suffix in ("op4", "asm", "pch"):
        shutil.copy(nastran_file(f"inboard.{suffix}"), tmp_path)
    shutil.copy(nastran_file("inboard.op2"), tmp_path)  # results, which name no rows
    text, said = found_in(tmp_path)
    assert 'stiffness = "inboard.op4"\n' in text
    assert 'dofs = "inboard.asm"' in text
    assert "inboard.asm: rows of the matrices" in said
    assert len(read_model(tmp_path / "model.toml").dofs) > 0


def test_rows_of_a_residual_structure_are_found(tmp_path):
    nastran = library("pyyeti.nastran.op2", "nastran").rdnas2cam(str(nastran_file("nas2cam")))
    matrices = {"KAA": nastran["kaa"][0], "MAA": nastran["maa"][0]}
    library("pyyeti.nastran.op4", "nastran").write(str(tmp_path / "a.op4"), matrices)
    shutil.copy(nastran_file("nas2cam.op2"), tmp_path)
    text, _ = found_in(tmp_path)
    assert 'dofs = "nas2cam.op2"' in text
    assert not read_model(tmp_path / "model.toml").geometry.is_schematic


@pytest.mark.slow  # Ansys's reader takes seconds to load
def test_a_full_file_of_ansys_is_drawn_on_the_archive_with_its_nodes(tmp_path):
    examples = library("ansys.mapdl.reader.examples", "ansys")
    library("mapdl_archive", "mesh")
    shutil.copy(examples.fullfile, tmp_path / "file.full")
    shutil.copy(examples.hexarchivefile, tmp_path / "brick.cdb")
    text, said = found_in(tmp_path)
    assert 'stiffness = "file.full"\n' in text
    assert 'nodes = "brick.cdb"\n' in text
    assert "brick.cdb: where the model's nodes are" in said


def test_of_two_models_one_is_taken_and_the_other_named(tmp_path):
    write_abaqus(tmp_path, beam(left="clamped", elements=5), names=("wing_STIF1", "wing_MASS1"))
    write_abaqus(tmp_path, beam(left="clamped", elements=3), names=("arm_STIF1", "arm_MASS1"))
    text, said = found_in(tmp_path)
    assert 'stiffness = "arm_STIF1.mtx"' in text
    assert "other models: wing_STIF1.mtx   CHECK" in text
    assert "wing_MASS1.mtx, wing_STIF1.mtx: matrices of another FE model, which is left out" in said


def test_a_mesh_of_another_structure_is_no_place_of_the_nodes(tmp_path):
    write_dmig(tmp_path, beam(left="clamped", elements=5))
    (tmp_path / "plate.bdf").unlink()
    write_bdf(tmp_path, beam(left="clamped", elements=3))
    text, _ = found_in(tmp_path)
    assert "nodes =" not in text
    assert read_model(tmp_path / "model.toml").geometry.is_schematic


def test_a_part_has_the_order_of_the_whole_and_another_model_its_own(tmp_path):
    whole, other = beam(left="clamped", elements=5), beam(left="clamped", elements=3)
    write_numpy(tmp_path, whole)
    sparse.save_npz(tmp_path / "K_tip.npz", whole.stiffness)
    sparse.save_npz(tmp_path / "M_tip.npz", whole.mass)
    sparse.save_npz(tmp_path / "K_old.npz", other.stiffness)
    sparse.save_npz(tmp_path / "M_old.npz", other.mass)
    text, said = found_in(tmp_path)
    assert 'name = "tip"\nstiffness = "K_tip.npz"\nmass = "M_tip.npz"' in text
    assert 'name = "old"' not in text
    assert "K_old.npz, M_old.npz: matrices of another FE model, which is left out" in said


def test_neither_zeros_nor_what_is_not_symmetric_is_taken_for_a_matrix_of_the_structure(tmp_path):
    model = beam(left="clamped", elements=5)
    write_odd_op4(tmp_path, model)
    order = len(model.dofs)
    matrices = {"A0": np.zeros((order, order)), "A1": model.stiffness.toarray(), "A2": model.mass.toarray()}
    matrices["T"] = 1e12 * np.triu(np.ones((order, order))) + np.tril(np.ones((order, order)))
    library("pyyeti.nastran.op4", "nastran").write(str(tmp_path / "plate.op4"), matrices)
    text, _ = found_in(tmp_path)
    assert 'variables = { stiffness = "a1", mass = "a2" }' in text


def test_damping_beside_both_is_found_and_a_table_with_other_rows_is_marked(tmp_path):
    model = beam(left="clamped", elements=5)
    matrices = {"KAA": model.stiffness.toarray(), "MAA": model.mass.toarray(), "BAA": 1e-6 * model.stiffness.toarray()}
    library("pyyeti.nastran.op4", "nastran").write(str(tmp_path / "plate.op4"), matrices)
    (tmp_path / "dofs.csv").write_text("node,direction,x_m,y_m,z_m\n1,x,0,0,0\n")
    text, _ = found_in(tmp_path)
    assert 'damping = "plate.op4"\n' in text
    assert "has other rows than the matrices   CHECK" in text


@pytest.mark.parametrize(("write", "name"), [(write_dmig, "plate.pch"), (write_op4, "plate.op4")])
def test_a_model_whose_reader_is_missing_is_found_nevertheless(tmp_path, monkeypatch, write, name):
    write(tmp_path, beam(left="clamped", elements=5))
    for module in [known for known in sys.modules if known.partition(".")[0] == "pyyeti"]:
        monkeypatch.setitem(sys.modules, module, None)
    text, said = found_in(tmp_path)
    assert f'stiffness = "{name}"' in text
    assert f"{name}: matrices of the FE model" in said
    with pytest.raises(FileFormatError, match=r"frf_ipz\[nastran\]"):
        read_model(tmp_path / "model.toml")


def test_what_a_solver_printed_beside_its_matrices_is_passed_over(tmp_path):
    write_calculix(tmp_path, beam(left="clamped", elements=5))
    for name in ("job.dat", "shaker.dat"):
        (tmp_path / name).write_text("")
    _, said = found_in(tmp_path)
    assert "shaker.dat: left out" in said
    assert "job.dat" not in said
