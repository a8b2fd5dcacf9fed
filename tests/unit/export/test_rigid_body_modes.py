"""Rigid-body modes leave the export as exact double integrators; states that no port drives or sees are left out."""

from dataclasses import replace

import control
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import frf_ipz
from chains import updated
from frf_ipz.dofs import Dof
from frf_ipz.export.options import ExportOptions
from frf_ipz.export.state_space import make_state_space, make_state_space_ensemble, to_control
from frf_ipz.export.state_space_files import read_state_space_arrays, write_ensemble, write_state_space
from frf_ipz.fe.reduction.reduce import reduce_to_dofs
from frf_ipz.fe.response import compute_frfs
from frf_ipz.frf import FrfLabel
from frf_ipz.quantities import FrfQuantity
from measured_labels import measured

MASSES_KG = np.array([1.0, 2.0, 0.7])
SPRINGS_N_M = 1.3e6, 0.9e6
BAND_HZ = (10.0, 400.0)


def three_masses(**options):
    """Three free masses in a row."""
    first, second = SPRINGS_N_M
    stiffness = np.array([[first, -first, 0], [-first, first + second, -second], [0, -second, second]])
    return frf_ipz.StructuralModel.from_matrices(
        np.diag(MASSES_KG), stiffness, dofs=["1:x", "2:x", "3:x"], modal_damping=0.01, **options
    )


def beam(**options):
    given = {"length_m": 0.5, "width_m": 0.02, "thickness_m": 0.005, "youngs_modulus_Pa": 70e9, "density_kg_m3": 2700}
    return frf_ipz.make_beam(**given | {"elements": 20, "modal_ratio": 0.01} | options)


def exported(model, sensors, actuators, **options):
    dofs = [[frf_ipz.parse_dof(text) for text in texts] for texts in (sensors, actuators)]
    reduced = reduce_to_dofs(model, sensors=dofs[0], actuators=dofs[1], points=[], band_hz=BAND_HZ)
    labels = tuple(FrfLabel(out, force, FrfQuantity.RECEPTANCE) for out in dofs[0] for force in dofs[1])
    return reduced, make_state_space(measured(labels), updated(reduced), options=ExportOptions(**options))


def require_double_integrators(space, count):
    for mode in range(count):
        rows = space.A[2 * mode : 2 * mode + 2]
        assert np.count_nonzero(rows) == 1
        assert rows[0, 2 * mode + 1] > 0
        assert not space.A[:, 2 * mode].any()
    assert space.state_names[: 2 * count : 2] == tuple(f"rigid-body mode {k + 1} displacement" for k in range(count))


def test_three_free_masses_have_two_poles_at_zero():
    _, space = exported(three_masses(), ["3:x"], ["1:x"])
    require_double_integrators(space, 1)
    system = to_control(space)
    poles = system.poles()
    assert np.count_nonzero(poles == 0) == 2
    assert (poles[poles != 0].real < 0).all()
    assert np.isinf(np.abs(system.dcgain()))
    low = 2j * np.pi * np.array([1e-7, 1e-5, 1e-3, 1e-1])
    assert_allclose(low**2 * system(low) * MASSES_KG.sum(), 1.0, rtol=1e-5)
    assert "poles at 0 exactly" in space.notes[0]


def test_a_loop_around_it_is_as_stable_as_the_analytic_one():
    """A lead controller holds the masses: closed-loop poles are those of the quotient of polynomials."""
    _, space = exported(three_masses(), ["2:x"], ["2:x"])
    crossover = 2 * np.pi * 20
    lead = 3.7 * crossover**2 / 3 * control.tf([3 / crossover, 1], [1 / (3 * crossover), 1])
    loop = to_control(space) * control.ss(lead)
    assert (loop.poles().real <= 0).all()
    closed = control.feedback(loop, 1)
    assert (closed.poles().real < 0).all()
    assert abs(closed.dcgain() - 1.0) < 1e-6  # a type-two loop leaves no error


MODELS = {
    "free beam": (beam(), ["21:z", "3:z"], ["1:z", "11:z"], 2),
    "free beam, one sensor": (beam(), ["21:z"], ["1:z"], 1),
    "beam on a hinge": (beam(left="pinned"), ["21:z"], ["11:z"], 1),
    "sliding beam": (beam(left="sliding"), ["21:z"], ["11:z"], 1),
    "held beam": (beam(left="clamped"), ["21:z"], ["11:z"], 0),
    "three masses": (three_masses(), ["1:x", "3:x"], ["2:x"], 1),
}
OPTIONS = (
    {},
    {"outputs": "displacement"},
    {"outputs": "velocity"},
    {"outputs": "acceleration"},
    {"outputs": "displacement", "residual": "feedthrough"},
)


