"""Steps from a component to its neighbours and imitators, alone and in pairs."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosed import beam, measured, problem_of
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.search import component_search as searching
from frf_ipz.diagnosis.search import neighbourhood_search as climb
from frf_ipz.diagnosis.search import pair_search as pairs
from frf_ipz.diagnosis.search.component_search import Ranking, fit_null_model, search_component
from frf_ipz.diagnosis.search.robust_refinement import Start

pytestmark = pytest.mark.slow

KINDS = ("attached_resonator", "local_damper", "grounded_spring", "coupling_spring", "viscoelastic_joint")
SEEN = 0.05  # relative


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    return beam(tmp_path_factory.mktemp("beam"))


def component_at(problem, name, *nodes):
    effect = problem.effects[name]
    locations = effect.locations(problem.context)
    location = next(location for location in locations if location.nodes == tuple(nodes))
    return Component(effect=effect, location=location, n_locations=len(locations))


def joint_at_end(problem):
    joint = problem.effects["viscoelastic_joint"]
    (location,) = (location for location in joint.locations(problem.context) if location.end)
    return Component(effect=joint, location=location, n_locations=16)


def problem_with(nominal, names, components, values):
    """The problem of a beam with some components."""
    blank = problem_of(nominal, measured(nominal), tuple({*names, *(name for name, *_ in components)}))
    return problem_doing(
        nominal, names, blank, tuple(component_at(blank, *component) for component in components), values
    )


def problem_doing(nominal, names, blank, components, values):
    hypothesis = blank.make_hypothesis(components)
    values, nuisance = np.array(values), np.zeros(blank.nuisance_prior.size)

    def chain(frequency_hz):
        s = 2j * np.pi * frequency_hz
        alone = blank.make_hypothesis(()).respond(np.zeros(0), nuisance, s).values
        return hypothesis.respond(values, nuisance, s).values / alone

    return problem_of(nominal, measured(nominal, factors=chain), names)


def likeliest(fits):
    return max(fits, key=lambda fit: fit.log_evidence)


def climbed(problem, base, fit):
    fits = {fit.hypothesis.components[-1].key: fit}
    climb.search_neighbourhoods(problem, base, fits)
    return likeliest(fits.values())


@pytest.mark.parametrize(("times", "is_settled"), [(3.0, True), (30.0, False)])
def test_a_neighbour_whose_fit_was_stopped_early_is_continued(nominal, times, is_settled):
    problem = problem_with(nominal, ("local_damper",), [("local_damper", 12)], [20.0])
    base = fit_null_model(problem)
    neighbour = problem.fit_to_convergence(problem.fit((component_at(problem, "local_damper", 11),), np.array([20.0])))
    true = problem.fit((component_at(problem, "local_damper", 12),), np.array([20.0]))
    assert true.log_evidence > neighbour.log_evidence
    on_its_way = replace(
        true, has_converged=False, misfit=2 * times * neighbour.cost, log_evidence=neighbour.log_evidence - 100
    )
    fits = {fit.hypothesis.components[-1].key: fit for fit in (neighbour, on_its_way)}
    climb._search_neighbourhood(problem, base, neighbour, fits, lambda _: True)
    assert fits[true.hypothesis.components[-1].key].has_converged == is_settled
    assert (likeliest(fits.values()).hypothesis.components[-1].location == {"nodes": [12]}) == is_settled


def test_a_neighbour_that_cannot_be_continued_is_fitted_anew_from_the_best(nominal, monkeypatch):
    problem = problem_with(nominal, ("local_damper",), [("local_damper", 12)], [20.0])
    neighbour = problem.fit_to_convergence(problem.fit((component_at(problem, "local_damper", 11),), np.array([20.0])))
    true = problem.fit((component_at(problem, "local_damper", 12),), np.array([20.0]))
    stuck = replace(true, has_converged=False, misfit=2 * neighbour.cost, log_evidence=neighbour.log_evidence - 100)
    monkeypatch.setattr(type(problem), "fit_to_convergence", lambda _bench, fit: fit)
    fits = {fit.hypothesis.components[-1].key: fit for fit in (neighbour, stuck)}
    climb._search_neighbourhood(problem, fit_null_model(problem), neighbour, fits, lambda _: True)
    assert likeliest(fits.values()).hypothesis.components[-1].location == {"nodes": [12]}
    assert likeliest(fits.values()).cost == pytest.approx(true.cost, rel=SEEN)


def test_a_neighbour_that_began_at_the_best_does_not_begin_there_again(nominal, monkeypatch):
    problem = problem_with(nominal, ("local_damper",), [("local_damper", 12)], [20.0])
    best = problem.fit((component_at(problem, "local_damper", 12),), np.array([20.0]))
    begun = []

    def begin(_problem, _base, component, fit, _limit):
        begun.append(component.key)
        return replace(
            fit,
            hypothesis=problem.make_hypothesis((component,)),
            has_converged=False,
            misfit=1.1 * fit.misfit,
            log_evidence=fit.log_evidence - 100,
        )

    monkeypatch.setattr(climb, "fit_from_neighbour", begin)
    monkeypatch.setattr(type(problem), "fit_to_convergence", lambda _problem, fit: fit)
    fits = {best.hypothesis.components[-1].key: best}
    climb._search_neighbourhood(problem, fit_null_model(problem), best, fits, lambda _: True)
    assert len(begun) > 1
    assert len(set(begun)) == len(begun)


def test_where_the_first_component_moves_second_ones_are_searched_again(nominal, monkeypatch):
    """Beside a mass one node off, another effect may have explained more than the true one."""
    names = ("added_mass", "grounded_spring", "coupling_spring")
    problem = problem_with(nominal, names, [("added_mass", 12), ("grounded_spring", 7)], [0.03, 250.0])
    first = problem.fit((component_at(problem, "added_mass", 11),), np.array([0.03]))
    pair = problem.fit(
        (*first.hypothesis.components, component_at(problem, "coupling_spring", 3, 8)), np.array([0.03, 250.0])
    )
    true = problem.fit(
        (component_at(problem, "added_mass", 12), component_at(problem, "grounded_spring", 7)), np.array([0.03, 250.0])
    )

    def beside(_bench, base, _least):
        assert base.hypothesis.components[0].location == {"nodes": [12]}
        return Ranking(base=base, fits=(true,), n_tried=1)

    monkeypatch.setattr(pairs, "search_small_component", beside)
    monkeypatch.setattr(climb, "_add_imitators", lambda *_: None)
    assert pairs._reposition(problem, Ranking(base=first, fits=(pair,), n_tried=1), {}).best is true


def test_where_all_are_far_off_what_stands_out_beside_the_nuisance_is_tried(nominal, monkeypatch):
    problem = problem_with(
        nominal, ("attached_resonator", "added_mass"), [("attached_resonator", 12)], [4e-3, 120.0, 0.01]
    )
    monkeypatch.setattr(searching, "_fit_starts", lambda *_: True)
    monkeypatch.setattr(searching, "search_neighbourhoods", lambda *_: None)
    best = search_component(problem, fit_null_model(problem)).best
    assert best.hypothesis.components[-1].effect.name == "attached_resonator"
    assert best.values[1] == pytest.approx(120.0, rel=SEEN)


def test_a_spring_whose_other_end_hardly_moves_is_tried_as_a_support(nominal):
    problem = problem_with(nominal, ("coupling_spring", "grounded_spring"), [("grounded_spring", 12)], [2e3])
    base = fit_null_model(problem)
    neighbour = problem.fit((component_at(problem, "coupling_spring", 2, 12),), np.array([2e3]))
    assert neighbour.is_nearly_right
    best = climbed(problem, base, neighbour).hypothesis.components[-1]
    assert (best.effect.name, dict(best.location)) == ("grounded_spring", {"nodes": [12]})


def test_an_imitator_is_fitted_from_values_that_do_the_same_in_the_band(nominal, monkeypatch):
    """What is best far from the axis may be far off near it."""
    names = ("attached_resonator", "viscoelastic_joint")
    problem = problem_with(nominal, names, [("viscoelastic_joint", 14)], [3e3, 4e-4])
    base = fit_null_model(problem)
    neighbour = problem.fit((component_at(problem, "attached_resonator", 14),), np.array([0.2, 9.0, 0.3]))
    monkeypatch.setattr(
        climb,
        "find_best_start",
        lambda _bench, _base, component, *_: Start(component=component, values=np.array([0.5, 1e-6]), cost=0.0),
    )
    monkeypatch.setattr(type(problem), "fit", lambda *_, **__: neighbour)  # no beginning anew
    monkeypatch.setattr(climb, "refine", lambda _hypothesis, _measured, _weights, values, **_: (values, 0.0))
    best = climbed(problem, base, neighbour)
    component = best.hypothesis.components[-1]
    assert (component.effect.name, dict(component.location)) == ("viscoelastic_joint", {"nodes": [14]})
    assert np.prod(best.values) == pytest.approx(1.2, rel=SEEN)  # what the joint takes from the motion
    monkeypatch.undo()
    assert problem.fit(best.hypothesis.components, best.values).values == pytest.approx([3e3, 4e-4], rel=SEEN)


def test_the_end_of_a_beam_is_tried_with_values_of_its_own(tmp_path, monkeypatch):
    """A spring against a rotation has as many parameters as one against a motion, in other units."""
    pinned, names = beam(tmp_path, left="pinned", right="sliding"), ("viscoelastic_joint",)
    blank = problem_of(pinned, measured(pinned), names)
    problem = problem_doing(pinned, names, blank, (joint_at_end(blank),), [30.0, 5e-4])
    base = fit_null_model(problem)
    neighbour = problem.fit((component_at(problem, "viscoelastic_joint", 2),), np.array([3e4, 5e-4]))
    monkeypatch.setattr(type(problem), "fit", lambda *_, **__: neighbour)  # no beginning anew
    monkeypatch.setattr(climb, "refine", lambda _hypothesis, _measured, _weights, values, **_: (values, 0.0))
    best = climbed(problem, base, neighbour)
    assert best.hypothesis.components[-1].location == {"end": "left", "nodes": [1]}
    assert best.values == pytest.approx([30.0, 5e-4], rel=SEEN)


def test_surroundings_are_chosen_near_the_axis(nominal, monkeypatch):
    """Far from the axis other pairs of nodes may look better than the true one, and no step beside leads there."""
    problem = problem_with(nominal, ("coupling_spring",), [("coupling_spring", 6, 15)], [4e3])
    neighbour = problem.fit((component_at(problem, "coupling_spring", 4, 14),), np.array([4e3]))
    around = climb.refine_surroundings(problem, neighbour.hypothesis.components, neighbour.values)
    true = [components[-1].location.nodes for components, _ in around].index((6, 15))
    wrong = [entry for index, entry in enumerate(around) if index != true]
    blurred = [*wrong[: climb.N_GLANCED - 1], around[true], *wrong[climb.N_GLANCED - 1 :]]
    monkeypatch.setattr(climb, "refine_surroundings", lambda *_: blurred)
    assert climb._promising_surroundings(problem, neighbour)[0].nodes == (6, 15)


def test_a_place_between_those_that_were_fitted_is_reached_beside_one_that_explains_all(nominal, monkeypatch):
    """A spring is hundreds behind at nodes 11 and 13 where one from node 12 to one near the clamp does the same."""
    monkeypatch.setattr(climb, "_add_imitators", lambda *_: None)  # this place is an end of the other here
    names = ("grounded_spring", "coupling_spring")
    problem = problem_with(nominal, names, [("grounded_spring", 12)], [400.0])
    places = [(names[1], 2, 12), (names[0], 11), (names[0], 13)]
    other, *beside = (
        problem.fit_to_convergence(problem.fit((component_at(problem, *place),), np.array([400.0]))) for place in places
    )
    assert other.explains_nearly_all
    assert all(fit.log_evidence < other.log_evidence - climb.MAX_BEHIND_COMPLETE for fit in beside)
    fits = {fit.hypothesis.components[-1].key: fit for fit in (other, *beside)}
    climb.search_neighbourhoods(problem, fit_null_model(problem), fits)
    assert likeliest(fits.values()).hypothesis.components[-1].key == component_at(problem, names[0], 12).key


def test_neighbours_with_fewer_parameters_are_rivals_with_values_of_their_own(nominal):
    """A support that may be compliant in rotation, in translation, or in both, beside a spring that explains all."""
    names = ("grounded_spring", "boundary_compliance")
    problem = problem_with(nominal, names, [("grounded_spring", 12)], [2e3])
    base = fit_null_model(problem)
    spring = problem.fit((component_at(problem, names[0], 12),), np.array([2e3]))
    support = problem.effects[names[1]]
    both = next(place for place in support.locations(problem.context) if len(place.directions) == 2)
    component = Component(effect=support, location=both, n_locations=3)
    fit = problem.fit((component,), support.start_values(problem.context, both)[0])
    fits = {one.hypothesis.components[-1].key: one for one in (spring, fit)}
    assert climb._step_to_rivals(problem, base, fit, spring, fits, lambda _: True).log_evidence < spring.log_evidence


def test_of_several_starts_the_data_choose(nominal):
    problem = problem_with(nominal, ("grounded_spring",), [("grounded_spring", 12)], [2e3])
    hypothesis = problem.make_hypothesis((component_at(problem, "grounded_spring", 12),))
    right = problem.fit(hypothesis.components, np.array([2e3]))
    start, nuisance = problem.nearest_start(hypothesis, [np.array([10.0]), np.array([2e3]), np.array([9e4])], right)
    assert start == pytest.approx([2e3])
    assert nuisance.shape == (problem.nuisance_prior.size,)


def test_a_grid_is_thinned_so_that_every_value_stays():
    grid = np.array([[a, b, c] for a in range(8) for b in range(8) for c in range(8)], float)
    thinned = climb._thin_grid(grid)
    assert 32 <= len(thinned) <= climb.MAX_STARTS
    assert all(set(column) == set(range(8)) for column in thinned.T)
    assert len(climb._thin_grid(grid[:5])) == 5


def test_a_second_component_is_searched_beside_a_first_that_leaves_much(nominal, monkeypatch):
    """A slow high-pass of a channel changes nothing far from the axis, where pairs are searched."""
    names = ("grounded_spring", "sensor_dynamics", "sensor_gain")
    problem = problem_with(nominal, names, [("grounded_spring", 12)], [2e3])
    late = problem.effects["sensor_dynamics"]
    location = Location.on_channel("acc_2", form="highpass")
    pair = (component_at(problem, "grounded_spring", 12), Component(effect=late, location=location, n_locations=4))

    def chain(frequency_hz):
        s, nuisance = 2j * np.pi * frequency_hz, np.zeros(problem.nuisance_prior.size)
        alone = problem.make_hypothesis(()).respond(np.zeros(0), nuisance, s).values
        return problem.make_hypothesis(pair).respond(np.array([2e3, 1.2]), nuisance, s).values / alone

    problem = problem_of(nominal, measured(nominal, factors=chain), names)
    first = search_component(problem, fit_null_model(problem))
    assert not first.best.is_nearly_right
    assert not first.best.is_far_off
    assert first.refined
    monkeypatch.setattr(pairs, "_search_far_pairs", lambda *_: [])
    best = pairs.search_pair(problem, first, lambda fit: fit.explains_nearly_all).best
    assert {component.effect.name for component in best.hypothesis.components} == {
        "grounded_spring",
        "sensor_dynamics",
    }


def test_two_resonators_give_way_to_simpler_effects(nominal):
    problem = problem_with(nominal, KINDS, [("local_damper", 15), ("grounded_spring", 9)], [0.4, 1.5e3])
    two = (component_at(problem, "attached_resonator", 15), component_at(problem, "attached_resonator", 9))
    fit = problem.fit(two, np.array([0.02, 11.0, 0.5, 0.3, 11.0, 1e-3]))
    base = problem.fit(two[:1], fit.values[:3])
    best = pairs._try_simpler_effects(problem, Ranking(base=base, fits=(fit,), n_tried=1), {}).best
    components = {(component.effect.name, *component.location.nodes) for component in best.hypothesis.components}
    assert components == {("local_damper", 15), ("grounded_spring", 9)}
