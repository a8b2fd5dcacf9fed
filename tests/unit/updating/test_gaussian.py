"""The linear Gaussian step, its draws and its evidence, against what they are by definition."""

import tracemalloc

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal

from frf_ipz.updating.gaussian import (
    SIZES,
    _HeldSlack,
    contradicted,
    distance_to_optimum,
    draw_posterior,
    gain_of_further_terms,
    linearise,
    log_evidence,
    most_likely_scales,
    solve_step,
    step_by_discrepancy,
    with_more_noise,
)
from frf_ipz.updating.parameters import PriorTerm
from frf_ipz.updating.target_noise import TargetNoise, noise_of

DRAWS = 40_000
ROUNDING = 1e-9  # relative, of matrices of ten rows
SAMPLED = 0.03  # of the largest variance: four standard deviations of a sample covariance of that many draws


@pytest.fixture
def problem():
    rng = np.random.default_rng(0)
    sensitivity = rng.standard_normal((3, 5))
    return sensitivity, rng.standard_normal(3), np.diag([0.1, 0.2, 0.05])


@pytest.fixture
def many():
    """More data than parameters, in blocks, with errors that all of them share."""
    rng = np.random.default_rng(7)
    blocks = tuple(root @ root.T + 0.1 * np.eye(3) for root in rng.standard_normal((4, 3, 3)))
    return (
        rng.standard_normal((12, 5)),
        rng.standard_normal(12),
        TargetNoise(common=rng.standard_normal((12, 2)), blocks=blocks),
    )


def whole(noise):
    matrix = noise.common @ noise.common.T
    for part, block in noise.parts():
        matrix[np.ix_(part, part)] += block
    return matrix


def posterior(sensitivity, data, noise):
    information = np.eye(sensitivity.shape[1]) + sensitivity.T @ np.linalg.solve(noise, sensitivity)
    covariance = np.linalg.inv(information)
    return covariance @ sensitivity.T @ np.linalg.solve(noise, data), covariance


def test_the_step_is_the_posterior_mean(problem):
    sensitivity, data, noise = problem
    step = solve_step(linearise([sensitivity], data, noise_of(noise)), np.ones(1))
    mean, covariance = posterior(*problem)
    assert_allclose(step.mean, mean, rtol=1e-9)
    error = data - sensitivity @ mean
    assert_allclose(step.misfit, error @ np.linalg.solve(noise, error), rtol=1e-9)
    assert_allclose(step.n_determined, np.trace(np.eye(5) - covariance), rtol=1e-9)


def test_shared_errors_blocks_and_slack_are_those_of_the_whole_matrix(many):
    sensitivity, data, noise = many
    slack, factor = np.linspace(0.1, 2.0, len(data)), 0.7
    matrix = whole(noise) + np.diag((factor * slack) ** 2)
    linear = linearise([sensitivity[:, :2], sensitivity[:, 2:]], data, noise, slack)
    step = solve_step(linear, np.ones(2), factor)
    mean, covariance = posterior(sensitivity, data, matrix)
    assert_allclose(step.mean, mean, rtol=1e-9)
    error = data - sensitivity @ mean
    assert_allclose(step.misfit, error @ np.linalg.solve(matrix, error), rtol=1e-9)
    assert_allclose(linear.square(error, factor), step.misfit, rtol=1e-9)
    assert_allclose(step.n_determined, np.trace(np.eye(5) - covariance), rtol=1e-9)
    assert_allclose(np.concatenate([rows for _, rows in linear.sensitivity(np.ones(2))]), sensitivity, rtol=1e-9)


def test_the_gain_of_further_parameters_is_that_of_the_whole_covariance(many):
    sensitivity, data, noise = many
    slack, factor, scales = np.linspace(0.1, 2.0, len(data)), 0.7, np.array([0.4, 1.3])
    parts = [sensitivity[:, :2], sensitivity[:, 2:]]
    further = np.random.default_rng(4).standard_normal((len(data), 3))
    matrix = whole(noise) + np.diag((factor * slack) ** 2)
    matrix += sum(scale**2 * part @ part.T for scale, part in zip(scales, parts, strict=True))
    before = multivariate_normal(cov=matrix).logpdf(data)
    gains = [multivariate_normal(cov=matrix + s**2 * further @ further.T).logpdf(data) - before for s in SIZES]
    for combining in (False, True):
        linear = linearise(parts, data, noise, slack, scales=scales, combining=combining)
        assert_allclose(gain_of_further_terms(linear, further, scales, factor), max(gains), rtol=1e-7)


