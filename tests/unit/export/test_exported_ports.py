"""What a control engineer asks for: chosen ports, several quantities, delays, decoupled axes, the model built again."""

import control
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import expm

import frf_ipz
from chains import updated
from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.export.options import ExportOptions
from frf_ipz.export.realization import Matrices
from frf_ipz.export.reduced_model_file import read_updated_model, write_reduced_model
from frf_ipz.export.sampling import discretise_with_delays
from frf_ipz.export.state_space import make_state_space, to_control
from frf_ipz.fe.reduction.reduce import reduce_to_dofs
from frf_ipz.frf import FrfLabel
from measured_labels import measured

EXACT = 1e-8  # of the largest FRF: the same numbers along two ways
BAND_HZ = (10.0, 400.0)
S = 2j * np.pi * np.geomspace(5.0, 300.0, 40)
STEP_S = 1e-4
ACTUATORS, SENSORS = ("1:+z", "11:+z", "force pair"), ("1:+z", "11:+z", "tilt")


@pytest.fixture(scope="module")
def free_beam():
    beam = frf_ipz.make_beam(
        length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
        modal_ratio=0.01,
    )  # fmt: skip
    return beam.with_ports(
        [
            frf_ipz.Port("tilt", {"8:z": 5.0, "4:z": -5.0}, "rad"),
            frf_ipz.Port("mean", {"8:z": 0.5, "4:z": 0.5}),
            frf_ipz.Port("force pair", {"9:z": 1.0, "5:z": -1.0}),
        ]
    )


@pytest.fixture(scope="module")
def reduced(free_beam):
    dofs = [[frf_ipz.FrfLabel(name, name, "receptance").output_dof for name in names] for names in (SENSORS, ACTUATORS)]
    return reduce_to_dofs(free_beam, sensors=dofs[0], actuators=dofs[1], points=[], band_hz=BAND_HZ)


def exported(reduced, **options):
    labels = tuple(FrfLabel(output, force, "receptance") for output in SENSORS for force in ACTUATORS)
    return make_state_space(measured(labels), updated(reduced), options=ExportOptions(**options))


def responses(reduced, outputs, inputs, quantity="receptance"):
    labels = [FrfLabel(output, force, quantity) for output in outputs for force in inputs]
    return frf_ipz.compute_frfs(reduced, labels, S).T.reshape(len(outputs), len(inputs), len(S))


def assert_same(first, second, exactness=EXACT):
    scale = np.abs(second).max(axis=-1, keepdims=True)
    assert_allclose(first / scale, second / scale, rtol=0, atol=exactness)


def test_every_quantity_of_every_chosen_port(reduced):
    """Ports that were never measured may be named: the model knows them."""
    space = exported(reduced, ports=("-mean", "tilt"), inputs=("force pair",), outputs=("displacement", "velocity"))
    assert space.output_names == ("-mean displacement", "-mean velocity", "tilt displacement", "tilt velocity")
    assert space.output_units == ("m", "m/s", "rad", "rad/s")
    assert (space.input_names, space.input_units) == (("force pair",), ("N",))
    by_position = responses(reduced, ("-mean", "tilt"), ("force pair",))
    values = to_control(space)(S)
    assert_same(values[::2], by_position)
    assert_same(values[1::2], by_position * S)


def test_the_states_of_a_mode_are_driven_as_much_as_their_velocity_is_seen(reduced):
    space = exported(reduced, outputs="velocity")
    modes = len(space.A) // 2
    driven = np.linalg.norm(space.B.reshape(modes, -1), axis=1)
    seen = np.linalg.norm(space.C.reshape(len(space.C), modes, 2), axis=(0, 2))
    assert_allclose(driven, seen, rtol=1e-12)
    elastic = space.A[4:, 4:]
    rates = np.diag(elastic, 1)[::2]
    assert_allclose(-np.diag(elastic, -1)[::2], rates, rtol=1e-9)  # a rotation each: entries of one size


def held_response(system, inputs, delay, time):
    """Outputs at a time in samples of 1 ms, to inputs that are held and act late, integrated piece by piece."""
    augmented = np.block([[system.A, system.B], [np.zeros((1, len(system.A) + 1))]])
    states, place = np.zeros(len(system.A)), 0.0
    while place < time - 1e-9:
        index = int(np.floor(place - delay + 1e-9))
        until = min(time, index + 1 + delay)
        piece = expm(augmented * (until - place) * 1e-3)
        states = piece[:-1, :-1] @ states + piece[:-1, -1] * (inputs[index] if index >= 0 else 0.0)
        place = until
    arrived = int(np.floor(time - delay + 1e-9))
    return system.C @ states + system.D[:, 0] * (inputs[arrived] if arrived >= 0 else 0.0)


