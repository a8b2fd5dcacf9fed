"""Products of vectors that fit a matrix best, each entry weighed by itself.

The singular value decomposition gives them where all entries weigh the same, or weigh as a product of row and column.
Else rows and columns are solved for in turn, each a linear problem, from there: sec. 3 of [Srebro2003].

[Srebro2003] N. Srebro, T. Jaakkola, Weighted low-rank approximations, Proc. 20th Int. Conf. on Machine Learning, 2003,
720-727.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, FloatArray

SWEEPS = 30  # over rows and columns


def fit_products(matrix: ComplexArray | FloatArray, weight: FloatArray, rank: int) -> tuple[ComplexArray, ComplexArray]:
    """Find the sum of products of two vectors, ``rows @ columns.T``, that fits a matrix best; of many at once.

    Parameters
    ----------
    matrix : (..., n_rows, n_columns) complex or real array
        What is fitted.
    weight : (..., n_rows, n_columns) array
        Of the square of each entry's misfit; 0 where there is no entry.
    rank : int
        Number of products.

    Returns
    -------
    rows : (..., n_rows, rank) complex array
        Left vectors; 0 in rows without weight.
    columns : (..., n_columns, rank) complex array
        Right vectors; 0 in columns without weight.
    """
    present = np.where(weight > 0, matrix, 0.0)
    log_weight = np.log(np.where(weight > 0, weight, 1.0)) / 2
    mean = log_weight.mean(axis=(-2, -1), keepdims=True)
    by_row, by_column = (np.exp(log_weight.mean(axis=axis, keepdims=True) - mean / 2) for axis in (-1, -2))
    right = np.linalg.svd(present * by_row * by_column, full_matrices=False)[2]
    columns = (right[..., :rank, :] / by_column).mT
    for _ in range(SWEEPS):
        rows = _fit_rows(present, weight, columns)
        columns = _fit_rows(present.mT, weight.mT, np.linalg.qr(rows)[0])
        columns = np.linalg.qr(columns)[0]
    return _fit_rows(present, weight, columns), columns


def _fit_rows(matrix: ComplexArray | FloatArray, weight: FloatArray, columns: ComplexArray) -> ComplexArray:
    """Coefficients of each row in the columns."""
    rank = columns.shape[-1]
    pairs = (columns.conj()[..., :, None] * columns[..., None, :]).reshape(*columns.shape[:-1], rank**2)
    normal = (weight @ pairs).reshape(*weight.shape[:-1], rank, rank)
    size = np.trace(normal, axis1=-2, axis2=-1).real[..., None, None]
    ridge = (np.finfo(float).eps * size + np.finfo(float).tiny) * np.eye(rank)  # where a row has no weight
    return np.asarray(np.linalg.solve(normal + ridge, ((weight * matrix) @ columns.conj())[..., None])[..., 0])
