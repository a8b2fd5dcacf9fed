"""Which further components are fitted, by what a linear step promises of them."""

from types import SimpleNamespace

import numpy as np

from frf_ipz.diagnosis.search.component_search import _promising, _with_location_prior
from frf_ipz.diagnosis.search.robust_refinement import GAIN, Start


def component(effect, place):
    return SimpleNamespace(effect=SimpleNamespace(name=effect), key=(effect, place), n_locations=20)


def scored(effect, place, cost):
    return Start(component=component(effect, place), values=np.ones(1), cost=cost)


def test_places_that_promise_less_than_the_best_of_their_effect_are_not_fitted():
    worth_fitting = _promising(
        [scored("mass", 3, -90.0), scored("mass", 4, -90.0 + GAIN), scored("mass", 9, -20.0)], 40.0
    )
    assert worth_fitting(component("mass", 3))
    assert worth_fitting(component("mass", 4))
    assert not worth_fitting(component("mass", 9))


def test_effects_that_promise_too_little_are_not_fitted_and_those_that_were_not_scored_are():
    worth_fitting = _promising([scored("mass", 3, -90.0), scored("damper", 3, -30.0)], 40.0)
    assert not worth_fitting(component("damper", 3))
    assert worth_fitting(component("spring", 5))


def test_one_of_many_places_promises_something_by_chance():
    (start,) = _with_location_prior([scored("mass", 3, -90.0)])
    np.testing.assert_allclose(start.cost, -90.0 + np.log(20))
