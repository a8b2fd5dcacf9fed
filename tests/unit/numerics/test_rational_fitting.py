"""Partial fractions as columns, and poles by the polyreference method, on exact data."""

import numpy as np
import pytest

from frf_ipz.numerics.partial_fractions import pair_columns, pair_values, stacked, unstacked
from frf_ipz.numerics.polyreference import denominator, denominator_roots, participation, reduced_normal_matrix

EXACT = 1e-12  # relative: rounding of sums of a few terms
POLES = np.array([-0.02 + 0.5j, -0.01 + 1.1j, -0.03 + 2.2j])
LINES = np.linspace(0.05, 3.0, 400)


def test_columns_times_residues_are_the_response():
    rng = np.random.default_rng(1)
    residues = rng.standard_normal((3, 2)) + 1j * rng.standard_normal((3, 2))
    parts = np.concatenate([residues.real, residues.imag])
    for s in (1j * LINES, 0.3 + 1j * LINES):
        np.testing.assert_allclose(
            unstacked(pair_columns(s, POLES) @ parts), pair_values(s, POLES, residues), rtol=EXACT, atol=EXACT
        )


def test_second_power_is_the_derivative():
    s, step = 1j * LINES, 1e-6
    for change in (step, 1j * step):
        moved = POLES + np.array([0, change, 0])
        residues = np.array([[0.0], [0.7 - 0.4j], [0.0]])
        difference = (pair_values(s, moved, residues) - pair_values(s, POLES, residues)) / step
        slope = residues * change / step
        columns = pair_columns(s, POLES, power=2) @ np.concatenate([slope.real, slope.imag])
        # a one-sided difference is off by step over the distance from the axis
        np.testing.assert_allclose(unstacked(columns), difference, rtol=0, atol=5 * step / 0.01 * np.abs(columns).max())


def test_stacking_is_undone():
    values = np.array([[1 + 2j], [3 - 1j]])
    np.testing.assert_array_equal(unstacked(stacked(values)), values)


@pytest.mark.parametrize("real", [True, False])
def test_poles_of_exact_frfs_are_found(real):
    theta = LINES if real else (LINES - LINES[0]) * 0.9
    z_line = np.exp(-1j * theta)
    rng = np.random.default_rng(2)
    roots = np.exp(-POLES) if real else np.exp(-0.9 * (POLES - 1j * LINES[0]))
    vectors = rng.standard_normal((3, 4, 1)) * rng.standard_normal((3, 1, 2))
    H = sum(vector / (1 - z_line[:, None, None] / root) for root, vector in zip(roots, vectors, strict=True))
    if real:
        H = H + sum(
            vector / (1 - z_line[:, None, None] / root.conj()) for root, vector in zip(roots, vectors, strict=True)
        )
    order = 6
    M = reduced_normal_matrix(theta, H, order, real=real)
    D = denominator(M, 2, order - 2)
    found = denominator_roots(D)
    nearest = np.abs(found[:, None] - roots).argmin(axis=0)
    np.testing.assert_allclose(found[nearest], roots, rtol=1e-6, atol=0)  # squared condition of the normal equations
    shapes = participation(D, found[nearest])
    for shape, vector in zip(shapes, vectors, strict=True):
        along = vector[0] / np.linalg.norm(vector[0])
        assert abs(shape @ along.conj()) ** 2 == pytest.approx(1.0, abs=1e-6)
