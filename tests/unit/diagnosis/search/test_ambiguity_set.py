"""Locations that explain a test as well as the best one of a search."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosed import beam, labels, measured, problem_of
from frf_ipz.diagnosis.catalogue.effects import coupling_spring
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.search import ambiguity_set as ties
from frf_ipz.diagnosis.search.ambiguity_set import add_distant_candidates, find_next_neighbour, rescore_ambiguity_set
from frf_ipz.diagnosis.search.component_search import Ranking, fit_null_model
from frf_ipz.diagnosis.search.global_scan import scan_globally
from frf_ipz.dofs import parse_dof
from frf_ipz.fe.changes import with_point_masses, with_springs

NODES, TRUE, MIRRORED, ADDED_KG = 25, 6, 20, 2e-3
LITTLE_KG = 5e-5  # whose location is hardly observable
MIDDLE = labels(outputs=("13:+z",), inputs=("13:+z",))  # a sensor and impacts that do not distinguish left from right
ASTRAY = 9
SPRING_N_M = 5e3


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    """A beam clamped at both ends."""
    return beam(tmp_path_factory.mktemp("beam"), elements=NODES - 1, right="clamped")


@pytest.fixture(scope="module")
def symmetric(nominal):
    """Measured in its middle."""
    return problem_of(nominal, measured(with_point_masses(nominal, {TRUE: ADDED_KG}), MIDDLE), ("added_mass",))


def only(problem, *nodes, added_kg=ADDED_KG):
    """The ranking of a search that found some nodes only."""
    effect, null = problem.effects["added_mass"], fit_null_model(problem)
    locations = {location.node: location for location in effect.locations(problem.context)}
    components = [Component(effect=effect, location=locations[node], n_locations=len(locations)) for node in nodes]
    fits = [problem.fit((component,), np.array([added_kg])) for component in components]
    return Ranking(base=null, fits=tuple(sorted(fits, key=lambda fit: -fit.log_evidence)), n_tried=0)


def node_of(component):
    return component.location.node


def evidence(fits):
    return {node_of(fit.hypothesis.components[-1]): fit.log_evidence for fit in fits}


def by_key(ranking):
    return {fit.hypothesis.components[-1].key: fit for fit in ranking.fits}


def test_a_mirrored_location_that_explains_as_well_is_added(symmetric):
    ranking = only(symmetric, TRUE)
    fits = by_key(ranking)
    add_distant_candidates(symmetric, ranking, fits)
    log_evidence = evidence(fits.values())
    assert log_evidence[MIRRORED] == pytest.approx(log_evidence[TRUE], abs=0.1)


def test_what_a_search_has_scanned_is_not_scanned_again(symmetric, monkeypatch):
    null = fit_null_model(symmetric)
    starts = scan_globally(symmetric, null)
    ranking = replace(only(symmetric, TRUE), base=null, scanned=tuple(starts))
    monkeypatch.setattr(ties, "scan_globally", lambda *_: pytest.fail("scanned again"))
    assert add_distant_candidates(symmetric, ranking, by_key(ranking)) == len(starts)


@pytest.mark.parametrize(("true", "mirrored"), [(12, 14), (14, 12)])
def test_a_nearby_location_that_explains_as_well_is_added(nominal, true, mirrored):
    """Two nodes off, where of two locations only the better one is tried."""
    problem = problem_of(nominal, measured(with_point_masses(nominal, {true: ADDED_KG}), MIDDLE), ("added_mass",))
    fits = by_key(only(problem, true))
    add_distant_candidates(problem, only(problem, true), fits)
    log_evidence = evidence(fits.values())
    assert log_evidence[mirrored] == pytest.approx(log_evidence[true], abs=0.1)


def test_neighbours_of_a_better_distant_location_are_fitted_too(nominal):
    """Of a search that went astray, measured where left and right differ."""
    true = with_point_masses(nominal, {TRUE: ADDED_KG})
    problem = problem_of(nominal, measured(true, labels(outputs=("8:+z",), inputs=("10:+z",))), ("added_mass",))
    ranking = only(problem, MIRRORED)
    fits = by_key(ranking)
    add_distant_candidates(problem, ranking, fits)
    log_evidence = evidence(fits.values())
    assert max(log_evidence, key=log_evidence.get) == TRUE
    assert {TRUE - 1, TRUE + 1} <= log_evidence.keys()


def test_the_next_neighbour_is_that_of_the_best_fit_that_has_one(symmetric):
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
    """So little mass that all locations near the true one explain alike."""
    monkeypatch.setattr(ties, "add_distant_candidates", lambda *_: 0)
    true = with_point_masses(nominal, {TRUE: LITTLE_KG})
    return problem_of(nominal, measured(true, labels(outputs=("8:+z",), inputs=("10:+z",))), ("added_mass",))


def as_if_found(ranking):
    """As if it explained much of what the nominal model leaves."""
    return replace(ranking, base=replace(ranking.base, log_evidence=ranking.base.log_evidence - 1e3))


def test_the_ambiguity_set_extends_along_a_flat_valley(valley):
    """Of a search that found one end of it."""
    ranking = rescore_ambiguity_set(valley, as_if_found(only(valley, ASTRAY, ASTRAY + 1, added_kg=LITTLE_KG)))
    assert evidence(ranking.fits)[TRUE] > ranking.best.log_evidence - 1


def test_the_number_of_rescored_neighbours_is_limited(valley, monkeypatch):
    monkeypatch.setattr(ties, "MAX_NEIGHBOURS", 1)
    assert (
        len(rescore_ambiguity_set(valley, as_if_found(only(valley, ASTRAY, ASTRAY + 1, added_kg=LITTLE_KG))).fits)
        == 2 + 1
    )


def test_what_was_not_rescored_is_no_candidate(valley, monkeypatch):
    monkeypatch.setattr(ties, "CANDIDATES_PER_EFFECT", 2)
    monkeypatch.setattr(ties, "MAX_NEIGHBOURS", 0)
    alike = only(valley, TRUE - 1, TRUE, TRUE + 1, added_kg=LITTLE_KG)
    assert alike.fits[2].log_evidence > alike.fits[0].log_evidence - ties.AMBIGUOUS
    ranking = rescore_ambiguity_set(valley, alike)
    assert [fit.log_evidence > ranking.fits[0].log_evidence - ties.AMBIGUOUS for fit in ranking.fits] == [
        True,
        True,
        False,
    ]


def test_no_neighbours_are_added_to_what_explains_nothing(valley):
    assert len(rescore_ambiguity_set(valley, only(valley, ASTRAY, ASTRAY + 1, added_kg=LITTLE_KG)).fits) == 2


@pytest.mark.parametrize(("tried", "first"), [(2, "grounded_spring"), (0, "coupling_spring")])
def test_imitators_are_rescored_at_the_location_of_the_best(nominal, monkeypatch, tried, first):
    """A search that found a spring to a node beside the clamped end, which hardly moves."""
    monkeypatch.setattr(ties, "add_distant_candidates", lambda *_: 0)
    monkeypatch.setattr(ties, "MAX_NEIGHBOURS", 0)
    monkeypatch.setattr(ties, "MAX_IMITATOR_ROUNDS", tried)
    true = with_springs(nominal, {parse_dof(f"{TRUE}:+z"): SPRING_N_M})
    frfs = measured(true, labels(outputs=("8:+z",), inputs=("10:+z",)))
    problem = problem_of(nominal, frfs, ("grounded_spring", "coupling_spring"))
    effect = problem.effects["coupling_spring"]
    locations = effect.locations(problem.context)
    wrong = [location for location in locations if location.nodes in ((2, TRUE), (2, TRUE + 1))]
    components = [Component(effect=effect, location=location, n_locations=len(locations)) for location in wrong]
    fits = sorted(
        (problem.fit((component,), np.array([SPRING_N_M])) for component in components),
        key=lambda fit: -fit.log_evidence,
    )
    ranking = rescore_ambiguity_set(problem, Ranking(base=fit_null_model(problem), fits=tuple(fits), n_tried=0))
    assert ranking.best.hypothesis.components[-1].effect.name == first


def test_a_pair_of_nodes_is_as_likely_however_few_are_listed(symmetric, monkeypatch):
    effect = coupling_spring.CouplingSpring()
    context, location = symmetric.context, Location(nodes=(5, 17), directions=("z",))

    def prior():
        n_locations = len(effect.locations(context))
        return n_locations, effect.log_prior(context, location, np.array([1e3])) - np.log(n_locations)

    n_all, expected = prior()
    monkeypatch.setattr(coupling_spring, "MAX_IN_A_ROW", 9)
    n_few, log_prior = prior()
    assert n_few < n_all / 4
    assert log_prior == pytest.approx(expected, abs=0.4)
