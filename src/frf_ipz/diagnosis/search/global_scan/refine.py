"""Brings the values of a wide search to the right place, where every peak is so wide that no other minimum is near.

Only the parameters of the causes move. The misfit of each line counts by its logarithm, so that lines which nothing
explains yet do not pull.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray

if TYPE_CHECKING:
    from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions
    from frf_ipz.diagnosis.search.hypothesis import Hypothesis

STEP = 1e-4  # of the logarithm of a parameter, for its derivative
LONGEST_STEP = 0.5
MOST_DAMPING = 1e4
GOOD_ENOUGH = 0.01  # change of the robust misfit


def robust_misfit(misfit: ComplexArray, weights: FloatArray) -> float:
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
        nats.
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
        Causes at their places.
    measured : TransferFunctions
        Transfer functions far from the axis.
    weights : (n_points, n_frfs) array
        Over the squared misfit.
    values : (n_parameters,) array
        Physical values to start from.
    iterations : int
        At most that many.

    Returns
    -------
    values : (n_parameters,) array
        Better ones.
    misfit : float
        Robust misfit there.
    """
    unknown = np.zeros(hypothesis.nuisance.size)

    def misfit_at(searched: FloatArray) -> ComplexArray:
        response = hypothesis.respond(hypothesis.physical(searched), unknown, measured.s)
        return np.asarray(measured.values - response.values)

    point = hypothesis.start_at(values)
    misfit = misfit_at(point)
    cost, damping = robust_misfit(misfit, weights), 1e-2
    if not len(point):
        return values, cost
    for _ in range(iterations):
        curvature, gradient = _normal(misfit_at, point, misfit, weights, hypothesis.high)
        gain = 0.0
        while damping < MOST_DAMPING:
            step = np.linalg.solve(curvature + damping * np.diag(np.diag(curvature) + 1e-12), gradient)
            step *= min(1.0, LONGEST_STEP / float(np.abs(step).max() + 1e-300))
            trial = np.clip(point + step, hypothesis.low, hypothesis.high)
            trial_misfit = misfit_at(trial)
            trial_cost = robust_misfit(trial_misfit, weights)
            if trial_cost < cost:
                gain, point, misfit, cost = cost - trial_cost, trial, trial_misfit, trial_cost
                damping = max(0.2 * damping, 1e-6)
                break
            damping *= 6.0
        if gain < GOOD_ENOUGH:
            break
    return hypothesis.physical(point), cost


def _normal(
    misfit_at: Callable[[FloatArray], ComplexArray],
    point: FloatArray,
    misfit: ComplexArray,
    weights: FloatArray,
    high: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    robust = weights / (1 + np.sum(weights * np.abs(misfit) ** 2, 1))[:, None]
    columns = []
    for index in range(len(point)):
        moved = point.copy()
        step = STEP if moved[index] + STEP <= high[index] else -STEP
        moved[index] += step
        columns.append(((misfit - misfit_at(moved)) / step).ravel())
    derivative = np.stack(columns, 1)
    weighted = robust.ravel()[:, None] * derivative
    return (derivative.conj().T @ weighted).real, (weighted.conj().T @ misfit.ravel()).real
