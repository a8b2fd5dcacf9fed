"""Motions that a matrix lets pass without a force: whether they are such, and how they stay such despite rounding."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from frf_ipz.arrays import BoolArray, FloatArray

EPS = float(np.finfo(float).eps)
ROUNDING = 1e3 * EPS  # of the sum of all terms' sizes: reduced matrices hold the condition number of their modes


def meet_no_force(matrix: FloatArray, motions: FloatArray) -> BoolArray:
    """Tell which motions meet no force beyond rounding, and give none.

    Parameters
    ----------
    matrix : (r, r) array
        Stiffness or damping; it need not be symmetric.
    motions : (r, k) array
        The motions.

    Returns
    -------
    (k,) bool array
        True for none.
    """
    passed = np.ones(motions.shape[1], bool)
    for side in (matrix, matrix.T):
        allowed = ROUNDING * (np.abs(side) @ np.abs(motions)).max(0, initial=0.0)
        passed &= (np.abs(side @ motions) <= allowed).all(0)
    return passed


def mass_normalise(motions: FloatArray, mass: FloatArray) -> FloatArray:
    """Combine motions to mass-normalised ones, each of itself and those before it.

    Parameters
    ----------
    motions : (r, k) array
        Independent motions.
    mass : (r, r) array
        Mass matrix.

    Returns
    -------
    (r, k) array
        They span the same.
    """
    if not motions.shape[1]:
        return motions
    lower = cholesky(motions.T @ mass @ motions, lower=True)
    return np.asarray(solve_triangular(lower, motions.T, lower=True).T)


def without_force(matrix: FloatArray, mass: FloatArray, motions: FloatArray) -> FloatArray:
    """Take off a matrix what resists some motions, and leave it as it is for those that are orthogonal in the mass.

    Parameters
    ----------
    matrix, mass : (r, r) array
        Stiffness or damping, and mass.
    motions : (r, k) array
        The motions.

    Returns
    -------
    (r, r) array
        Symmetric to the last bit where the matrix is.

    Examples
    --------
    >>> chain = np.array([[2.0, -1.0 - 1e-9], [-1.0 - 1e-9, 1.0]])
    >>> without_force(chain, np.eye(2), np.ones((2, 1))).sum(axis=0).round(15).tolist()
    [0.0, 0.0]
    """
    normalised = mass_normalise(motions, mass)
    keep = np.eye(len(mass)) - normalised @ (normalised.T @ mass)
    result = keep.T @ matrix @ keep
    return np.asarray((result + result.T) / 2 if (matrix == matrix.T).all() else result)
