"""Rows of held DOFs are found by the scale of their own diagonal, and nothing else is."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import io, sparse
from scipy.linalg import eigh

import frf_ipz
from fe_models import beam, export
from frf_ipz.fe.eigen import solve_modes
from frf_ipz.fe.model_file import read_model
from frf_ipz.numerics.held_rows import find_held_rows


def cantilever_with_held_rows(hold):
    """Matrices of a free beam after `hold` has marked the two DOFs of its first node, and the modes of the rest."""
    model = beam(left="free", elements=8)
    stiffness, mass = model.stiffness.toarray(), model.mass.toarray()
    values = eigh(stiffness[2:, 2:], mass[2:, 2:], eigvals_only=True)
    hold(stiffness, mass)
    return model, stiffness, mass, np.sqrt(values) / (2 * np.pi)


def clear(matrix, diagonal, *, rows=True, columns=True):
    if rows:
        matrix[:2] = 0.0
    if columns:
        matrix[:, :2] = 0.0
    matrix[[0, 1], [0, 1]] = diagonal


def both(stiffness_diagonal, mass_diagonal):
    def hold(stiffness, mass):
        clear(stiffness, stiffness_diagonal)
        clear(mass, mass_diagonal)

    return hold


def penalty(value, mass_value=None):
    def hold(stiffness, mass):
        stiffness[[0, 1], [0, 1]] = value
        if mass_value is not None:
            clear(mass, mass_value)

    return hold


def one_side(*, rows, columns):
    def hold(stiffness, mass):
        clear(stiffness, 1.0, rows=rows, columns=columns)
        clear(mass, 1.0, rows=rows, columns=columns)

    return hold


def stiffness_only(stiffness, mass):
    del mass
    clear(stiffness, 1.0)


HOLDS = {
    "zero": both(0.0, 0.0),
    "printed as 1e-30": both(1e-30, 1e-30),
    "identity in both": both(1.0, 1.0),
    "zero, mass one": both(0.0, 1.0),
    "zero, mass 2e-3": both(0.0, 2e-3),
    "identity and zero": both(1.0, 0.0),
    "a scale and zero": both(3.7e6, 0.0),
    "a scale in both": both(3.7e6, 3.7e6),
    "identity in the stiffness, mass as it was": stiffness_only,
    "identity, rows cleared only": one_side(rows=True, columns=False),
    "identity, columns cleared only": one_side(rows=False, columns=True),
    "two scales": both(3.7e6, 8.2e-3),
    "masses of their own, stiffnesses in proportion": both([3.7e4, 1.48e2], [0.25, 1e-3]),
    "1e36": penalty(1e36),
    "1e30": penalty(1e30),
    "1e20": penalty(1e20),
    "1e36, mass zero": penalty(1e36, 0.0),
    "1e36, mass one": penalty(1e36, 1.0),
    "1e36 alone": both(1e36, 1e-3),
    "1e20 alone, mass one": both(1e20, 1.0),
}


@pytest.mark.parametrize("hold", HOLDS.values(), ids=HOLDS)
def test_held_rows_are_left_out_and_said(hold):
    model, stiffness, mass, expected_hz = cantilever_with_held_rows(hold)
    made = frf_ipz.StructuralModel.from_matrices(mass, stiffness, dofs=model.dofs)
    assert made.held_dofs == model.dofs[:2]
    assert made.dofs == model.dofs[2:]
    assert len(made.notes) == 1
    assert "1:z, 1:ry" in made.notes[0]
    assert_allclose(solve_modes(made).natural_frequency_hz, expected_hz, rtol=1e-7)
    with pytest.raises(frf_ipz.InputError, match="the DOF 1:z is held"):
        made.index(frf_ipz.Dof(1, "z"))


def test_more_rows_may_be_held_than_are_free():
    model = beam(left="free", elements=8)
    stiffness, mass = model.stiffness.toarray(), model.mass.toarray()
    values = eigh(stiffness[12:, 12:], mass[12:, 12:], eigvals_only=True)
    stiffness[np.arange(12), np.arange(12)] = 1e36
    made = frf_ipz.StructuralModel.from_matrices(mass, stiffness, dofs=model.dofs)
    assert_allclose(solve_modes(made).natural_frequency_hz, np.sqrt(values) / (2 * np.pi), rtol=1e-9)


def chain(stiffness_N_m, ground_N_m, mass_kg):
    stiffness = np.diag(np.array(ground_N_m, float))
    for place, value in enumerate(stiffness_N_m):
        stiffness[place : place + 2, place : place + 2] += value * np.array([[1, -1], [-1, 1]])
    return sparse.csr_array(stiffness), sparse.csr_array(np.diag(np.array(mass_kg, float)))


MODES = sparse.csr_array(np.diag([(2 * np.pi * hz) ** 2 for hz in (0.159, 30.0, 400.0)]))
BEAM = beam(left="clamped")
MICRO = beam(length_m=2e-4, width_m=1e-5, thickness_m=2e-6, left="clamped")
NOT_HELD = {
    "modes": (MODES, sparse.eye_array(3, format="csr")),
    "identities": (sparse.eye_array(3, format="csr"), sparse.eye_array(3, format="csr")),
    "beam": (BEAM.stiffness, BEAM.mass),
    "free beam": (beam(left="free").stiffness, beam(left="free").mass),
    "micrometres": (MICRO.stiffness, MICRO.mass),
    "soft and stiff springs": chain([1e3, 1e9], [1.0, 0, 0], [1, 2, 0.7]),
    "a stiff spring to the ground": chain([1e6, 1e6], [1e10, 0, 0], [1, 2, 0.7]),
    "a mass on its own": (
        sparse.csr_array(np.diag([0, 0, 4.0]) + np.array([[2.0, -1, 0], [-1, 1, 0], [0, 0, 0]])),
        sparse.csr_array(np.diag([1.0, 2.0, 0.7])),
    ),
    "a mass without a spring that others take along": (
        sparse.csr_array(np.array([[2e6, -1e6, 0], [-1e6, 1e6, 0], [0, 0, 0]])),
        sparse.csr_array(np.array([[1.0, 0, 0], [0, 2, 0.1], [0, 0.1, 1]])),
    ),
}


@pytest.mark.parametrize(("stiffness", "mass"), NOT_HELD.values(), ids=NOT_HELD)
def test_rows_of_a_structure_are_not_held(stiffness, mass):
    assert not find_held_rows(mass, stiffness).any.any()


WITHOUT_SPRING = np.array([[2e6, -1e6, 0, 0], [-1e6, 1e6, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]])


def test_masses_that_differ_are_said_to_be_held_by_nothing():
    dofs = [frf_ipz.Dof(node, "z") for node in range(1, 5)]
    for last, why in (
        (1.0, "a mass of 1 .*DOFs are held, or held by"),
        (3.0, "masses of 1 to 3 .*are held by"),
    ):
        mass = np.diag([1.0, 2.0, 1.0, last])
        made = frf_ipz.StructuralModel.from_matrices(mass, WITHOUT_SPRING, dofs=dofs)
        assert made.dofs == tuple(dofs[:2])
        assert re.search(rf"zero in the stiffness, with {why} nothing, and left out", made.notes[0])


def test_a_damper_alone_may_join_a_mass_to_the_structure():
    dofs = [frf_ipz.Dof(node, "z") for node in range(1, 5)]
    joined = np.zeros((4, 4))
    joined[np.ix_([1, 2], [1, 2])] = [[5.0, -5.0], [-5.0, 5.0]]
    mass = np.diag([1.0, 2.0, 1.0, 1.0])
    made = frf_ipz.StructuralModel.from_matrices(mass, WITHOUT_SPRING, damping=joined, dofs=dofs)
    assert made.dofs == tuple(dofs[:3])


TWO_OF_EACH = np.diag([0, 0, 3.7e6, 3.7e6, 5.1e4, 5.1e4]), np.diag([1.0, 2.0, 8e-3, 8e-3, 2e-3, 2e-3])


def test_rows_that_are_held_with_the_diagonals_they_had_are_left_out_where_several_are_alike():
    stiffness, mass = TWO_OF_EACH
    stiffness[:2, :2] = [[2e6, -1e6], [-1e6, 1e6]]
    dofs = [frf_ipz.Dof(node, name) for node in (1, 2, 3) for name in ("z", "ry")]
    made = frf_ipz.StructuralModel.from_matrices(mass, stiffness, dofs=dofs, units="mm-t-s")
    assert made.dofs == tuple(dofs[:2])
    frequencies = ", ".join(f"{np.sqrt(stiffness[row, row] / mass[row, row]) / 2 / np.pi:.5g}" for row in (4, 2))
    assert f"4 rows are alone in mass and stiffness, several at each of {frequencies} Hz" in made.notes[0]
    assert "held, or joined to nothing, and left out" in made.notes[0]


def test_one_row_alone_stays_and_is_said():
    """A mass on a spring of its own cannot be told from a held DOF; its frequency is 1000 times as high per ms."""
    stiffness = np.array([[2e6, -1e6, 0], [-1e6, 1e6, 0], [0, 0, 4e4]])
    dofs = [frf_ipz.Dof(node, "z") for node in (1, 2, 3)]
    for units, hz in (("SI", 100.66), ("mm-kg-ms", "1.0066e+05")):
        made = frf_ipz.StructuralModel.from_matrices(np.diag([1.0, 2.0, 0.1]), stiffness, dofs=dofs, units=units)
        assert made.dofs == tuple(dofs)
        assert f"1 row is alone in mass and stiffness (3:z): kept, with a mode of its own at {hz} Hz" in made.notes[0]


def test_a_damper_joins_rows_of_one_frequency_to_the_structure():
    stiffness = np.diag([0.0, 0.0, 4e4, 4e4])
    stiffness[:2, :2] = [[2e6, -1e6], [-1e6, 1e6]]
    joined = np.zeros((4, 4))
    joined[np.ix_([1, 2], [1, 2])] = joined[np.ix_([0, 3], [0, 3])] = [[5.0, -5.0], [-5.0, 5.0]]
    mass = np.diag([1.0, 2.0, 0.1, 0.1])
    dofs = [frf_ipz.Dof(node, "z") for node in range(1, 5)]
    assert frf_ipz.StructuralModel.from_matrices(mass, stiffness, damping=joined, dofs=dofs).dofs == tuple(dofs)


def test_rows_are_taken_as_they_are_where_the_user_says_so(tmp_path):
    path = export(tmp_path, beam(left="clamped", elements=8))
    _, stiffness, mass, expected_hz = cantilever_with_held_rows(both(1.0, 1.0))
    free = beam(left="free", elements=8)
    export(tmp_path, free)
    for name, matrix in (("K.mtx", stiffness), ("M.mtx", mass)):
        io.mmwrite(tmp_path / name, sparse.coo_array(matrix), symmetry="symmetric", precision=17)
    held = read_model(path)
    assert_allclose(solve_modes(held).natural_frequency_hz, expected_hz, rtol=1e-9)
    assert held.geometry.supports == {1: "clamped"}
    path.write_text(path.read_text("utf-8").replace("[matrices]", '[matrices]\nheld = "keep"'), "utf-8")
    kept = read_model(path)
    assert kept.dofs == free.dofs
    lowest = solve_modes(kept, n_modes=4).natural_frequency_hz
    assert_allclose(lowest, [1 / (2 * np.pi), 1 / (2 * np.pi), *expected_hz[:2]], rtol=1e-6)


def test_a_penalty_that_is_kept_leaves_the_modes_right():
    """Eigenvalues are compared with the diagonal of their own rows, not with 1e36."""
    model, stiffness, mass, expected_hz = cantilever_with_held_rows(penalty(1e36))
    made = frf_ipz.StructuralModel.from_matrices(mass, stiffness, dofs=model.dofs, held="keep")
    assert made.dofs == model.dofs
    assert_allclose(solve_modes(made, n_modes=5).natural_frequency_hz, expected_hz[:5], rtol=1e-6)
