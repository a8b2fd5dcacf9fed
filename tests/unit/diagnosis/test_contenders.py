"""Places that explain a test as well as the best one that a search came to."""

import numpy as np
import pytest

from diagnosed import beam, bench_of, labels, measured
from frf_ipz.diagnosis.catalogue.effect import Place
from frf_ipz.diagnosis.catalogue.supports import coupling_spring
from frf_ipz.diagnosis.search import contenders
from frf_ipz.diagnosis.search.contenders import fit_contenders
from frf_ipz.diagnosis.search.hypothesis import Cause
from frf_ipz.diagnosis.search.search import Ranking, fit_nothing
from frf_ipz.diagnosis.search.ties import settle_ties
from frf_ipz.fe.changes import with_point_masses

NODES, TRUE, MIRRORED, ADDED_KG = 25, 6, 20, 2e-3
MIDDLE = labels(outputs=("13:+z",), inputs=("13:+z",))  # a sensor and blows that do not tell left from right


@pytest.fixture(scope="module")
def symmetric(tmp_path_factory):
    """A beam clamped at both ends, looked at in its middle."""
    nominal = beam(tmp_path_factory.mktemp("beam"), elements=NODES - 1, right="clamped")
    return bench_of(nominal, measured(with_point_masses(nominal, {TRUE: ADDED_KG}), MIDDLE), ("added_mass",))


def only(bench, *nodes):
    """A ranking of a search that came to some nodes only."""
    effect, null = bench.effects["added_mass"], fit_nothing(bench)
    places = {place.location["nodes"][0]: place for place in effect.places(bench.specimen)}
    causes = [Cause(effect=effect, place=places[node], n_places=len(places)) for node in nodes]
    return Ranking(base=null, fits=tuple(bench.fit((cause,), np.array([ADDED_KG])) for cause in causes), n_tried=0)


def nodes_of(ranking, nats=np.inf):
    least = ranking.fits[0].log_evidence - nats
    return {fit.hypothesis.causes[-1].place.location["nodes"][0] for fit in ranking.fits if fit.log_evidence > least}


def test_what_explains_as_well_on_the_far_side_is_found(symmetric):
    found = fit_contenders(symmetric, only(symmetric, TRUE))
    assert {TRUE, MIRRORED} <= nodes_of(found, nats=1.0)
    evidence = {fit.hypothesis.causes[-1].place.location["nodes"][0]: fit.log_evidence for fit in found.fits}
    assert evidence[MIRRORED] == pytest.approx(evidence[TRUE], abs=0.1)


def test_places_beside_all_that_is_nearly_as_good_are_fitted(symmetric, monkeypatch):
    monkeypatch.setattr(contenders, "FAR", 0)
    found = nodes_of(fit_contenders(symmetric, only(symmetric, TRUE, MIRRORED)))
    assert {TRUE - 1, TRUE, TRUE + 1, MIRRORED - 1, MIRRORED, MIRRORED + 1} <= found


def test_no_more_places_are_fitted_than_can_be_waited_for(symmetric, monkeypatch):
    monkeypatch.setattr(contenders, "FAR", 0)
    monkeypatch.setattr(contenders, "TIE", np.inf)
    monkeypatch.setattr(contenders, "MOST", 5)
    assert len(fit_contenders(symmetric, only(symmetric, TRUE)).fits) == 1 + 5


def test_ties_are_settled_among_all_contenders(symmetric):
    assert {TRUE, MIRRORED} <= nodes_of(settle_ties(symmetric, only(symmetric, TRUE)), nats=3.0)


def test_a_pair_of_nodes_is_as_likely_however_few_are_listed(symmetric, monkeypatch):
    effect = coupling_spring.CouplingSpring()
    specimen, place = symmetric.specimen, Place(key=(5, 17, "z"), location={"nodes": [5, 17]})

    def prior():
        n_places = len(effect.places(specimen))
        return n_places, effect.log_prior(specimen, place, np.array([1e3])) - np.log(n_places)

    n_all, expected = prior()
    monkeypatch.setattr(coupling_spring, "MOST_IN_A_ROW", 9)
    n_few, found = prior()
    assert n_few < n_all / 4
    assert found == pytest.approx(expected, abs=0.4)
