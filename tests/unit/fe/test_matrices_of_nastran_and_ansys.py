"""Matrices of Nastran and Ansys, from files that came with the libraries that read them, against those programs."""

import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import io, linalg, sparse

from frf_ipz.errors import FileFormatError
from frf_ipz.fe.eigen import solve_modes
from frf_ipz.fe.matrices.nastran_rows import _axes
from frf_ipz.fe.matrices.registry import read_matrix
from frf_ipz.fe.matrices.stored import MatrixRequest
from frf_ipz.fe.model_file import read_model

MASS = np.diag([2.0, 1.0, 3.0])
STIFFNESS = np.array([[3e4, -1e4, 0.0], [-1e4, 5e4, -4e4], [0.0, -4e4, 4e4]])
EXPECTED = np.sqrt(linalg.eigh(STIFFNESS, MASS, eigvals_only=True)) / (2 * np.pi)
DOFS = "node,direction,x_m,y_m,z_m\n1,x,0,0,0\n2,x,0.1,0,0\n3,x,0.2,0,0\n"


def model_toml(folder, matrices, rows="", further=""):
    dofs = f'dofs = "{rows}"\n' if rows else ""
    (folder / "model.toml").write_text(
        f'[model]\nkind = "matrices"\n[matrices]\nmass = "{matrices[0]}"\nstiffness = "{matrices[1]}"\n{dofs}{further}'
    )
    (folder / "dofs.csv").write_text(DOFS)
    return folder / "model.toml"


def frequencies(path, **options):
    return solve_modes(read_model(path), **options).natural_frequency_hz


def library(name):
    """Load a part of pyyeti, which would set NumPy's print options for all tests after this one."""
    with np.printoptions():
        return pytest.importorskip(name, reason="the extra 'nastran' is not installed")


@pytest.fixture
def op4():
    return library("pyyeti.nastran.op4")


@pytest.fixture
def nastran_files():
    pyyeti = library("pyyeti")
    folder = Path(pyyeti.__file__).parent / "tests" / "nas2cam_extseout"
    if not folder.is_dir():
        pytest.skip("this pyyeti came without its files of Nastran")
    return folder


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("layout", ["dense", "bigmat", "nonbigmat"])
def test_output4(tmp_path, op4, binary, layout):
    matrices = {"KAA": STIFFNESS, "MAA": MASS, "GM": np.zeros((2, 3))}
    op4.write(str(tmp_path / "f.op4"), matrices, binary=binary, sparse=layout)
    assert_allclose(frequencies(model_toml(tmp_path, ("f.op4", "f.op4"), "dofs.csv")), EXPECTED, rtol=1e-9)


def test_a_matrix_of_output4_is_named(tmp_path, op4):
    op4.write(str(tmp_path / "f.op4"), {"A1": STIFFNESS, "A2": MASS})
    path = model_toml(tmp_path, ("f.op4", "f.op4"), "dofs.csv", 'variables = { stiffness = "A1", mass = "a2" }\n')
    assert_allclose(frequencies(path), EXPECTED, rtol=1e-9)


def test_a_text_of_output4_whose_column_is_longer_than_the_file_is_refused_at_once(tmp_path, op4):
    """What reads it would look for so many numbers behind its end."""
    op4.write(str(tmp_path / "f.op4"), {"A1": STIFFNESS, "A2": MASS}, binary=False)
    lines = (tmp_path / "f.op4").read_text().splitlines(keepends=True)
    assert lines[1].split()[0] == "1"
    lines[1] = f"{lines[1][:16]}99999999\n"
    (tmp_path / "f.op4").write_text("".join(lines))
    with pytest.raises(FileFormatError, match="line 2: says that 99999999 numbers follow"):
        read_model(model_toml(tmp_path, ("f.op4", "f.op4"), "dofs.csv", 'variables = { stiffness = "A1" }\n'))


@pytest.mark.parametrize("length", [-48, 16, 2**31 - 1])
def test_a_record_of_output4_that_leads_astray_is_refused(tmp_path, op4, length):
    """A negative length would lead back, again and again."""
    op4.write(str(tmp_path / "f.op4"), {"A1": STIFFNESS, "A2": MASS}, binary=True)
    content = bytearray((tmp_path / "f.op4").read_bytes())
    assert int.from_bytes(content[:4], "little") == 24
    content[32:36] = length.to_bytes(4, "little", signed=True)
    (tmp_path / "f.op4").write_bytes(bytes(content))
    with pytest.raises(FileFormatError, match="no record of the length that stands at byte 32"):
        read_model(model_toml(tmp_path, ("f.op4", "f.op4"), "dofs.csv", 'variables = { stiffness = "A1" }\n'))


