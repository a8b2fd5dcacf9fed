"""Errors in the files of a model are reported: which file, where, and what to do."""

import numpy as np
import pytest
from scipy import io, sparse

from fe_models import BEAM_TEXT, LUMPED_TEXT, beam, export
from frf_ipz.errors import FileFormatError
from frf_ipz.fe.model_file import read_model

SECTION = "[[beam.section]]\nelements = [{}, {}]\nthickness_m = 0.01\n"

BEAM_CASES = {
    "no model section": (lambda text: text.replace("[model]", "[modle]"), ["no section [model]"]),
    "not TOML": (lambda text: text + "length_m = = 3", ["not valid TOML", "line"]),
    "unknown kind": (
        lambda text: text.replace('"beam"\nname', '"beem"\nname'),
        ["key 'model.kind'", "did you mean 'beam'"],
    ),
    "unknown key": (lambda text: text.replace("length_m", "lenght_m"), ["lenght_m", "did you mean 'length_m'"]),
    "unknown section": (lambda text: text + "[daming]\nmodal_ratio = 0.1", ["daming", "did you mean 'damping'"]),
    "missing key": (lambda text: text.replace("youngs_modulus_Pa = 69e9\n", ""), ["youngs_modulus_Pa", "missing"]),
    "missing beam": (lambda text: text[: text.index("[beam]")], ["beam", "missing"]),
    "other kind's section": (lambda text: text.replace("[beam]", "[lumped]"), ["lumped", "unknown key"]),
    "text for a number": (lambda text: text.replace("= 0.5", '= "0.5"'), ["beam.length_m", "valid number", "'0.5'"]),
    "truth value for a number": (lambda text: text.replace("= 0.5", "= true"), ["beam.length_m", "valid number"]),
    "number for a text": (lambda text: text.replace('"clamped"', "3"), ["beam.left", "'clamped'"]),
    "fraction for a count": (lambda text: text.replace("= 20", "= 20.5"), ["beam.elements", "integer"]),
    "negative length": (lambda text: text.replace("= 0.5", "= -0.5"), ["beam.length_m", "greater than 0", "-0.5"]),
    "length without end": (lambda text: text.replace("= 0.5", "= inf"), ["beam.length_m", "finite"]),
    "thickness nought": (lambda text: text.replace("= 0.005", "= 0.0"), ["beam.thickness_m", "greater than 0"]),
    "no element": (lambda text: text.replace("= 20", "= 0"), ["beam.elements", "greater than or equal to 1"]),
    "too many elements": (lambda text: text.replace("= 20", "= 2000000"), ["beam.elements", "100000"]),
    "poisson ratio": (lambda text: text.replace("= 0.33", "= 0.6"), ["beam.poisson_ratio", "0.5"]),
    "unknown support": (lambda text: text.replace("clamped", "glued"), ["beam.left", "'pinned'", "glued"]),
    "unknown theory": (lambda text: text + 'formulation = "euler"', ["beam.formulation", "'euler-bernoulli'"]),
    "nothing can move": (
        lambda text: text.replace("= 20", "= 1") + 'right = "clamped"',
        ["hold every DOF", "more elements"],
    ),
    "section behind the end": (lambda text: text + SECTION.format(18, 21), ["[1]", "18 to 21", "1 to 20"]),
    "section backwards": (lambda text: text + SECTION.format(7, 5), ["beam.section.[1]", "7 to 5"]),
    "sections overlap": (
        lambda text: text + SECTION.format(1, 4) + SECTION.format(4, 6),
        ["beam.section.[2]", "element 4", "overlap"],
    ),
    "section of one number": (lambda text: text + "[[beam.section]]\nelements = [3]", ["beam.section.[1].elements"]),
    "section changes nothing": (lambda text: text + "[[beam.section]]\nelements = [3, 4]", ["give thickness_m"]),
    "mass at no node": (
        lambda text: text + "[[beam.point_mass]]\nnode = 22\nmass_kg = 1.0",
        ["beam.point_mass", "no node 22", "1 to 21"],
    ),
    "negative mass": (
        lambda text: text + "[[beam.point_mass]]\nnode = 2\nmass_kg = -1.0",
        ["beam.point_mass.[1].mass_kg", "greater than or equal to 0"],
    ),
    "spring at no node": (
        lambda text: text + "[[beam.point_spring]]\nnode = 50\nstiffness_N_m = 1.0",
        ["beam.point_spring", "no node 50"],
    ),
    "spring without stiffness": (lambda text: text + "[[beam.point_spring]]\nnode = 5", ["has no stiffness"]),
    "two kinds of damping": (
        lambda text: text.replace("modal_ratio = 0.001", "modal_ratio = 0.001\nrayleigh = { beta_s = 1e-6 }"),
        ["damping", "exactly one"],
    ),
    "no damping in its section": (lambda text: text.replace("modal_ratio = 0.001\n", ""), ["damping", "exactly one"]),
    "damping above critical": (lambda text: text.replace("= 0.001", "= 1.5"), ["damping.modal_ratio", "less than 1"]),
    "negative damping": (lambda text: text.replace("= 0.001", "= [0.01, -0.01]"), ["damping.modal_ratio.[2]", "-0.01"]),
    "empty list of damping": (lambda text: text.replace("= 0.001", "= []"), ["damping.modal_ratio"]),
}

