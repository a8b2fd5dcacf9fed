"""FE matrices in the formats of other programs, each written by another library or by hand."""

import shutil

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import io, sparse

from calculix_models import SHELL, SOLID, run_calculix
from fe_models import beam, export
from frf_ipz.errors import FileFormatError
from frf_ipz.fe.eigen import solve_modes
from frf_ipz.fe.matrices.registry import read_matrix, recognises
from frf_ipz.fe.matrices.stored import MatrixRequest
from frf_ipz.fe.model_file import model_files, read_model

ROUNDING = 1e-12
DOFS = "node,direction,x_m,y_m,z_m\n1,x,0,0,0\n2,x,0.1,0,0\n3,x,0.2,0,0\n"
MASS = np.diag([2.0, 1.0, 3.0])
STIFFNESS = np.array([[3e4, -1e4, 0.0], [-1e4, 5e4, -4e4], [0.0, -4e4, 4e4]])
EXPECTED = np.sqrt(np.linalg.eigvals(np.linalg.solve(MASS, STIFFNESS)).real) / (2 * np.pi)
EXPECTED.sort()


def model_toml(folder, mass, stiffness, *further, dofs='dofs = "dofs.csv"'):
    text = f'[model]\nkind = "matrices"\n[matrices]\nmass = "{mass}"\nstiffness = "{stiffness}"\n{dofs}\n'
    (folder / "model.toml").write_text(text + "\n".join(further) + "\n", encoding="utf-8")
    if dofs and not (folder / "dofs.csv").exists():
        (folder / "dofs.csv").write_text(DOFS, encoding="utf-8")
    return folder / "model.toml"


def frequencies(path):
    return solve_modes(read_model(path)).natural_frequency_hz


