"""FRFs come from products of shapes, without the modal motions; these are solved for when they are asked for."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from diagnosed import beam, labels, lumped, measured, problem_of
from frf_ipz.diagnosis.evidence.hypothesis import Component, make_hypothesis
from frf_ipz.diagnosis.model import basis as bases
from frf_ipz.diagnosis.model.response import ModalStiffness, nuisance_jacobian

DIGITS = 1e-9


@pytest.fixture(scope="module", params=["beam", "dashpot"])
def problem(request, tmp_path_factory):
    """A beam whose modes a damping ratio leaves uncoupled, and a frame with a dashpot, which couples them."""
    folder = tmp_path_factory.mktemp(request.param)
    if request.param == "beam":
        model, names, band_hz = beam(folder), labels(), (10.0, 700.0)
    else:
        model = lumped(folder, damping="modal_ratio = 0.0", dashpot_Ns_m=40.0)
        names, band_hz = labels(("2:+x", "3:-x"), ("1:+x",)), (10.0, 700.0)
    return problem_of(model, measured(model, names, band_hz=band_hz), ("attached_resonator", "time_delay"))


def hypothesis_of(problem, name):
    effect = problem.effects[name]
    location = effect.locations(problem.context)[0]
    hypothesis = problem.make_hypothesis((Component(effect=effect, location=location, n_locations=1),))
    return hypothesis, effect.start_values(problem.context, location)[0]


def respond(problem, name):
    hypothesis, values = hypothesis_of(problem, name)
    nuisance = 0.3 * np.random.default_rng(2).standard_normal(problem.nuisance_prior.size)
    return hypothesis.respond(values, nuisance, problem.data.measured.s), hypothesis.nuisance_prior.unpack(nuisance)


@pytest.mark.parametrize("name", ["attached_resonator", "time_delay"])
def test_frfs_are_those_of_the_motions(problem, name):
    response, nuisance = respond(problem, name)
    layout = problem.context.layout
    receptance = (response.outputs @ response.input_motion)[:, layout.output_index, layout.input_index]
    expected = (receptance + nuisance.local) * response.chain
    assert_allclose(response.values, expected, rtol=0, atol=DIGITS * np.abs(expected).max())
    by_reciprocity = np.swapaxes(response.inputs @ response.output_motion, 1, 2)
    expected = response.outputs @ response.input_motion
    assert_allclose(by_reciprocity, expected, rtol=0, atol=DIGITS * np.abs(expected).max())


def test_what_damping_couples_is_solved_for_once_whatever_is_attached(problem, monkeypatch):
    respond(problem, "attached_resonator")  # the hypothesis is known from here on
    solved, receptances = [], ModalStiffness.receptances

    def count(stiffness, motions, loads):
        solved.append(len(loads))
        return receptances(stiffness, motions, loads)

    monkeypatch.setattr(ModalStiffness, "receptances", count)
    response, _ = respond(problem, "attached_resonator")
    assert solved == [len(response.inputs) + len(response.attached)]


def test_receptances_at_some_points_are_those_of_all(problem):
    response, _ = respond(problem, "attached_resonator")
    points = np.array([3, 7, 20])
    some = response.receptances_at(points)
    assert_allclose(some.values, (response.values / response.chain)[points], rtol=DIGITS)
    assert_allclose(some.input_motion, response.input_motion[points], rtol=DIGITS)


def test_frfs_of_uncoupled_modes_need_no_motions(problem, monkeypatch):
    hypothesis, values = hypothesis_of(problem, "attached_resonator")
    nothing = np.zeros(problem.nuisance_prior.size)
    response = hypothesis.respond(values, nothing, problem.data.measured.s)
    if response.stiffness.coupling is not None:
        pytest.skip("modes that are coupled have to be solved for")
    monkeypatch.setattr(ModalStiffness, "move", lambda *_: pytest.fail("solved for motions"))
    hypothesis.respond(values, nothing, problem.data.measured.s)


def test_modes_of_the_nominal_structure_are_solved_for_once(problem, monkeypatch):
    """A delay, and what is attached, leave mass and stiffness as they are."""
    solved = []
    solve_modes = bases.solve_modes
    monkeypatch.setattr(bases, "solve_modes", lambda *args: solved.append(args) or solve_modes(*args))
    hypothesis, values = hypothesis_of(replace(problem), "time_delay")
    for factor in range(1, 8):
        hypothesis.modes(factor * values, np.zeros(problem.nuisance_prior.size))
    assert len(solved) == 1


def test_damping_that_is_not_proportional_couples_modes(problem):
    """What the nuisance couples two modes by is a damping matrix between them, beyond first order too."""
    s, n_modes = problem.data.measured.s, problem.nuisance_prior.n_modes
    std = 0.1 * (1 - np.eye(n_modes))
    prior = replace(problem.nuisance_prior, coupling_std=std)
    hypothesis, drawn = make_hypothesis(problem.context, prior, ()), np.random.default_rng(5)
    nuisance = 0.5 * drawn.standard_normal(prior.size)
    nuisance[prior.blocks.coupling] = 4.0 * drawn.standard_normal(n_modes * (n_modes - 1) // 2)
    response = hypothesis.respond(np.zeros(0), nuisance, s)
    jacobian = nuisance_jacobian(response, prior, problem.context.layout)
    for index in (prior.blocks.coupling.start, prior.blocks.coupling.stop - 1):
        step = 1e-4 * (np.arange(prior.size) == index)
        ahead, behind = (hypothesis.respond(np.zeros(0), nuisance + sign * step, s).values for sign in (1, -1))
        change = (ahead - behind) / 2e-4
        assert_allclose(jacobian[:, :, index], change, rtol=0, atol=1e-5 * np.abs(change).max())
    uncoupled = nuisance.copy()
    uncoupled[prior.blocks.coupling] = 0.0
    if problem.context.basis.model.modal_damping.any():
        assert not np.allclose(hypothesis.respond(np.zeros(0), uncoupled, s).values, response.values, rtol=1e-4, atol=0)


@pytest.mark.parametrize(("ratio", "couples"), [(0.02, True), (1e-4, False)])
def test_damping_couples_modes_that_are_not_far_apart_for_their_bandwidths(tmp_path, ratio, couples):
    model = replace(beam(tmp_path), modal_damping=np.array([ratio]))
    prior = problem_of(model, measured(model, labels()), ()).nuisance_prior
    assert prior.is_coupled.any() == couples
    assert not np.diag(prior.coupling_std).any()
