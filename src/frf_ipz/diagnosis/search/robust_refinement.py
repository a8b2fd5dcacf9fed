"""Refines the values that a global scan led to, steps to better locations, and comes half the way back to the axis.

Far from the axis every peak is so wide that no other minimum is near, and every step down leads on; near it, only the
right location has a way. Half-way, values are exact enough for a fit near the axis to find narrow peaks. Only the
parameters of the effects move. The misfit of each line counts by its logarithm, so that lines which nothing explains
yet do not dominate.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem, compute_weights
from frf_ipz.numerics.levenberg_marquardt import LevenbergMarquardt, NormalEquations, minimise

if TYPE_CHECKING:
    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.evidence.hypothesis import ComponentKey, Hypothesis
    from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions

STEP = 1e-4  # of the logarithm of a parameter, for its derivative
LONGEST_STEP = 0.5
SETTINGS = LevenbergMarquardt(
    steps=12,
    initial_damping=1e-2,
    min_damping=1e-6,
    max_damping=1e4,
    damping_decrease=0.2,
    damping_increase=6.0,
    absolute_decrease=0.01,
)
REFINED_ERROR = 0.01  # of an FRF's size: what counts as a misfit after the global scan
LOCATIONS_PER_EFFECT = 3  # of an effect that are refined
N_STEPPED = 8  # hypotheses whose neighbours are tried far from the axis
COST_RATIO = 4.0  # times the best cost: what is further behind is not followed any more
N_STEPPED_HALFWAY = 3  # hypotheses whose neighbours are tried half-way to the axis
NEIGHBOURHOOD = 2  # nodes or elements: locations so near are not distinguished there
MAX_STEPS = 12
GAIN = 0.5  # of a robust misfit or a log Bayes factor: a neighbour must be better by that


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Start:
    """Values to start a fit from.

    Parameters
    ----------
    component : Component
        Effect and location.
    values : (n_parameters,) array
        Physical values of its parameters.
    cost : float
        Robust misfit there; the lower the better.
    """

    component: Component
    values: FloatArray
    cost: float


def compute_robust_misfit(misfit: ComplexArray, weights: FloatArray) -> float:
    """Sum of the logarithms of the lines' misfits.

    Parameters
    ----------
    misfit : (n_points, n_frfs) complex array
        Measurement minus model.
    weights : (n_points, n_frfs) array
        Over its square.

    Returns
    -------
    float
        Minus a robust log-likelihood.
    """
    return float(np.sum(np.log1p(np.sum(weights * np.abs(misfit) ** 2, 1))))


def refine(
    hypothesis: Hypothesis,
    measured: TransferFunctions,
    weights: FloatArray,
    values: FloatArray,
    *,
    iterations: int = 12,
) -> tuple[FloatArray, float]:
    """Improve values on a contour far from the axis.

    Parameters
    ----------
    hypothesis : Hypothesis
        Components at their locations.
    measured : TransferFunctions
        Transfer functions far from the axis.
    weights : (n_points, n_frfs) array
        Over the squared misfit.
    values : (n_parameters,) array
        Physical values to start from.
    iterations : int
        At most so many.

    Returns
    -------
    values : (n_parameters,) array
        Improved ones.
    misfit : float
        Robust misfit there.
    """
    problem = _RobustProblem(
        hypothesis=hypothesis,
        measured=measured,
        weights=weights,
        nuisance=np.zeros(hypothesis.nuisance_prior.size),
    )
    start = problem.evaluate(hypothesis.clip_to_searched(values))
    if not len(start.searched):
        return values, problem.cost(start)
    optimum = minimise(problem, start, replace(SETTINGS, steps=iterations))
    return hypothesis.to_physical(optimum.point.searched), optimum.cost


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _RobustPoint:
    """Parameters of the effects as searched, and what they leave."""

    searched: FloatArray
    misfit: ComplexArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _RobustProblem:
    """What is minimised: the robust misfit, whose curvature is that of its lines reweighted."""

    hypothesis: Hypothesis
    measured: TransferFunctions
    weights: FloatArray
    nuisance: FloatArray

    def evaluate(self, searched: FloatArray) -> _RobustPoint:
        """Compute the misfit for some parameters."""
        response = self.hypothesis.respond(self.hypothesis.to_physical(searched), self.nuisance, self.measured.s)
        return _RobustPoint(searched=searched, misfit=np.asarray(self.measured.values - response.values))

    def cost(self, point: _RobustPoint) -> float:
        """Give the robust misfit."""
        return compute_robust_misfit(point.misfit, self.weights)

    def linearise(self, point: _RobustPoint) -> NormalEquations:
        """Derive by differences, away from the upper bound."""
        self.hypothesis.deadline.check()
        robust = self.weights / (1 + np.sum(self.weights * np.abs(point.misfit) ** 2, 1))[:, None]
        columns = []
        for index in range(len(point.searched)):
            moved = point.searched.copy()
            step = STEP if moved[index] + STEP <= self.hypothesis.high[index] else -STEP
            moved[index] += step
            columns.append(((point.misfit - self.evaluate(moved).misfit) / step).ravel())
        derivative = np.stack(columns, 1)
        weighted = robust.ravel()[:, None] * derivative
        return NormalEquations(
            matrix=(derivative.conj().T @ weighted).real, right=(weighted.conj().T @ point.misfit.ravel()).real
        )

    def move(self, point: _RobustPoint, _equations: NormalEquations, step: FloatArray) -> _RobustPoint:
        """Take a step that is not too long, within bounds."""
        step = step * min(1.0, LONGEST_STEP / float(np.abs(step).max() + 1e-300))
        return self.evaluate(np.clip(point.searched + step, self.hypothesis.low, self.hypothesis.high))


StartBeside: TypeAlias = tuple[tuple[Component, ...], Start]
"""Components that are fitted already, and one more with the values of all."""


def refine_starts(problem: InferenceProblem, base: Fit, starts: Sequence[Start]) -> list[Start]:
    """Refine the best starts of a global scan, and step to better locations.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    base : Fit
        The fit to build on.
    starts : sequence of Start
        By rising cost.

    Returns
    -------
    list of Start
        With the values of all components, by rising cost.
    """
    weights = compute_weights(problem.coarse, REFINED_ERROR)
    refined = []
    for start in select_apart(starts, LOCATIONS_PER_EFFECT):
        hypothesis = problem.make_hypothesis((*base.hypothesis.components, start.component))
        values, cost = refine(hypothesis, problem.coarse, weights, np.concatenate([base.values, start.values]))
        refined.append(Start(component=start.component, values=values, cost=cost))
    refined.sort(key=lambda start: start.cost)
    stepped = [
        step_to_neighbours(problem, base.hypothesis.components, start)
        for start in refined[:N_STEPPED]
        if start.cost < COST_RATIO * refined[0].cost
    ]
    best: dict[ComponentKey, Start] = {}
    for start in sorted([*stepped, *refined[len(stepped) :]], key=lambda start: start.cost):
        best.setdefault(start.component.key, start)
    return list(best.values())


def refine_halfway(problem: InferenceProblem, starts: Sequence[StartBeside]) -> list[StartBeside]:
    """Bring starts half the way to the axis: their values, and the locations of the best.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    starts : sequence of (tuple of Component, Start)
        Each with the other components.

    Returns
    -------
    list of (tuple of Component, Start)
        By rising cost half-way.
    """
    weights = compute_weights(problem.middle, REFINED_ERROR)
    halfway = []
    for known, start in starts:
        values, cost = refine(problem.make_hypothesis((*known, start.component)), problem.middle, weights, start.values)
        halfway.append((known, Start(component=start.component, values=values, cost=cost)))
    halfway.sort(key=lambda entry: entry[1].cost)
    best = [(known, _step(problem, known, start, problem.middle)) for known, start in halfway[:N_STEPPED_HALFWAY]]
    return sorted([*best, *halfway[N_STEPPED_HALFWAY:]], key=lambda entry: entry[1].cost)


def step_to_neighbours(problem: InferenceProblem, known: tuple[Component, ...], start: Start) -> Start:
    """Step to neighbours far from the axis, where every step down leads on: near it, only the right location has a way.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    known : tuple of Component
        The other components, at the same locations.
    start : Start
        With the values of all components.

    Returns
    -------
    Start
        The same component at a better location.
    """
    return _step(problem, known, start, problem.coarse)


def _step(problem: InferenceProblem, known: tuple[Component, ...], start: Start, measured: TransferFunctions) -> Start:
    weights = compute_weights(measured, REFINED_ERROR)
    tried = {start.component.key}
    for _ in range(MAX_STEPS):
        best = start
        for location in start.component.effect.neighbours(problem.context, start.component.location):
            component = Component(
                effect=start.component.effect, location=location, n_locations=start.component.n_locations
            )
            if component.key in tried:
                continue
            tried.add(component.key)
            hypothesis = problem.make_hypothesis((*known, component))
            if len(hypothesis.parameters) != len(start.values):
                continue
            values, cost = refine(hypothesis, measured, weights, start.values, iterations=3)
            if cost < best.cost - GAIN:
                best = Start(component=component, values=values, cost=cost)
        if best is start:
            break
        start = best
    return start


def select_apart(starts: Iterable[Start], per_effect: int) -> list[Start]:
    """Select the best locations of each effect that are no neighbours of each other.

    Parameters
    ----------
    starts : iterable of Start
        By rising cost.
    per_effect : int
        Number of starts of each effect.

    Returns
    -------
    list of Start
        The selected ones, by effect.
    """
    selected: dict[str, list[Start]] = {}
    for start in starts:
        of_effect = selected.setdefault(start.component.effect.name, [])
        if len(of_effect) < per_effect and not any(
            start.component.location.is_near(known.component.location, NEIGHBOURHOOD) for known in of_effect
        ):
            of_effect.append(start)
    return [start for of_effect in selected.values() for start in of_effect]
