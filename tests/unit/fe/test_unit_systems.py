"""FE models in units other than SI."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import io, sparse

from fe_models import BEAM_TEXT, LUMPED_TEXT, beam, export, read_text_model
from frf_ipz.dofs import Dof
from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.fe.eigen import solve_modes
from frf_ipz.fe.model_file import read_model
from frf_ipz.structure import StructuralModel
from frf_ipz.unit_systems import UnitSystem

ROUNDING = 1e-12
IN_MM_T_S = {  # numbers of the tests' models, as a deck in mm, t and s has them
    "length_m = 0.5\n": "length_m = 500.0\n",
    "youngs_modulus_Pa = 69e9": "youngs_modulus_Pa = 69e3",
    "density_kg_m3 = 2690.0": "density_kg_m3 = 2.69e-9",
    "width_m = 0.025": "width_m = 25.0",
    "thickness_m = 0.005": "thickness_m = 5.0",
}
IN_MM_KG_MS = {
    "mass_kg = 2.0": "mass_kg = 2.0",
    "4e5": "0.4",
    "damping_Ns_m = 3.0": "damping_Ns_m = 3e-3",
    "1e5": "0.1",
}


def replaced(text, changes):
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    return text


def in_units(folder, model, units, length, mass, time):
    """Export a model in SI to another system of units, by hand: moments have a length more than forces."""
    path = export(folder, model)
    lengths = np.array([length if dof.direction.startswith("r") else 1.0 for dof in model.dofs])
    scale = 1 / np.outer(lengths, lengths)
    for name, matrix, factor in (("M", model.mass, 1 / mass), ("K", model.stiffness, time**2 / mass)):
        exported = sparse.coo_array(factor * scale * matrix.toarray())
        io.mmwrite(folder / f"{name}.mtx", exported, symmetry="symmetric", precision=17)
    rows = (folder / "dofs.csv").read_text(encoding="utf-8").splitlines()
    lines = [rows[0]]
    for row in rows[1:]:
        node, direction, *position = row.split(",")
        lines.append(",".join([node, direction, *(repr(float(cell) / length) for cell in position)]))
    (folder / "dofs.csv").write_text("\n".join(lines), encoding="utf-8")
    text = path.read_text(encoding="utf-8").replace("[model]\n", f"[model]\nunits = {units}\n")
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("units", "length", "mass", "time"),
    [
        ('"mm-t-s"', 1e-3, 1e3, 1.0),
        ('"mm-kg-ms"', 1e-3, 1.0, 1e-3),
        ('"cm-g-s"', 1e-2, 1e-3, 1.0),
        ('"in-lbf-s"', 0.0254, 175.126835, 1.0),
        ('{ length = "cm", mass = "g", time = "us" }', 1e-2, 1e-3, 1e-6),
        ('{ length = "ft", mass = "slug" }', 0.3048, 14.5939029, 1.0),
    ],
)
def test_matrices_and_coordinates_in_other_units_are_the_same_structure(tmp_path, units, length, mass, time):
    model = beam(left="clamped", elements=4)
    read = read_model(in_units(tmp_path, model, units, length, mass, time))
    digits = 1e-7  # of the factors above
    for name in ("mass", "stiffness"):
        assert_allclose(getattr(read, name).toarray(), getattr(model, name).toarray(), rtol=digits)
    assert_allclose(read.geometry.coordinates_m, model.geometry.coordinates_m[1:], rtol=ROUNDING)
    assert "SI" in " ".join(read.notes)


def test_groups_are_brought_to_si_too(tmp_path):
    model = beam(left="clamped", elements=4)
    path = in_units(tmp_path, model, '"mm-t-s"', 1e-3, 1e3, 1.0)
    text = path.read_text(encoding="utf-8") + '[[matrices.group]]\nname = "all"\nstiffness = "K.mtx"\nmass = "M.mtx"\n'
    path.write_text(text, encoding="utf-8")
    (part,) = read_model(path).parts
    assert_allclose(part.stiffness.toarray(), model.stiffness.toarray(), rtol=ROUNDING)


def test_a_beam_in_millimetres_and_tonnes_is_the_same_beam(tmp_path):
    expected = solve_modes(read_text_model(tmp_path, BEAM_TEXT)).natural_frequency_hz
    text = replaced(BEAM_TEXT, IN_MM_T_S).replace("[model]\n", '[model]\nunits = "mm-t-s"\n')
    model = read_text_model(tmp_path, text)
    assert_allclose(solve_modes(model).natural_frequency_hz, expected, rtol=1e-9)
    assert_allclose(model.geometry.coordinates_m[-1, 0], 0.5, rtol=ROUNDING)


def test_springs_and_dashpots_in_kilonewtons_and_milliseconds_are_the_same(tmp_path):
    expected = read_text_model(tmp_path, LUMPED_TEXT)
    text = replaced(LUMPED_TEXT, IN_MM_KG_MS).replace("[model]\n", '[model]\nunits = "mm-kg-ms"\n')
    model = read_text_model(tmp_path, text)
    for name in ("mass", "stiffness", "damping"):
        assert_allclose(getattr(model, name).toarray(), getattr(expected, name).toarray(), rtol=ROUNDING)


def test_rayleigh_damping_is_in_the_unit_of_time(tmp_path):
    model = beam(left="clamped", elements=4)
    damping = "\n[damping]\nrayleigh = { alpha_1_s = 0.002, beta_s = 0.05 }\n"
    path = in_units(tmp_path, model, '"mm-kg-ms"', 1e-3, 1.0, 1e-3)
    path.write_text(path.read_text(encoding="utf-8") + damping, encoding="utf-8")
    read = read_model(path)
    expected = 2.0 * model.mass.toarray() + 5e-5 * model.stiffness.toarray()
    assert_allclose(read.damping.toarray(), expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())


def test_arrays_in_memory_have_units_too():
    model = StructuralModel.from_matrices(
        np.diag([2e-3, 1e-3]), [[30.0, -10.0], [-10.0, 10.0]], dofs=["1:x", "2:x"],
        coordinates={1: (0, 0, 0), 2: (200, 0, 0)}, units="mm-t-s",
    )  # fmt: skip
    assert_allclose(model.mass.toarray(), np.diag([2.0, 1.0]), rtol=ROUNDING)
    assert_allclose(model.stiffness.toarray()[0, 0], 30e3, rtol=ROUNDING)
    assert_allclose(model.geometry.coordinates_m[1, 0], 0.2, rtol=ROUNDING)
    assert model.dofs[0] == Dof(1, "x")


@pytest.mark.parametrize(
    "units",
    ["mm-g-s", {"length": "kg"}, {"length": "m**9**9**9"}, {"mass": "__import__('os')"}, {"size": "m"}, {"time": ""}],
)
def test_what_is_no_system_of_units_is_refused(units):
    with pytest.raises(InputError, match="is no"):
        UnitSystem.of(units)


@pytest.mark.parametrize("units", ['"mm-ton-s"', '{ length = "stone" }', '{ weight = "kg" }', "3"])
def test_units_that_are_none_are_refused_with_their_key(tmp_path, units):
    with pytest.raises(FileFormatError, match=r"model\.toml.*model.*units|units.*model"):
        read_text_model(tmp_path, BEAM_TEXT.replace("[model]\n", f"[model]\nunits = {units}\n"))
