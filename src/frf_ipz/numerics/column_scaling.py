"""Least squares of columns in different units: compared at one size, for rounding would drop the small ones."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray

Columns = TypeVar("Columns", FloatArray, ComplexArray)


def even(columns: Columns) -> tuple[Columns, FloatArray]:
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


def solve_columns(columns: Columns, right: Columns, cut: float | None = None) -> Columns:
    """Solve least squares by columns of one size.

    Parameters
    ----------
    columns : (n_data, n) array
        Real or complex.
    right : (n_data,) array
        What they shall add up to.
    cut : float, optional
        Singular values below that part of the largest one count as zero; by default those below rounding.

    Returns
    -------
    (n,) array
        Of the columns as they were given.
    """
    scaled, sizes = even(columns)
    return np.asarray(np.linalg.lstsq(scaled, right, rcond=cut)[0] / sizes, dtype=columns.dtype)