@pytest.mark.parametrize("options", OPTIONS, ids=str)
@pytest.mark.parametrize(("model", "sensors", "actuators", "count"), MODELS.values(), ids=MODELS)
def test_the_export_has_the_frfs_of_the_model(model, sensors, actuators, count, options):
    reduced, space = exported(model, sensors, actuators, **options)
    require_double_integrators(space, count)
    quantity = {"velocity": FrfQuantity.MOBILITY, "acceleration": FrfQuantity.ACCELERANCE}.get(
        options.get("outputs"), FrfQuantity.RECEPTANCE
    )
    s = 2j * np.pi * np.linspace(2.0, 200.0, 50)
    for row, sensor in enumerate(sensors):
        for column, force in enumerate(actuators):
            label = FrfLabel(frf_ipz.parse_dof(sensor), frf_ipz.parse_dof(force), quantity)
            expected = compute_frfs(reduced, [label], s)[:, 0]
            values = to_control(space)(s).reshape(len(sensors), len(actuators), -1)[row, column]
            scale = np.abs(expected).max()
            limit = 1e-3 if "residual" in options else 1e-9  # what the flexibility without inertia leaves out
            assert np.abs(values - expected).max() < limit * scale


def test_a_sampled_double_integrator_is_exact():
    _, space = exported(three_masses(), ["3:x"], ["1:x"], sample_time_s=1e-4)
    rate = space.A[0, 1]
    assert_array_equal(space.A[:2, :2], [[1.0, rate], [0.0, 1.0]])
    assert not space.A[:2, 2:].any()
    assert not space.A[2:, :2].any()
    _, continuous = exported(three_masses(), ["3:x"], ["1:x"])
    assert_allclose(space.B[:2, 0], [rate * continuous.B[1, 0] * 1e-4 / 2, continuous.B[1, 0] * 1e-4], rtol=1e-12)
    poles = np.linalg.eigvals(space.A)
    assert np.count_nonzero(poles == 1) == 2
    assert (np.abs(poles[poles != 1]) < 1).all()


def test_a_delay_leaves_it_exact():
    model = three_masses()
    dof = frf_ipz.parse_dof("1:x")
    reduced = reduce_to_dofs(model, sensors=[dof], actuators=[dof], points=[], band_hz=BAND_HZ)
    labels = measured((FrfLabel(dof, dof, FrfQuantity.RECEPTANCE, output_channel="x"),))
    for sample_time_s in (0.0, 1e-4):
        options = ExportOptions(pade_order=2, sample_time_s=sample_time_s)
        space = make_state_space(labels, updated(reduced), options=options, delays_s={"x": 3e-4})
        assert space.state_names[-1] == ("output 1:+x, 3 samples before" if sample_time_s else "delay of 1:+x 2")
        pole = 1.0 if sample_time_s else 0.0
        assert np.count_nonzero(np.linalg.eigvals(space.A) == pole) == 2


def test_balanced_truncation_of_the_rest_keeps_the_elastic_modes():
    """Without slycot: the stable part is truncated by itself, which poles at 0 exactly allow to tell from the rest."""
    _, space = exported(beam(), ["21:z", "3:z"], ["1:z", "11:z"])
    system = to_control(space)
    rigid = 2 * sum(name.startswith("rigid-body") and name.endswith("displacement") for name in space.state_names)
    assert np.count_nonzero(system.poles() == 0) == rigid == 4
    stable = control.ss(space.A[rigid:, rigid:], space.B[rigid:], space.C[:, rigid:], space.D)
    assert (stable.poles().real < 0).all()
    gramians = [
        control.lyap(matrix, load @ load.T) for matrix, load in ((stable.A, stable.B), (stable.A.T, stable.C.T))
    ]
    hankel = np.sqrt(np.sort(np.linalg.eigvals(gramians[0] @ gramians[1]).real)[::-1])
    assert hankel[0] < 1e-2  # m/N: of the elastic modes; a pole of 1e-5 rad/s has one beyond 1e3


@pytest.mark.parametrize("order", [8, 12])
def test_balred_keeps_rigid_body_modes_and_reduces_the_rest(order):
    pytest.importorskip("slycot")
    _, space = exported(beam(), ["21:z", "3:z"], ["1:z", "11:z"])
    system = to_control(space)
    reduced = control.balred(system, order)
    assert reduced.nstates == order
    assert np.count_nonzero(np.abs(reduced.poles()) < 1e-6) == 4
    s = 2j * np.pi * np.linspace(30.0, 500.0, 200)
    assert np.linalg.norm(reduced(s) - system(s)) < 0.1 * np.linalg.norm(system(s))