def test_a_residual_structure_has_the_frequencies_that_nastran_computed(tmp_path, op4, nastran_files):
    """Rows by the USET of the OP2: sets, scalar points, displacement coordinate systems."""
    op2 = library("pyyeti.nastran.op2")
    nastran = op2.rdnas2cam(str(nastran_files / "nas2cam"))
    op4.write(str(tmp_path / "f.op4"), {"KAA": nastran["kaa"][0], "MAA": nastran["maa"][0]})
    shutil.copy(nastran_files / "nas2cam.op2", tmp_path / "f.op2")
    computed = np.sqrt(nastran["lambda"][0][6:]) / (2 * np.pi)
    model = read_model(model_toml(tmp_path, ("f.op4", "f.op4"), "f.op2"))
    found = solve_modes(model).natural_frequency_hz
    assert found[:6].tolist() == [0] * 6
    assert_allclose(found[6:], computed, rtol=1e-7)
    assert sum(dof.direction == "q" for dof in model.dofs) > 0


def test_an_external_super_element_has_its_rows_in_the_asm(tmp_path, op4, nastran_files):
    for name in ("inboard.op4", "inboard.asm", "inboard.pch"):
        shutil.copy(nastran_files / name, tmp_path)
    model = read_model(model_toml(tmp_path, ("inboard.op4", "inboard.op4"), "inboard.asm"))
    matrices = op4.read(str(nastran_files / "inboard.op4"))
    mass, stiffness = matrices["mxx"], matrices["kxx"]
    squares = 1 / linalg.eigh(mass, stiffness + 1e4 * mass, eigvals_only=True)[:0:-1] - 1e4  # one motion has no mass
    found = solve_modes(model).natural_frequency_hz
    assert found[:6].tolist() == [0] * 6
    assert_allclose(found[6:20], np.sqrt(squares[6:20]) / (2 * np.pi), rtol=1e-6)
    assert_allclose(model.geometry.coordinates_m[0], [600, 0, 300])


def dmig(name, matrix, form=6):
    text = f"{'DMIG':8}{name:8}{0:8}{form:8}{2:8}{0:8}\n"
    for column in range(3):
        text += f"{'DMIG*':8}{name:16}{column + 1:16}{1:16}\n"
        for row in range(column, 3):
            if matrix[row, column]:
                text += f"{'*':8}{row + 1:16}{1:16}{matrix[row, column]:16.9E}\n".replace("E", "D")
    return text


def test_dmig_cards_name_their_rows(tmp_path, op4):
    del op4
    (tmp_path / "f.pch").write_text("$ punched\n" + dmig("KAAX", STIFFNESS) + dmig("MAAX", MASS))
    names = 'variables = { stiffness = "KAAX", mass = "maax" }\n'
    model = read_model(model_toml(tmp_path, ("f.pch", "f.pch"), further=names))
    assert [dof.name for dof in model.dofs] == ["1:x", "2:x", "3:x"]
    assert_allclose(solve_modes(model).natural_frequency_hz, EXPECTED, rtol=1e-8)


@pytest.mark.parametrize("point", ["inf", "1.5", "-2"])
def test_rows_of_dmig_cards_are_whole_numbers(tmp_path, op4, point):
    del op4
    text = "$ punched\n" + dmig("KAAX", STIFFNESS)
    (tmp_path / "f.pch").write_text(text.replace(f"{'DMIG*':8}{'KAAX':16}{1:16}", f"{'DMIG*':8}{'KAAX':16}{point:>16}"))
    with pytest.raises(FileFormatError, match=f"grid point '?{re.escape(point)}.*whole numbers, the first above 0"):
        read_matrix(MatrixRequest(path=tmp_path / "f.pch", what="stiffness"))


@pytest.mark.parametrize("kind", [1, 2, 3])
def test_axes_of_displacement_systems_are_right_handed_and_point_outward(kind):
    turn, _ = np.linalg.qr(np.random.default_rng(kind).normal(size=(3, 3)))
    turn[:, 2] = np.cross(turn[:, 0], turn[:, 1])
    origin = np.array([1.0, -2.0, 0.5])
    local = np.array([0.3, 0.4, -0.7])
    axes = _axes(origin + turn @ local, kind, origin, turn)
    assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert_allclose(np.cross(axes[0], axes[1]), axes[2], atol=1e-12)
    outward = {1: [1, 0, 0], 2: [0.6, 0.8, 0], 3: local / np.linalg.norm(local)}[kind]
    assert_allclose(turn.T @ axes[0], outward, atol=1e-12)


