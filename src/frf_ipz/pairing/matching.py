"""One-to-one assignment in which either side may stay unmatched, and the margin of each choice."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from frf_ipz.arrays import FloatArray, IntArray

FORBIDDEN = 1e6  # cost of a pair that must not be


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Matching:
    """The cheapest assignment.

    Parameters
    ----------
    partner : (n,) int array
        Column of each row; -1 where it stays unmatched.
    cost : float
        Of the whole assignment.
    margin : (n,) array
        Rise of the cost when a row may not have its partner; 0 for unmatched rows.
    rival : (n,) int array
        Partner of the row in that second-best assignment; -1 where it then stays unmatched.
    """

    partner: IntArray
    cost: float
    margin: FloatArray
    rival: IntArray


def match(
    costs: FloatArray, row_unmatched: FloatArray, column_unmatched: FloatArray, *, margins: bool = True
) -> Matching:
    """Assign rows to columns.

    Parameters
    ----------
    costs : (n, m) array
        Of every pair; infinity where a pair must not be.
    row_unmatched : (n,) array
        Cost of a row without a partner.
    column_unmatched : (m,) array
        Cost of a column without a partner.
    margins : bool
        Compute margins and rivals too.

    Returns
    -------
    Matching
        The cheapest assignment.

    Examples
    --------
    >>> costs = np.array([[1.0, 9.0], [0.5, 0.8]])
    >>> match(costs, np.full(2, 4.0), np.zeros(2)).partner
    array([0, 1])
    """
    table = _with_unmatched(costs, row_unmatched, column_unmatched)
    partner, cost = _solve_assignment(table, *costs.shape)
    margin, rival = np.zeros(len(costs)), np.full(len(costs), -1)
    if margins:
        for row in np.flatnonzero(partner >= 0):
            changed = table.copy()
            changed[row, partner[row]] = FORBIDDEN
            second_partner, second_cost = _solve_assignment(changed, *costs.shape)
            margin[row], rival[row] = second_cost - cost, second_partner[row]
    return Matching(partner=partner, cost=cost, margin=margin, rival=rival)


def _with_unmatched(costs: FloatArray, row_unmatched: FloatArray, column_unmatched: FloatArray) -> FloatArray:
    """Pad with one stand-in partner a row and a column; stand-ins pair among themselves for nothing."""
    n_rows, n_columns = costs.shape
    table = np.zeros((n_rows + n_columns, n_rows + n_columns))
    table[:n_rows, :n_columns] = np.minimum(np.where(np.isnan(costs), FORBIDDEN, costs), FORBIDDEN)
    table[:n_rows, n_columns:] = row_unmatched[:, None]
    table[n_rows:, :n_columns] = column_unmatched
    return table


def _solve_assignment(table: FloatArray, n_rows: int, n_columns: int) -> tuple[IntArray, float]:
    rows, columns = linear_sum_assignment(table)
    partner = columns[:n_rows].copy()
    partner[partner >= n_columns] = -1
    return partner, float(table[rows, columns].sum())
