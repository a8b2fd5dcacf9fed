import numpy as np
from numpy.testing import assert_allclose

from frf_ipz.diagnosis.nonlinear.fitting.normal_equations import assemble, solve_scaled

EXACT = 1e-6  # relative: digits that remain of unknowns of such sizes
SIZES = np.array([1e9, 1.0, 1e-6])


def test_unknowns_of_very_different_sizes_are_solved_for():
    scaled = np.array([[2.0, 0.5, 0.1], [0.5, 1.0, 0.3], [0.1, 0.3, 1.5]])
    expected = np.array([[1e-9, 2e-9], [3.0, -1.0], [5e6, 4e6]])
    normal = scaled * np.outer(SIZES, SIZES)
    assert_allclose(solve_scaled(normal, normal @ expected), expected, rtol=EXACT)
    assert_allclose(solve_scaled(normal, normal @ expected[:, 0]), expected[:, 0], rtol=EXACT)


def test_rounding_that_left_no_definite_matrix_is_overcome():
    """Two unknowns with one effect, so large that the prior of 1 is lost in rounding."""
    row = 1e9 * np.array([1.0, 1.0])
    solution = solve_scaled(np.outer(row, row) + np.eye(2) - np.diag([2.0, 2.0]) * 64, row)
    assert_allclose(row @ solution, 1.0, rtol=EXACT)


def test_states_of_segments_change_their_own_segment_only():
    """Blocks give what derivatives would that are zero in all other segments."""
    rng = np.random.default_rng(3)

    def draw(*shape):
        return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)

    structural, of_states, misfit, moving = draw(5, 3, 2, 7), draw(2, 2, 4, 2, 7), draw(3, 2, 7), np.array([0, 2])
    dense = np.zeros((2, 2, 4, 3, 2, 7), complex)
    for number, segment in enumerate(moving):
        dense[:, number, :, segment] = of_states[:, number]
    rows = np.concatenate([structural, dense.reshape(-1, 3, 2, 7)]).reshape(-1, misfit.size).view(float)
    matrix, right = assemble(structural, of_states, misfit, moving)
    assert_allclose(matrix, rows @ rows.T, rtol=1e-12, atol=1e-12)
    assert_allclose(right, rows @ misfit.reshape(-1).view(float), rtol=1e-12, atol=1e-12)
    at_rest, _ = assemble(structural, of_states[:, :0], misfit, moving[:0])
    assert_allclose(at_rest, matrix[:5, :5])