def hdf5(path, arrays, *, sparse_too):
    """A MATLAB file of version 7.3, as MATLAB lays it out: transposed, sparse ones in parts."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, array in arrays.items():
            if sparse_too:
                columns = sparse.csc_array(array)
                group = file.create_group(name)
                group.attrs["MATLAB_sparse"] = np.uint64(array.shape[0])
                group["data"], group["ir"], group["jc"] = columns.data, columns.indices, columns.indptr
            else:
                file[name] = array.T
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(512, b"\0"))


@pytest.mark.parametrize("form", ["csr", "csc", "coo", "dense", "named", "npy"])
def test_numpy_files(tmp_path, form):
    for name, matrix in (("M", MASS), ("K", STIFFNESS)):
        if form == "dense":
            np.savez_compressed(tmp_path / f"{name}.npz", something=matrix)
        elif form == "named":
            np.savez(tmp_path / f"{name}.npz", K=STIFFNESS, M=MASS, eta=np.zeros((2, 2)))
        elif form == "npy":
            np.save(tmp_path / f"{name}.npy", matrix)
        else:
            sparse.save_npz(tmp_path / f"{name}.npz", sparse.coo_array(matrix).asformat(form))
    suffix = "npy" if form == "npy" else "npz"
    assert_allclose(frequencies(model_toml(tmp_path, f"M.{suffix}", f"K.{suffix}")), EXPECTED, rtol=ROUNDING)


@pytest.mark.parametrize("version", ["4", "5", "5 sparse", "5 in a structure", "7.3", "7.3 sparse"])
def test_matlab_files(tmp_path, version):
    path = tmp_path / "fem.mat"
    arrays = {"K": STIFFNESS, "M": MASS, "unused": np.zeros((3, 7))}
    if version == "5 sparse":
        io.savemat(path, {name: sparse.csc_array(array) for name, array in arrays.items()}, do_compression=True)
    elif version == "5 in a structure":
        io.savemat(path, {"fem": {"K": sparse.csc_array(STIFFNESS), "E": MASS}})
    elif version in {"4", "5"}:
        io.savemat(path, arrays, format=version)
    else:
        hdf5(path, arrays, sparse_too="sparse" in version)
    further = ['variables = { mass = "E" }'] if "structure" in version else []
    assert_allclose(frequencies(model_toml(tmp_path, path.name, path.name, *further)), EXPECTED, rtol=ROUNDING)
    assert recognises(path)


@pytest.mark.parametrize("shape", [(3,), (3, 1), (1, 3)])
@pytest.mark.parametrize("name", ["fem.mat", "fem.npz"])
def test_lumped_masses_are_a_vector(tmp_path, name, shape):
    """The stiffness beside them was taken for the mass, without a word."""
    save = io.savemat if name.endswith("mat") else lambda path, arrays: np.savez(path, **arrays)
    save(tmp_path / name, {"K": STIFFNESS, "M": np.diag(MASS).reshape(shape)})
    model = read_model(model_toml(tmp_path, name, name))
    assert_allclose(solve_modes(model).natural_frequency_hz, EXPECTED, rtol=ROUNDING)
    assert f"{name}: 'M' is a vector of 3 values: the diagonal of the mass" in model.notes


@pytest.mark.parametrize("as_sparse", [False, True])
def test_complex_matrices_without_an_imaginary_part_are_real(tmp_path, as_sparse):
    made = sparse.csc_array if as_sparse else np.array
    io.savemat(tmp_path / "fem.mat", {"K": made(STIFFNESS + 0j), "M": made(MASS + 0j)})
    np.savez(tmp_path / "fem.npz", K=STIFFNESS + 0j, M=MASS + 0j)
    for name in ("fem.mat", "fem.npz"):
        assert_allclose(frequencies(model_toml(tmp_path, name, name)), EXPECTED, rtol=ROUNDING)


def test_no_stiffness_is_a_mass_for_want_of_one(tmp_path):
    io.savemat(tmp_path / "fem.mat", {"K": STIFFNESS, "X": np.ones((2, 3))})
    with pytest.raises(FileFormatError, match=r"fem.mat.* holds the matrices K; \[matrices\] variables = \{ mass = "):
        read_model(model_toml(tmp_path, "fem.mat", "fem.mat"))


def test_a_file_may_name_its_rows(tmp_path):
    labels = np.array(["1:x", "2:x", "3:x"])
    places = [[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]]
    np.savez(tmp_path / "fem.npz", K=STIFFNESS, M=MASS, dofs=labels, coordinates=places)
    io.savemat(tmp_path / "fem.mat", {"K": STIFFNESS, "M": MASS, "dofs": [[1, 1], [2, 1], [3, 1]]})
    for name, is_placed in (("fem.npz", True), ("fem.mat", False)):
        model = read_model(model_toml(tmp_path, name, name, dofs=""))
        assert [dof.name for dof in model.dofs] == ["1:x", "2:x", "3:x"]
        assert model.geometry.is_schematic is not is_placed
        if is_placed:
            assert_allclose(model.geometry.coordinates_m[:, 0], [0, 0.1, 0.2])


def triplets(matrix, *, separator=" ", lower=True):
    rows, columns = np.nonzero(np.tril(matrix) if lower else matrix)
    return "".join(
        f"{i + 1}{separator}{j + 1}{separator}{matrix[i, j]:.16e}\n" for i, j in zip(rows, columns, strict=True)
    )


def test_calculix_writes_rows_columns_values_and_a_table_of_dofs(tmp_path):
    (tmp_path / "job.sti").write_text(triplets(STIFFNESS))
    (tmp_path / "job.mas").write_text(triplets(MASS))
    (tmp_path / "job.dof").write_text("1.1\n2.1\n3.1\n")
    (tmp_path / "job.inp").write_text(
        "** a deck\n*NODE, NSET=ALL\n1, 0., 0., 0.\n2, 100.,0,0\n3, 200.\n*ELEMENT\n1, 2\n"
    )
    path = model_toml(tmp_path, "job.mas", "job.sti", 'nodes = "job.inp"', dofs='dofs = "job.dof"')
    model = read_model(path)
    assert_allclose(solve_modes(model).natural_frequency_hz, EXPECTED, rtol=ROUNDING)
    assert_allclose(model.geometry.coordinates_m[:, 0], [0, 100, 200])
    assert tmp_path / "job.inp" in model_files(path)


@pytest.mark.parametrize("kind", ["matrix input", "both triangles", "coordinate"])
def test_abaqus_writes_labels_or_coordinates(tmp_path, kind):
    for name, matrix in (("STIF2", STIFFNESS), ("MASS2", MASS)):
        if kind == "coordinate":
            text = triplets(matrix, separator=", ", lower=False)
        else:
            text = "** Abaqus\n*MATRIX, TYPE=STIFFNESS\n" + "".join(
                f"{i + 1},1,{j + 1},1, {matrix[i, j]:.16e}\n"
                for i in range(3)
                for j in range(3)
                if matrix[i, j] and (kind == "both triangles" or (i + j) % 2 == (i > j) or i == j)
            )
        (tmp_path / f"job_{name}.mtx").write_text(text)
    dofs = 'dofs = "dofs.csv"' if kind == "coordinate" else ""
    path = model_toml(tmp_path, "job_MASS2.mtx", "job_STIF2.mtx", dofs=dofs)
    assert_allclose(frequencies(path), EXPECTED, rtol=ROUNDING)


def test_multipliers_of_abaqus_have_negative_labels(tmp_path):
    """Nodes 1 and 3 move alike."""
    rows = "".join(
        f"{i + 1},1,{j + 1},1,{STIFFNESS[i, j]:.16e}\n" for i in range(3) for j in range(i + 1) if STIFFNESS[i, j]
    )
    (tmp_path / "K.mtx").write_text(rows + "-1,0,1,1,1e6\n-1,0,3,1,-1e6\n")
    (tmp_path / "M.mtx").write_text("1,1,1,1,2.0\n2,1,2,1,1.0\n3,1,3,1,3.0\n")
    basis = np.array([[1.0, 0], [0, 1], [1, 0]])
    squares = np.linalg.eigvals(np.linalg.solve(basis.T @ MASS @ basis, basis.T @ STIFFNESS @ basis)).real
    path = model_toml(tmp_path, "M.mtx", "K.mtx", dofs="")
    assert_allclose(frequencies(path), np.sqrt(np.sort(squares)) / (2 * np.pi), rtol=1e-9)


def test_matrices_that_name_rows_are_put_in_the_order_of_the_table(tmp_path):
    (tmp_path / "K.mtx").write_text("1,1,1,1,3e4\n2,1,1,1,-1e4\n2,1,2,1,5e4\n3,1,2,1,-4e4\n3,1,3,1,4e4\n")
    (tmp_path / "M.mtx").write_text("3,1,3,1,3.0\n2,1,2,1,1.0\n1,1,1,1,2.0\n")
    (tmp_path / "dofs.csv").write_text("node,direction,x_m,y_m,z_m\n3,x,0.2,0,0\n1,x,0,0,0\n2,x,0.1,0,0\n")
    model = read_model(model_toml(tmp_path, "M.mtx", "K.mtx"))
    assert [dof.node for dof in model.dofs] == [3, 1, 2]
    assert model.mass.diagonal().tolist() == [3, 2, 1]
    assert_allclose(solve_modes(model).natural_frequency_hz, EXPECTED, rtol=1e-9)


@pytest.mark.parametrize(
    ("deck", "name"),
    [
        (f"{'GRID':8}{1:8}{'':8}{0.0:8}{0.0:8}{0.0:8}\n{'GRID':8}{2:8}{'':8}{'.1':>8}{0.0:8}\n", "a.bdf"),
        (f"{'GRID*':8}{1:16}{'':16}{0.0:16}{0.0:16}\n{'*':8}{0.0:16}\nGRID,2,,.1,0.0,0.0\n", "a.dat"),
        ("node,x,y,z\n1,0,0,0\n2,1e-1,0,0\n", "a.csv"),
        ("*Node\n1,0,0,0\n2,1D-1,0,0\n", "a.inp"),
    ],
)  # fmt: skip
def test_positions_come_from_decks(tmp_path, deck, name):
    text = deck + {"a.bdf": "GRID           3              .2\n", "a.dat": "GRID,3,,.2\n"}.get(name, "3,0.2,0,0\n")
    (tmp_path / name).write_text(text)
    (tmp_path / "job.dof").write_text("1.1\n2.1\n3.1\n")
    np.savez(tmp_path / "fem.npz", K=STIFFNESS, M=MASS)
    path = model_toml(tmp_path, "fem.npz", "fem.npz", f'nodes = "{name}"', dofs='dofs = "job.dof"')
    assert_allclose(read_model(path).geometry.coordinates_m, [[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]])


@pytest.mark.parametrize(("unit", "factor"), [("m", 1.0), ("mm", 1000.0)])
def test_elements_are_drawn_with_held_nodes_and_in_the_unit_of_the_file(tmp_path, unit, factor):
    factors = f"{factor:25.17E}{1.0:25.17E}{1.0:25.17E}\n{0.0:25.17E}".replace("E", "D")
    rows = "\n".join(
        f"{n:10d}{0:10d}{0:10d}{0:10d}\n{0.1 * factor * (n - 1):25.16E}{0.0:25.16E}{0.0:25.16E}" for n in range(5)
    )
    frame = f"{1:10d}{4:10d}{1:10d}\nframe\n" + "".join(f"{n:10d}" for n in range(1, 5))
    sets = {164: f"{1:10d}{unit:<20}{2:10d}\n{factors}", 2411: rows, 82: frame}
    (tmp_path / "a.unv").write_text("".join(f"    -1\n{kind:6d}\n{text}\n    -1\n" for kind, text in sets.items()))
    (tmp_path / "job.dof").write_text("1.1\n2.1\n3.1\n")
    np.savez(tmp_path / "fem.npz", K=STIFFNESS, M=MASS)
    path = model_toml(tmp_path, "fem.npz", "fem.npz", 'nodes = "a.unv"', dofs='dofs = "job.dof"')
    geometry = read_model(path).geometry
    assert_allclose(geometry.coordinates_m, [[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]])
    assert geometry.mesh.nodes.tolist() == [1, 2, 3, 4]  # the last one has no row
    assert_allclose(geometry.mesh.coordinates_m[:, 0], [0, 0.1, 0.2, 0.3])
    assert geometry.mesh.lines.tolist() == [[1, 2], [2, 3], [3, 4]]


REFUSED = {
    "several matrices": (lambda f: np.savez(f / "K.npz", A=MASS, B=MASS), "K.npz", ["A, B", "variables"]),
    "no matrix": (lambda f: np.savez(f / "K.npz", A=np.zeros(3)), "K.npz", ["no square matrix"]),
    "another order": (lambda f: np.savez(f / "K.npz", K=np.eye(4)), "K.npz", ["4 x 4", "dofs.csv names 3"]),
    "pickled": (lambda f: np.savez(f / "K.npz", K=np.array([{}], object)), "K.npz", ["pickled"]),
    "not finite": (lambda f: np.savez(f / "K.npz", K=np.full((3, 3), np.nan)), "K.npz", ["not finite"]),
    "no archive": (lambda f: (f / "K.npz").write_bytes(b"PK\x03\x04 nothing"), "K.npz", ["NumPy"]),
    "places outside": (
        lambda f: np.savez(
            f / "K.npz", format="csr", shape=[3, 3], data=np.ones(3), indices=[0, 1, 90], indptr=[0, 1, 2, 3]
        ),
        "K.npz",
        ["NumPy"],
    ),
    "no MATLAB file": (lambda f: (f / "K.mat").write_bytes(b"MATLAB 5.0 MAT-file nothing"), "K.mat", ["MAT"]),
    "no HDF5 file": (lambda f: (f / "K.mat").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(99)), "K.mat", ["7.3"]),
    "a word among numbers": (
        lambda f: (f / "K.sti").write_text("1 1 3e4\n1 2 x\n"),
        "K.sti",
        ["line 2", "'x'"],
    ),
    "columns that change": (lambda f: (f / "K.sti").write_text("1 1 3e4\n1 2\n"), "K.sti", ["line 2", "2 columns"]),
    "row 0": (lambda f: (f / "K.sti").write_text("0 0 3e4\n"), "K.sti", ["count from 1"]),
    "a row too many": (lambda f: (f / "K.sti").write_text("9 9 3e4\n"), "K.sti", ["9 x 9"]),
    "DOFs of no table": (lambda f: (f / "K.sti").write_text("7,1,7,1,3e4\n"), "K.sti", ["7:x", "dofs.csv"]),
    "nothing": (lambda f: (f / "K.sti").write_text("* only this\n"), "K.sti", ["no entry"]),
}


@pytest.mark.parametrize(("write", "name", "words"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_matrix_is_refused_by_name(tmp_path, write, name, words):
    np.savez(tmp_path / "M.npz", M=MASS)
    write(tmp_path)
    with pytest.raises(FileFormatError) as caught:
        read_model(model_toml(tmp_path, "M.npz", name))
    message = str(caught.value)
    assert name in message
    for word in words:
        assert word in message


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1.5, -2.0])
def test_dofs_as_numbers_are_whole_ones(tmp_path, wrong):
    np.savez(tmp_path / "fem.npz", K=STIFFNESS, M=MASS, dofs=[[1.0, 1.0], [wrong, 1.0], [3.0, 1.0]])
    with pytest.raises(FileFormatError, match=r"fem\.npz, array 'dofs': has nodes and directions that are no whole"):
        read_model(model_toml(tmp_path, "fem.npz", "fem.npz", dofs=""))


def test_rows_have_to_be_named_somewhere(tmp_path):
    np.savez(tmp_path / "fem.npz", K=STIFFNESS, M=MASS)
    with pytest.raises(FileFormatError, match=r"model\.toml, key 'matrices\.dofs'.*fem\.npz does not say"):
        read_model(model_toml(tmp_path, "fem.npz", "fem.npz", dofs=""))


def test_groups_come_in_any_format(tmp_path):
    path = export(tmp_path, beam(left="clamped", elements=4))
    sparse.save_npz(tmp_path / "K_part.npz", sparse.csr_array(0.3 * read_model(path).stiffness))
    path.write_text(path.read_text() + '[[matrices.group]]\nname = "part"\nstiffness = "K_part.npz"\n')
    (part,) = read_model(path).parts
    assert part.stiffness.shape == (8, 8)


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (Debian's calculix-ccx) is not installed")
@pytest.mark.parametrize("deck", [SOLID, SHELL], ids=["solid", "shell"])
def test_frequencies_of_calculix_are_its_own(tmp_path, deck):
    expected = run_calculix(tmp_path, deck)
    nodes = 'nodes = "job.inp"' if deck is SOLID else ""
    path = model_toml(tmp_path, "job.mas", "job.sti", nodes, dofs='dofs = "job.dof"')
    path.write_text(path.read_text().replace("[model]\n", '[model]\nunits = "mm-t-s"\n'))
    model = read_model(path)
    assert_allclose(solve_modes(model, n_modes=8).natural_frequency_hz, expected, rtol=1e-6)
    if deck is SOLID:
        assert_allclose(np.ptp(model.geometry.coordinates_m, axis=0), [0.05, 0.01, 0.004])


HARWELL_BOEING = """K of a chain
             4             1             1             2             0
