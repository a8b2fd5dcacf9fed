"""Normal equations whose unknowns differ in size by many orders of magnitude."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from frf_ipz.arrays import FloatArray

ROUNDING = 1e-10  # added to normal equations of unit diagonal: they stay positive definite
LEAST_COLUMN = 1e-100  # norm of a column: of a number without effect


def solve_scaled(normal: FloatArray, right: FloatArray) -> FloatArray:
    """Solve normal equations, however different the sizes of their unknowns are.

    Parameters
    ----------
    normal : (n, n) array
        Symmetric, positive definite but for rounding.
    right : (n,) or (n, k) array
        Right sides.

    Returns
    -------
    (n,) or (n, k) array
        The solutions.
    """
    scale = 1 / np.sqrt(np.diag(normal))
    scaled = normal * scale * scale[:, None] + ROUNDING * np.eye(len(normal))
    solution = linalg.cho_solve(linalg.cho_factor(scaled, lower=True), (right.T * scale).T)
    return np.asarray((solution.T * scale).T)


def solve_with_prior(
    rows: FloatArray, misfit: FloatArray, nuisance: FloatArray, ridge: float
) -> tuple[FloatArray, FloatArray]:
    """Compute the least-squares step of nuisance parameters with a prior of 1, and of numbers without one.

    Parameters
    ----------
    rows : (n_nuisance + n_numbers, n_rows) array
        Derivatives by the nuisance parameters, and by the numbers.
    misfit : (n_rows,) array
        With the present nuisance parameters, and without the effect of the numbers.
    nuisance : (n_nuisance,) array
        Present values, in standard deviations.
    ridge : float
        Of a number's own square: numbers may have nearly the same effect.

    Returns
    -------
    step : (n_nuisance + n_numbers,) array
        Of the nuisance parameters; the numbers as a whole.
    covariance : (n_numbers, n_numbers) array
        Of the numbers.
    """
    n = len(nuisance)
    sizes, prior = np.ones(len(rows)), np.ones(len(rows))
    sizes[n:] = np.maximum(np.linalg.norm(rows[n:], axis=1), LEAST_COLUMN)
    prior[n:] = ridge
    scaled = rows / sizes[:, None]
    right = scaled @ misfit
    right[:n] -= nuisance
    solution = solve_scaled(scaled @ scaled.T + np.diag(prior), np.column_stack([right, np.eye(len(rows))[:, n:]]))
    return solution[:, 0] / sizes, solution[n:, 1:] / sizes[n:] / sizes[n:, None]
