"""A structure that is the same in two directions: measuring one couples it to the other nowhere."""

import numpy as np
import pytest

import frf_ipz
from frf_ipz.dofs import Dof
from frf_ipz.export.realization import SecondOrder, select_states
from frf_ipz.export.state_space import make_state_space
from frf_ipz.fe.reduction.reduce import reduce_to_dofs
from frf_ipz.numerics.pencils import modes_of_stack
from frf_ipz.pairing.pair import pair_roots
from frf_ipz.updating.scale import _amplitudes
from frf_ipz.updating.update import update_model
from frf_testbench.updating.synthetic_fit import TrueModes, list_labels, simulate_fit

N_MASSES = 6
BAND_HZ = (5.0, 170.0)
UNTOUCHED = 1e-10  # of the largest stiffness: rounding is 1e-14, and what mixed modes of one frequency leave 1e-8
SENSORS, STRUCK = (Dof(6, "x"), Dof(3, "x")), (Dof(6, "x"),)


def rows_of_masses(axes, factor=1.0):
    """Masses in a row on springs that are the factor as stiff, which move along each axis alike."""
    springs = 1e5 * factor * np.linspace(1.0, 2.0, N_MASSES)
    row = np.diag(springs) + np.diag(np.append(springs[1:], 0.0))
    row -= np.diag(springs[1:], 1) + np.diag(springs[1:], -1)
    matrices = [np.kron(matrix, np.eye(len(axes))) for matrix in (0.5 * np.eye(N_MASSES), row)]
    dofs = [f"{node}:{axis}" for node in range(1, N_MASSES + 1) for axis in axes]
    return frf_ipz.StructuralModel.from_matrices(*matrices, dofs=dofs, modal_damping=0.01)


@pytest.fixture(scope="module")
def updated():
    """Of springs that are 4 % too soft, by two sensors along x."""
    truth = TrueModes(rows_of_masses("x", 1.04), np.full(N_MASSES, 0.01))
    fit = simulate_fit(truth, list_labels(STRUCK, SENSORS), BAND_HZ, noise=1e-4, rng=np.random.default_rng(0))
    reduced = reduce_to_dofs(
        rows_of_masses("xy"), sensors=SENSORS, actuators=STRUCK, points=[Dof(4, "x")], band_hz=BAND_HZ
    )
    return fit, update_model(fit, reduced, pairs=pair_roots(fit, reduced))


def test_directions_stay_apart(updated):
    model = updated[1].model
    change = model.stiffness - updated[1].nominal.stiffness
    is_x = np.array([dof.direction == "x" for dof in model.dofs])
    assert is_x.any()
    assert not is_x.all()
    assert np.abs(change[is_x][:, is_x]).max() > 0.01 * np.abs(model.stiffness).max()
    assert np.abs(change[is_x][:, ~is_x]).max() < UNTOUCHED * np.abs(model.stiffness).max()


def test_what_no_port_moves_is_not_exported(updated):
    fit, result = updated
    space = make_state_space(fit, result, points=[Dof(4, "x")])
    assert len(space.A) == 2 * sum(dof.direction == "x" for dof in result.model.dofs)
    assert "no output sees it" in space.notes[-1]


def coupled(*pairs, inputs=(1.0, 0.0, 0.0, 0.0), outputs=(1.0, 0.0, 0.0, 0.0)):
    """Four modes, those of each pair coupled by damping."""
    damping = np.diag(np.ones(4))
    for first, second in pairs:
        damping[first, second] = damping[second, first] = 0.1
    return SecondOrder(
        damping=damping,
        stiffness=np.diag([1.0, 2.0, 3.0, 4.0]) * 1e4,
        inputs=np.array(inputs)[:, None],
        outputs=np.array(outputs)[None],
        flexibility=np.zeros((1, 1)),
    )


@pytest.mark.parametrize(
    ("system", "kept"),
    [
        (coupled((2, 3)), [0]),  # coupled to each other only
        (coupled((0, 1), (1, 2)), [0, 1, 2]),  # in turn
        (coupled((0, 1), outputs=(0.0, 1.0, 0.0, 0.0)), [0, 1]),  # one driven, the other seen
        (coupled(inputs=(1.0, 1e-6, 1e-3, 0.0), outputs=(1.0, 1e-6, 1e-3, 1.0)), [0, 2]),
    ],
)
def test_modes_are_kept_that_are_driven_and_seen_together(system, kept):
    assert np.flatnonzero(select_states(system).elastic).tolist() == kept


def test_amplitudes_are_those_of_modes_that_the_sensors_see():
    """To rounding each frequency is that of a mode along x and of one along y, which is in no FRF."""
    reduced = reduce_to_dofs(
        rows_of_masses("xy"), sensors=SENSORS, actuators=STRUCK, points=[Dof(4, "x")], band_hz=BAND_HZ
    )
    omega = np.sqrt(modes_of_stack(reduced.mass, reduced.stiffness)[0][::2])
    no_members = np.zeros((0, 3, *reduced.mass.shape))
    amplitudes, _ = _amplitudes(tuple(list_labels(STRUCK, SENSORS)), reduced, omega, no_members)
    assert np.abs(amplitudes).max(axis=1).min() > 1e-4
