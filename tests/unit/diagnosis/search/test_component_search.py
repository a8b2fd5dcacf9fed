"""Which further components are fitted, by what a linear step promises of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from frf_ipz.diagnosis.search import component_search
from frf_ipz.diagnosis.search.component_search import _promising, _with_location_prior
from frf_ipz.diagnosis.search.robust_refinement import GAIN, Start


def component(effect, place):
    return SimpleNamespace(effect=SimpleNamespace(name=effect), key=(effect, place), n_locations=20)


def scored(effect, place, cost):
    return Start(component=component(effect, place), values=np.ones(1), cost=cost)


def score_nothing(_):
    raise AssertionError("it was scored already")


def test_places_that_promise_less_than_the_best_of_their_effect_are_not_fitted():
    worth_fitting = _promising(
        [scored("mass", 3, -90.0), scored("mass", 4, -90.0 + GAIN), scored("mass", 9, -20.0)], 40.0, score_nothing, GAIN
    )
    assert worth_fitting(component("mass", 3))
    assert worth_fitting(component("mass", 4))
    assert not worth_fitting(component("mass", 9))


def test_effects_that_promise_too_little_are_not_fitted():
    worth_fitting = _promising([scored("mass", 3, -90.0), scored("damper", 3, -30.0)], 40.0, score_nothing, GAIN)
    assert not worth_fitting(component("damper", 3))


def test_places_that_were_passed_over_are_scored_when_they_are_asked_for():
    later = []

    def score(components):
        later.extend(component.key for component in components)
        return [scored(*component.key, -85.0 if component.key[1] == 4 else -89.9) for component in components][:1]

    worth_fitting = _promising([scored("mass", 3, -90.0)], 40.0, score, GAIN)
    assert not worth_fitting(component("mass", 4))
    assert worth_fitting(component("mass", 5))
    assert worth_fitting(component("spring", 5))
    assert not worth_fitting(component("mass", 4))
    assert later == [("mass", 4), ("mass", 5), ("spring", 5)]


def test_what_would_help_with_a_negative_size_only_promises_nothing():
    assert not _promising([scored("mass", 3, -90.0)], 40.0, lambda _: [], GAIN)(component("mass", 4))


def test_one_of_many_places_promises_something_by_chance():
    (start,) = _with_location_prior([scored("mass", 3, -90.0)])
    np.testing.assert_allclose(start.cost, -90.0 + np.log(20))


@pytest.mark.parametrize(("base_is_nearly_right", "is_explained", "is_scored"), [
    (False, False, True), (False, True, False), (True, True, True),
])  # fmt: skip
def test_nothing_is_scored_from_far_off_where_one_effect_explains_nearly_all(
    monkeypatch, base_is_nearly_right, is_explained, is_scored
):
    """What a linear step promises from a model that is far off is no match for what explains nearly all."""
    scored = []
    base = SimpleNamespace(explains_nearly_all=False, is_far_off=False, is_nearly_right=base_is_nearly_right)
    fit = SimpleNamespace(explains_nearly_all=is_explained, is_far_off=False)
    monkeypatch.setattr(component_search, "scan_globally", lambda *_: [])
    monkeypatch.setattr(component_search, "refine_starts", lambda *_: [])
    monkeypatch.setattr(component_search, "_fit_starts", lambda *given: given[-1].update(key=fit) or True)
    effects = SimpleNamespace(score_everywhere=lambda: scored.append(1) or [])
    monkeypatch.setattr(component_search, "prepare_small_effects", lambda *_: effects)
    monkeypatch.setattr(component_search, "_add_by_score_test", lambda *_: None)
    monkeypatch.setattr(component_search, "_count_searched_effects", lambda *_: 0)
    monkeypatch.setattr(component_search, "rank_fits", lambda _, fits: tuple(fits))
    component_search.search_component(None, base)
    assert bool(scored) == is_scored


@pytest.mark.parametrize(("min_log_bayes_factor", "worth"), [(0.0, [3, 4]), (20.0, [3]), (31.8, [])])
def test_where_nothing_seems_missing_only_neighbours_that_promise_enough_are_fitted(
    monkeypatch, min_log_bayes_factor, worth
):
    """Of a sound machine all neighbours of what explains a little by chance were fitted."""
    base = SimpleNamespace(explains_nearly_all=True, is_far_off=False, is_nearly_right=True, log_evidence=-50.0)
    found = SimpleNamespace(explains_nearly_all=True, is_far_off=False, log_evidence=-40.0)
    costs = {3: -12.0, 4: -6.0, 5: -3.0}
    effects = SimpleNamespace(
        score_everywhere=lambda: [scored("mass", 3, costs[3])],
        score=lambda components: [scored(*one.key, costs[one.key[1]]) for one in components if one.key[1] in costs],
    )
    searched = []
    monkeypatch.setattr(component_search, "prepare_small_effects", lambda *_: effects)
    monkeypatch.setattr(component_search, "_add_by_score_test", lambda *given: given[-1].update(key=found))
    monkeypatch.setattr(component_search, "_count_searched_effects", lambda *_: 6)
    monkeypatch.setattr(component_search, "search_neighbourhoods", lambda *given: searched.append(given[-1]))
    monkeypatch.setattr(component_search, "rank_fits", lambda _, fits: tuple(fits))
    component_search.search_component(None, base, min_log_bayes_factor=min_log_bayes_factor)
    (worth_fitting,) = searched
    assert [place for place in range(2, 8) if worth_fitting(component("mass", place))] == worth
