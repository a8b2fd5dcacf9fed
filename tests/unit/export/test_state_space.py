"""The exported state space has the FRFs of the model it was made from, and files keep it to the last bit."""

import json
from dataclasses import replace

import control
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.io import loadmat

import frf_ipz
from chains import chain, label, updated
from frf_ipz.dofs import Dof
from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.export.options import ExportOptions
from frf_ipz.export.reduced_model_file import REDUCED_MODEL, write_reduced_model
from frf_ipz.export.state_space import make_state_space, make_state_space_ensemble, to_control
from frf_ipz.export.state_space_files import (
    read_state_space,
    read_state_space_arrays,
    write_state_space,
)
from frf_ipz.fe.response import compute_frfs
from frf_ipz.frf import FrfLabel
from frf_ipz.quantities import FrfQuantity, frf_quantity_of
from measured_labels import measured

SAME = 1e-10  # of the largest value: both sides solve the same equations
S = 2j * np.pi * np.linspace(1.0, 120.0, 60)
LABELS = (
    label(2, 1, FrfQuantity.ACCELERANCE, output_channel="acc", input_channel="hammer"),
    label(-4, 1, FrfQuantity.ACCELERANCE, output_channel="acc_b", input_channel="hammer"),
    label(2, -3, FrfQuantity.ACCELERANCE, output_channel="acc", input_channel="hammer"),
)
POINT = Dof(99, "x")


def expected_frfs(model, space, quantities):
    """FRFs of the matrices themselves, in the order of python-control: output, input, line."""
    inputs = (Dof(1, "x"), Dof(3, "x", -1))
    outputs = (Dof(2, "x"), Dof(4, "x", -1), POINT)
    assert space.input_names == tuple(str(dof) for dof in inputs)
    assert space.output_names == tuple(str(dof) for dof in outputs)
    ends = [FrfLabel(o, i, q) for o, q in zip(outputs, quantities, strict=True) for i in inputs]
    return compute_frfs(model, ends, S).T.reshape(len(outputs), len(inputs), -1)


def unsymmetric(model):
    rng = np.random.default_rng(1)
    return replace(model, stiffness=model.stiffness + 300.0 * rng.standard_normal(model.stiffness.shape))


MODELS = {
    "chain": chain(between=True),
    "free": chain(free=True, between=True),
    "unsymmetric": unsymmetric(chain(between=True)),
    "heavily damped": chain(damping=1.0, between=True),
}


@pytest.mark.parametrize("outputs", ["measured", "displacement", "velocity", "acceleration"])
@pytest.mark.parametrize("name", MODELS)
def test_the_state_space_has_the_frfs_of_the_matrices(name, outputs):
    model = MODELS[name]
    space = make_state_space(measured(LABELS), updated(model), points=(POINT,), options=ExportOptions(outputs=outputs))
    quantity = FrfQuantity.ACCELERANCE if outputs == "measured" else frf_quantity_of(outputs)
    expected = expected_frfs(model, space, [quantity] * 3)
    assert np.abs(to_control(space)(S) - expected).max() < SAME * np.abs(expected).max()
    unit = {"displacement": "m", "velocity": "m/s"}.get(outputs, "m/s^2")
    assert space.output_units == (unit,) * 3
    assert space.input_units == ("N", "N")


def test_every_sensor_keeps_its_own_quantity():
    mixed = (LABELS[0], replace(LABELS[1], quantity=FrfQuantity.RECEPTANCE), LABELS[2])
    space = make_state_space(measured(mixed), updated(MODELS["chain"]), points=(POINT,))
    quantities = [FrfQuantity.ACCELERANCE, FrfQuantity.RECEPTANCE, FrfQuantity.ACCELERANCE]
    assert space.output_units == ("m/s^2", "m", "m/s^2")
    expected = expected_frfs(MODELS["chain"], space, quantities)
    assert np.abs(to_control(space)(S) / expected - 1).max() < 1e-8


def test_a_sensor_at_a_point_of_interest_is_one_output():
    space = make_state_space(measured(LABELS), updated(MODELS["chain"]), points=(Dof(2, "x"), POINT))
    assert space.output_names == ("2:+x", "4:-x", "99:+x")


def test_states_are_modes_of_one_size():
    space = make_state_space(measured(LABELS), updated(MODELS["chain"]), points=())
    omega = np.sqrt(np.linalg.eigvals(np.linalg.solve(MODELS["chain"].mass, MODELS["chain"].stiffness)).real)
    assert_allclose(np.diag(space.A[::2, 1::2]), np.sort(omega), rtol=1e-9)
    assert_allclose(np.diag(space.A[1::2, ::2]), -np.sort(omega), rtol=1e-9)
    assert space.state_names[:3] == ("mode 1 displacement", "mode 1 velocity", "mode 2 displacement")


def test_a_rigid_body_mode_is_scaled_by_a_rate_that_is_not_zero():
    stiff = chain(3, free=True)
    exact = replace(stiff, mass=np.eye(3), damping=np.zeros((3, 3)), stiffness=np.diag([0.0, 1e4, 4e4]))
    for model in (exact, stiff):
        space = make_state_space(measured((label(1, 1), label(2, 1))), updated(model), points=())
        assert np.isfinite(space.A).all()
        assert space.A[0, 1] >= 1e-7 * np.abs(space.A).max()


