"""What rivals of a fit that explains nearly all are compared by, far from the axis, and which of them are fitted."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosed import beam, measured, problem_of
from frf_ipz.diagnosis.evidence.fit import NEARLY_ALL
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.search import neighbourhood_search
from frf_ipz.diagnosis.search.component_search import fit_null_model, search_component
from frf_ipz.diagnosis.search.rivals import MAX_BEHIND_COMPLETE, is_hopeless, make_rival_test
from frf_ipz.fe.changes import with_point_masses

NODE, MASS_KG = 12, 0.02
NOTHING = 1.0  # log-likelihood: what the last steps of two fits differ by
FROM = (0.3, 3.0)  # times the mass that is there


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    nominal = beam(tmp_path_factory.mktemp("beam"))
    heavier = measured(with_point_masses(nominal, {NODE: MASS_KG}))
    return problem_of(nominal, heavier, ("added_mass", "grounded_spring", "sensor_gain", "damping_level"))


def mass_at(problem, node):
    return Component(effect=problem.effects["added_mass"], location=Location.at_node(node, "z"), n_locations=16)


@pytest.fixture(scope="module")
def fit(problem):
    best = problem.fit((mass_at(problem, NODE),), np.array([MASS_KG]))
    assert best.explains_nearly_all, "the case is not what it should be"
    return best


def test_a_fit_is_no_worse_than_itself(problem, fit):
    deficit = make_rival_test(problem, fit).deficit(fit.hypothesis, [factor * fit.values for factor in FROM])
    assert deficit < MAX_BEHIND_COMPLETE
    assert make_rival_test(problem, fit).deficit(fit.hypothesis, [fit.values]) == pytest.approx(0.0, abs=NOTHING)


@pytest.mark.parametrize("node", [11, 16])
def test_a_rival_is_behind_far_from_the_axis_by_no_more_than_near_it(problem, fit, node):
    components = (mass_at(problem, node),)
    hypothesis = problem.make_hypothesis(components)
    near = problem.fit(components, fit.values).cost - fit.cost
    assert make_rival_test(problem, fit).deficit(hypothesis, [fit.values]) < near + NOTHING


def test_nothing_is_hopeless_beside_a_fit_that_leaves_much(problem, fit):
    rival = problem.make_hypothesis((mass_at(problem, 3),))
    assert is_hopeless(problem, fit, rival, [fit.values])
    assert not is_hopeless(problem, replace(fit, misfit=2 * NEARLY_ALL * fit.n_values), rival, [fit.values])


def test_hopeless_rivals_are_evaluated_and_not_fitted(problem, monkeypatch):
    fitted = []
    iterate = neighbourhood_search.fit_map

    def record(hypothesis, *arguments, **options):
        if options.get("iterations") != 0:
            fitted.append(hypothesis.components[-1].key)
        return iterate(hypothesis, *arguments, **options)

    monkeypatch.setattr(neighbourhood_search, "fit_map", record)
    ranking = search_component(problem, fit_null_model(problem))
    assert ranking.best.hypothesis.components[-1].location.node == NODE
    known = {fit.hypothesis.components[-1].key for fit in ranking.fits}
    assert ("grounded_spring", Location.at_node(NODE, "z")) in known - set(fitted)