def test_errors_are_drawn_with_the_cholesky_factor_of_the_whole_matrix(many):
    noise = many[2]
    white = np.random.default_rng(3).standard_normal((4, 12))
    assert_allclose(noise.draw(white), white @ np.linalg.cholesky(whole(noise)).T, rtol=1e-9)


def test_a_matrix_is_split_into_its_blocks(many):
    noise = many[2]
    blocks = noise_of(whole(TargetNoise(common=np.zeros((12, 0)), blocks=noise.blocks))).blocks
    assert [len(block) for block in blocks] == [3, 3, 3, 3]
    assert_allclose(np.array(blocks), np.array(noise.blocks))


def held(count):
    """A term whose standard deviation is known."""
    return PriorTerm(name="held", root=np.eye(count), std=1.0, scale_uncertainty=0.0)


def test_draws_have_the_posterior_mean_and_covariance(problem):
    sensitivity, data, noise = problem
    linear, terms = linearise([sensitivity], data, noise_of(noise)), [held(sensitivity.shape[1])]
    members = draw_posterior(linear, terms, np.ones(1), noise_of(noise), np.random.default_rng(1), DRAWS, factor=0.0)
    mean, covariance = posterior(*problem)
    assert np.abs(members.mean(0) - mean).max() < SAMPLED
    assert np.abs(np.cov(members.T) - covariance).max() < SAMPLED * covariance.max()