def test_residual_flexibility_as_feedthrough_keeps_the_static_frf_and_drops_its_states():
    model = replace(chain(between=True), n_modes=3)
    options = ExportOptions(outputs="displacement", residual="feedthrough")
    space = make_state_space(measured(LABELS), updated(model), points=(POINT,), options=options)
    whole = make_state_space(
        measured(LABELS), updated(model), points=(POINT,), options=replace(options, residual="dynamics")
    )
    assert (len(space.A), len(whole.A)) == (6, 10)
    assert np.abs(space.D).max() > 0
    assert not whole.D.any()
    static, low = np.array([1e-6j]), S[:20]
    assert_allclose(to_control(space)(static), to_control(whole)(static), rtol=1e-8)
    expected = to_control(whole)(low)
    assert np.abs(to_control(space)(low) - expected).max() < 0.02 * np.abs(expected).max()


def test_the_feedthrough_of_a_stiffness_that_is_not_symmetric_keeps_the_static_frf():
    model = replace(MODELS["unsymmetric"], n_modes=3)
    options = ExportOptions(outputs="displacement", residual="feedthrough")
    space = make_state_space(measured(LABELS), updated(model), points=(POINT,), options=options)
    whole = make_state_space(
        measured(LABELS), updated(model), points=(POINT,), options=replace(options, residual="dynamics")
    )
    assert_allclose(to_control(space)(1e-6j), to_control(whole)(1e-6j), rtol=1e-8)


def test_a_feedthrough_of_accelerations_is_refused_with_the_way_out():
    model = replace(chain(between=True), n_modes=3)
    with pytest.raises(InputError, match="residual = 'dynamics'"):
        make_state_space(measured(LABELS), updated(model), points=(), options=ExportOptions(residual="feedthrough"))


@pytest.mark.parametrize("order", [1, 2, 3, 5])
def test_a_delay_is_a_pade_approximant_of_the_late_channel_alone(order):
    delay = 4e-4
    plain = make_state_space(measured(LABELS), updated(MODELS["chain"]), points=(POINT,), options=ExportOptions())
    options = ExportOptions(pade_order=order)
    late = make_state_space(
        measured(LABELS), updated(MODELS["chain"]), points=(POINT,), options=options, delays_s={"acc_b": delay}
    )
    above, below = control.pade(delay, order)
    factor = np.polyval(above, S) / np.polyval(below, S)
    ratio = to_control(late)(S) / to_control(plain)(S)
    assert_allclose(ratio[1], np.broadcast_to(factor, ratio[1].shape), rtol=1e-8)
    assert_allclose(ratio[[0, 2]], np.ones_like(ratio[[0, 2]]), rtol=1e-8)
    assert late.state_names[-1] == f"delay of 4:-x {order}"


def test_delays_are_omitted_by_default():
    space = make_state_space(
        measured(LABELS), updated(MODELS["chain"]), points=(), options=ExportOptions(), delays_s={"acc": 1e-3}
    )
    assert len(space.A) == 10


def test_a_delay_of_an_unknown_channel_is_refused_with_the_closest_one():
    with pytest.raises(InputError, match="did you mean 'acc_b'"):
        make_state_space(measured(LABELS), updated(MODELS["chain"]), points=(), delays_s={"acc_c": 1e-3})
    with pytest.raises(InputError, match="negative"):
        make_state_space(measured(LABELS), updated(MODELS["chain"]), points=(), delays_s={"acc": -1e-3})


@pytest.mark.parametrize("name", ["chain", "free"])
def test_a_sampled_model_steps_as_the_continuous_one_does(name):
    time = np.arange(200) * 1e-3
    force = np.random.default_rng(0).standard_normal((2, 200))
    space = make_state_space(
        measured(LABELS), updated(MODELS[name]), points=(POINT,), options=ExportOptions(sample_time_s=1e-3)
    )
    assert space.dt == 1e-3
    steps = control.forced_response(to_control(space), time, force).outputs
    fine = np.arange(20 * 200 - 19) * 5e-5
    whole = to_control(make_state_space(measured(LABELS), updated(MODELS[name]), points=(POINT,)))
    held = control.sample_system(whole, 5e-5, method="zoh")
    expected = control.forced_response(held, fine, np.repeat(force, 20, axis=1)[:, : len(fine)]).outputs[:, ::20]
    assert np.abs(steps - expected).max() < 1e-8 * np.abs(expected).max()


def test_the_ensemble_has_the_members_matrices():
    model = MODELS["chain"]
    members = [(model.mass, model.damping, factor * model.stiffness) for factor in (1.0, 1.1, 1.2)]
    spaces = make_state_space_ensemble(
        measured(LABELS), updated(model, members), points=(POINT,), options=ExportOptions(ensemble=2)
    )
    assert len(spaces) == 2
    stiffer = replace(model, stiffness=1.1 * model.stiffness)
    expected = expected_frfs(stiffer, spaces[1], [FrfQuantity.ACCELERANCE] * 3)
    assert np.abs(to_control(spaces[1])(S) - expected).max() < SAME * np.abs(expected).max()
    assert (
        make_state_space_ensemble(measured(LABELS), updated(model), points=(POINT,), options=ExportOptions(ensemble=2))
        == ()
    )


