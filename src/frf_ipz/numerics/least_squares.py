"""Least squares that rounding does not spoil: columns in different units, and large derivatives beside a prior.

Columns are compared at one size, for rounding would drop the small ones. With a prior the normal equations are factored
without forming the product of the derivatives, whose digits would hide it.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from scipy import linalg

from frf_ipz.arrays import ComplexArray, FloatArray

Columns = TypeVar("Columns", FloatArray, ComplexArray)


def scale_columns(columns: Columns) -> tuple[Columns, FloatArray]:
    """Bring columns to a norm of one.

    Parameters
    ----------
    columns : (n_data, n) array
        Real or complex; zero columns stay zero.

    Returns
    -------
    columns : (n_data, n) array
        Of norm one.
    sizes : (n,) array
        Their norms before.
    """
    sizes = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    return columns / sizes, sizes


def solve_scaled_columns(columns: Columns, right: Columns, cut: float | None = None) -> Columns:
    """Solve least squares by columns of one size.

    Parameters
    ----------
    columns : (n_data, n) array
        Real or complex.
    right : (n_data,) array
        What the columns have to add up to.
    cut : float, optional
        Singular values below that part of the largest one count as zero; by default those below rounding.

    Returns
    -------
    (n,) array
        Coefficients of the columns before scaling.
    """
    scaled, sizes = scale_columns(columns)
    return np.asarray(np.linalg.lstsq(scaled, right, rcond=cut)[0] / sizes, dtype=columns.dtype)


def cholesky_with_prior(rows: FloatArray) -> FloatArray:
    """Give the Cholesky factor of rows rows^T + 1, however large the rows are: the product is not formed.

    Parameters
    ----------
    rows : (n, n_data) array
        Derivatives by parameters whose prior is a unit normal distribution.

    Returns
    -------
    (n, n) array
        Lower triangular, its diagonal positive.
    """
    (upper,) = linalg.qr(np.vstack([rows.T, np.eye(len(rows))]), mode="r")
    upper = upper[: len(rows)]
    return np.asarray(upper.T * np.where(np.diag(upper) < 0, -1.0, 1.0))
