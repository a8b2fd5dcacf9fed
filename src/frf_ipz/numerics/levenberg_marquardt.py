"""Nonlinear least squares by damped Gauss-Newton steps [Marquardt1963]: one iteration for all who fit.

A problem says what a point costs, how the cost changes around it, and where a step leads; the settings say how steps
are damped and when they end. What a problem computes at a point it may keep in it: the iteration only hands points on.
A cost is twice the negative logarithm of a posterior, or anything else that has a Gauss-Newton matrix: a problem may
compress its data, eliminate linear parameters, weigh robustly, or bound and shorten steps in `move`.

[Marquardt1963] D. W. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, J. SIAM 11, 1963,
431-441, doi:10.1137/0111030.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from typing import Generic, Protocol, TypeVar

import numpy as np
from scipy import linalg

from frf_ipz.arrays import FloatArray

PATIENCE = 3  # steps after which an iteration may be stopped early
FURTHER_GAIN = 6.0  # times the last decrease: what further steps may gain together
Point = TypeVar("Point")
Equations = TypeVar("Equations", bound="NormalEquations")


class LeastSquaresStatus(Enum):
    """How an iteration ended."""

    CONVERGED = "a further step would lower the cost by less than matters"
    STALLED = "no damped step lowers the cost"
    MAX_STEPS = "the largest number of steps or trials was reached"
    STOPPED = "the caller stopped it"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NormalEquations:
    """The quadratic model of a cost around a point: ``cost - 2 step^T right + step^T matrix step``.

    Parameters
    ----------
    matrix : (n, n) array
        Gauss-Newton matrix, that of a prior included; half the curvature of the cost.
    right : (n,) array
        Minus half the gradient of the cost.
    """

    matrix: FloatArray
    right: FloatArray

    def solve_damped(self, damping: float) -> FloatArray | None:
        """Solve for the step, with the diagonal of the matrix raised.

        Parameters
        ----------
        damping : float
            By which part of itself the diagonal is raised.

        Returns
        -------
        (n,) array or None
            None where rounding leaves no positive definite matrix, or a number is not finite.
        """
        diagonal = np.diagonal(self.matrix)
        if not np.isfinite(diagonal).all():
            return None
        # parameters of any size: the error of a Cholesky factor does not depend on the scale of rows and columns
        damped = self.matrix + damping * np.diag(np.where(diagonal > 0, diagonal, 1.0))
        try:
            factor = linalg.cho_factor(damped, lower=True, check_finite=False)
        except linalg.LinAlgError:
            return None
        step = linalg.cho_solve(factor, self.right, check_finite=False)
        return np.asarray(step) if np.isfinite(step).all() else None

    def predict_decrease(self, step: FloatArray) -> float:
        """Compute by how much a step lowers the quadratic model."""
        return float(2 * step @ self.right - step @ self.matrix @ step)


class LeastSquaresProblem(Protocol[Point, Equations]):
    """What is minimised."""

    def cost(self, point: Point) -> float:
        """Give the cost of a point; not finite, where it is none at all."""

    def linearise(self, point: Point) -> Equations:
        """Give the quadratic model of the cost around a point."""

    def move(self, point: Point, equations: Equations, step: FloatArray) -> Point:
        """Give the point a step leads to, within what bounds and limits allow.

        Parameters
        ----------
        point : Point
            Where the iteration is.
        equations : Equations
            The model of the cost there.
        step : (n,) array
            Change of the parameters by that model.

        Returns
        -------
        Point
            A trial.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class LevenbergMarquardt:
    """How steps are damped, and when they end.

    Parameters
    ----------
    steps : int
        Accepted steps at most.
    trials : int, optional
        Trials at most, accepted or rejected; as many as it takes by default.
    trials_per_step : int, optional
        Trials at most around one point; by default until the largest damping.
    initial_damping, min_damping, max_damping : float
        Of the first step, and of all: parts of the diagonal of the matrix. Beyond the largest, the iteration stalls.
    damping_decrease, damping_increase : float
        Factors of the damping after an accepted and after a rejected step.
    min_rejected_damping : float
        After a rejected step it is not less than this.
    absolute_decrease, relative_decrease : float
        An accepted step that lowers the cost by less, or by a smaller part of it, is the last.
    negligible_increase : float
        A rejected step that raises the cost by less is the last.
    predicted_decrease : float
        A step by which the quadratic model falls by less is not tried, and nothing after it.
    """

    steps: int
    trials: int | None = None
    trials_per_step: int | None = None
    initial_damping: float = 1e-3
    min_damping: float = 1e-10
    max_damping: float = 1e8
    damping_decrease: float = 0.1
    damping_increase: float = 10.0
    min_rejected_damping: float = 0.0
    absolute_decrease: float = 0.0
    relative_decrease: float = 0.0
    negligible_increase: float = 0.0
    predicted_decrease: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AcceptedStep(Generic[Point]):
    """A step that lowered the cost, for a caller who may stop there.

    Parameters
    ----------
    number : int
        Of the step, from 1.
    before, after : Point
        Where it began and where it led.
    decrease : float
        Of the cost.
    """

    number: int
    before: Point
    after: Point
    decrease: float

    def can_reach(self, cost_limit: float, cost: float, *, patience: int = PATIENCE) -> bool:
        """Tell whether further steps are likely to bring the cost, `cost` after this one, below a limit."""
        return self.number <= patience or cost - FURTHER_GAIN * self.decrease <= cost_limit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LeastSquaresResult(Generic[Point, Equations]):
    """Where an iteration ended.

    Parameters
    ----------
    problem : LeastSquaresProblem
        What was minimised.
    point : Point
        The best point.
    cost : float
        Its cost.
    n_steps, n_trials : int
        Accepted steps, and all that were tried.
    status : LeastSquaresStatus
        How it ended.
    known_equations : Equations or None
        Model of the cost around the point; None where the last step was accepted and needed none.
    """

    problem: LeastSquaresProblem[Point, Equations]
    point: Point
    cost: float
    n_steps: int
    n_trials: int
    status: LeastSquaresStatus
    known_equations: Equations | None

    def linearise(self) -> Equations:
        """Give the model of the cost around the point; it is computed only if the iteration has not."""
        return self.problem.linearise(self.point) if self.known_equations is None else self.known_equations