LUMPED_CASES = {
    "no mass": (lambda text: text[: text.index("[[lumped.mass]]")] + "mass = []", ["lumped.mass", "no mass"]),
    "massless node": (
        lambda text: text.replace("= 3.0\n[[lumped.spring]]", "= 0.0\n[[lumped.spring]]", 1),
        ["mass_kg"],
    ),
    "node twice": (lambda text: text.replace("node = 2", "node = 1"), ["node 1 has two masses"]),
    "mass at the ground": (lambda text: text.replace("node = 2", "node = 0"), ["lumped.mass.[2].node"]),
    "spring twice": (lambda text: text.replace('"k2"', '"k1"'), ["'k1'", "rename"]),
    "spring to nowhere": (lambda text: text.replace("[1, 2]", "[1, 7]"), ["'k2'", "node 7", "no mass", "[0, 1, 2]"]),
    "spring to itself": (lambda text: text.replace("[1, 2]", "[2, 2]"), ["'k2'", "both its ends at node 2"]),
    "negative spring": (lambda text: text.replace("= 1e5", "= -1e5"), ["lumped.spring.[2].stiffness_N_m"]),
    "negative damper": (lambda text: text.replace("= 3.0\n[[lumped.spring]]", "= -3.0\n[[lumped.spring]]"), ["-3.0"]),
    "direction": (lambda text: text.replace('direction = "x"', 'direction = "w"'), ["lumped.direction", "'y'"]),
    "unknown key of a spring": (
        lambda text: text.replace("stiffness_N_m = 1e5", "stifness_N_m = 1e5"),
        ["stiffness_N_m"],
    ),
}


def refused(path):
    with pytest.raises(FileFormatError) as caught:
        read_model(path)
    return str(caught.value)


@pytest.mark.parametrize(("change", "fragments"), BEAM_CASES.values(), ids=BEAM_CASES)
def test_a_beam_that_cannot_be(tmp_path, change, fragments):
    path = tmp_path / "model.toml"
    changed = change(BEAM_TEXT)
    assert changed != BEAM_TEXT
    path.write_text(changed, encoding="utf-8")
    message = refused(path)
    for fragment in (str(path), *fragments):
        assert fragment in message


@pytest.mark.parametrize(("change", "fragments"), LUMPED_CASES.values(), ids=LUMPED_CASES)
def test_a_lumped_model_that_cannot_be(tmp_path, change, fragments):
    path = tmp_path / "model.toml"
    changed = change(LUMPED_TEXT)
    assert changed != LUMPED_TEXT
    path.write_text(changed, encoding="utf-8")
    message = refused(path)
    for fragment in (str(path), *fragments):
        assert fragment in message


def write_matrix(folder, name, change):
    matrix = io.mmread(folder / name).toarray()
    io.mmwrite(folder / name, sparse.coo_array(change(matrix)), symmetry="general", precision=17)


def set_entries(*entries):
    def change(matrix):
        for row, column, value in entries:
            matrix[row, column] = value
        return matrix

    return change


def edit(name, old, new):
    def change(folder):
        path = folder / name
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new, 1), encoding="utf-8")

    return change


