"""The assignment is the cheapest one, and as sure as its alternatives let it be."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from frf_ipz.pairing.matching import match, pair_probabilities
from frf_ipz.pairing.pair import SURE


def cheapest(costs, row_alone, column_alone):
    """Cost by trying all: every row has its own column or stays unmatched."""
    rows, columns = costs.shape
    best = np.inf
    for choice in set(permutations([*range(columns), *[-1] * rows], rows)):
        taken = [column for column in choice if column >= 0]
        total = sum(costs[row, column] if column >= 0 else row_alone[row] for row, column in enumerate(choice))
        best = min(best, total + sum(column_alone[column] for column in range(columns) if column not in taken))
    return best


@given(st.integers(0, 10_000))
def test_the_assignment_is_the_cheapest_of_all(seed):
    rng = np.random.default_rng(seed)
    rows, columns = rng.integers(1, 4, 2)
    costs = rng.uniform(0, 10, (rows, columns))
    alone = rng.uniform(0, 10, rows), rng.uniform(0, 10, columns)
    assert_allclose(match(costs, *alone).cost, cheapest(costs, *alone), rtol=1e-12)


def probabilities_by_trying(costs, row_alone, column_alone):
    """Probability of every pair over all assignments."""
    rows, columns = costs.shape
    share = np.zeros((rows, columns + 1))
    for choice in set(permutations([*range(columns), *[-1] * rows], rows)):
        total = sum(costs[row, column] if column >= 0 else row_alone[row] for row, column in enumerate(choice))
        total += sum(column_alone[column] for column in range(columns) if column not in choice)
        share[np.arange(rows), choice] += np.exp(-total / 2)
    return share / share.sum(axis=1, keepdims=True)


@given(st.integers(0, 10_000))
def test_a_sure_pair_is_sure_over_all_assignments(seed):
    rng = np.random.default_rng(seed)
    rows, columns = rng.integers(1, 5, 2)
    given_costs = rng.uniform(0, 15, (rows, columns)), np.full(rows, 9.0), np.full(columns, 9.0)
    found, exact = pair_probabilities(*given_costs), probabilities_by_trying(*given_costs)
    assert_allclose(found.sum(axis=1), 1.0, rtol=1e-12)
    sure = found >= SURE
    wrong = 1.0 - exact[sure]
    assert (wrong < 2.2 * (1.0 - SURE)).all()  # alternatives of the same best assignment count once
    assert (found.argmax(axis=1)[sure.any(axis=1)] == exact.argmax(axis=1)[sure.any(axis=1)]).all()


def test_one_row_has_the_probabilities_of_its_costs():
    found = pair_probabilities(np.array([[1.0, 3.0]]), np.array([5.0]), np.zeros(2))
    weights = np.exp(-np.array([1.0, 3.0, 5.0]) / 2)
    assert_allclose(found, [weights / weights.sum()], rtol=1e-12)


def test_rows_that_could_exchange_their_columns_are_not_sure():
    found = pair_probabilities(np.ones((2, 2)), np.full(2, 50.0), np.zeros(2))
    assert_allclose(found, [[0.5, 0.5, 0.0]] * 2, atol=1e-9)


@pytest.mark.parametrize("forbidden", [np.inf, np.nan])
def test_a_forbidden_pair_is_not_assigned(forbidden):
    table = np.array([[forbidden]]), np.array([9.0]), np.zeros(1)
    assert match(*table).partner[0] == -1
    assert_allclose(pair_probabilities(*table), [[0.0, 1.0]], atol=1e-300)


def test_a_column_that_should_not_stay_unmatched_is_assigned():
    costs = np.array([[1.0, 2.0]])
    assert match(costs, np.array([9.0]), np.array([0.0, 0.0])).partner[0] == 0
    assert match(costs, np.array([9.0]), np.array([0.0, 5.0])).partner[0] == 1


def test_an_empty_assignment_costs_nothing():
    matching = match(np.zeros((0, 0)), np.zeros(0), np.zeros(0))
    assert matching.cost == 0
    assert len(matching.partner) == 0
