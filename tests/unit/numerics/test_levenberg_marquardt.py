"""Damped Gauss-Newton steps: the minima that SciPy finds, and what each setting does."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import optimize

from frf_ipz.numerics.levenberg_marquardt import (
    AcceptedStep,
    LeastSquaresStatus,
    LevenbergMarquardt,
    NormalEquations,
    minimise,
)

SETTINGS = LevenbergMarquardt(steps=200, absolute_decrease=1e-25)  # else Powell's function falls for ever
EXACT = 1e-6  # of a parameter: two iterations to the same minimum, of a cost that rounding leaves about 1e-16 of
FLAT = 1e-3  # of a parameter of Powell's function, whose cost rises with the fourth power alone


@dataclass
class VectorProblem:
    """Parameters are a vector with a normal prior; steps end at a bound."""

    misfit: Callable[[np.ndarray], np.ndarray]
    jacobian: Callable[[np.ndarray], np.ndarray]
    prior_mean: np.ndarray | float = 0.0
    prior_std: np.ndarray | float = np.inf
    high: float = np.inf
    tried: list[np.ndarray] = field(default_factory=list)
    n_linearised: int = 0

    def cost(self, point):
        return float(np.sum(self.misfit(point) ** 2) + np.sum(((point - self.prior_mean) / self.prior_std) ** 2))

    def linearise(self, point):
        self.n_linearised += 1
        jacobian = self.jacobian(point)
        precision = np.ones(len(point)) / self.prior_std**2
        return NormalEquations(
            matrix=jacobian.T @ jacobian + np.diag(precision),
            right=-jacobian.T @ self.misfit(point) - precision * (point - self.prior_mean),
        )

    def move(self, point, _equations, step):
        self.tried.append(np.minimum(point + step, self.high))
        return self.tried[-1]


def rosenbrock(**changes):
    return VectorProblem(
        misfit=lambda x: np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]),
        jacobian=lambda x: np.array([[-20 * x[0], 10.0], [-1.0, 0.0]]),
        **changes,
    )


def powell(**changes):
    """Singular at its minimum, 0."""
    return VectorProblem(
        misfit=lambda x: np.array(
            [x[0] + 10 * x[1], np.sqrt(5) * (x[2] - x[3]), (x[1] - 2 * x[2]) ** 2, np.sqrt(10) * (x[0] - x[3]) ** 2]
        ),
        jacobian=lambda x: np.array(
            [
                [1.0, 10.0, 0.0, 0.0],
                [0.0, 0.0, np.sqrt(5), -np.sqrt(5)],
                [0.0, 2 * (x[1] - 2 * x[2]), -4 * (x[1] - 2 * x[2]), 0.0],
                [2 * np.sqrt(10) * (x[0] - x[3]), 0.0, 0.0, -2 * np.sqrt(10) * (x[0] - x[3])],
            ]
        ),
        **changes,
    )


def decay(**changes):
    """Three decaying exponentials, of which two are one: amplitudes of the same column."""
    times = np.linspace(0, 4, 30)
    measured = 3 * np.exp(-1.3 * times) + 0.05 * np.sin(20 * times)

    def columns(x):
        return np.exp(-x[2] * times)

    return VectorProblem(
        misfit=lambda x: (x[0] + x[1]) * columns(x) - measured,
        jacobian=lambda x: np.stack([columns(x), columns(x), -(x[0] + x[1]) * times * columns(x)], axis=1),
        **changes,
    )


def solve_with_scipy(problem, start):
    """The prior is stacked below the misfit."""
    std = np.broadcast_to(problem.prior_std, np.shape(start))

    def misfit(x):
        return np.concatenate([problem.misfit(x), (x - problem.prior_mean) / std])

    def jacobian(x):
        return np.vstack([problem.jacobian(x), np.diag(1 / std)])

    return optimize.least_squares(misfit, start, jacobian, xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=500)


@pytest.mark.parametrize(
    ("problem", "start", "tolerance"),
    [
        (rosenbrock(), [-1.2, 1.0], EXACT),
        (rosenbrock(prior_mean=np.array([0.3, -0.5]), prior_std=np.array([0.2, 0.5])), [-1.2, 1.0], EXACT),
        (powell(), [3.0, -1.0, 0.0, 1.0], FLAT),
        (powell(prior_mean=1.0, prior_std=3.0), [3.0, -1.0, 0.0, 1.0], EXACT),
        (decay(prior_mean=1.0, prior_std=10.0), [1.0, 0.5, 0.4], EXACT),
    ],
    ids=["rosenbrock", "with prior", "powell", "powell with prior", "amplitudes of one column"],
)
def test_the_minimum_is_that_of_scipy(problem, start, tolerance):
    expected = solve_with_scipy(problem, np.array(start))
    fit = minimise(problem, np.array(start), SETTINGS)
    assert_allclose(fit.point, expected.x, rtol=tolerance, atol=tolerance)
    assert_allclose(fit.cost, 2 * expected.cost, rtol=1e-8, atol=1e-10)
    assert fit.status is not LeastSquaresStatus.MAX_STEPS


def test_without_a_prior_a_rank_deficient_jacobian_leaves_the_sum_determined():
    problem, start = decay(), np.array([1.0, 0.5, 0.4])
    fit = minimise(problem, start, SETTINGS)
    expected = solve_with_scipy(problem, start)
    assert_allclose(fit.point[0] + fit.point[1], expected.x[0] + expected.x[1], rtol=EXACT)
    assert_allclose(fit.point[2], expected.x[2], rtol=EXACT)
    assert_allclose(fit.point[0] - fit.point[1], start[0] - start[1], rtol=1e-4)  # rounding over the least damping


def test_parameters_of_any_size_are_found():
    size = np.array([1e9, 1e-9])
    scaled = rosenbrock()
    problem = VectorProblem(
        misfit=lambda x: scaled.misfit(x / size), jacobian=lambda x: scaled.jacobian(x / size) / size
    )
    assert_allclose(minimise(problem, np.array([-1.2, 1.0]) * size, SETTINGS).point, size, rtol=EXACT)


@pytest.mark.parametrize("outside", [np.nan, np.inf])
def test_a_step_whose_cost_is_not_finite_is_rejected(outside):
    """The logarithm has no value where the first step leads."""
    problem = VectorProblem(
        misfit=lambda x: np.where(x > 0, np.log(np.maximum(x, 1e-300)) + 2, outside),
        jacobian=lambda x: np.diag(1 / x),
    )
    fit = minimise(problem, np.array([5.0]), SETTINGS)
    assert problem.tried[0] < 0
    assert_allclose(fit.point, np.exp(-2), rtol=EXACT)
    assert fit.n_trials > fit.n_steps


@pytest.mark.parametrize("start_cost", [np.nan, np.inf])
def test_a_start_whose_cost_is_not_finite_is_left(start_cost):
    problem = VectorProblem(
        misfit=lambda x: np.where(x == 3.0, start_cost, x - 1), jacobian=lambda _: np.eye(1), prior_std=1e6
    )
    problem.linearise = lambda point: NormalEquations(matrix=np.eye(1), right=1 - point)
    fit = minimise(problem, np.array([3.0]), SETTINGS)
    assert_allclose(fit.point, 1.0, rtol=EXACT)


@pytest.mark.parametrize("matrix", [np.diag([1.0, -1.0]), np.diag([1.0, np.nan]), np.full((2, 2), np.inf)])
def test_a_matrix_that_is_not_positive_definite_gives_no_step(matrix):
    assert NormalEquations(matrix=matrix, right=np.ones(2)).solve_damped(1e-3) is None


def test_a_gradient_that_is_not_finite_gives_no_step():
    assert NormalEquations(matrix=np.eye(2), right=np.array([1.0, np.nan])).solve_damped(1e-3) is None


def test_where_no_matrix_is_positive_definite_the_start_stays():
    problem = rosenbrock()
    problem.linearise = lambda _: NormalEquations(matrix=np.full((2, 2), np.nan), right=np.ones(2))
    fit = minimise(problem, np.array([-1.2, 1.0]), SETTINGS)
    assert fit.status is LeastSquaresStatus.STALLED
    assert not problem.tried
    assert_allclose(fit.point, [-1.2, 1.0])


def test_no_parameters_have_converged():
    problem = VectorProblem(misfit=lambda _: np.ones(3), jacobian=lambda _: np.ones((3, 0)))
    fit = minimise(problem, np.zeros(0), SETTINGS)
    assert (fit.status, fit.cost, fit.n_trials) == (LeastSquaresStatus.CONVERGED, 3.0, 0)


def test_a_wrong_derivative_stalls_at_the_largest_damping():
    problem = VectorProblem(misfit=lambda x: x, jacobian=lambda _: -np.eye(2))
    settings = LevenbergMarquardt(steps=9, initial_damping=1.0, damping_increase=4.0, max_damping=64.0)
    fit = minimise(problem, np.ones(2), settings)
    assert (fit.status, fit.n_steps, fit.n_trials) == (LeastSquaresStatus.STALLED, 0, 4)
    dampings = 1 / (np.array(problem.tried)[:, 0] - 1) - 1  # a step is 1 / (1 + damping)
    assert_allclose(dampings, [1.0, 4.0, 16.0, 64.0])


def test_damping_falls_after_good_steps_to_its_floor():
    """The Jacobian is twice too large: each step is half as long as it should be, over one plus the damping."""
    problem = VectorProblem(misfit=lambda x: x, jacobian=lambda _: 2 * np.eye(1))
    settings = LevenbergMarquardt(steps=4, initial_damping=1.0, damping_decrease=0.2, min_damping=0.1)
    minimise(problem, np.ones(1), settings)
    values = np.array([1.0, *np.ravel(problem.tried)])
    assert_allclose(0.5 / (1 - values[1:] / values[:-1]) - 1, [1.0, 0.2, 0.1, 0.1])


def test_after_a_rejected_step_damping_is_not_less_than_asked_for():
    problem = VectorProblem(misfit=lambda x: x, jacobian=lambda _: -np.eye(1))
    settings = LevenbergMarquardt(steps=9, initial_damping=0.0, min_rejected_damping=0.5, trials_per_step=3)
    fit = minimise(problem, np.ones(1), settings)
    assert_allclose(1 / (np.ravel(problem.tried) - 1) - 1, [0.0, 0.5, 5.0])
    assert (fit.status, fit.n_trials) == (LeastSquaresStatus.STALLED, 3)


def halving(**settings):
    """Costs of an iteration that halves its parameter each step, from 1: a quarter of the cost is left."""
    problem = VectorProblem(misfit=lambda x: x, jacobian=lambda _: 2 * np.eye(1))
    return minimise(
        problem, np.ones(1), LevenbergMarquardt(**{"steps": 30, "initial_damping": 0.0, "min_damping": 0.0} | settings)
    )


def test_the_number_of_steps_is_limited():
    fit = halving(steps=3)
    assert (fit.n_steps, fit.cost, fit.status) == (3, 0.25**3, LeastSquaresStatus.MAX_STEPS)


def test_the_number_of_trials_is_limited():
    fit = halving(trials=3)
    assert (fit.n_trials, fit.cost, fit.status) == (3, 0.25**3, LeastSquaresStatus.MAX_STEPS)


def test_without_steps_the_start_is_returned():
    fit = halving(steps=0)
    assert (fit.n_trials, fit.cost, fit.status) == (0, 1.0, LeastSquaresStatus.MAX_STEPS)
    assert_allclose(fit.linearise().matrix, [[4.0]])


@pytest.mark.parametrize(
    ("settings", "n_steps"),
    [
        ({"absolute_decrease": 0.1}, 3),  # decreases are 0.75, 0.19, 0.05
        ({"relative_decrease": 0.74}, 30),
        ({"relative_decrease": 0.76}, 1),
        ({"predicted_decrease": 0.1}, 2),  # predicted are 1, 0.25, 0.06 of the cost before, which is one times those
    ],
)
def test_a_small_decrease_ends_the_iteration(settings, n_steps):
    fit = halving(**settings)
    assert fit.n_steps == n_steps
    assert (fit.status is LeastSquaresStatus.CONVERGED) == (n_steps < 30)


def test_a_negligible_increase_ends_the_iteration():
    problem = VectorProblem(misfit=lambda x: 1 + 1e-3 * x, jacobian=lambda _: -1e-3 * np.eye(1), high=1.0)
    settings = LevenbergMarquardt(steps=9, max_damping=1.0)
    assert minimise(problem, np.zeros(1), settings).n_trials > 1
    fit = minimise(problem, np.zeros(1), LevenbergMarquardt(steps=9, max_damping=1.0, negligible_increase=0.01))
    assert (fit.status, fit.n_trials, fit.n_steps) == (LeastSquaresStatus.CONVERGED, 1, 0)
    assert_allclose(fit.point, 0.0)


def test_the_model_of_the_result_is_computed_once():
    problem = rosenbrock()
    fit = minimise(problem, np.array([-1.2, 1.0]), LevenbergMarquardt(steps=2))
    assert problem.n_linearised == 2
    assert_allclose(fit.linearise().matrix, rosenbrock().linearise(fit.point).matrix)
    assert problem.n_linearised == 3
    fit = minimise(problem, fit.point, SETTINGS)
    n_linearised = problem.n_linearised
    assert fit.status is not LeastSquaresStatus.MAX_STEPS
    assert_allclose(fit.linearise().matrix, rosenbrock().linearise(fit.point).matrix)
    assert problem.n_linearised == n_linearised


def test_a_caller_stops_after_a_step():
    steps = []

    def stop(step):
        steps.append(step)
        return step.number == 2

    fit = minimise(rosenbrock(), np.array([-1.2, 1.0]), SETTINGS, stop=stop)
    assert (fit.status, fit.n_steps) == (LeastSquaresStatus.STOPPED, 2)
    assert_allclose(steps[1].before, steps[0].after)
    assert_allclose(steps[1].after, fit.point)
    assert_allclose(sum(step.decrease for step in steps), 24.2 - fit.cost)


def test_an_accepted_point_may_lose_parameters():
    """A parameter that has come close to zero is dropped; what it did to the cost remains."""
    problem = VectorProblem(
        misfit=lambda x: np.append(x - np.array([0.0, 2.0])[-len(x) :], 1.0),
        jacobian=lambda x: np.eye(len(x) + 1)[:, : len(x)],
    )
    fit = minimise(problem, np.array([3.0, 5.0]), SETTINGS, revise=lambda point: point[np.abs(point) > 0.1])
    assert fit.point.shape == (1,)
    assert_allclose(fit.cost, problem.cost(fit.point))
    assert_allclose(fit.point, 2.0)
    fit = minimise(problem, np.array([3.0, 5.0]), LevenbergMarquardt(steps=1), revise=lambda point: point[-1:] + 7.0)
    assert_allclose(fit.cost, problem.cost(fit.point))


@pytest.mark.parametrize(
    ("number", "decrease", "can_reach"), [(3, 1.0, True), (4, 1.0, False), (4, 15.0, True), (9, 14.0, False)]
)
def test_further_steps_may_gain_a_few_times_what_the_last_one_did(number, decrease, can_reach):
    step = AcceptedStep(number=number, before=None, after=None, decrease=decrease)
    assert step.can_reach(10.0, 100.0) == can_reach
