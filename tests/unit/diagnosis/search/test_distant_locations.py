"""A spring between two nodes, which softer and stiffer ones between other nodes imitate."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from diagnosed import beam, labels, measured, problem_of
from frf_ipz.diagnosis.catalogue.effects import coupling_spring
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.model.change import with_change
from frf_ipz.diagnosis.search import ambiguity_set as elsewhere
from frf_ipz.diagnosis.search.component_search import Ranking, fit_null_model
from frf_ipz.diagnosis.search.global_scan import scan_globally
from frf_ipz.diagnosis.search.robust_refinement import Start
from frf_ipz.diagnosis.verdict import decision
from frf_ipz.dofs import Dof
from frf_ipz.progress import silent

ENDS, WRONG = (6, 13), (7, 12)
STIFFNESS_N_M = 3e3
ROUGHLY, EXACTLY = 0.05, 0.01  # relative: amplitudes of the scan are a factor of two apart


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    nominal = beam(tmp_path_factory.mktemp("beam"), elements=24)
    motion = np.zeros(len(nominal.all_dofs))
    motion[[nominal.full_indices[Dof(node, "z")] for node in ENDS]] = 1.0, -1.0
    added = STIFFNESS_N_M * np.outer(motion, motion)
    true = replace(nominal, stiffness_all=sparse.csr_array(nominal.stiffness_all + added))
    return problem_of(nominal, measured(true, labels(outputs=("25:+z", "10:-z"))), ("coupling_spring",))


def nodes_of(component):
    return component.location.nodes


def test_a_global_scan_finds_values_closer_than_its_amplitudes_are_spaced(problem):
    best = scan_globally(problem, fit_null_model(problem))[0]
    assert nodes_of(best.component) == ENDS
    assert best.values[0] == pytest.approx(STIFFNESS_N_M, rel=ROUGHLY)


def test_a_global_scan_looks_between_the_locations_of_a_thinned_row(problem, monkeypatch):
    monkeypatch.setattr(coupling_spring, "MAX_IN_A_ROW", 12)
    locations = problem.effects["coupling_spring"].locations(problem.context)
    assert ENDS not in [location.nodes for location in locations]
    best = scan_globally(problem, fit_null_model(problem))[0]
    assert nodes_of(best.component) == ENDS


def test_a_location_that_needs_too_much_of_the_tolerances_gives_way_to_a_better_one(problem, monkeypatch):
    null = fit_null_model(problem)
    start = next(start for start in scan_globally(problem, null) if nodes_of(start.component) == WRONG)
    wrong = problem.fit((start.component,), start.values)
    assert wrong.explains_nearly_all
    monkeypatch.setattr(decision, "search_component", lambda *_, **__: Ranking(base=null, fits=(wrong,), n_tried=0))
    monkeypatch.setattr(decision, "search_pair", lambda *_: Ranking(base=wrong, fits=(), n_tried=0))
    decided = decision.decide(problem, silent)
    assert decided.verdict == "explained"
    (component,) = decided.final.hypothesis.components
    assert nodes_of(component) == ENDS
    assert decided.final.values[0] == pytest.approx(STIFFNESS_N_M, rel=EXACTLY)


TRUE, ASTRAY, RESONATOR = 13, 14, np.array([0.02, 150.0, 0.02])  # nodes; kg, Hz, 1


def at_node(problem, node):
    effect = problem.effects["attached_resonator"]
    location = next(location for location in effect.locations(problem.context) if location == {"nodes": [node]})
    return Component(effect=effect, location=location, n_locations=1)


def test_a_location_is_fitted_from_the_best_values_where_a_global_scan_finds_none(tmp_path_factory, monkeypatch):
    nominal = beam(tmp_path_factory.mktemp("beam"), elements=24)
    blank = problem_of(nominal, measured(nominal), ("attached_resonator",))
    component = at_node(blank, TRUE)
    true = with_change(nominal, component.effect.build(blank.context, component.location)(RESONATOR))
    problem = problem_of(nominal, measured(true), ("attached_resonator",))
    wrong = problem.fit((at_node(problem, ASTRAY),), RESONATOR)
    lost = Start(component=at_node(problem, TRUE), values=np.array([1e-4, 900.0, 0.5]), cost=0.0)
    monkeypatch.setattr(elsewhere, "scan_globally", lambda *_: [lost])
    monkeypatch.setattr(elsewhere, "search_neighbourhoods", lambda *_: None)
    ranking = elsewhere.fit_distant_locations(problem, Ranking(base=fit_null_model(problem), fits=(wrong,), n_tried=0))
    assert ranking.best.hypothesis.components[-1].location == {"nodes": [TRUE]}
    assert ranking.best.values[:2] == pytest.approx(RESONATOR[:2], rel=EXACTLY)
