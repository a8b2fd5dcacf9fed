"""Files for robust design keep every member and every weight to the last bit."""

from dataclasses import fields

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.io import loadmat

from chains import chain, label, updated
from frf_ipz.dofs import Dof
from frf_ipz.errors import InputError
from frf_ipz.export.options import ExportOptions
from frf_ipz.export.state_space import make_state_space_ensemble, to_control
from frf_ipz.export.state_space_files import (
    read_ensemble,
    read_ensemble_arrays,
    read_uncertainty_weights,
    write_ensemble,
    write_uncertainty_weights,
)
from frf_ipz.export.uncertainty import estimate_uncertainty_weights
from measured_labels import measured

POINT = Dof(99, "x")


def members_of(count, labels, points=()):
    model = chain(between=True)
    spread = [(model.mass, model.damping, (1 + 0.01 * number) * model.stiffness) for number in range(count)]
    whole = updated(model, spread)
    return whole, make_state_space_ensemble(
        measured(labels), whole, points=points, options=ExportOptions(ensemble=count, sample_time_s=1e-3)
    )


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("labels", [(label(2, 1),), (label(2, 1), label(-4, 1), label(2, -3))])
def test_an_ensemble_loses_nothing(tmp_path, count, labels):
    _, members = members_of(count, labels)
    write_ensemble(members, tmp_path / "e.mat")
    for restored, member in zip(read_ensemble_arrays(tmp_path / "e.mat"), members, strict=True):
        for field in fields(member):
            assert_array_equal(getattr(restored, field.name), getattr(member, field.name))
    s = 2j * np.pi * np.array([3.0, 40.0])
    for restored, member in zip(read_ensemble(tmp_path / "e.mat"), members, strict=True):
        assert_array_equal(restored(s), to_control(member)(s))


def test_matlab_takes_members_as_its_model_arrays(tmp_path):
    _, members = members_of(3, (label(2, 1), label(4, 1)))
    write_ensemble(members, tmp_path / "e.mat")
    assert_array_equal(loadmat(tmp_path / "e.mat")["C"][:, :, 2], members[2].C)


def test_no_members_are_refused_with_the_way_out(tmp_path):
    with pytest.raises(InputError, match="ensemble = 200"):
        write_ensemble((), tmp_path / "e.mat")
    assert not (tmp_path / "e.mat").exists()


def test_weights_lose_nothing(tmp_path):
    whole, _ = members_of(5, (label(2, 1),))
    weights = estimate_uncertainty_weights(
        measured((label(2, 1),)), whole, points=(POINT,), frequency_hz=np.geomspace(1.0, 100.0, 40)
    )
    write_uncertainty_weights(weights, tmp_path / "w.json")
    restored = read_uncertainty_weights(tmp_path / "w.json")
    for field in fields(weights):
        assert_array_equal(getattr(restored, field.name), getattr(weights, field.name))


@pytest.mark.parametrize(("read", "name"), [(read_ensemble_arrays, "e.mat"), (read_uncertainty_weights, "w.json")])
def test_other_files_are_refused(tmp_path, read, name):
    (tmp_path / name).write_text("{}")
    with pytest.raises(InputError, match=name):
        read(tmp_path / name)
