"""Steps from a cause to its neighbours and to what looks like it, alone and in pairs."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosed import beam, bench_of, measured
from frf_ipz.diagnosis.evidence.hypothesis import Cause
from frf_ipz.diagnosis.search import component_search as searching
from frf_ipz.diagnosis.search import neighbourhood_search as climb
from frf_ipz.diagnosis.search import pair_search as pairs
from frf_ipz.diagnosis.search.component_search import Ranking, fit_nothing, search
from frf_ipz.diagnosis.search.robust_refinement import Start

KINDS = ("attached_resonator", "local_damper", "grounded_spring", "coupling_spring", "viscoelastic_joint")
SEEN = 0.05  # relative


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    return beam(tmp_path_factory.mktemp("beam"))


def cause_at(bench, name, *nodes):
    effect = bench.effects[name]
    places = effect.places(bench.specimen)
    place = next(place for place in places if place.location.get("nodes") == list(nodes))
    return Cause(effect=effect, place=place, n_places=len(places))


def joint_at_end(bench):
    joint = bench.effects["viscoelastic_joint"]
    (place,) = (place for place in joint.places(bench.specimen) if place.key[0] == "end")
    return Cause(effect=joint, place=place, n_places=16)


def bench_with(nominal, names, causes, values):
    """A bench for what a beam with some causes is measured to do."""
    blank = bench_of(nominal, measured(nominal), tuple({*names, *(name for name, *_ in causes)}))
    return bench_doing(nominal, names, blank, tuple(cause_at(blank, *cause) for cause in causes), values)


def bench_doing(nominal, names, blank, causes, values):
    both = blank.suppose(causes)
    values, unknown = np.array(values), np.zeros(blank.nuisance.size)

    def chain(frequency_hz):
        s = 2j * np.pi * frequency_hz
        alone = blank.suppose(()).respond(np.zeros(0), unknown, s).values
        return both.respond(values, unknown, s).values / alone

    return bench_of(nominal, measured(nominal, factors=chain), names)


def likeliest(fits):
    return max(fits, key=lambda fit: fit.log_evidence)


def climbed(bench, base, fit):
    fits = {fit.hypothesis.causes[-1].key: fit}
    climb.climb_all(bench, base, fits)
    return likeliest(fits.values())


@pytest.mark.parametrize(("times", "is_settled"), [(3.0, True), (30.0, False)])
def test_a_fit_beside_the_best_that_was_given_up_is_gone_on_with(nominal, times, is_settled):
    bench = bench_with(nominal, ("local_damper",), [("local_damper", 12)], [20.0])
    base = fit_nothing(bench)
    near = bench.go_on(bench.fit((cause_at(bench, "local_damper", 11),), np.array([20.0])))
    true = bench.fit((cause_at(bench, "local_damper", 12),), np.array([20.0]))
    assert true.log_evidence > near.log_evidence
    on_its_way = replace(true, converged=False, misfit=2 * times * near.cost, log_evidence=near.log_evidence - 100)
    fits = {fit.hypothesis.causes[-1].key: fit for fit in (near, on_its_way)}
    climb._climb(bench, base, near, fits)
    assert fits[true.hypothesis.causes[-1].key].converged == is_settled
    assert (likeliest(fits.values()).hypothesis.causes[-1].place.location == {"nodes": [12]}) == is_settled


def test_a_fit_beside_the_best_that_cannot_go_on_begins_anew_from_there(nominal, monkeypatch):
    bench = bench_with(nominal, ("local_damper",), [("local_damper", 12)], [20.0])
    near = bench.go_on(bench.fit((cause_at(bench, "local_damper", 11),), np.array([20.0])))
    true = bench.fit((cause_at(bench, "local_damper", 12),), np.array([20.0]))
    stuck = replace(true, converged=False, misfit=2 * near.cost, log_evidence=near.log_evidence - 100)
    monkeypatch.setattr(type(bench), "go_on", lambda _bench, fit: fit)
    fits = {fit.hypothesis.causes[-1].key: fit for fit in (near, stuck)}
    climb._climb(bench, fit_nothing(bench), near, fits)
    assert likeliest(fits.values()).hypothesis.causes[-1].place.location == {"nodes": [12]}
    assert likeliest(fits.values()).cost == pytest.approx(true.cost, rel=SEEN)


def test_where_settling_moves_the_first_cause_others_are_searched_beside_it_again(nominal, monkeypatch):
    """Beside a mass one node off, another effect may have explained more than the true one."""
    names = ("added_mass", "grounded_spring", "coupling_spring")
    bench = bench_with(nominal, names, [("added_mass", 12), ("grounded_spring", 7)], [0.03, 250.0])
    first = bench.fit((cause_at(bench, "added_mass", 11),), np.array([0.03]))
    pair = bench.fit((*first.hypothesis.causes, cause_at(bench, "coupling_spring", 3, 8)), np.array([0.03, 250.0]))
    true = bench.fit(
        (cause_at(bench, "added_mass", 12), cause_at(bench, "grounded_spring", 7)), np.array([0.03, 250.0])
    )

    def beside(_bench, base, _least):
        assert base.hypothesis.causes[0].place.location == {"nodes": [12]}
        return Ranking(base=base, fits=(true,), n_tried=1)

    monkeypatch.setattr(pairs, "search_beside", beside)
    monkeypatch.setattr(climb, "_add_imitators", lambda *_: None)
    assert pairs._settled(bench, Ranking(base=first, fits=(pair,), n_tried=1)).best is true


def test_where_all_are_far_off_what_stands_out_beside_fitted_scatter_is_tried(nominal, monkeypatch):
    bench = bench_with(nominal, ("attached_resonator", "added_mass"), [("attached_resonator", 12)], [4e-3, 120.0, 0.01])
    monkeypatch.setattr(searching, "_fitted", lambda *_: {})
    monkeypatch.setattr(searching, "climb_all", lambda *_: None)
    best = search(bench, fit_nothing(bench)).best
    assert best.hypothesis.causes[-1].effect.name == "attached_resonator"
    assert best.values[1] == pytest.approx(120.0, rel=SEEN)


def test_a_spring_whose_other_end_hardly_moves_is_tried_as_a_support(nominal):
    bench = bench_with(nominal, ("coupling_spring", "grounded_spring"), [("grounded_spring", 12)], [2e3])
    base = fit_nothing(bench)
    near = bench.fit((cause_at(bench, "coupling_spring", 2, 12),), np.array([2e3]))
    assert near.is_nearly_right
    best = climbed(bench, base, near).hypothesis.causes[-1]
    assert (best.effect.name, best.place.location) == ("grounded_spring", {"nodes": [12]})


def test_what_looks_alike_is_fitted_from_values_that_do_the_same_in_the_band(nominal, monkeypatch):
    """What is best far from the axis may be far off near it."""
    names = ("attached_resonator", "viscoelastic_joint")
    bench = bench_with(nominal, names, [("viscoelastic_joint", 14)], [3e3, 4e-4])
    base = fit_nothing(bench)
    near = bench.fit((cause_at(bench, "attached_resonator", 14),), np.array([0.2, 9.0, 0.3]))
    monkeypatch.setattr(
        climb,
        "best_start",
        lambda _bench, _base, cause, *_: Start(cause=cause, values=np.array([0.5, 1e-6]), cost=0.0),
    )
    monkeypatch.setattr(type(bench), "fit", lambda *_, **__: near)  # no beginning anew
    monkeypatch.setattr(climb, "refine", lambda _hypothesis, _measured, _weights, values, **_: (values, 0.0))
    best = climbed(bench, base, near)
    cause = best.hypothesis.causes[-1]
    assert (cause.effect.name, cause.place.location) == ("viscoelastic_joint", {"nodes": [14]})
    assert best.values == pytest.approx([3e3, 4e-4], rel=SEEN)


def test_the_end_of_a_beam_is_tried_with_values_of_its_own(tmp_path, monkeypatch):
    """A spring against a rotation has as many parameters as one against a motion, in other units."""
    pinned, names = beam(tmp_path, left="pinned", right="sliding"), ("viscoelastic_joint",)
    blank = bench_of(pinned, measured(pinned), names)
    bench = bench_doing(pinned, names, blank, (joint_at_end(blank),), [30.0, 5e-4])
    base = fit_nothing(bench)
    near = bench.fit((cause_at(bench, "viscoelastic_joint", 2),), np.array([3e4, 5e-4]))
    monkeypatch.setattr(type(bench), "fit", lambda *_, **__: near)  # no beginning anew
    monkeypatch.setattr(climb, "refine", lambda _hypothesis, _measured, _weights, values, **_: (values, 0.0))
    best = climbed(bench, base, near)
    assert best.hypothesis.causes[-1].place.location == {"end": "left", "nodes": [1]}
    assert best.values == pytest.approx([30.0, 5e-4], rel=SEEN)


def test_places_around_are_chosen_near_the_axis(nominal, monkeypatch):
    """Far from the axis other pairs of nodes may look better than the true one, and no step beside leads there."""
    bench = bench_with(nominal, ("coupling_spring",), [("coupling_spring", 6, 15)], [4e3])
    near = bench.fit((cause_at(bench, "coupling_spring", 4, 14),), np.array([4e3]))
    around = climb.further_around(bench, near.hypothesis.causes, near.values)
    true = [causes[-1].place.location["nodes"] for causes, _ in around].index([6, 15])
    others = [one for index, one in enumerate(around) if index != true]
    blurred = [*others[: climb.GLANCED_AT - 1], around[true], *others[climb.GLANCED_AT - 1 :]]
    monkeypatch.setattr(climb, "further_around", lambda *_: blurred)
    assert climb._promising_around(bench, near)[0].location == {"nodes": [6, 15]}


def test_of_equal_starts_that_is_taken_which_the_data_support(nominal):
    bench = bench_with(nominal, ("grounded_spring",), [("grounded_spring", 12)], [2e3])
    hypothesis = bench.suppose((cause_at(bench, "grounded_spring", 12),))
    right = bench.fit(hypothesis.causes, np.array([2e3]))
    start, unknown = bench.nearest(hypothesis, [np.array([10.0]), np.array([2e3]), np.array([9e4])], right)
    assert start == pytest.approx([2e3])
    assert unknown.shape == (bench.nuisance.size,)


def test_a_grid_is_thinned_so_that_every_value_stays():
    grid = np.array([[a, b, c] for a in range(8) for b in range(8) for c in range(8)], float)
    some = climb._some(grid)
    assert 32 <= len(some) <= climb.MOST_STARTS
    assert all(set(column) == set(range(8)) for column in some.T)
    assert len(climb._some(grid[:5])) == 5


def test_a_second_cause_is_looked_for_beside_a_first_that_leaves_much(nominal, monkeypatch):
    """A slow high-pass of a channel changes nothing far from the axis, where pairs are searched."""
    names = ("grounded_spring", "sensor_dynamics", "sensor_gain")
    bench = bench_with(nominal, names, [("grounded_spring", 12)], [2e3])
    late = bench.effects["sensor_dynamics"]
    place = next(place for place in late.places(bench.specimen) if place.key == ("acc_2", "highpass"))
    both = (cause_at(bench, "grounded_spring", 12), Cause(effect=late, place=place, n_places=4))

    def chain(frequency_hz):
        s, unknown = 2j * np.pi * frequency_hz, np.zeros(bench.nuisance.size)
        alone = bench.suppose(()).respond(np.zeros(0), unknown, s).values
        return bench.suppose(both).respond(np.array([2e3, 1.2]), unknown, s).values / alone

    bench = bench_of(nominal, measured(nominal, factors=chain), names)
    first = search(bench, fit_nothing(bench))
    assert not first.best.is_nearly_right
    assert not first.best.is_hopeless
    assert first.refined
    monkeypatch.setattr(pairs, "_of_pairs", lambda *_: [])
    found = pairs.search_second(bench, first, lambda fit: fit.is_nearly_all).best
    assert {cause.effect.name for cause in found.hypothesis.causes} == {"grounded_spring", "sensor_dynamics"}


def test_two_resonators_are_taken_for_simpler_things(nominal):
    bench = bench_with(nominal, KINDS, [("local_damper", 15), ("grounded_spring", 9)], [0.4, 1.5e3])
    two = (cause_at(bench, "attached_resonator", 15), cause_at(bench, "attached_resonator", 9))
    fit = bench.fit(two, np.array([0.02, 11.0, 0.5, 0.3, 11.0, 1e-3]))
    base = bench.fit(two[:1], fit.values[:3])
    found = pairs._simpler(bench, Ranking(base=base, fits=(fit,), n_tried=1)).best
    causes = {(cause.effect.name, *cause.place.location["nodes"]) for cause in found.hypothesis.causes}
    assert causes == {("local_damper", 15), ("grounded_spring", 9)}
