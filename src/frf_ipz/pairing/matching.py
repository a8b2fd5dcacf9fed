"""One-to-one assignment in which either side may stay alone, and how sure each choice is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from frf_ipz.arrays import FloatArray, IntArray

FORBIDDEN = 1e6  # cost of what must not be


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Matching:
    """The cheapest assignment.

    Parameters
    ----------
    partner : (n,) int array
        Column of each row; -1 where it stays alone.
    cost : float
        Of the whole assignment.
    margin : (n,) array
        By how much the cost rises when a row may not have its partner; 0 for rows that stay alone.
    rival : (n,) int array
        Partner of the row in that second-best assignment; -1 where it then stays alone.
    """

    partner: IntArray
    cost: float
    margin: FloatArray
    rival: IntArray


def match(costs: FloatArray, row_alone: FloatArray, column_alone: FloatArray, *, margins: bool = True) -> Matching:
    """Assign rows to columns.

    Parameters
    ----------
    costs : (n, m) array
        Of every pair; infinity where a pair must not be.
    row_alone : (n,) array
        Cost of a row without a partner.
    column_alone : (m,) array
        Cost of a column without a partner.
    margins : bool
        Work out margins and rivals too.

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
    table = _with_lonely(costs, row_alone, column_alone)
    partner, cost = _solve(table, *costs.shape)
    margin, rival = np.zeros(len(costs)), np.full(len(costs), -1)
    if margins:
        for row in np.flatnonzero(partner >= 0):
            changed = table.copy()
            changed[row, partner[row]] = FORBIDDEN
            others, other_cost = _solve(changed, *costs.shape)
            margin[row], rival[row] = other_cost - cost, others[row]
    return Matching(partner=partner, cost=cost, margin=margin, rival=rival)


def _with_lonely(costs: FloatArray, row_alone: FloatArray, column_alone: FloatArray) -> FloatArray:
    """Pad with one stand-in partner a row and a column; stand-ins pair among themselves for nothing."""
    n_rows, n_columns = costs.shape
    table = np.zeros((n_rows + n_columns, n_rows + n_columns))
    table[:n_rows, :n_columns] = np.minimum(np.where(np.isnan(costs), FORBIDDEN, costs), FORBIDDEN)
    table[:n_rows, n_columns:] = row_alone[:, None]
    table[n_rows:, :n_columns] = column_alone
    return table


def _solve(table: FloatArray, n_rows: int, n_columns: int) -> tuple[IntArray, float]:
    rows, columns = linear_sum_assignment(table)
    partner = columns[:n_rows].copy()
    partner[partner >= n_columns] = -1
    return partner, float(table[rows, columns].sum())
