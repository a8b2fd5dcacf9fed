"""Normal equations of unknowns whose sizes differ by many orders of magnitude."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from frf_ipz.arrays import FloatArray

ROUNDING = 1e-10  # added to normal equations of unit diagonal: they stay positive


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
    scaled = right * scale if right.ndim == 1 else right * scale[:, None]
    found = linalg.cho_solve(linalg.cho_factor(even, lower=True), scaled)
    return np.asarray(found * scale if right.ndim == 1 else found * scale[:, None])
