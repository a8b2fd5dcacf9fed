"""`minimal-change` on the data of sections 4 and 5 of [Dorosti2018] (doi:10.1016/j.conengprac.2017.11.002)."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from frf_ipz.prediction.agreement import shift_to_measured_poles
from frf_ipz.updating.options import UpdateOptions
from frf_ipz.updating.parameters import make_structural_basis
from frf_ipz.updating.update import update_model
from frf_ipz.updating.updated_model import UpdateStatus
from frf_testbench.updating.paper_cases import build_section_4, build_section_5
from frf_testbench.updating.paper_comparison import compare_section_4, judge_model

MOST_ITERATIONS = 5
IMAGINARY = 1e-5  # of the imaginary part: the bar for poles and zeros
REAL = 2e-3  # of the real part: only the damping of poles and of seven zeros is there to be met
ALIKE = 0.999  # X_S and X_A at the point of interest
WITHIN_DB = 0.5  # median at the point of interest, 40 to 3900 rad/s
PRINTED = 1e-4  # of the targets of table 5, which have three digits and contradict each other a little


@pytest.fixture(scope="module", params=["any stiffness", "elements"])
def update(request):
    case = build_section_4()
    basis = make_structural_basis(case.full_model, case.reduced_model) if request.param == "elements" else None
    return case, update_model(case.fit, case.reduced_model, pairs=case.pairs, options=UpdateOptions(), basis=basis)


def test_it_converges_in_five_iterations(update):
    _, updated = update
    assert updated.status is UpdateStatus.CONVERGED
    assert len(updated.history) <= MOST_ITERATIONS
    assert not updated.unmet


def test_it_meets_all_poles_and_zeros(update):
    case, updated = update
    assert np.abs(updated.after - case.targets).max() > 0
    assert np.all(np.abs(updated.after.imag - case.targets.imag) < IMAGINARY * case.targets.imag)
    assert np.all(np.abs(updated.after - case.targets) < IMAGINARY * case.targets.imag)
    assert_allclose(updated.after.real, case.targets.real, rtol=REAL)


def test_the_matrices_stay_those_of_a_structure(update):
    _, updated = update
    for matrix in (updated.model.mass, updated.model.damping, updated.model.stiffness):
        assert np.array_equal(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix)[0] > 0


def test_the_point_of_interest_is_right(update):
    case, updated = update
    row = judge_model(case, updated.model, updated)
    assert row["X_S"] >= ALIKE
    assert row["X_A"] >= ALIKE
    assert row["dB"] <= WITHIN_DB


@pytest.mark.slow
def test_it_beats_the_trivial_answer_in_db_and_zeros_and_so_does_the_table():
    rows = compare_section_4()
    ours, trivial = rows.loc["minimal-change, elements"], rows.loc["measured poles, nominal shapes"]
    assert trivial["X_S"] > ALIKE  # why X_S says nothing of shapes
    assert ours["dB"] < trivial["dB"] / 3
    assert ours["zeros_%"] < trivial["zeros_%"] / 2
    assert 1.1 < trivial["dB"] < 1.3  # known beforehand: 1.2
    assert 6.1 < rows.loc["nominal"]["dB"] < 6.3  # known beforehand: 6.2


def test_the_trivial_answer_has_the_measured_poles():
    case = build_section_4()
    trivial = shift_to_measured_poles(case.pairs, case.reduced_model)
    values = np.linalg.eigvals(np.linalg.solve(trivial.mass, trivial.stiffness)).real
    assert_allclose(np.sqrt(np.sort(values)[:4]), np.abs(case.targets[:4]), rtol=1e-9)


@pytest.mark.parametrize("excited", ["88:z", "89:z"])
def test_it_meets_the_targets_of_section_5(excited):
    case = build_section_5(excited)
    updated = update_model(case.fit, case.reduced_model, pairs=case.pairs, options=UpdateOptions())
    assert updated.status is UpdateStatus.CONVERGED
    assert_allclose(updated.after.imag, case.targets.imag, rtol=PRINTED)
