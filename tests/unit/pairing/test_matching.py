"""The assignment is the cheapest one, with the right margin."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from frf_ipz.pairing.matching import match


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


def test_the_margin_is_what_the_second_best_costs_more():
    costs = np.array([[1.0, 3.0], [9.0, 2.0]])
    matching = match(costs, np.full(2, 5.0), np.zeros(2))
    assert matching.partner.tolist() == [0, 1]
    # without (0, 0): 0 takes 1 (3) and 1 stays alone (5): 8; or 0 stays alone (5) and 1 keeps 1 (2): 7
    assert_allclose(matching.margin, [4.0, 3.0], rtol=1e-12)
    assert matching.rival.tolist() == [-1, -1]


def test_a_rival_is_named():
    matching = match(np.array([[1.0, 1.5]]), np.array([9.0]), np.zeros(2))
    assert (matching.partner[0], matching.rival[0]) == (0, 1)
    assert_allclose(matching.margin, [0.5], rtol=1e-12)


@pytest.mark.parametrize("forbidden", [np.inf, np.nan])
def test_a_forbidden_pair_is_not_assigned(forbidden):
    matching = match(np.array([[forbidden]]), np.array([9.0]), np.zeros(1))
    assert matching.partner[0] == -1


def test_a_column_that_should_not_stay_unmatched_is_assigned():
    costs = np.array([[1.0, 2.0]])
    assert match(costs, np.array([9.0]), np.array([0.0, 0.0])).partner[0] == 0
    assert match(costs, np.array([9.0]), np.array([0.0, 5.0])).partner[0] == 1


def test_an_empty_assignment_costs_nothing():
    matching = match(np.zeros((0, 0)), np.zeros(0), np.zeros(0))
    assert matching.cost == 0
    assert len(matching.partner) == 0