def test_draws_leave_open_what_the_data_leave_open_of_the_scales():
    """Two terms and few data: the mixture over a fine grid of both scales, by its evidence, is what draws must have."""
    rng = np.random.default_rng(12)
    parts = [rng.standard_normal((5, 2)), rng.standard_normal((5, 3))]
    data, noise = rng.standard_normal(5), 0.3 * np.eye(5)
    terms = [PriorTerm(name=str(k), root=np.eye(part.shape[1]), std=0.5) for k, part in enumerate(parts)]
    linear = linearise(parts, data, noise_of(noise))
    scales = most_likely_scales(linear, terms, np.full(2, 0.5))
    members = draw_posterior(linear, terms, scales, noise_of(noise), np.random.default_rng(1), DRAWS // 8, factor=0.0)
    members = members * np.repeat(scales, [2, 3])
    logs = np.linspace(-5.0, 4.0, 31)
    precision = np.eye(2)
    weights, means, squares = [], [], []
    for first in logs:
        for second in logs:
            pull = np.array([first, second]) - np.log(0.5)
            sensitivity = np.hstack([np.exp(first) * parts[0], np.exp(second) * parts[1]])
            density = multivariate_normal(np.zeros(5), sensitivity @ sensitivity.T + noise).logpdf(data)
            weights.append(np.exp(density - 0.5 * pull @ precision @ pull))
            mean, covariance = posterior(sensitivity, data, noise)
            size = np.repeat(np.exp([first, second]), [2, 3])
            means.append(size * mean)
            squares.append(size**2 * (np.diagonal(covariance) + mean**2))
    mean = np.average(means, axis=0, weights=weights)
    std = np.sqrt(np.average(squares, axis=0, weights=weights) - mean**2)
    assert_allclose(members.mean(axis=0), mean, atol=0.1 * std.max())
    assert_allclose(members.std(axis=0), std, rtol=0.1)
    alone = posterior(np.hstack([scale * part for scale, part in zip(scales, parts, strict=True)]), data, noise)[1]
    assert np.abs(np.repeat(scales, [2, 3]) * np.sqrt(np.diagonal(alone)) / std - 1).max() > 0.2


def few_data_of_many_parameters(combining):
    """Twenty data of two hundred parameters in two terms."""
    rng = np.random.default_rng(21)
    parts = [rng.standard_normal((20, 120)), rng.standard_normal((20, 80))]
    terms = [PriorTerm(name=str(k), root=np.eye(part.shape[1]), std=1.0) for k, part in enumerate(parts)]
    return linearise(parts, rng.standard_normal(20), noise_of(0.1 * np.eye(20)), combining=combining), terms


def test_draws_are_the_same_whether_combinations_were_found_before_or_not():
    draws = []
    for combining in (True, False):
        linear, terms = few_data_of_many_parameters(combining)
        noise, rng = noise_of(0.1 * np.eye(20)), np.random.default_rng(1)
        draws.append(draw_posterior(linear, terms, np.ones(2), noise, rng, 200, factor=0.0))
    assert_allclose(*draws, rtol=0, atol=1e-3)  # of a standard deviation of the prior


def test_draws_take_the_memory_of_a_few_matrices_of_the_parameters():
    """Not that of one for each draw of the scales, of which there are fifty."""
    linear, terms = few_data_of_many_parameters(combining=False)
    noise, rng = noise_of(0.1 * np.eye(20)), np.random.default_rng(1)
    tracemalloc.start()
    draw_posterior(linear, terms, np.ones(2), noise, rng, 200, factor=0.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 12 * 200**2 * np.dtype(float).itemsize


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

    scales = most_likely_scales(linearise(parts, data, noise_of(noise)), terms, np.array([0.5, 0.5]))
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
    linear = linearise(parts, 5.0 * np.ones(4), noise_of(1e-4 * np.eye(4)))
    scales = most_likely_scales(linear, terms, np.array([0.2, 0.2]))
    assert scales[0] == 0.2
    assert scales[1] > 1.0


def test_the_most_likely_slack_has_the_largest_evidence(many):
    """Beside two scales, with errors in common and blocks: against the density of the whole covariance."""
    sensitivity, data, noise = many
    parts, slack = [sensitivity[:, :2], sensitivity[:, 2:]], np.linspace(0.1, 2.0, len(data))
    stds = (0.5, 0.5, 1.0)
    terms = [PriorTerm(name=str(k), root=np.eye(1), std=std) for k, std in enumerate(stds)]

    def evidence(scales):
        total = whole(noise) + np.diag((scales[2] * slack) ** 2)
        total += sum(s**2 * part @ part.T for s, part in zip(scales, parts, strict=False))
        believed = sum(0.5 * np.log(s / std) ** 2 for s, std in zip(scales, stds, strict=True))
        return multivariate_normal(np.zeros(12), total).logpdf(4 * data) - believed

    scales = most_likely_scales(linearise(parts, 4 * data, noise, slack), terms, np.array(stds))
    best = evidence(scales)
    for number in range(3):
        for factor in (0.9, 1.1):
            assert evidence(scales * np.where(np.arange(3) == number, factor, 1.0)) < best


def test_slack_grows_until_the_misfit_is_that_of_noise():
    """The discrepancy principle: two data that no parameter tells apart disagree by a hundred deviations."""
    sensitivity, noise, slack = np.ones((2, 1)), 1e-4 * np.eye(2), np.full(2, 1e-3)
    data = np.array([1.0, 2.0])
    linear, scales = linearise([sensitivity], data, noise_of(noise), slack), np.ones(1)
    step, factor = step_by_discrepancy(linear, scales, 1.0)
    assert step.misfit <= 2 < solve_step(linear, scales, factor / 3).misfit


def test_slack_stays_where_data_agree():
    linear = linearise([np.eye(2)], np.array([0.1, -0.2]), noise_of(0.01 * np.eye(2)), np.full(2, 0.1))
    assert step_by_discrepancy(linear, np.ones(1), 0.7)[1] == 0.7


def contradictions(linear, limit, *, std=10.0, most=4):
    return contradicted(linear, np.ones(1), limit=limit, excluded_std=std, most=most).tolist()


def test_the_most_contradicted_datum_is_found():
    sensitivity, noise = np.ones((5, 1)), 1e-4 * np.eye(5)
    data = np.array([1.0, 1.01, 3.0, 0.99, 1.0])
    assert contradictions(linearise([sensitivity], data, noise_of(noise)), 6.0) == [2]
    data[2] = 1.0
    assert contradictions(linearise([sensitivity], data, noise_of(noise)), 6.0) == []


def test_contradicted_data_are_those_of_the_whole_matrix_one_after_another(many):
    """Each is judged with more noise of those before it, with shared errors and blocks."""
    sensitivity, data, noise = many
    std, matrix = 10.0, sensitivity @ sensitivity.T + whole(noise)
    expected, distances = [], []
    for _ in range(3):
        inverse = np.linalg.inv(matrix)
        distance = np.abs(inverse @ data) / np.sqrt(np.diagonal(inverse))
        expected.append(int(np.argmax(distance)))
        distances.append(distance[expected[-1]])
        matrix[expected[-1], expected[-1]] += std**2
    linear = linearise([sensitivity], data, noise)
    assert contradictions(linear, 0.999 * min(distances), std=std, most=3) == expected
    assert contradictions(linear, 1.001 * distances[0], std=std) == []


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_the_search_for_scales_stays_within_reason(size):
    """Data that nothing explains must not send it out of all numbers; warnings of overflow are errors."""
    rng = np.random.default_rng(4)
    parts = [1e-3 * rng.standard_normal((9, 2)), rng.standard_normal((9, 3)), 1e-5 * np.eye(9)]
    terms = [PriorTerm(name=str(k), root=np.eye(part.shape[1]), std=0.1) for k, part in enumerate(parts)]
    linear = linearise(parts, size * rng.standard_normal(9), noise_of(1e-16 * np.eye(9)))
    scales = most_likely_scales(linear, terms, np.full(3, 0.1))
    assert np.all(np.abs(np.log(scales / 0.1)) <= 6.0 + 1e-9)


def test_scales_so_large_that_rounding_takes_the_prior_are_passed_over():
    """Data ten thousand times larger than expected, known to all digits, of fewer combinations than parameters."""
    rng = np.random.default_rng(3)
    sensitivity, data = rng.standard_normal((5, 8)), 1e4 * rng.standard_normal(5)
    terms = [PriorTerm(name="parameters", root=np.eye(8), std=0.5)]
    noise = noise_of(1e-20 * np.eye(5))
    linear = linearise([sensitivity], data, noise, scales=np.full(1, 0.5), combining=False)
    with pytest.raises(np.linalg.LinAlgError):
        linear.information(np.full(1, 1e3), 0.0)
    assert 10 < most_likely_scales(linear, terms, np.full(1, 0.5))[0] < 1e3


def test_what_no_datum_moves_keeps_its_prior_and_takes_no_column():
    """Sixty parameters of which the data see three combinations, and a fourth too faintly to matter."""
    rng = np.random.default_rng(5)
    seen = np.linalg.qr(rng.standard_normal((60, 4)))[0]
    sensitivity = rng.standard_normal((30, 4)) @ (np.array([1.0, 1.0, 1.0, 1e-5])[:, None] * seen.T)
    data, noise = rng.standard_normal(30), noise_of(0.1 * np.eye(30))
    linear = linearise([sensitivity], data, noise)
    step = solve_step(linear, np.ones(1))
    mean, covariance = posterior(sensitivity, data, 0.1 * np.eye(30))
    assert linear.parts[0].shape == (30, 3)
    assert_allclose(step.mean, mean, atol=1e-3)
    assert_allclose(step.n_determined, np.trace(np.eye(60) - covariance), rtol=1e-6)
    members = draw_posterior(linear, [held(60)], np.ones(1), noise, np.random.default_rng(1), 2000, factor=0.0)
    assert np.abs((members @ seen[:, 3]).std() - 1) < 0.1
    assert np.abs((members @ seen[:, 0]).std() - np.sqrt(seen[:, 0] @ covariance @ seen[:, 0])) < 0.05


def test_sums_over_the_data_serve_for_every_slack(many):
    sensitivity, data, noise = many
    linear = linearise([sensitivity], data, noise, np.ones(len(data)))
    factors = np.random.default_rng(8).permutation(np.geomspace(0.3, 3.0, 30))  # a search goes to and fro
    for factor in factors:
        root, right, square = linear.information(np.ones(1), float(factor))
        alone = linearise([sensitivity], data, noise, np.ones(len(data)))
        expected, its_right, its_square = alone.information(np.ones(1), float(factor))
        assert_allclose(root, expected, rtol=1e-3, atol=1e-3)
        assert_allclose(right, its_right, rtol=1e-3, atol=1e-3)
        assert_allclose(square, its_square, rtol=1e-3)
    assert len(linear.sums) < len(factors) / 2


def test_scales_and_slack_of_large_data_are_the_most_likely_ones():
    """Parameters explain nearly all: what a mixture of sums is off by must not count as evidence."""
    rng = np.random.default_rng(11)
    parts = [rng.standard_normal((400, 12)), rng.standard_normal((400, 30))]
    levels = np.geomspace(1e-6, 1e-2, 400)
    data = parts[0] @ (1e3 * rng.standard_normal(12)) + parts[1] @ (100 * rng.standard_normal(30))
    data += np.sqrt(levels + 0.02**2) * rng.standard_normal(400)
    terms = [PriorTerm(name=str(k), root=np.eye(part.shape[1]), std=100.0) for k, part in enumerate(parts)]
    terms.append(PriorTerm(name="slack", root=np.zeros((0, 0)), std=1.0, scale_uncertainty=3.0))
    linear = linearise(parts, data, noise_of(np.diag(levels)), np.ones(400))
    logs = np.log(most_likely_scales(linear, terms, np.array([100.0, 100.0, 1.0])))

    def loss(logs):
        variance = np.exp(2 * logs)
        matrix = np.diag(levels + variance[2])
        matrix += sum(size * part @ part.T for size, part in zip(variance, parts, strict=False))
        deviations = [(x - np.log(term.std)) / term.scale_uncertainty for x, term in zip(logs, terms, strict=True)]
        prior = np.sum(np.square(deviations)) / 2
        root = np.linalg.cholesky(matrix)
        return prior + np.sum(np.linalg.solve(root, data) ** 2) / 2 + np.log(np.diagonal(root)).sum()

    for step in np.vstack([0.05 * np.eye(3), -0.05 * np.eye(3)]):
        assert loss(logs + step) > loss(logs)


def test_the_distance_to_the_optimum_is_in_posterior_deviations(problem):
    sensitivity, data, noise = problem
    linear, scales = linearise([sensitivity], data, noise_of(noise)), np.ones(1)
    step = solve_step(linear, scales)
    mean, covariance = posterior(*problem)
    change = np.arange(5) / 10

    def distance(whitened):
        return distance_to_optimum(linear, step, scales, 0.0, whitened, data - sensitivity @ whitened)

    assert distance(mean) < 1e-7  # the root of a sum that is rounding
    assert_allclose(distance(mean + change), np.sqrt(change @ np.linalg.solve(covariance, change)), rtol=1e-9)


def test_groups_of_data_need_not_be_next_to_one_another(many):
    noise = many[2]
    matrix = whole(TargetNoise(common=np.zeros((12, 0)), blocks=noise.blocks))
    order = np.random.default_rng(6).permutation(12)
    turned = noise_of(matrix[np.ix_(order, order)])
    assert len(turned.blocks) == 4
    assert_allclose(whole(turned), matrix[np.ix_(order, order)])
    assert_allclose(turned.variance, np.diagonal(matrix)[order])
    sensitivity, data = many[0][order], many[1][order]
    step = solve_step(linearise([sensitivity], data, turned), np.ones(1))
    assert_allclose(step.mean, posterior(sensitivity, data, matrix[np.ix_(order, order)])[0], rtol=1e-9)


def test_more_noise_of_a_datum_is_that_of_its_block(many):
    sensitivity, data, noise = many
    more = noise.plus(5.0 * (np.arange(len(data)) == 7))
    changed, again = (
        with_more_noise(linearise([sensitivity], data, noise), more, np.array([7])),
        linearise([sensitivity], data, more),
    )
    for factor in (0.0, 0.7):
        first, second = (solve_step(linear, np.ones(1), factor) for linear in (changed, again))
        assert_allclose(first.mean, second.mean, rtol=1e-9)
        assert_allclose(first.misfit, second.misfit, rtol=1e-9)


def test_a_target_that_runs_off_leaves_the_others_their_information():
    """As a zero does that is about to meet another: its slope has no bound, and its square no place in a number."""
    rng = np.random.default_rng(5)
    sensitivity = 0.1 * rng.standard_normal((40, 60))
    sensitivity[0] *= 1e4
    noise = TargetNoise(common=np.zeros((40, 0)), blocks=(1e-12 * np.eye(40),))
    others = TargetNoise(common=np.zeros((39, 0)), blocks=(1e-12 * np.eye(39),))
    data = sensitivity @ rng.standard_normal(60)
    linear = linearise([sensitivity], data, noise)
    root, _, _ = linear.information(np.ones(1), 0.0)
    assert np.isfinite(root).all()
    without = linearise([sensitivity[1:]], data[1:], others)
    assert not without.rounding.any()
    assert set(np.flatnonzero(linear.rounding)) == {0}
    assert linear.rounding[0] < 1e-6 * np.sum(sensitivity[0] ** 2)
    changed = with_more_noise(linear, noise.plus(0.01 * (np.arange(40) == 3)), np.array([3]))
    assert np.isfinite(changed.information(np.ones(1), 0.0)[0]).all()


def test_the_evidence_at_one_slack_is_that_of_the_whole_information(many):
    """With the block of the larger term diagonalised once; against the search, which factorises all of it."""
    sensitivity, data, noise = many
    terms = [PriorTerm(name=str(size), root=np.eye(size), std=0.5) for size in (2, 3)]
    linear = linearise([sensitivity[:, :2], sensitivity[:, 2:]], data, noise)
    held = _HeldSlack.of(linear, 0.0)
    constants = []
    for scales in ([0.5, 0.5], [0.1, 2.0]):
        step = solve_step(linear, np.array(scales))
        right = linear.factors(np.array(scales)) * held.right
        assert_allclose(held.solve(np.array(scales), right[:, None])[2:, 0], step.mean, rtol=ROUNDING)
        prior = 0.5 * np.sum((np.log(np.array(scales) / 0.5) / terms[0].scale_uncertainty) ** 2)
        constants.append(held.value(np.array(scales)) + prior + log_evidence(linear, terms, np.array(scales)))
    assert constants[0] == pytest.approx(constants[1], rel=ROUNDING)  # of the data alone
