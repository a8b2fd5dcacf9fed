"""One-to-one assignment in which either side may stay unmatched, and the probability of each choice.

Costs are squared deviations, so an assignment is as likely as the exponential of minus half its cost. The alternatives
of a row are its other columns, and none: each as likely as the cheapest assignment that holds it. All of these follow
from the cheapest one, as shortest paths along which rows hand on their columns ([Ahuja1993], sec. 12.4).

[Ahuja1993]: R. K. Ahuja, T. L. Magnanti, J. B. Orlin, Network Flows, Prentice Hall, 1993.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.optimize import linear_sum_assignment
else:
    linear_sum_assignment = import_late("scipy.optimize", "linear_sum_assignment")

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
    """

    partner: IntArray
    cost: float


def match(costs: FloatArray, row_unmatched: FloatArray, column_unmatched: FloatArray) -> Matching:
    """Assign rows to columns.

    Parameters
    ----------
    costs : (n, m) array
        Of every pair; infinity where a pair must not be.
    row_unmatched : (n,) array
        Cost of a row without a partner.
    column_unmatched : (m,) array
        Cost of a column without a partner.

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
    return Matching(partner=partner, cost=cost)


def pair_probabilities(costs: FloatArray, row_unmatched: FloatArray, column_unmatched: FloatArray) -> FloatArray:
    """Give the probability of every pair, against the best assignments that hold another.

    Parameters
    ----------
    costs, row_unmatched, column_unmatched
        As for `match`.

    Returns
    -------
    (n, m + 1) array
        Of each row with each column, and of no partner; rows add up to 1.

    Examples
    --------
    >>> pair_probabilities(np.array([[1.0, 1.0]]), np.array([40.0]), np.zeros(2)).round(2)
    array([[0.5, 0.5, 0. ]])
    """
    n_rows, n_columns = costs.shape
    if not n_rows:
        return np.zeros((0, n_columns + 1))
    within_reach = np.isfinite(costs).any(axis=0)
    if not within_reach.all():  # what no row may take has no part in it
        probabilities = np.zeros((n_rows, n_columns + 1))
        probabilities[:, [*np.flatnonzero(within_reach), n_columns]] = pair_probabilities(
            costs[:, within_reach], row_unmatched, column_unmatched[within_reach]
        )
        return probabilities
    table = _with_unmatched(costs, row_unmatched, column_unmatched)
    _, holder_of = linear_sum_assignment(table)  # column of each row
    rise = table[:, holder_of] - table[np.arange(len(table)), holder_of][:, None]  # row takes the column of another row
    back = rise.copy()
    for middle in range(len(back)):  # Floyd and Warshall; no cycle lowers the cost, for the assignment is the cheapest
        back = np.minimum(back, back[:, middle, None] + back[middle])
    owner = np.argsort(holder_of)  # row of each column
    excess = (rise + back.T)[:n_rows, owner]
    excess = np.column_stack([excess[:, :n_columns], excess[:, n_columns:].min(axis=1)])
    likelihood = np.exp(-np.maximum(excess, 0.0) / 2)
    return np.asarray(likelihood / likelihood.sum(axis=1, keepdims=True))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hypothesis:
    """What costs may be, such as one scatter of the frequencies, and the cheapest assignment under it.

    Parameters
    ----------
    matching : Matching
        The cheapest assignment.
    costs : (n, m) array
        Of pairs.
    unmatched : pair of (n,) and (m,) array
        Costs of rows and of columns without a partner.
    total : float
        Minus twice the logarithm of how likely it is: the cost of the assignment, and what speaks against it besides.
    """

    matching: Matching
    costs: FloatArray
    unmatched: tuple[FloatArray, FloatArray]
    total: float


def mixed_probabilities(tried: Sequence[Hypothesis]) -> FloatArray:
    """Give the probability of every pair, over all hypotheses.

    Parameters
    ----------
    tried : sequence of Hypothesis
        At least one.

    Returns
    -------
    (n, m + 1) array
        As `pair_probabilities` gives them.
    """
    totals = np.array([hypothesis.total for hypothesis in tried])
    weights = np.exp(-(totals - totals.min()) / 2)
    weights /= weights.sum()
    shares = zip(weights.tolist(), tried, strict=True)
    likely = [(weight, hypothesis) for weight, hypothesis in shares if weight > np.finfo(float).eps]
    return np.asarray(sum(weight * pair_probabilities(each.costs, *each.unmatched) for weight, each in likely))


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
