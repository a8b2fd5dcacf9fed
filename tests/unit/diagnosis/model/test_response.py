"""FRFs come from products of shapes, without the modal motions; these are solved for when they are asked for."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from diagnosed import beam, labels, lumped, measured, problem_of
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.model import basis as bases
from frf_ipz.diagnosis.model.response import ModalStiffness

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
