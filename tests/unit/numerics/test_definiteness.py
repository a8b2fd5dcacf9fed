"""Whether large matrices are those of a structure, from few products and from one factor."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import sparse

from brick_plate import plate_matrices
from frf_ipz.dofs import Dof
from frf_ipz.errors import IllConditionedError, InputError
from frf_ipz.fe.eigen import solve_basis
from frf_ipz.numerics import definiteness
from frf_ipz.structure import StructuralModel


@pytest.fixture(scope="module")
def plate():
    return plate_matrices((14, 10, 2), (0.14, 0.1, 0.02))


@pytest.fixture
def factored(monkeypatch):
    """Orders of the matrices that are factored."""
    orders, real = [], definiteness.is_positive_definite
    monkeypatch.setattr(
        definiteness, "is_positive_definite", lambda matrix, nodes: orders.append(1) or real(matrix, nodes)
    )
    return orders


def model_of(stiffness, mass, corners):
    dofs = [Dof(node + 1, axis) for node in range(len(corners)) for axis in "xyz"]
    assert len(dofs) > definiteness.DENSE_ORDER
    return StructuralModel.from_matrices(
        mass, stiffness, dofs=dofs, coordinates={node + 1: place for node, place in enumerate(corners)}
    )


def test_the_mass_of_finite_elements_needs_no_factor(plate, factored):
    model_of(*plate)
    assert len(factored) == 1, "that of the stiffness"


def test_a_negative_mass_deep_inside_is_seen(plate):
    stiffness, mass, corners = plate
    lowered = mass.tolil()
    lowered[700, 703] = lowered[703, 700] = -1.2 * mass[700, 700]
    with pytest.raises(InputError, match="a negative mass"):
        model_of(stiffness, sparse.csr_array(lowered), corners)


def test_motions_without_mass_are_left_to_factors(plate, factored):
    stiffness, mass, corners = plate
    pair = mass.tolil()
    for row in (30, 33):
        pair[row, :] = 0
        pair[:, row] = 0
    pair[30, 30] = pair[33, 33] = pair[30, 33] = pair[33, 30] = 1e-3  # the two moving against each other have none
    model_of(stiffness, sparse.csr_array(pair), corners)
    assert len(factored) > 1


def test_a_very_large_stiffness_is_judged_by_the_factors_of_its_modes(plate, monkeypatch):
    stiffness, mass, corners = plate
    monkeypatch.setattr(definiteness, "FACTORED_ORDER", 1000)
    monkeypatch.setattr(definiteness, "is_positive_definite", None)  # is not called
    bad = stiffness.tolil()
    bad[5, 5] = -bad[5, 5]
    model = model_of(sparse.csr_array(bad), mass, corners)
    with pytest.raises(IllConditionedError, match="stiffness matrix of the model 'model' is indefinite"):
        solve_basis(model, n_modes=4)


MASS, STIFFNESS, DOFS = np.eye(2), np.array([[3e5, -1e5], [-1e5, 2e5]]), ["1:x", "1:y"]


@pytest.mark.parametrize("gyroscopic", [40.0, 0.5])  # more and less than what is symmetric
def test_the_advice_on_a_gyroscopic_matrix_works(gyroscopic):
    damping = 1e-5 * STIFFNESS + gyroscopic * np.array([[0.0, -1.0], [1.0, 0.0]])
    with pytest.raises(InputError, match="gyroscopic") as refusal:
        StructuralModel.from_matrices(MASS, STIFFNESS, dofs=DOFS, damping=damping)
    assert str(refusal.value).endswith("hand in the mean of this matrix and its transpose")
    model = StructuralModel.from_matrices(MASS, STIFFNESS, dofs=DOFS, damping=np.mean([damping, damping.T], axis=0))
    assert_allclose(model.damping.toarray(), 1e-5 * STIFFNESS, rtol=1e-12)


def test_half_a_matrix_is_not_taken_for_gyroscopic():
    with pytest.raises(InputError, match="both triangles") as refusal:
        StructuralModel.from_matrices(MASS, np.triu(STIFFNESS), dofs=DOFS)
    assert "gyroscopic" not in str(refusal.value)


@pytest.mark.parametrize(
    ("wrong", "words", "else_gyroscopic"),
    [
        ({(0, 1): 0.0}, "of 1 pair of entries one is missing, and all others agree; export it again", False),
        ({(0, 1): 0.0, (2, 1): 0.0}, "of 2 pairs of entries one is missing", False),
        ({(0, 1): -4e5, (1, 2): -2e5}, "above the diagonal 2 entries are 2 times those below; export it again", False),
        ({(0, 1): -2.1e5}, "no other pair of entries differs, so that one number may be wrong", True),
        ({(0, 1): -2.1e5, (1, 2): -1.3e5}, "its triangles differ: a skew-symmetric part", True),
    ],
)
def test_a_lost_or_doubled_entry_is_no_gyroscopic_force(wrong, words, else_gyroscopic):
    stiffness = np.array([[3e5, -2e5, 0.0], [-2e5, 4e5, -1e5], [0.0, -1e5, 2e5]])
    for place, value in wrong.items():
        stiffness[place] = value
    with pytest.raises(InputError, match=re.escape(words)) as refusal:
        StructuralModel.from_matrices(np.eye(3), stiffness, dofs=["1:x", "1:y", "1:z"])
    assert ("gyroscopic" in str(refusal.value)) == else_gyroscopic