@pytest.mark.parametrize("late", [(0.0, 0.0), (2.0, 0.7), (1.3, 0.0)])
@pytest.mark.parametrize("delay", [0.0, 1.0, 3.0, 0.4, 2.7])
def test_delays_are_exact_where_the_model_is_sampled(delay, late):
    A = np.array([[0.0, 700.0, 0.0, 0.0], [-700.0, -14.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0]])
    system = Matrices(A, np.array([[0.0], [2.0], [0.0], [1.0]]), np.eye(4)[::2], np.array([[0.0], [0.3]]))
    sampled, n_before = discretise_with_delays(system, 1e-3, delay * 1e-3, [1e-3 * value for value in late])
    assert n_before.tolist() == [int(np.ceil(value)) for value in late]
    inputs = np.random.default_rng(4).normal(size=8)
    states = np.zeros(len(sampled.A))
    for sample in range(8):
        expected = [held_response(system, inputs, delay, sample - value)[row] for row, value in enumerate(late)]
        assert_allclose(sampled.C @ states + sampled.D[:, 0] * inputs[sample], expected, rtol=0, atol=1e-9)
        states = sampled.A @ states + sampled.B[:, 0] * inputs[sample]


@pytest.mark.parametrize("delay_s", [2e-4, 2.5e-4])
def test_the_delay_of_the_loop_turns_the_phase(reduced, delay_s):
    s = S[:25]
    plain = to_control(exported(reduced, sample_time_s=STEP_S))
    delayed = exported(reduced, sample_time_s=STEP_S, delay_s=delay_s)
    assert len(set(delayed.state_names)) == len(delayed.A)
    ratio = to_control(delayed)(np.exp(s * STEP_S)) / plain(np.exp(s * STEP_S))
    whole = delay_s == 2e-4
    assert_allclose(ratio, np.broadcast_to(np.exp(-s * delay_s), ratio.shape), rtol=1e-6 if whole else 0.05)
    continuous = exported(reduced, delay_s=delay_s, pade_order=3)
    assert len(set(continuous.state_names)) == len(continuous.A)
    ratio = to_control(continuous)(s) / to_control(exported(reduced))(s)
    assert_allclose(ratio, np.broadcast_to(np.exp(-s * delay_s), ratio.shape), rtol=1e-6)
    assert_array_equal(continuous.A[1:4:2, :4], 0.0)  # the rigid-body modes stay double integrators


def test_rigid_body_modes_are_decoupled(reduced):
    space = exported(reduced, outputs="displacement")
    for axes in ((), ("tilt", "1:+z")):
        decoupling = frf_ipz.decouple_rigid_body(space, axes=axes)
        low = 2j * np.pi * 1e-3
        plant = decoupling.apply(space)(low) * low**2
        assert_allclose(plant, np.eye(2), rtol=0, atol=1e-6)
    assert decoupling.axes == ("tilt", "1:+z")
    sampled = exported(reduced, outputs="displacement", sample_time_s=STEP_S)
    inputs = frf_ipz.decouple_rigid_body(sampled, axes=axes).inputs
    assert_allclose(inputs, decoupling.inputs, rtol=1e-9, atol=1e-15)  # one of them is 0
    late = exported(reduced, outputs="displacement", delay_s=3e-4, sample_time_s=STEP_S)
    assert decoupling.apply(late).noutputs == 2


@pytest.mark.parametrize(
    ("options", "axes", "message"),
    [
        ({"outputs": "acceleration"}, (), "no output is a displacement"),
        ({"outputs": "displacement"}, ("tilt",), "1 axes are named, and there are 2"),
        ({"outputs": "displacement"}, ("tilt", "tilt"), "the axes see 1 of 2"),
        ({"outputs": "displacement"}, ("tilt", "titl"), "did you mean 'tilt'"),
        ({"outputs": "displacement", "delay_s": 1e-4, "sample_time_s": 1e-4}, (), "a delay at its inputs"),
    ],
)
def test_what_cannot_be_decoupled_is_refused(reduced, options, axes, message):
    with pytest.raises(InputError, match=message):
        frf_ipz.decouple_rigid_body(exported(reduced, **options), axes=axes)


