"""The DOFs that a reduced model retains: independent ones, by pivoted QR of their mode shapes.

[Kammer1991] D. C. Kammer, Sensor placement for on-orbit modal identification and correlation of large space structures,
Journal of Guidance, Control and Dynamics 14 (2), 1991, 251-259, doi:10.2514/3.20635.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from collections.abc import Sequence

MAX_CONDITION = 1e3  # beyond, fewer than ten of sixteen digits of the reduced matrices are right (they hold its square)
INDEPENDENT = (0.02, 0.1, 0.5, 1.0)  # share of a required DOF's shapes beyond those before it, tried in turn


def condition_number(shapes: FloatArray) -> float:
    """Condition number of the square matrix of mode shapes at the retained DOFs, Phi_s.

    Rows are scaled to the same length, since units of the DOFs do no harm.

    Parameters
    ----------
    shapes : (r, r) array
        Mass-normalised mode shapes and residual vectors at the retained DOFs.

    Returns
    -------
    float
        1 is best; infinite where a DOF does not move at all.
    """
    lengths = np.linalg.norm(shapes, axis=1)
    if not lengths.all():
        return float("inf")
    return float(np.linalg.cond(shapes / lengths[:, None]))


def choose_retained_rows(shapes: FloatArray, required: Sequence[int], candidates: IntArray, count: int) -> IntArray:
    """Choose DOFs at which modes are as independent as can be.

    The required ones come first, in their order, as long as they are independent of each other; further ones follow by
    pivoted QR, which makes the volume that their shapes span large (and so, nearly, the effective independence of
    [Kammer1991]). If the whole is badly conditioned all the same, fewer of the required ones are retained.

    Parameters
    ----------
    shapes : (n, r) array
        Mode shapes and residual vectors at all DOFs.
    required : sequence of int
        Rows to retain if possible.
    candidates : (n_candidates,) int array
        Rows to fill up with.
    count : int
        Number of rows to choose; at most r.

    Returns
    -------
    (count,) int array
        Rows.
    """
    rows = np.zeros(0, np.int64)
    for independent in INDEPENDENT:
        rows = _select_rows(shapes, required, candidates, count, independent)
        if condition_number(shapes[rows]) <= MAX_CONDITION:
            break
    return rows


def _select_rows(
    shapes: FloatArray, required: Sequence[int], candidates: IntArray, count: int, independent: float
) -> IntArray:
    chosen: list[int] = []
    spanned = np.zeros((shapes.shape[1], 0))
    for row in required:
        shape = shapes[row]
        rest = shape - spanned @ (spanned.T @ shape)
        if len(chosen) < count and np.linalg.norm(rest) > independent * np.linalg.norm(shape):
            chosen.append(row)
            spanned = np.column_stack([spanned, rest / np.linalg.norm(rest)])
    missing = count - len(chosen)
    if missing:
        further = np.setdiff1d(candidates, chosen)
        rest = shapes[further] - (shapes[further] @ spanned) @ spanned.T
        _, pivots = linalg.qr(rest.T, mode="r", pivoting=True)
        chosen += [int(row) for row in further[pivots[:missing]]]
    return np.array(chosen, dtype=np.int64)