def test_the_example_of_ansys_has_its_published_frequencies(tmp_path):
    """The first six of the example in the documentation of ansys-mapdl-reader, to the digits printed there."""
    examples = pytest.importorskip("ansys.mapdl.reader.examples", reason="the extra 'ansys' is not installed")
    shutil.copy(examples.fullfile, tmp_path / "file.full")
    model = read_model(model_toml(tmp_path, ("file.full", "file.full")))
    found = solve_modes(model, n_modes=4).natural_frequency_hz
    assert_allclose(found, [1283.20036, 1283.20036, 5781.97486, 6919.39887], rtol=1e-8)
    assert len(model.held_dofs) == 63


@pytest.mark.parametrize("kind", ["RUA", "RSA"])
def test_harwell_boeing_files(tmp_path, kind):
    for name, matrix in (("K", STIFFNESS), ("M", MASS)):
        written = sparse.csc_matrix(np.tril(matrix) if kind == "RSA" else matrix)
        io.hb_write(str(tmp_path / f"{name}.hb"), written)
        text = (tmp_path / f"{name}.hb").read_text().replace("RUA", kind)
        (tmp_path / f"{name}.hb").write_text(text)
    (tmp_path / "K.mapping").write_text(
        "  Matrix Eqn    Node   DOF\n" + "".join(f" {row}  {row}  UX\n" for row in (1, 2, 3))
    )
    for rows in ("dofs.csv", "K.mapping"):
        model = read_model(model_toml(tmp_path, ("M.hb", "K.hb"), rows))
        assert [dof.name for dof in model.dofs] == ["1:x", "2:x", "3:x"]
        assert_allclose(solve_modes(model).natural_frequency_hz, EXPECTED, rtol=1e-9)


SLOW = pytest.param("f.full", marks=pytest.mark.slow)  # Ansys's reader takes seconds to load


@pytest.mark.parametrize("name", ["f.op4", SLOW, "f.hb", "f.pch"])
@pytest.mark.parametrize("content", [b"", b"nothing of that kind\n" * 8, bytes(range(256)) * 40])
def test_damaged_files_are_refused_by_name(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileFormatError, match=name):
        read_model(model_toml(tmp_path, (name, name), "dofs.csv"))


@pytest.mark.parametrize("rows", ["f.op2", "f.asm", "f.dof", "f.mapping"])
def test_damaged_tables_of_rows_are_refused_by_name(tmp_path, rows):
    np.savez(tmp_path / "f.npz", K=STIFFNESS, M=MASS)
    (tmp_path / rows).write_bytes(b"nothing of that kind\n" * 8)
    with pytest.raises(FileFormatError, match=rows):
        read_model(model_toml(tmp_path, ("f.npz", "f.npz"), rows))


def test_an_op2_of_results_is_not_called_damaged(tmp_path, nastran_files):
    np.savez(tmp_path / "f.npz", K=STIFFNESS, M=MASS)
    shutil.copy(nastran_files / "inboard.op2", tmp_path / "f.op2")
    with pytest.raises(FileFormatError, match=r"holds the data blocks PVT0, .* written by NAS2CAM") as error:
        read_model(model_toml(tmp_path, ("f.npz", "f.npz"), "f.op2"))
    assert "damaged" not in str(error.value)


@pytest.mark.slow
def test_a_cut_full_file_is_refused(tmp_path):
    examples = pytest.importorskip("ansys.mapdl.reader.examples", reason="the extra 'ansys' is not installed")
    data = Path(examples.fullfile).read_bytes()
    (tmp_path / "f.full").write_bytes(data[: len(data) // 3])
    with pytest.raises(FileFormatError, match=r"f\.full"):
        read_model(model_toml(tmp_path, ("f.full", "f.full")))


@pytest.mark.parametrize(("name", "library", "extra"), [("f.op4", "pyyeti", "nastran"), ("f.full", "ansys", "ansys")])
def test_a_missing_library_is_named_with_its_extra(tmp_path, monkeypatch, name, library, extra):
    for module in [known for known in sys.modules if known.partition(".")[0] == library]:
        monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setitem(sys.modules, library, None)
    (tmp_path / name).write_bytes(b"something")
    with pytest.raises(FileFormatError, match=rf"frf_ipz\[{extra}\]"):
        read_model(model_toml(tmp_path, (name, name), "dofs.csv"))