@pytest.mark.parametrize(
    ("inputs", "outputs", "message"), [(1, 2, "the inputs move 1 of 2"), (2, 1, "the displacement outputs see 1 of 2")]
)
def test_too_few_actuators_or_sensors_are_refused(inputs, outputs, message):
    A = np.zeros((4, 4))
    A[0, 1] = A[2, 3] = 1.0
    space = frf_ipz.StateSpaceModel(
        A=A,
        B=np.array([[0.0], [1.0], [0.0], [1.0]])[:, [0] * inputs],
        C=np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])[:outputs],
        D=np.zeros((outputs, inputs)),
        dt=0.0,
        input_names=("a", "b")[:inputs],
        output_names=("c", "d")[:outputs],
        state_names=tuple(f"rigid-body mode {k} {what}" for k in (1, 2) for what in ("displacement", "velocity")),
        input_units=("N",) * inputs,
        output_units=("m",) * outputs,
    )
    if inputs == 2:
        space.B[1] = [1.0, 0.0]
    with pytest.raises(InputError, match=message):
        frf_ipz.decouple_rigid_body(space)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"outputs": ("displacement", "displacement")}, "outputs names 'displacement' twice"),
        ({"outputs": ()}, "outputs is empty"),
        ({"outputs": ("displacement", "measured")}, "displacement"),
        ({"ports": ("tilt", "tilt")}, "ports names 'tilt' twice"),
        ({"delay_s": 1e-4}, "needs pade_order"),
        ({"delay_s": -1e-4, "pade_order": 2}, "delay_s"),
        ({"ports": ("tlit",)}, r"\[export\] ports names 'tlit'.*did you mean 'tilt'"),
        ({"inputs": ("3:x",)}, r"\[export\] inputs names '3:\+x'"),
        ({"outputs": ("displacement", "velocity"), "residual": "feedthrough"}, "needs outputs = 'displacement'"),
    ],
)
def test_options_that_do_not_fit_are_refused(reduced, options, message):
    with pytest.raises(InputError, match=message):
        exported(reduced, **options)


def test_the_file_of_the_model_gives_the_state_space_again(reduced, tmp_path):
    path = tmp_path / "updated_model.npz"
    dofs = [label.output_dof for label in measured([FrfLabel("11:+z", "1:+z", "receptance")]).labels]
    write_reduced_model(reduced, path, dofs=dofs)
    again = read_updated_model(path)
    assert_array_equal(again.rigid, reduced.rigid)
    system = frf_ipz.rebuild_state_space(path, inputs=["force pair"], outputs=["mean", "-tilt"])
    space = exported(reduced, inputs=("force pair",), ports=("mean", "-tilt"), outputs="displacement")
    assert isinstance(system, control.StateSpace)
    assert_array_equal(system.A, space.A)
    assert_array_equal(system.C, space.C)
    assert_same(system(S), responses(reduced, ("mean", "-tilt"), ("force pair",)))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"inputs": [], "outputs": ["tilt"]}, "inputs is empty"),
        ({"inputs": ["1:z"], "outputs": ["lift"]}, "outputs names 'lift'"),
        ({"inputs": ["1:z"], "outputs": ["tilt"], "options": ExportOptions()}, "as they were measured"),
        ({"inputs": "1:z", "outputs": ["tilt"]}, "is no list of DOFs"),
    ],
)
def test_what_the_file_does_not_know_is_refused(reduced, tmp_path, arguments, message):
    path = tmp_path / "updated_model.npz"
    write_reduced_model(reduced, path)
    with pytest.raises(InputError, match=message):
        frf_ipz.rebuild_state_space(path, **arguments)


def test_a_file_of_an_earlier_version_or_another_program_is_refused(tmp_path):
    path = tmp_path / "updated_model.npz"
    np.savez(path, M=np.eye(2), B=np.eye(2), K=np.eye(2), dofs=np.array(["1:z", "2:z"]))
    with pytest.raises(FileFormatError, match="holds no updated model as this version writes it"):
        read_updated_model(path)
    path.write_bytes(b"no archive")
    with pytest.raises(FileFormatError, match="holds no updated model"):
        read_updated_model(path)
