"""Cholesky factors of least squares with a prior: the products of large derivatives are not formed."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from frf_ipz.arrays import FloatArray


def factor_with_prior(rows: FloatArray) -> FloatArray:
    """Give the Cholesky factor of rows rows^T + 1, however large the rows are: the product is not formed.

    Parameters
    ----------
    rows : (n, n_data) array
        Derivatives by unknowns with a prior of 1.

    Returns
    -------
    (n, n) array
        Lower triangular, its diagonal positive.
    """
    (upper,) = linalg.qr(np.vstack([rows.T, np.eye(len(rows))]), mode="r")
    upper = upper[: len(rows)]
    return np.asarray(upper.T * np.where(np.diag(upper) < 0, -1.0, 1.0))
