"""Normal equations whose unknowns differ in size by many orders of magnitude."""

from __future__ import annotations

import math

import numpy as np
from scipy import linalg

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray

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


def assemble(
    structural: ComplexArray, of_states: ComplexArray, misfit: ComplexArray, moving: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Assemble normal equations in which the initial state of a segment changes nothing but that segment.

    Parameters
    ----------
    structural : (n_structural, n_segments, n_sensors, n_used) complex array
        Derivatives by what all segments have in common.
    of_states : (2, n_moving, n_free, n_sensors, n_used) complex array
        Derivatives of segments by their own states.
    misfit : (n_segments, n_sensors, n_used) complex array
        Weighted as they are.
    moving : (n_moving,) int array
        Which segments these are.

    Returns
    -------
    matrix : (n, n) array
        Sums of products of derivatives, of real and imaginary parts, for all n parameters as in `NuisancePrior`.
    right : (n,) array
        Sums of their products with the misfit.
    """
    n_structural, n_segments = structural.shape[:2]
    n_moving, n_free = of_states.shape[1:3]
    shared = np.ascontiguousarray(structural.reshape(n_structural, n_segments, -1)).view(float)
    own = np.ascontiguousarray(
        of_states.swapaxes(0, 1).reshape(n_moving, 2 * n_free, math.prod(misfit.shape[1:]))
    ).view(float)
    left = np.ascontiguousarray(misfit.reshape(n_segments, -1)).view(float)
    flat = shared.reshape(n_structural, -1)
    matrix = np.zeros((n_structural + 2 * n_moving * n_free,) * 2)
    right = np.zeros(len(matrix))
    matrix[:n_structural, :n_structural] = flat @ flat.T
    right[:n_structural] = flat @ left.reshape(-1)
    for number, segment in enumerate(moving):
        first = n_structural + number * n_free + np.arange(n_free)
        at = np.concatenate([first, first + n_moving * n_free])
        matrix[np.ix_(at, at)] = own[number] @ own[number].T
        across = shared[:, segment] @ own[number].T
        matrix[:n_structural, at], matrix[at, :n_structural] = across, across.T
        right[at] = own[number] @ left[segment]
    return matrix, right


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
