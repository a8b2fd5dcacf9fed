"""Places that explain a test as well as the best one that a search came to."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosed import beam, labels, measured, problem_of
from frf_ipz.diagnosis.catalogue.effect import Location
from frf_ipz.diagnosis.catalogue.effects import coupling_spring
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.search import ambiguity_set as ties
from frf_ipz.diagnosis.search.ambiguity_set import add_distant_candidates, find_next_neighbour, rescore_ambiguity_set
from frf_ipz.diagnosis.search.component_search import Ranking, fit_null_model
from frf_ipz.dofs import parse_dof
from frf_ipz.fe.changes import with_point_masses, with_springs

NODES, TRUE, MIRRORED, ADDED_KG = 25, 6, 20, 2e-3
LITTLE_KG = 5e-5  # of which the place is hardly seen
MIDDLE = labels(outputs=("13:+z",), inputs=("13:+z",))  # a sensor and blows that do not tell left from right
ASTRAY = 9
SPRING_N_M = 5e3


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    """A beam clamped at both ends."""
    return beam(tmp_path_factory.mktemp("beam"), elements=NODES - 1, right="clamped")


@pytest.fixture(scope="module")
def symmetric(nominal):
    """Looked at in its middle."""
    return problem_of(nominal, measured(with_point_masses(nominal, {TRUE: ADDED_KG}), MIDDLE), ("added_mass",))


def only(problem, *nodes, added_kg=ADDED_KG):
    """A ranking of a search that came to some nodes only."""
    effect, null = problem.effects["added_mass"], fit_null_model(problem)
    locations = {location.entries["nodes"][0]: location for location in effect.locations(problem.context)}
    components = [Component(effect=effect, location=locations[node], n_locations=len(locations)) for node in nodes]
    fits = [problem.fit((component,), np.array([added_kg])) for component in components]
    return Ranking(base=null, fits=tuple(sorted(fits, key=lambda fit: -fit.log_evidence)), n_tried=0)


def node_of(component):
    return component.location.entries["nodes"][0]


def evidence(fits):
    return {node_of(fit.hypothesis.components[-1]): fit.log_evidence for fit in fits}


def by_key(ranking):
    return {fit.hypothesis.components[-1].key: fit for fit in ranking.fits}


def test_what_explains_as_well_on_the_far_side_is_found(symmetric):
    ranking = only(symmetric, TRUE)
    fits = by_key(ranking)
    add_distant_candidates(symmetric, ranking, fits)
    found = evidence(fits.values())
    assert found[MIRRORED] == pytest.approx(found[TRUE], abs=0.1)


@pytest.mark.parametrize(("true", "mirrored"), [(12, 14), (14, 12)])
def test_what_explains_as_well_nearly_beside_it_is_found(nominal, true, mirrored):
    """Two nodes off, where of two places only the better one is looked at."""
    problem = problem_of(nominal, measured(with_point_masses(nominal, {true: ADDED_KG}), MIDDLE), ("added_mass",))
    fits = by_key(only(problem, true))
    add_distant_candidates(problem, only(problem, true), fits)
    found = evidence(fits.values())
    assert found[mirrored] == pytest.approx(found[true], abs=0.1)


def test_places_around_what_is_better_far_off_are_fitted_too(nominal):
    """Of a search that went astray, seen from where left and right are told apart."""
    true = with_point_masses(nominal, {TRUE: ADDED_KG})
    problem = problem_of(nominal, measured(true, labels(outputs=("8:+z",), inputs=("10:+z",))), ("added_mass",))
    ranking = only(problem, MIRRORED)
    fits = by_key(ranking)
    add_distant_candidates(problem, ranking, fits)
    found = evidence(fits.values())
    assert max(found, key=found.get) == TRUE
    assert {TRUE - 1, TRUE + 1} <= found.keys()


def test_the_next_place_is_beside_the_best_that_has_one(symmetric):
    best, second = only(symmetric, TRUE, MIRRORED).fits
    effect = symmetric.effects["added_mass"]
    locations = effect.neighbours(symmetric.context, best.hypothesis.components[-1].location)
    around = [Component(effect=effect, location=location, n_locations=1).key for location in locations]
    component, beside = find_next_neighbour(symmetric, (best, second), around[1:])
    assert (component.key, beside) == (around[0], best)
    component, beside = find_next_neighbour(symmetric, (best, second), around)
    assert component.key not in around
    assert beside is second
    assert find_next_neighbour(symmetric, (best,), around) is None


@pytest.fixture
def valley(nominal, monkeypatch):
    """So little mass that all places near the true one explain alike."""
    monkeypatch.setattr(ties, "add_distant_candidates", lambda *_: 0)
    true = with_point_masses(nominal, {TRUE: LITTLE_KG})
    return problem_of(nominal, measured(true, labels(outputs=("8:+z",), inputs=("10:+z",))), ("added_mass",))


def as_if_found(ranking):
    """As if it explained much of what the nominal model leaves."""
    return replace(ranking, base=replace(ranking.base, log_evidence=ranking.base.log_evidence - 1e3))


def test_ties_are_settled_along_a_valley_as_far_as_it_is_level(valley):
    """Of a search that came to one end of it."""
    found = rescore_ambiguity_set(valley, as_if_found(only(valley, ASTRAY, ASTRAY + 1, added_kg=LITTLE_KG)))
    assert evidence(found.fits)[TRUE] > found.best.log_evidence - 1


def test_no_more_places_are_weighed_than_can_be_waited_for(valley, monkeypatch):
    monkeypatch.setattr(ties, "MAX_NEIGHBOURS", 1)
    assert (
        len(rescore_ambiguity_set(valley, as_if_found(only(valley, ASTRAY, ASTRAY + 1, added_kg=LITTLE_KG))).fits)
        == 2 + 1
    )


def test_what_was_not_weighed_again_is_no_contender(valley, monkeypatch):
    monkeypatch.setattr(ties, "CANDIDATES_PER_EFFECT", 2)
    monkeypatch.setattr(ties, "MAX_NEIGHBOURS", 0)
    alike = only(valley, TRUE - 1, TRUE, TRUE + 1, added_kg=LITTLE_KG)
    assert alike.fits[2].log_evidence > alike.fits[0].log_evidence - ties.AMBIGUOUS
    found = rescore_ambiguity_set(valley, alike)
    assert [fit.log_evidence > found.fits[0].log_evidence - ties.AMBIGUOUS for fit in found.fits] == [True, True, False]


def test_nothing_is_looked_for_beside_what_explains_nothing(valley):
    assert len(rescore_ambiguity_set(valley, only(valley, ASTRAY, ASTRAY + 1, added_kg=LITTLE_KG)).fits) == 2


@pytest.mark.parametrize(("tried", "first"), [(2, "grounded_spring"), (0, "coupling_spring")])
def test_what_looks_like_the_best_is_weighed_where_the_best_sits_now(nominal, monkeypatch, tried, first):
    """A search that came to a spring to a node beside the clamped end, which hardly moves."""
    monkeypatch.setattr(ties, "add_distant_candidates", lambda *_: 0)
    monkeypatch.setattr(ties, "MAX_NEIGHBOURS", 0)
    monkeypatch.setattr(ties, "MAX_IMITATOR_ROUNDS", tried)
    true = with_springs(nominal, {parse_dof(f"{TRUE}:+z"): SPRING_N_M})
    frfs = measured(true, labels(outputs=("8:+z",), inputs=("10:+z",)))
    problem = problem_of(nominal, frfs, ("grounded_spring", "coupling_spring"))
    effect = problem.effects["coupling_spring"]
    locations = effect.locations(problem.context)
    near_it = [location for location in locations if location.entries["nodes"] in ([2, TRUE], [2, TRUE + 1])]
    components = [Component(effect=effect, location=location, n_locations=len(locations)) for location in near_it]
    fits = sorted(
        (problem.fit((component,), np.array([SPRING_N_M])) for component in components),
        key=lambda fit: -fit.log_evidence,
    )
    found = rescore_ambiguity_set(problem, Ranking(base=fit_null_model(problem), fits=tuple(fits), n_tried=0))
    assert found.best.hypothesis.components[-1].effect.name == first


def test_a_pair_of_nodes_is_as_likely_however_few_are_listed(symmetric, monkeypatch):
    effect = coupling_spring.CouplingSpring()
    context, location = symmetric.context, Location(key=(5, 17, "z"), entries={"nodes": [5, 17]})

    def prior():
        n_locations = len(effect.locations(context))
        return n_locations, effect.log_prior(context, location, np.array([1e3])) - np.log(n_locations)

    n_all, expected = prior()
    monkeypatch.setattr(coupling_spring, "MAX_IN_A_ROW", 9)
    n_few, found = prior()
    assert n_few < n_all / 4
    assert found == pytest.approx(expected, abs=0.4)