RSA                        3             3             5             0
(4I7)           (5I7)           (3E20.8)
      1      3      5      6
      1      2      2      3      3
      2.00000000E+00     -1.00000000E+00      2.00000000E+00
     -1.00000000E+00      1.00000000E+00
"""


@pytest.mark.parametrize("number", ["1.5", "1e300", "-1e300", "1e19"])
@pytest.mark.parametrize("line", [4, 5])
def test_places_of_harwell_boeing_are_whole_numbers(tmp_path, line, number):
    lines = HARWELL_BOEING.split("\n")
    lines[line] = lines[line].replace("      3", f"{number:>7}", 1)
    path = tmp_path / "K.hb"
    path.write_text("\n".join(lines))
    with pytest.raises(FileFormatError, match=r"K\.hb: its (pointers|rows) hold .*no whole number"):
        read_matrix(MatrixRequest(path=path, what="stiffness"))


@pytest.mark.parametrize("text", ["1 1 2.0\n99999999999999999999 1 3.0\n", "1,1,1,1,2.0\n9007199254740995,1,1,1,3.0\n"])
def test_rows_that_no_double_holds_are_refused(tmp_path, text):
    path = tmp_path / "job.sti"
    path.write_text(text)
    with pytest.raises(FileFormatError, match=r"job\.sti: its rows and columns hold .*no whole number"):
        read_matrix(MatrixRequest(path=path, what="stiffness"))


@pytest.mark.parametrize("name", ["indices", "indptr", "shape"])
@pytest.mark.parametrize("number", [0.5, 1e300, np.nan])
def test_places_of_a_sparse_matrix_are_whole_numbers(tmp_path, name, number):
    parts = {
        "format": np.array("csr"),
        "shape": np.array([2.0, 2.0]),
        "data": np.array([2.0, 1.0]),
        "indices": np.array([0.0, 1.0]),
        "indptr": np.array([0.0, 1.0, 2.0]),
    }
    np.savez(tmp_path / "whole.npz", **parts)
    assert read_matrix(MatrixRequest(path=tmp_path / "whole.npz", what="stiffness")).matrix.shape == (2, 2)
    parts[name][1] = number
    np.savez(tmp_path / "K.npz", **parts)
    with pytest.raises(FileFormatError, match=r"K\.npz.* hold .*no whole number"):
        read_matrix(MatrixRequest(path=tmp_path / "K.npz", what="stiffness"))
