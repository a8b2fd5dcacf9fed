"""The linear Gaussian step, its draws and its evidence, against what they are by definition."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal

from frf_ipz.updating.gaussian import (
    draw_posterior,
    most_contradicted,
    most_likely_scales,
    slack_by_discrepancy,
    solve_step,
)
from frf_ipz.updating.parameters import PriorTerm

DRAWS = 40_000
SAMPLED = 0.03  # of the largest variance: four standard deviations of a sample covariance of that many draws


@pytest.fixture
def problem():
    rng = np.random.default_rng(0)
    sensitivity = rng.standard_normal((3, 5))
    noise = np.diag([0.1, 0.2, 0.05])
    return sensitivity, rng.standard_normal(3), noise


def posterior(sensitivity, data, noise):
    information = np.eye(sensitivity.shape[1]) + sensitivity.T @ np.linalg.solve(noise, sensitivity)
    covariance = np.linalg.inv(information)
    return covariance @ sensitivity.T @ np.linalg.solve(noise, data), covariance


def test_the_step_is_the_posterior_mean(problem):
    sensitivity, data, noise = problem
    step = solve_step(sensitivity, data, noise)
    mean, covariance = posterior(*problem)
    assert_allclose(step.mean, mean, rtol=1e-9)
    error = data - sensitivity @ mean
    assert_allclose(step.misfit, error @ np.linalg.solve(noise, error), rtol=1e-9)
    assert_allclose(step.n_determined, np.trace(np.eye(5) - covariance), rtol=1e-9)


def test_draws_have_the_posterior_mean_and_covariance(problem):
    sensitivity, data, noise = problem
    step = solve_step(sensitivity, data, noise)
    members = draw_posterior(step, sensitivity, noise, np.random.default_rng(1), DRAWS)
    mean, covariance = posterior(*problem)
    assert np.abs(members.mean(0) - mean).max() < SAMPLED
    assert np.abs(np.cov(members.T) - covariance).max() < SAMPLED * covariance.max()


def test_the_most_likely_scales_have_the_largest_evidence():
    rng = np.random.default_rng(2)
    parts = [rng.standard_normal((12, 4)), rng.standard_normal((12, 6))]
    terms = [PriorTerm(name=str(k), root=np.eye(part.shape[1]), std=0.5) for k, part in enumerate(parts)]
    noise = 0.01 * np.eye(12)
    data = 3.0 * parts[0] @ rng.standard_normal(4) + 0.1 * parts[1] @ rng.standard_normal(6)

    def evidence(scales):
        total = noise + sum(s**2 * part @ part.T for s, part in zip(scales, parts, strict=True))
        believed = sum(0.5 * np.log(s / 0.5) ** 2 for s in scales)
        return multivariate_normal(np.zeros(12), total).logpdf(data) - believed

    scales = most_likely_scales(parts, terms, data, noise, np.array([0.5, 0.5]))
    best = evidence(scales)
    for factor in (0.9, 1.1):
        assert evidence(scales * [factor, 1.0]) < best
        assert evidence(scales * [1.0, factor]) < best
    assert scales[0] > 3 * scales[1]


def test_a_fixed_scale_stays():
    parts = [np.eye(4), np.ones((4, 1))]
    terms = [
        PriorTerm(name="sure", root=np.eye(4), std=0.2, scale_uncertainty=0.0),
        PriorTerm(name="open", root=np.eye(1), std=0.2),
    ]
    scales = most_likely_scales(parts, terms, 5.0 * np.ones(4), 1e-4 * np.eye(4), np.array([0.2, 0.2]))
    assert scales[0] == 0.2
    assert scales[1] > 1.0


def test_slack_grows_until_the_misfit_is_that_of_noise():
    """The discrepancy principle: two data that no parameter tells apart disagree by a hundred deviations."""
    sensitivity, noise, slack = np.ones((2, 1)), 1e-4 * np.eye(2), np.full(2, 1e-3)
    data = np.array([1.0, 2.0])
    factor = slack_by_discrepancy(sensitivity, data, noise, slack, 1.0)
    met = solve_step(sensitivity, data, noise + np.diag((factor * slack) ** 2)).misfit
    before = solve_step(sensitivity, data, noise + np.diag((factor / 3 * slack) ** 2)).misfit
    assert met <= 2 < before


def test_slack_stays_where_data_agree():
    assert slack_by_discrepancy(np.eye(2), np.array([0.1, -0.2]), 0.01 * np.eye(2), np.full(2, 0.1), 0.7) == 0.7


def test_the_most_contradicted_datum_is_found():
    sensitivity, noise = np.ones((5, 1)), 1e-4 * np.eye(5)
    data = np.array([1.0, 1.01, 3.0, 0.99, 1.0])
    assert most_contradicted(sensitivity, data, noise, 6.0) == 2
    data[2] = 1.0
    assert most_contradicted(sensitivity, data, noise, 6.0) == -1


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_the_search_for_scales_stays_within_reason(size):
    """Data that nothing explains must not send it out of all numbers; warnings of overflow are errors."""
    rng = np.random.default_rng(4)
    parts = [1e-3 * rng.standard_normal((9, 2)), rng.standard_normal((9, 3)), 1e-5 * np.eye(9)]
    terms = [PriorTerm(name=str(k), root=np.eye(part.shape[1]), std=0.1) for k, part in enumerate(parts)]
    scales = most_likely_scales(parts, terms, size * rng.standard_normal(9), 1e-16 * np.eye(9), np.full(3, 0.1))
    assert np.all(np.abs(np.log(scales / 0.1)) <= 6.0 + 1e-9)