def minimise(
    problem: LeastSquaresProblem[Point, Equations],
    start: Point,
    settings: LevenbergMarquardt,
    *,
    revise: Callable[[Point], Point] | None = None,
    stop: Callable[[AcceptedStep[Point]], bool] | None = None,
) -> LeastSquaresResult[Point, Equations]:
    """Find a minimum of a cost by damped Gauss-Newton steps.

    Parameters
    ----------
    problem : LeastSquaresProblem
        Cost, its quadratic model, and where steps lead.
    start : Point
        Where to start.
    settings : LevenbergMarquardt
        How steps are damped, and when they end.
    revise : callable, optional
        Changes a point whose step was accepted: it may drop parameters, and cost more.
    stop : callable, optional
        Says after an accepted step whether further ones are of no use.

    Returns
    -------
    LeastSquaresResult
        The best point. A trial whose cost is not finite, or not below the last one, is rejected.
    """
    state = _State(point=start, cost=_as_cost(problem.cost(start)), damping=settings.initial_damping)
    status, n_steps, n_trials = LeastSquaresStatus.MAX_STEPS, 0, 0
    equations: Equations | None = None
    while n_steps < settings.steps:
        before, equations = state, problem.linearise(state.point)
        state, status, n_tried = _search_damping(problem, before, equations, settings, n_trials)
        n_trials += n_tried
        if state.point is before.point:
            break
        equations, n_steps, decrease = None, n_steps + 1, before.cost - state.cost
        if revise is not None:
            revised = revise(state.point)
            state = replace(state, point=revised, cost=_as_cost(problem.cost(revised)))
        if decrease < max(settings.absolute_decrease, settings.relative_decrease * before.cost):
            status = LeastSquaresStatus.CONVERGED
            break
        taken = AcceptedStep(number=n_steps, before=before.point, after=state.point, decrease=decrease)
        if stop is not None and stop(taken):
            status = LeastSquaresStatus.STOPPED
            break
    return LeastSquaresResult(
        problem=problem,
        point=state.point,
        cost=state.cost,
        n_steps=n_steps,
        n_trials=n_trials,
        status=status,
        known_equations=equations,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _State(Generic[Point]):
    """Where the iteration is, and how its next step is damped."""

    point: Point
    cost: float
    damping: float


def _search_damping(
    problem: LeastSquaresProblem[Point, Equations],
    state: _State[Point],
    equations: Equations,
    settings: LevenbergMarquardt,
    n_before: int,
) -> tuple[_State[Point], LeastSquaresStatus, int]:
    """Raise the damping until a step lowers the cost; the same point where none does, with the reason."""
    damping, n_trials = state.damping, 0
    while damping <= settings.max_damping and n_trials != settings.trials_per_step:
        if n_before + n_trials == settings.trials:
            return state, LeastSquaresStatus.MAX_STEPS, n_trials
        step = equations.solve_damped(damping)
        if step is not None and equations.predict_decrease(step) <= settings.predicted_decrease:
            return state, LeastSquaresStatus.CONVERGED, n_trials
        n_trials += 1
        if step is not None:
            trial = problem.move(state.point, equations, step)
            cost = _as_cost(problem.cost(trial))
            if cost < state.cost:
                damping = max(settings.damping_decrease * damping, settings.min_damping)
                return _State(point=trial, cost=cost, damping=damping), LeastSquaresStatus.MAX_STEPS, n_trials
            if cost - state.cost < settings.negligible_increase:
                return state, LeastSquaresStatus.CONVERGED, n_trials
        damping = max(settings.damping_increase * damping, settings.min_rejected_damping)
    return state, LeastSquaresStatus.STALLED, n_trials


def _as_cost(cost: float) -> float:
    return cost if np.isfinite(cost) else np.inf
