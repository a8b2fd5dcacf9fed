"""Fits that cannot come near the best are stopped early, and equal values are solved for once."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import linalg

from diagnosed import BAND_HZ, beam, measured, observed
from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.evidence import hypothesis as hypotheses
from frf_ipz.diagnosis.evidence.inference_problem import pose_problem
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.diagnosis.search import component_search as search
from frf_ipz.diagnosis.search import neighbourhood_search as climb
from frf_ipz.diagnosis.search.global_scan import list_components
from frf_ipz.fe.changes import with_point_masses
from frf_ipz.numerics.pencils import generalised_eigh

MASS_KG = 0.02
START = np.array([MASS_KG / 1.1])
DIGITS = 1e-12


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    nominal = beam(tmp_path_factory.mktemp("beam"))
    effects = {"added_mass": shipped_effects()["added_mass"]}
    source = split_data(observed(measured(with_point_masses(nominal, {12: MASS_KG}))))
    return pose_problem(nominal, source, BAND_HZ, DiagnoseOptions(), effects)


def mass_at(problem, node):
    components = list_components(problem.effects["added_mass"], problem.context)
    return next(component for component in components if component.location == {"nodes": [node]})


def test_a_fit_at_a_wrong_location_is_stopped_above_the_limit(problem):
    right = problem.fit((mass_at(problem, 12),), START)
    wrong = (mass_at(problem, 16),)
    to_the_end = problem.fit(wrong, START)
    given_up = problem.fit(wrong, START, cost_limit=climb.find_cost_limit([right]))
    assert to_the_end.cost > 4 * climb.find_cost_limit([right])
    assert given_up.cost > to_the_end.cost
    assert not given_up.has_converged


def test_the_limit_does_not_stop_a_fit_on_its_way_below_it(problem):
    right = problem.fit((mass_at(problem, 12),), START)
    limited = problem.fit((mass_at(problem, 12),), START, cost_limit=climb.find_cost_limit([right]))
    assert limited.cost == right.cost


def a_fit(cost, *, explains_nearly_all, has_converged=True):
    return SimpleNamespace(
        cost=cost,
        log_evidence=-cost,
        explains_nearly_all=explains_nearly_all,
        is_far_off=False,
        has_converged=has_converged,
    )


def test_the_limit_is_near_the_best_if_that_explains_nearly_all():
    worse = a_fit(9000.0, explains_nearly_all=False)
    assert climb.find_cost_limit([]) == np.inf
    assert climb.find_cost_limit([worse]) == np.inf
    assert climb.find_cost_limit([worse, a_fit(100.0, explains_nearly_all=True)]) == pytest.approx(500.0)


def test_only_a_fit_below_the_limit_is_continued():
    continued = []
    problem = SimpleNamespace(fit_to_convergence=lambda fit: continued.append(fit) or fit)
    best = a_fit(100.0, explains_nearly_all=True, has_converged=False)
    close, distant = (a_fit(cost, explains_nearly_all=False, has_converged=False) for cost in (300.0, 9000.0))
    search.rank_fits(problem, [best, distant])
    search.rank_fits(problem, [best, close])
    assert continued == [best, best, close]


def test_the_modes_of_the_same_values_are_solved_for_once(problem, monkeypatch):
    solved = []
    modify_structure = hypotheses.modify_structure
    monkeypatch.setattr(hypotheses, "modify_structure", lambda *args: solved.append(args) or modify_structure(*args))
    hypothesis = problem.make_hypothesis((mass_at(problem, 12),))
    nothing = np.zeros(hypothesis.nuisance_prior.size)
    scattered = nothing.copy()
    scattered[hypothesis.nuisance_prior.frequency_indices[-1]] = 1.0
    first, second = hypothesis.modes(START, nothing), hypothesis.modes(START, scattered)
    assert len(solved) == 1
    assert not np.allclose(first.squares, second.squares, rtol=DIGITS)
    assert_allclose(
        problem.make_hypothesis(hypothesis.components).modes(START, scattered).squares, second.squares, rtol=DIGITS
    )
    for factor in range(1, hypotheses.N_REMEMBERED + 1):
        hypothesis.modes((1 + factor) * START, nothing)
    before = len(solved)
    hypothesis.modes(START, nothing)  # was forgotten
    assert len(solved) == before + 1


def test_a_generalised_eigenproblem_is_scipys():
    rng = np.random.default_rng(3)
    first, second = (part @ part.T for part in rng.standard_normal((2, 9, 9)))
    values, vectors = generalised_eigh(first, second)
    assert_allclose(values, linalg.eigvalsh(first, second), rtol=1e-9)
    assert_allclose(vectors.T @ second @ vectors, np.eye(9), atol=1e-9)
    with pytest.raises(linalg.LinAlgError):
        generalised_eigh(first, -second)