def test_what_no_port_drives_or_sees_is_left_out():
    """Two free chains that nothing joins: ports on one of them."""
    first, second = SPRINGS_N_M
    chain = np.array([[first, -first, 0], [-first, first + second, -second], [0, -second, second]])
    none = np.zeros((3, 3))
    model = frf_ipz.StructuralModel.from_matrices(
        np.diag([*MASSES_KG, *MASSES_KG]),
        np.block([[chain, none], [none, 2 * chain]]),
        dofs=["1:x", "2:x", "3:x", "1:y", "2:y", "3:y"],
        modal_damping=0.01,
    )
    _, space = exported(model, ["3:x"], ["1:x"])
    _, alone = exported(three_masses(), ["3:x"], ["1:x"])
    require_double_integrators(space, 1)
    assert space.A.shape == alone.A.shape
    assert "1 rigid-body mode" in space.notes[1]
    s = 2j * np.pi * np.linspace(1.0, 300.0, 40)
    assert_allclose(to_control(space)(s), to_control(alone)(s), rtol=1e-8)


def test_a_mode_with_a_node_at_the_sensor_is_left_out():
    """The middle of a symmetric beam does not move in modes that are not symmetric."""
    _, space = exported(beam(), ["11:z"], ["1:z"])
    _, whole = exported(beam(), ["1:z"], ["1:z"])
    assert len(space.A) < len(whole.A)
    assert any("left out" in note for note in space.notes)


def test_a_grounded_spring_or_damper_makes_a_mode_of_it_again():
    reduced, _ = exported(three_masses(), ["3:x"], ["1:x"])
    labels = measured((FrfLabel(Dof(3, "x"), Dof(1, "x"), FrfQuantity.RECEPTANCE),))
    ground = np.outer(reduced.row(Dof(1, "x")), reduced.row(Dof(1, "x")))
    sprung = make_state_space(labels, updated(replace(reduced, stiffness=reduced.stiffness + 30.0 * ground)))
    damped = make_state_space(labels, updated(replace(reduced, damping=reduced.damping + 3.0 * ground)))
    lowest = np.abs(np.linalg.eigvals(sprung.A)).min()
    assert_allclose(lowest, np.sqrt(30.0 / MASSES_KG.sum()), rtol=1e-3)
    slow = np.sort(np.abs(np.linalg.eigvals(damped.A)))[:2]
    assert slow[0] < 1e-6
    assert_allclose(slow[1], 3.0 / MASSES_KG.sum(), rtol=1e-3)


def test_members_of_the_posterior_have_the_same_states(tmp_path):
    reduced, _ = exported(beam(), ["21:z"], ["1:z"])
    labels = measured((FrfLabel(Dof(21, "z"), Dof(1, "z"), FrfQuantity.RECEPTANCE),))
    members = [(reduced.mass, reduced.damping, share * reduced.stiffness) for share in (0.9, 1.0, 1.1)]
    spaces = make_state_space_ensemble(labels, updated(reduced, members), options=ExportOptions(ensemble=3))
    for space in spaces:
        require_double_integrators(space, 1)
        assert space.state_names == spaces[0].state_names
    write_ensemble(spaces, tmp_path / "members.mat")


@pytest.mark.parametrize("suffix", [".json", ".mat"])
def test_files_keep_zeros_and_notes(tmp_path, suffix):
    _, space = exported(three_masses(), ["3:x"], ["1:x"])
    write_state_space(space, tmp_path / f"statespace{suffix}")
    back = read_state_space_arrays(tmp_path / f"statespace{suffix}")
    assert_array_equal(back.A, space.A)
    assert back.notes == space.notes


@pytest.mark.parametrize("parameters", ["parts", "generic"])
@pytest.mark.parametrize("method", ["minimal-change", "ipz"])
def test_an_update_leaves_it_exact(method, parameters):
    machine, model = beam(youngs_modulus_Pa=66e9), beam()
    lines_hz = np.arange(20.0, 400.0, 0.5)
    dofs = [Dof(1, "z"), Dof(21, "z")]
    labels = [FrfLabel(dof, dofs[0], FrfQuantity.ACCELERANCE) for dof in dofs]
    values = compute_frfs(machine, labels, 2j * np.pi * lines_hz)[:, :, None]
    noise = 1e-3 * np.abs(values).mean()
    draw = np.random.default_rng(0).normal(size=(*values.shape, 2)).view(complex)[..., 0]
    frfs = frf_ipz.FrfSet.from_arrays(
        lines_hz,
        values + noise * draw / 2**0.5,
        outputs=dofs,
        inputs=dofs[:1],
        variance=np.full(values.shape, noise**2),
    )
    fit = frf_ipz.fit_modes(frfs)
    reduced = frf_ipz.reduce_model(fit, model)
    options = frf_ipz.UpdateOptions(method=method)
    update = frf_ipz.update_model(
        fit, reduced, options=options, fe_model=model if parameters == "parts" and method != "ipz" else None
    )
    assert len(update.after)
    space = make_state_space(fit, update)
    require_double_integrators(space, 2 if len(space.A) > 2 and space.state_names[2].startswith("rigid") else 1)
    assert np.count_nonzero(np.linalg.eigvals(space.A) == 0) in (2, 4)