MATRIX_CASES = {
    "no stiffness file": (lambda folder: (folder / "K.mtx").unlink(), "K.mtx", ["no such file", "relative"]),
    "no table": (lambda folder: (folder / "dofs.csv").unlink(), "dofs.csv", ["no such file"]),
    "empty file": (lambda folder: (folder / "K.mtx").write_text(""), "K.mtx", ["cannot be read as a Matrix Market"]),
    "truncated file": (
        lambda folder: (folder / "K.mtx").write_bytes((folder / "K.mtx").read_bytes()[:-100]),
        "K.mtx",
        ["line 3", "17 entries are announced, but 14 follow"],
    ),
    "no number": (edit("K.mtx", "2 2 ", "2 x "), "K.mtx", ["line 6", "'x' is no number of a row"]),
    "complex": (
        lambda folder: io.mmwrite(folder / "K.mtx", sparse.eye_array(6, format="coo") * 1j),
        "K.mtx",
        ["imaginary values", "real"],
    ),
    "pattern only": (
        lambda folder: io.mmwrite(folder / "K.mtx", sparse.eye_array(6, format="coo"), field="pattern"),
        "K.mtx",
        ["pattern values"],
    ),
    "not square": (
        lambda folder: io.mmwrite(folder / "K.mtx", sparse.coo_array(np.ones((6, 5)))),
        "K.mtx",
        ["6 x 5", "square"],
    ),
    "other size than the table": (
        lambda folder: io.mmwrite(folder / "M.mtx", sparse.eye_array(8, format="coo")),
        "M.mtx",
        ["8 x 8", "dofs.csv names 6 DOFs"],
    ),
    "not finite": (
        lambda folder: write_matrix(folder, "K.mtx", set_entries((0, 0, np.inf))),
        "K.mtx",
        ["line 4", "'Infinity' is no finite number"],
    ),
    "not symmetric": (
        lambda folder: write_matrix(folder, "K.mtx", set_entries((0, 2, 0.0))),
        "K.mtx",
        ["not symmetric", "rows 1 and 3"],
    ),
    "no mass at all": (
        lambda folder: write_matrix(folder, "M.mtx", lambda mass: 0 * mass),
        "M.mtx",
        ["no DOF has any"],
    ),
    "indefinite mass": (
        lambda folder: write_matrix(folder, "M.mtx", set_entries((0, 2, 9.0), (2, 0, 9.0))),
        "M.mtx",
        ["a negative mass", "at the DOF"],
    ),
    "indefinite stiffness": (
        lambda folder: write_matrix(folder, "K.mtx", lambda stiffness: -stiffness),
        "K.mtx",
        ["indefinite", "at the DOF", "sign"],
    ),
    "missing column": (edit("dofs.csv", "direction", "dir"), "dofs.csv", ["line 1", "'direction'", "node,direction"]),
    "no row": (lambda folder: (folder / "dofs.csv").write_text("node,direction,x_m,y_m,z_m\n"), "dofs.csv", ["no DOF"]),
    "short row": (edit("dofs.csv", "2,ry,", "2,ry\n"), "dofs.csv", ["line 3", "2 cells"]),
    "node that is none": (edit("dofs.csv", "2,ry", "a,ry"), "dofs.csv", ["line 3", "'a'", "node number"]),
    "ground in the table": (edit("dofs.csv", "2,ry", "0,ry"), "dofs.csv", ["line 3", "1 or more"]),
    "unknown direction": (edit("dofs.csv", "2,ry", "2,rot"), "dofs.csv", ["line 3", "'rot'"]),
    "coordinate that is none": (edit("dofs.csv", ",0.0,", ",here,"), "dofs.csv", ["line 2", "'y_m'", "'here'"]),
    "coordinate without end": (edit("dofs.csv", ",0.0,", ",nan,"), "dofs.csv", ["line 2", "finite"]),
    "DOF twice": (edit("dofs.csv", "2,ry", "2,z"), "dofs.csv", ["line 3", "2:z", "line 2"]),
    "node at two positions": (
        edit("dofs.csv", ",0.0,", ",0.5,"),
        "dofs.csv",
        ["line 3", "node 2 has other coordinates"],
    ),
    "group twice": (
        lambda folder: add_text(folder, '[[matrices.group]]\nname = "a"\nstiffness = "K.mtx"\n' * 2),
        "model.toml",
        ["'a'", "rename"],
    ),
    "group of another size": (
        lambda folder: (
            io.mmwrite(folder / "small.mtx", sparse.eye_array(2, format="coo")),
            add_text(folder, '[[matrices.group]]\nname = "a"\nstiffness = "small.mtx"\n'),
        ),
        "small.mtx",
        ["2 x 2", "6 DOFs"],
    ),
    "group's mass too large": (
        lambda folder: (
            io.mmwrite(folder / "big.mtx", sparse.eye_array(6, format="coo") * 1e6),
            add_text(folder, '[[matrices.group]]\nname = "a"\nstiffness = "K.mtx"\nmass = "big.mtx"\n'),
        ),
        "model.toml",
        ["mass adds up to more"],
    ),
    "negative damping matrix": (
        lambda folder: (
            io.mmwrite(folder / "B.mtx", sparse.eye_array(6, format="coo") * -1.0),
            edit("model.toml", "dofs =", 'damping = "B.mtx"\ndofs =')(folder),
        ),
        "B.mtx",
        ["damping matrix is indefinite"],
    ),
}


def add_text(folder, text):
    path = folder / "model.toml"
    path.write_text(path.read_text(encoding="utf-8") + text, encoding="utf-8")


@pytest.mark.parametrize(("change", "name", "fragments"), MATRIX_CASES.values(), ids=MATRIX_CASES)
def test_matrices_that_cannot_be(tmp_path, change, name, fragments):
    path = export(tmp_path, beam(left="clamped", elements=3))
    read_model(path)
    change(tmp_path)
    message = refused(path)
    for fragment in (str(tmp_path / name), *fragments):
        assert fragment in message


def test_a_missing_model_file(tmp_path):
    assert "no such file" in refused(tmp_path / "model.toml")
