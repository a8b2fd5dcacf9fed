import numpy as np
import pytest
from numpy.testing import assert_allclose

from frf_ipz.numerics.column_scaling import even, solve_columns

SIZES = np.array([1.0, 1e-12, 1e9])
CUT = 1e-12


@pytest.mark.parametrize("turn", [1.0, 1.0 + 2.0j])
def test_columns_of_any_size_are_solved_for(turn):
    columns = turn * np.random.default_rng(0).standard_normal((20, 3)) * SIZES
    wanted = np.array([2.0, -3.0, 0.5]) / SIZES
    assert_allclose(solve_columns(columns, columns @ wanted, CUT), wanted, rtol=1e-10)


def test_nothing_is_asked_of_a_column_of_zeros():
    columns = np.array([[1.0, 0.0], [2.0, 0.0]])
    assert_allclose(solve_columns(columns, np.array([3.0, 6.0])), [3.0, 0.0])
    scaled, sizes = even(columns)
    assert_allclose(scaled * sizes, columns)
