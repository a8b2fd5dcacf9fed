"""Rivals of a component that explains nearly all: how much worse each must be, seen far from the axis.

Transfer functions far from the axis tell less than those near it, and nothing else: what a rival cannot explain there,
it cannot explain at all. There peaks are so wide that all a nuisance may do acts linearly, so that it is projected out
and only the rival's few parameters are searched. A rival that falls behind there by more than counts needs no fit near
the axis, where each step costs a hundred times as much.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.evidence.inference_problem import make_data
from frf_ipz.diagnosis.search.robust_refinement import LONGEST_STEP, SETTINGS, STEP
from frf_ipz.diagnosis.search.score_tests import ScoreTest, prepare_score_test
from frf_ipz.numerics.levenberg_marquardt import AcceptedStep, NormalEquations, minimise

if TYPE_CHECKING:
    from collections.abc import Iterable

    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.evidence.hypothesis import Hypothesis
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem

MAX_BEHIND_COMPLETE = 300.0  # log Bayes factor behind one that explains nearly all: further behind, no rival is fitted


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RivalTest:
    """Compares rivals with a fit, on the contour far from the axis.

    Parameters
    ----------
    test : ScoreTest
        Of the fit, with its nuisance.
    own_cost : float
        Half the sum of squares that it leaves there, the nuisance projected out.
    """

    test: ScoreTest
    own_cost: float

    def deficit(self, hypothesis: Hypothesis, starts: Iterable[FloatArray]) -> float:
        """Find how far a rival stays behind in log-likelihood.

        Parameters
        ----------
        hypothesis : Hypothesis
            All components, with the rival instead of the last one.
        starts : iterable of (n_parameters,) array
            Physical values to start from.

        Returns
        -------
        float
            At its best values; at the first that are not hopeless, where there are any.
        """
        problem = _RivalProblem(hypothesis=hypothesis, test=self.test)
        points = [problem.evaluate(hypothesis.clip_to_searched(values)) for values in starts]
        best = min(points, key=problem.cost)
        least = problem.cost(best)
        enough = self.own_cost + MAX_BEHIND_COMPLETE

        def is_enough(step: AcceptedStep[_RivalPoint]) -> bool:
            return problem.cost(step.after) < enough

        if least > enough and len(best.searched):
            settings = replace(SETTINGS, absolute_decrease=1.0)  # a log-likelihood of 1 decides nothing
            least = minimise(problem, best, settings, stop=is_enough).cost
        return least - self.own_cost


@lru_cache(maxsize=2)  # all rivals of a fit are compared with it
def make_rival_test(problem: InferenceProblem, fit: Fit) -> RivalTest:
    """Prepare the comparison of rivals with a fit.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    fit : Fit
        That explains nearly all.

    Returns
    -------
    RivalTest
        For any other last component.
    """
    data = make_data(problem.coarse, problem.context.options, free_gains=problem.data.free_gains)
    test = prepare_score_test(problem, fit, data)
    return RivalTest(test=test, own_cost=float(test.costs_of(test.response.values[:, :, None])[0]))


def is_hopeless(problem: InferenceProblem, fit: Fit, hypothesis: Hypothesis, starts: Iterable[FloatArray]) -> bool:
    """Tell whether a rival falls so far behind a fit that explains nearly all that it need not be fitted.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    fit : Fit
        Any fit.
    hypothesis : Hypothesis
        All its components, with another last one.
    starts : iterable of (n_parameters,) array
        Physical values to start from.

    Returns
    -------
    bool
        False where the fit does not explain nearly all: there a rival may be what is true.
    """
    return fit.explains_nearly_all and make_rival_test(problem, fit).deficit(hypothesis, starts) > MAX_BEHIND_COMPLETE


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _RivalPoint:
    """Parameters as searched, what they leave, and the part of it that the nuisance explains."""

    searched: FloatArray
    misfit: FloatArray
    explained: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _RivalProblem:
    """What is minimised: the misfit that the nuisance cannot explain."""

    hypothesis: Hypothesis
    test: ScoreTest

    def evaluate(self, searched: FloatArray) -> _RivalPoint:
        """Compute the misfit for some parameters."""
        values, data = self.hypothesis.to_physical(searched), self.test.data
        response = self.hypothesis.respond(values, self.test.base.nuisance, data.measured.s)
        misfit = self.test.without_nuisance(response.values[:, :, None])
        return _RivalPoint(
            searched=searched, misfit=misfit[:, 0], explained=self.test.explained_by_nuisance(misfit)[:, 0]
        )

    def cost(self, point: _RivalPoint) -> float:
        """Give half the sum of squares."""
        return float(0.5 * (point.misfit @ point.misfit - point.explained @ point.explained))

    def linearise(self, point: _RivalPoint) -> NormalEquations:
        """Derive by differences, away from the upper bound."""
        self.hypothesis.deadline.check()
        misfits, explained = [], []
        for index in range(len(point.searched)):
            moved = point.searched.copy()
            step = STEP if moved[index] + STEP <= self.hypothesis.high[index] else -STEP
            moved[index] += step
            there = self.evaluate(moved)
            misfits.append((point.misfit - there.misfit) / step)
            explained.append((point.explained - there.explained) / step)
        by_misfit, by_explained = np.stack(misfits, 1), np.stack(explained, 1)
        return NormalEquations(
            matrix=by_misfit.T @ by_misfit - by_explained.T @ by_explained,
            right=by_misfit.T @ point.misfit - by_explained.T @ point.explained,
        )

    def move(self, point: _RivalPoint, _equations: NormalEquations, step: FloatArray) -> _RivalPoint:
        """Take a step that is not too long, within bounds."""
        step = step * min(1.0, LONGEST_STEP / float(np.abs(step).max() + 1e-300))
        return self.evaluate(np.clip(point.searched + step, self.hypothesis.low, self.hypothesis.high))
