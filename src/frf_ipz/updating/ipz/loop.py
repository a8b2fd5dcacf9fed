"""The iteration of the published update: steps 2c to 3b of section 3.1 of [Dorosti2018], and its record.

[Dorosti2018] doi:10.1016/j.conengprac.2017.11.002.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.errors import NumericalError
from frf_ipz.late_imports import import_late
from frf_ipz.updating.ipz.step import PublishedStep
from frf_ipz.updating.updated_model import UpdateStatus

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.progress import Progress
else:
    pd = import_late("pandas")

MAX_ROWS = 32_768  # of the history: beyond, every second one is dropped, as often as needed
GROWTH = 1e4  # times the first misfit from which an iteration has diverged; it may rise at first
REPORT_INTERVAL = 1000  # iterations


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopResult:
    """Result of the published iteration.

    Parameters
    ----------
    matrix : (r, r) array
        K^u or B^u.
    status : UpdateStatus
        How it ended.
    history : DataFrame
        ``iteration``, ``misfit`` (epsilon), ``step`` (norm of the change over that of the parameters), ``gamma`` of
        eq. (41), and the parameters.
    """

    matrix: FloatArray
    status: UpdateStatus
    history: pd.DataFrame


def published_loop(
    steps: tuple[PublishedStep, ...],
    matrix: FloatArray,
    *,
    delta: float,
    max_iterations: int,
    progress: Progress,
) -> LoopResult:
    """Iterate until the misfit hardly changes.

    Parameters
    ----------
    steps : tuple of PublishedStep
        One an FRF; with several, an iteration makes the step of each in turn.
    matrix : (r, r) array
        Nominal stiffness or damping.
    delta : float
        Change of the misfit at which to stop, eq. (20).
    max_iterations : int
        Largest number of iterations.
    progress : Progress
        Reports the iteration.

    Returns
    -------
    LoopResult
        The matrix at the stop; where the iteration diverged, the one with the smallest misfit.
    """
    history = _History()
    previous, first, best = np.inf, 0.0, (np.inf, matrix)
    status = UpdateStatus.MAX_ITERATIONS
    with np.errstate(
        all="ignore"
    ):  # zeros at infinity divide by 0, and a diverging iteration overflows; both are detected
        for iteration in range(max_iterations):
            misfit, next_matrix = 0.0, matrix
            try:
                for step in steps:
                    misfit += step.evaluate(next_matrix)
                    next_matrix = step.step()
            except NumericalError:
                misfit = np.inf
            first = first or misfit
            if not misfit <= GROWTH * first:
                return LoopResult(matrix=best[1], status=UpdateStatus.DIVERGED, history=history.table(steps))
            best = min(best, (misfit, matrix), key=lambda pair: pair[0])
            history.add(iteration, misfit, steps)
            if abs(misfit - previous) <= delta:
                status = UpdateStatus.CONVERGED
                break
            previous, matrix = misfit, next_matrix
            if iteration % REPORT_INTERVAL == 0:
                progress(iteration / max_iterations, f"{iteration} iterations, epsilon {misfit:.5g}")
    return LoopResult(matrix=matrix, status=status, history=history.table(steps))


class _History:
    """Rows of the history, thinned out as they become many."""

    def __init__(self) -> None:
        self.rows: list[tuple[float, ...]] = []
        self.interval = 1
        self.before: tuple[FloatArray, FloatArray] | None = None

    def add(self, iteration: int, misfit: float, steps: tuple[PublishedStep, ...]) -> None:
        """Add an iteration; gamma is that of the first FRF's poles."""
        if iteration % self.interval:
            self.before = None
            return
        step = steps[0]
        roots = step.roots.copy()
        self.rows.append((iteration + 1, misfit, step.size_of_change(), self._gamma(step, roots), *_parameters(steps)))
        self.before = roots, step.predicted_poles()
        if len(self.rows) >= MAX_ROWS:
            self.rows, self.interval, self.before = self.rows[::2], 2 * self.interval, None

    def _gamma(self, step: PublishedStep, roots: FloatArray) -> float:
        if self.before is None:
            return float("nan")
        before, predicted = self.before
        change = (roots - before)[:, : step.n_poles].reshape(-1)
        return float(predicted @ change / np.sqrt((predicted @ predicted) * (change @ change)))

    def table(self, steps: tuple[PublishedStep, ...]) -> pd.DataFrame:
        """Give the history."""
        names = [f"{name} {k}" for name, count in _names(steps) for k in range(1, count + 1)]
        return pd.DataFrame(self.rows, columns=["iteration", "misfit", "step", "gamma", *names]).astype(
            {"iteration": int}
        )


def _parameters(steps: tuple[PublishedStep, ...]) -> list[float]:
    return [value for step in steps for value in step.theta.tolist()]


def _names(steps: tuple[PublishedStep, ...]) -> list[tuple[str, int]]:
    names = []
    for number, step in enumerate(steps, 1):
        of_frf = f" (FRF {number})" if len(steps) > 1 else ""
        names.append((f"pole parameter{of_frf}", step.n_poles))
        names.append((f"zero parameter{of_frf}", len(step.theta) - step.n_poles))
    return names
