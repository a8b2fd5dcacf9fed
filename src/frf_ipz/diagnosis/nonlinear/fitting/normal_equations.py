"""Normal equations of unknowns whose sizes differ by many orders of magnitude."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from frf_ipz.arrays import FloatArray

ROUNDING = 1e-10  # added to normal equations of unit diagonal: they stay positive
LEAST_COLUMN = 1e-100  # norm of a column: nothing is touched


def solve_even(normal: FloatArray, right: FloatArray) -> FloatArray:
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
    even = normal * scale * scale[:, None] + ROUNDING * np.eye(len(normal))
    found = linalg.cho_solve(linalg.cho_factor(even, lower=True), (right.T * scale).T)
    return np.asarray((found.T * scale).T)


def step_to(rows: FloatArray, misfit: FloatArray, unknowns: FloatArray, ridge: float) -> tuple[FloatArray, FloatArray]:
    """Give the step of unknowns with a prior of 1, and numbers without one, that brings a misfit to its least.

    Parameters
    ----------
    rows : (n_unknowns + n_numbers, n_rows) array
        Derivatives by the unknowns, and what a number of 1 does.
    misfit : (n_rows,) array
        With the unknowns as they are, and without what the numbers do.
    unknowns : (n_unknowns,) array
        As they are, in standard deviations.
    ridge : float
        Of a number's own square: numbers may do nearly the same.

    Returns
    -------
    step : (n_unknowns + n_numbers,) array
        Of the unknowns; the numbers as a whole.
    covariance : (n_numbers, n_numbers) array
        Of the numbers.
    """
    n = len(unknowns)
    sizes, prior = np.ones(len(rows)), np.ones(len(rows))
    sizes[n:] = np.maximum(np.linalg.norm(rows[n:], axis=1), LEAST_COLUMN)
    prior[n:] = ridge
    scaled = rows / sizes[:, None]
    right = scaled @ misfit
    right[:n] -= unknowns
    found = solve_even(scaled @ scaled.T + np.diag(prior), np.column_stack([right, np.eye(len(rows))[:, n:]]))
    return found[:, 0] / sizes, found[n:, 1:] / sizes[n:] / sizes[n:, None]
