"""The assignment is the cheapest one, and says by how much."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from frf_ipz.pairing.matching import match


def cheapest(costs, row_alone, column_alone):
    """By trying all: every row has a column of its own or stays alone."""
    rows, columns = costs.shape
    best = np.inf
    for choice in set(permutations([*range(columns), *[-1] * rows], rows)):
        taken = [column for column in choice if column >= 0]
        total = sum(costs[row, column] if column >= 0 else row_alone[row] for row, column in enumerate(choice))
        best = min(best, total + sum(column_alone[column] for column in range(columns) if column not in taken))
    return best


@given(st.integers(0, 10_000))
def test_it_is_the_cheapest_of_all(seed):
    rng = np.random.default_rng(seed)
    rows, columns = rng.integers(1, 4, 2)
    costs = rng.uniform(0, 10, (rows, columns))
    alone = rng.uniform(0, 10, rows), rng.uniform(0, 10, columns)
    assert_allclose(match(costs, *alone).cost, cheapest(costs, *alone), rtol=1e-12)


def test_the_margin_is_what_the_second_best_costs_more():
    costs = np.array([[1.0, 3.0], [9.0, 2.0]])
    found = match(costs, np.full(2, 5.0), np.zeros(2))
    assert found.partner.tolist() == [0, 1]
    # without (0, 0): 0 takes 1 (3) and 1 stays alone (5): 8; or 0 stays alone (5) and 1 keeps 1 (2): 7
    assert_allclose(found.margin, [4.0, 3.0], rtol=1e-12)
    assert found.rival.tolist() == [-1, -1]


def test_a_rival_is_named():
    found = match(np.array([[1.0, 1.5]]), np.array([9.0]), np.zeros(2))
    assert (found.partner[0], found.rival[0]) == (0, 1)
    assert_allclose(found.margin, [0.5], rtol=1e-12)


@pytest.mark.parametrize("forbidden", [np.inf, np.nan])
def test_what_must_not_be_is_not(forbidden):
    found = match(np.array([[forbidden]]), np.array([9.0]), np.zeros(1))
    assert found.partner[0] == -1


def test_a_column_that_should_not_stay_alone_is_taken():
    costs = np.array([[1.0, 2.0]])
    assert match(costs, np.array([9.0]), np.array([0.0, 0.0])).partner[0] == 0
    assert match(costs, np.array([9.0]), np.array([0.0, 5.0])).partner[0] == 1


def test_nothing_against_nothing():
    found = match(np.zeros((0, 0)), np.zeros(0), np.zeros(0))
    assert found.cost == 0
    assert len(found.partner) == 0
