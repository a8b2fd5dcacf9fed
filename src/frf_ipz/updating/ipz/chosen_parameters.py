"""The published iteration on parameters from a diagnosis: eqs. (6) to (20) without substructures.

With parameters of both matrices at once no substructure is put back (steps 2j to 2l), and all FRFs count in every step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
from frf_ipz.late_imports import import_late
from frf_ipz.numerics.pencils import Roots, damped_sensitivity
from frf_ipz.updating.ipz.step import ILL_CONDITIONED
from frf_ipz.updating.tracking import TargetRoots
from frf_ipz.updating.updated_model import UpdateStatus

if TYPE_CHECKING:
    import pandas as pd
    from scipy.optimize import linear_sum_assignment

    from frf_ipz.updating.parameters import ParameterBasis
    from frf_ipz.updating.problem import UpdateProblem
else:
    pd = import_late("pandas")
    linear_sum_assignment = import_late("scipy.optimize", "linear_sum_assignment")

INSENSITIVE = 1e-12  # of the largest sensitivity: a parameter below moves no target


def iterate_parameters(
    problem: UpdateProblem, basis: ParameterBasis, *, alpha: float, beta: float, delta: float, max_iterations: int
) -> tuple[FloatArray, ComplexArray, UpdateStatus, pd.DataFrame]:
    """Bring poles and zeros to their targets by some parameters.

    Parameters
    ----------
    problem : UpdateProblem
        Model and targets.
    basis : ParameterBasis
        The parameters.
    alpha, beta, delta : float
        Regularisation, step and stop.
    max_iterations : int
        Largest number of iterations.

    Returns
    -------
    theta : (p,) array
        Parameters.
    roots : (n,) complex array
        Poles and zeros reached, rad/s.
    status : UpdateStatus
        How it ended.
    history : DataFrame
        One row an iteration.
    """
    theta = np.zeros(len(basis.names))
    targets = TargetRoots(frf=problem.frf, rows={number: problem.rows(number) for number in problem.frfs})
    values, previous, rows = problem.computed, np.inf, []
    status = UpdateStatus.MAX_ITERATIONS
    for iteration in range(1, max_iterations + 1):
        values, slopes = _roots_and_slopes(problem, basis, targets, theta, values)
        weights = np.abs(values).max() / np.abs(values)
        error = (problem.values - values) * weights
        misfit = float(np.sum(np.abs(error) ** 2))
        change = beta * _solve_step(slopes * weights[:, None], error, alpha)
        size = float(np.linalg.norm(change))
        rows.append({"iteration": iteration, "misfit": misfit, "step": size, **_named(basis, theta)})
        if abs(misfit - previous) <= delta:
            status = UpdateStatus.CONVERGED
            break
        if not np.isfinite(misfit):
            status = UpdateStatus.DIVERGED
            break
        previous, theta = misfit, theta + change
    return theta, values, status, pd.DataFrame(rows)


def _roots_and_slopes(
    problem: UpdateProblem, basis: ParameterBasis, targets: TargetRoots, theta: FloatArray, reference: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    amounts, amount_slopes = basis.amounts(theta), basis.slopes(theta)
    model = problem.model
    all_roots = targets.damped(
        model.mass + np.tensordot(amounts, basis.mass, 1),
        model.damping + np.tensordot(amounts, basis.damping, 1),
        model.stiffness + np.tensordot(amounts, basis.stiffness, 1),
    )
    values, slopes = np.zeros(len(reference), complex), np.zeros((len(reference), len(theta)), complex)
    for number, candidates in all_roots.items():
        indices = np.flatnonzero(targets.frf == number)
        roots = _nearest_roots(candidates, reference[indices])
        values[indices] = roots.values
        root_slopes = damped_sensitivity(roots, mass=basis.mass, damping=basis.damping, stiffness=basis.stiffness)
        slopes[indices] = root_slopes * amount_slopes
    return values, slopes


def _nearest_roots(roots: Roots, reference: ComplexArray) -> Roots:
    upper = roots.take(np.flatnonzero(roots.values.imag > 0))
    _, nearest = linear_sum_assignment(np.abs(reference[:, None] - upper.values) / np.abs(reference)[:, None])
    return upper.take(nearest)


def _solve_step(slopes: ComplexArray, error: ComplexArray, alpha: float) -> FloatArray:
    """Eq. (18), with the rule for alpha of step 2g."""
    stacked = np.vstack([slopes.real, slopes.imag])
    is_sensitive: BoolArray = np.linalg.norm(stacked, axis=0) > INSENSITIVE * np.linalg.norm(stacked)
    normal = stacked[:, is_sensitive].T @ stacked[:, is_sensitive]
    if np.linalg.cond(normal) >= ILL_CONDITIONED:
        diagonal = np.diagonal(normal).copy()
        normal[np.diag_indices_from(normal)] += alpha**2 * diagonal.mean() / (1 / diagonal).mean() / diagonal
    change = np.zeros(len(is_sensitive))
    change[is_sensitive] = np.linalg.lstsq(
        normal, stacked[:, is_sensitive].T @ np.concatenate([error.real, error.imag])
    )[0]
    return change


def _named(basis: ParameterBasis, theta: FloatArray) -> dict[str, float]:
    return dict(zip(basis.names, theta.tolist(), strict=True))