@pytest.mark.parametrize("suffix", [".json", ".mat"])
@pytest.mark.parametrize("sample_time_s", [0.0, 1 / 3000])
def test_files_lose_nothing(tmp_path, suffix, sample_time_s):
    options = ExportOptions(sample_time_s=sample_time_s)
    space = make_state_space(measured(LABELS), updated(MODELS["chain"]), points=(POINT,), options=options)
    path = tmp_path / f"statespace{suffix}"
    write_state_space(space, path)
    back = read_state_space_arrays(path)
    for name in ("A", "B", "C", "D"):
        assert np.array_equal(getattr(back, name), getattr(space, name))
    for name in ("dt", "input_names", "output_names", "state_names", "input_units", "output_units"):
        assert getattr(back, name) == getattr(space, name)
    loaded = read_state_space(path)
    assert loaded.input_labels == ["1:+x", "3:-x"]
    assert loaded.output_labels == ["2:+x", "4:-x", "99:+x"]
    assert loaded.state_labels == list(space.state_names)
    assert np.array_equal(loaded.A, space.A)
    assert loaded.dt == sample_time_s


def test_one_input_one_output_survives_matlab(tmp_path):
    space = make_state_space(measured(LABELS[:1]), updated(MODELS["chain"]), points=())
    write_state_space(space, tmp_path / "statespace.mat")
    back = read_state_space_arrays(tmp_path / "statespace.mat")
    assert (back.input_names, back.output_names, back.D.shape) == (("1:+x",), ("2:+x",), (1, 1))


def test_the_files_hold_what_the_contract_says(tmp_path):
    keys = {"A", "B", "C", "D", "dt", "input_names", "output_names", "state_names", "input_units", "output_units"}
    keys |= {"notes"}
    space = make_state_space(measured(LABELS), updated(MODELS["chain"]), points=(POINT,))
    for suffix in (".json", ".mat"):
        write_state_space(space, tmp_path / f"statespace{suffix}")
    assert set(json.loads((tmp_path / "statespace.json").read_text(encoding="utf-8"))) == keys
    values = loadmat(tmp_path / "statespace.mat")
    assert keys <= set(values)
    assert values["output_names"].dtype == object  # a cell array in MATLAB


def test_other_endings_and_other_files_are_refused(tmp_path):
    space = make_state_space(measured(LABELS), updated(MODELS["chain"]), points=())
    with pytest.raises(InputError, match=r"\.json or \.mat"):
        write_state_space(space, tmp_path / "statespace.csv")
    (tmp_path / "other.json").write_text('{"A": [[1.0]]}', encoding="utf-8")
    (tmp_path / "other.mat").write_text("{}", encoding="utf-8")
    for name in ("other.json", "other.mat"):
        with pytest.raises(FileFormatError, match=r"no state space written by frf_ipz|a MATLAB file of version"):
            read_state_space_arrays(tmp_path / name)


def test_the_reduced_model_is_written_with_its_dofs(tmp_path):
    model = MODELS["chain"]
    write_reduced_model(model, tmp_path / "updated_model.npz")
    with np.load(tmp_path / "updated_model.npz") as values:
        assert set(values) == set(REDUCED_MODEL)
        assert np.array_equal(values["K"], model.stiffness)
        assert np.array_equal(values["B"], model.damping)
        assert values["dofs"].tolist() == ["1:x", "2:x", "3:x", "4:x", "5:x"]


def test_a_state_space_needs_a_measurement():
    with pytest.raises(InputError, match="at least one measured FRF"):
        make_state_space(measured(()), updated(MODELS["chain"]), points=())


@pytest.mark.parametrize("suffix", [".json", ".mat"])
def test_what_python_control_holds_is_written_and_read(tmp_path, suffix):
    options = ExportOptions(sample_time_s=1 / 3000)
    space = make_state_space(measured(LABELS), updated(MODELS["chain"]), points=(POINT,), options=options)
    path = str(tmp_path / f"statespace{suffix}")
    frf_ipz.write_state_space(to_control(space), path)
    back = frf_ipz.read_state_space(path)
    assert np.array_equal(back.A, space.A)
    assert (back.dt, back.input_labels) == (space.dt, list(space.input_names))
    assert (back.output_labels, back.state_labels) == (list(space.output_names), list(space.state_names))


def test_exports_in_several_quantities_have_the_same_states():
    measured_model, updated_model = measured(LABELS), updated(MODELS["chain"])
    spaces = [
        make_state_space(measured_model, updated_model, points=(), options=ExportOptions(outputs=outputs))
        for outputs in ("measured", "velocity", ["displacement", "acceleration"])
    ]
    for space in spaces[1:]:
        assert_array_equal(space.A, spaces[0].A)
        assert_allclose(space.B, spaces[0].B, rtol=1e-12)
