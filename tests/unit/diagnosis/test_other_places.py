"""A spring between two nodes, which softer and stiffer ones between other nodes imitate."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from diagnosed import beam, bench_of, labels, measured
from frf_ipz.diagnosis.catalogue.effects import coupling_spring
from frf_ipz.diagnosis.evidence.hypothesis import Cause
from frf_ipz.diagnosis.model.change import with_change
from frf_ipz.diagnosis.search import ambiguity_set as elsewhere
from frf_ipz.diagnosis.search.component_search import Ranking, fit_nothing
from frf_ipz.diagnosis.search.global_scan import wide_search
from frf_ipz.diagnosis.search.robust_refinement import Start
from frf_ipz.diagnosis.verdict import decision
from frf_ipz.dofs import Dof
from frf_ipz.progress import silent

ENDS, WRONG = (6, 13), (7, 12)
STIFFNESS_N_M = 3e3
ROUGHLY, EXACTLY = 0.05, 0.01  # relative: amplitudes of the first look are a factor of two apart


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    nominal = beam(tmp_path_factory.mktemp("beam"), elements=24)
    motion = np.zeros(len(nominal.all_dofs))
    motion[[nominal.full_indices[Dof(node, "z")] for node in ENDS]] = 1.0, -1.0
    added = STIFFNESS_N_M * np.outer(motion, motion)
    true = replace(nominal, stiffness_all=sparse.csr_array(nominal.stiffness_all + added))
    return bench_of(nominal, measured(true, labels(outputs=("25:+z", "10:-z"))), ("coupling_spring",))


def nodes_of(cause):
    return tuple(cause.place.location["nodes"])


def test_a_wide_search_finds_values_closer_than_its_amplitudes_are_apart(bench):
    best = wide_search(bench, fit_nothing(bench))[0]
    assert nodes_of(best.cause) == ENDS
    assert best.values[0] == pytest.approx(STIFFNESS_N_M, rel=ROUGHLY)


def test_a_wide_search_looks_between_the_places_of_a_thinned_row(bench, monkeypatch):
    monkeypatch.setattr(coupling_spring, "MOST_IN_A_ROW", 12)
    places = bench.effects["coupling_spring"].places(bench.specimen)
    assert ENDS not in [tuple(place.location["nodes"]) for place in places]
    best = wide_search(bench, fit_nothing(bench))[0]
    assert nodes_of(best.cause) == ENDS


def test_a_place_that_needs_too_much_of_the_tolerances_gives_way_to_another(bench, monkeypatch):
    null = fit_nothing(bench)
    start = next(start for start in wide_search(bench, null) if nodes_of(start.cause) == WRONG)
    wrong = bench.fit((start.cause,), start.values)
    assert wrong.is_nearly_all
    monkeypatch.setattr(decision, "search", lambda *_: Ranking(base=null, fits=(wrong,), n_tried=0))
    monkeypatch.setattr(decision, "search_second", lambda *_: Ranking(base=wrong, fits=(), n_tried=0))
    found = decision.decide(bench, silent)
    assert found.verdict == "explained"
    (cause,) = found.final.hypothesis.causes
    assert nodes_of(cause) == ENDS
    assert found.final.values[0] == pytest.approx(STIFFNESS_N_M, rel=EXACTLY)


TRUE, ASTRAY, RESONATOR = 13, 14, np.array([0.02, 150.0, 0.02])  # nodes; kg, Hz, 1


def at_node(bench, node):
    effect = bench.effects["attached_resonator"]
    place = next(place for place in effect.places(bench.specimen) if place.location == {"nodes": [node]})
    return Cause(effect=effect, place=place, n_places=1)


def test_another_place_is_fitted_from_the_best_values_where_a_wide_search_finds_none(tmp_path_factory, monkeypatch):
    nominal = beam(tmp_path_factory.mktemp("beam"), elements=24)
    one = bench_of(nominal, measured(nominal), ("attached_resonator",))
    cause = at_node(one, TRUE)
    true = with_change(nominal, cause.effect.build(one.specimen, cause.place)(RESONATOR))
    bench = bench_of(nominal, measured(true), ("attached_resonator",))
    wrong = bench.fit((at_node(bench, ASTRAY),), RESONATOR)
    lost = Start(cause=at_node(bench, TRUE), values=np.array([1e-4, 900.0, 0.5]), cost=0.0)
    monkeypatch.setattr(elsewhere, "wide_search", lambda *_: [lost])
    monkeypatch.setattr(elsewhere, "climb_all", lambda *_: None)
    found = elsewhere.look_elsewhere(bench, Ranking(base=fit_nothing(bench), fits=(wrong,), n_tried=0))
    assert found.best.hypothesis.causes[-1].place.location == {"nodes": [TRUE]}
    assert found.best.values[:2] == pytest.approx(RESONATOR[:2], rel=EXACTLY)
