"""Candidates of an ambiguity set are rescored with the model errors that are likely."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from diagnosed import beam, measured, problem_of
from frf_ipz.diagnosis.evidence.inference_problem import make_data
from frf_ipz.diagnosis.measured.transfer_functions import select_points
from frf_ipz.diagnosis.search import ambiguity_set as ties
from frf_ipz.diagnosis.search.ambiguity_set import rescore_ambiguity_set
from frf_ipz.diagnosis.search.component_search import fit_null_model, search_component
from frf_ipz.fe.changes import with_point_masses

LITTLE_KG, THICKER = 2e-4, 1.0015  # the thickness takes frequencies 0.15 % off, more than a part of 0.1 %
QUIET = 1e-5  # noise over FRFs


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    return beam(tmp_path_factory.mktemp("beam"))


def test_a_location_that_needs_more_of_the_tolerances_falls_behind_where_the_model_is_better(nominal):
    problem = problem_of(nominal, measured(with_point_masses(nominal, {12: LITTLE_KG})), ("added_mass",))
    ranking = search_component(problem, fit_null_model(problem))
    settled = rescore_ambiguity_set(problem, ranking)
    assert settled.best.hypothesis.components[0].location == {"nodes": [12]}
    assert settled.best.log_evidence == pytest.approx(ranking.best.log_evidence)
    assert ahead(ranking) < 5  # nats
    assert ahead(settled) > 2 * ahead(ranking)


def test_a_model_that_is_ten_times_better_than_stated_distinguishes_still_more(nominal, monkeypatch):
    problem = problem_of(nominal, measured(with_point_masses(nominal, {12: LITTLE_KG})), ("added_mass",))
    ranking = search_component(problem, fit_null_model(problem))
    finely = rescore_ambiguity_set(problem, ranking)
    monkeypatch.setattr(ties, "PARTS", (0.3,))
    assert ahead(finely) > ahead(rescore_ambiguity_set(problem, ranking)) + 1  # nats


def test_locations_stay_ambiguous_where_the_model_needs_its_tolerances(nominal, tmp_path):
    true = with_point_masses(beam(tmp_path, thickness_m=0.005 * THICKER), {12: 2 * LITTLE_KG})
    problem = problem_of(nominal, measured(true), ("added_mass",))
    ranking = search_component(problem, fit_null_model(problem))
    assert ahead(rescore_ambiguity_set(problem, ranking)) == pytest.approx(ahead(ranking), abs=0.5)


@pytest.mark.parametrize(("error", "expected"), [(0.0, 0.1), (3e-4, 0.3), (1e-3, 1.0)])
def test_errors_of_frfs_that_no_parameter_stands_for_are_as_large_as_the_best_explanation_says(
    nominal, error, expected
):
    """The tolerance is 0.1 %, half of which may be such errors."""
    true = with_point_masses(nominal, {12: LITTLE_KG})

    def wavy(frequency_hz):
        return 1 + error * np.sin(9 * np.log(frequency_hz))[:, None]

    problem = problem_of(nominal, measured(true, factors=wavy, noise=QUIET), ("added_mass",))
    best = search_component(problem, fit_null_model(problem)).best
    likely = ties._find_likeliest_errors(problem, best)
    floors = {1.0: problem.data} | {
        floor: make_data(problem.data.measured, problem.context.options, floor=floor) for floor in ties.FLOORS
    }
    (floor,) = (
        floor
        for floor, data in floors.items()
        if np.allclose(data.whitening.factors, likely.whitening.factors, rtol=1e-12)
    )
    assert floor == expected


@pytest.mark.parametrize("shared", [0.0, 0.02])
def test_the_log_density_of_whitening_is_that_of_a_normal_distribution(nominal, shared):
    """FRFs at one excited point share the noise of the force."""
    problem = problem_of(nominal, measured(nominal), ())
    sparse = select_points(problem.data.measured, np.arange(0, len(problem.data.measured.s), 40))
    sparse = replace(sparse, shared_errors=(np.full((len(sparse.s), 1), shared),))
    errors = sparse.size * 1e-3 * np.exp(1j * np.arange(sparse.values.size)).reshape(sparse.values.shape)
    approximate, exact = [], []
    for floor in (1.0, 0.3):
        white = make_data(sparse, problem.context.options, floor=floor).whitening
        roots = [np.linalg.inv(factor) for factor in white.factors]
        force = (sparse.values_above_noise * sparse.shared_errors[0]).T.ravel()
        covariance = linalg.block_diag(*(root @ root.conj().T for root in roots)) + np.outer(force, force.conj())
        approximate.append(white.log_density - 0.5 * np.sum(white(errors) ** 2))
        exact.append(log_normal(errors.T.ravel(), covariance))
    assert approximate[1] - approximate[0] == pytest.approx(exact[1] - exact[0])


def log_normal(errors, covariance):
    """Logarithm of a circular complex normal density, up to a constant."""
    return -np.linalg.slogdet(covariance)[1] - (errors.conj() @ np.linalg.solve(covariance, errors)).real


def ahead(ranking):
    """Log Bayes factor of the best location over the next."""
    return ranking.fits[0].log_evidence - ranking.fits[1].log_evidence
