"""Structural models: which DOFs are free, and which errors are said."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fe_models import beam
from frf_ipz.dofs import Dof
from frf_ipz.errors import InputError, ShapeError
from frf_ipz.runs.codec import load_result, save_result
from frf_ipz.structure import ReducedModel


def reduced(**changes):
    parts = {
        "mass": np.eye(2),
        "damping": np.zeros((2, 2)),
        "stiffness": np.eye(2),
        "dofs": (Dof(1, "z"), Dof(2, "z")),
        "expansion": np.array([[1.0, 0.0], [0.0, 1.0], [0.25, 0.75]]),
        "expanded_dofs": (Dof(1, "z"), Dof(2, "z"), Dof(7, "z")),
        "n_modes": 2,
    }
    return ReducedModel(**{**parts, **changes})


def test_held_dofs_stay_in_the_matrices_of_all_dofs():
    model = beam(elements=3, left="clamped", right="pinned")
    assert len(model.all_dofs) == 8
    assert model.dofs == tuple(dof for dof in model.all_dofs if dof.node in {2, 3} or dof == Dof(4, "ry"))
    assert model.mass.shape == model.stiffness.shape == model.damping.shape == (5, 5)
    assert_allclose(model.stiffness.toarray(), model.stiffness_all.toarray()[np.ix_([2, 3, 4, 5, 7], [2, 3, 4, 5, 7])])


def test_full_indices_count_all_dofs_and_indices_the_free_ones():
    model = beam(elements=3, left="clamped", right="pinned")
    assert model.full_index(Dof(4, "ry", -1)) == 7
    assert model.index(Dof(4, "ry", -1)) == 4
    assert model.full_index(Dof(1, "z")) == 0


@pytest.mark.parametrize(
    ("dof", "fragments"),
    [
        (Dof(9, "z"), ["no node 9", "1 to 4"]),
        (Dof(2, "x"), ["node 2", "no DOF 'x'", "z, ry"]),
        (Dof(1, "z"), ["1:z is held", "use another DOF"]),
    ],
)
def test_a_dof_that_cannot_move_is_refused(dof, fragments):
    with pytest.raises(InputError) as caught:
        beam(elements=3, left="clamped").index(dof)
    assert all(fragment in str(caught.value) for fragment in fragments)


def test_a_geometry_is_kept_exactly(tmp_path):
    geometry = beam(elements=5, left="clamped", right="pinned", modal_ratio=0.01).geometry
    save_result(geometry, tmp_path / "model.result")
    kept = load_result(tmp_path / "model.result")
    assert kept.supports == {1: "clamped", 6: "pinned"}
    assert kept.coordinates_m.tobytes() == geometry.coordinates_m.tobytes()


def test_sizes_must_agree():
    model = beam(elements=3)
    with pytest.raises(InputError, match="mass_all is"):
        replace(model, mass_all=model.mass_all[:4][:, :4])
    with pytest.raises(ShapeError, match="held DOFs"):
        replace(model, fixed=np.zeros(3, bool))
    with pytest.raises(InputError, match="twice"):
        replace(model, all_dofs=(*model.all_dofs[:-1], model.all_dofs[0]))


def test_a_row_of_a_reduced_model_has_the_sign_of_the_sensor():
    assert_allclose(reduced().row(Dof(7, "z", -1)), [-0.25, -0.75])
    with pytest.raises(InputError, match=r"does not know the DOF 8:z; add it to \[predict\] points"):
        reduced().row(Dof(8, "z"))


def test_a_reduced_model_of_wrong_sizes_is_refused():
    with pytest.raises(ShapeError, match="stiffness"):
        reduced(stiffness=np.eye(3))
    with pytest.raises(ShapeError, match="expansion"):
        reduced(expansion=np.eye(2))
