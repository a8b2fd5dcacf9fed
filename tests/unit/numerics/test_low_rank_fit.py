"""Products that fit a matrix best: what is exact is found, what has no weight says nothing."""

import numpy as np
from numpy.testing import assert_allclose

from frf_ipz.numerics.low_rank_fit import fit_products

RNG = np.random.default_rng(41)


def complex_normal(*shape):
    return RNG.standard_normal((*shape, 2)) @ np.array([1.0, 1j])


def test_a_product_is_found_from_the_entries_that_weigh():
    matrix = complex_normal(5, 2) @ complex_normal(2, 6)
    weight = np.exp(3 * RNG.standard_normal((5, 6)))
    rows, columns = fit_products(matrix, weight, 2)
    assert_allclose(rows @ columns.T, matrix, rtol=0, atol=1e-10 * np.abs(matrix).max())
    product = np.outer(complex_normal(5), complex_normal(6))
    absent = np.zeros((5, 6), bool)
    absent[[0, 2, 3], [1, 1, 4]] = True
    rows, columns = fit_products(np.where(absent, 1e6, product), np.where(absent, 0.0, 1.0), 1)
    assert_allclose(rows @ columns.T, product, rtol=0, atol=1e-6 * np.abs(product).max())


def test_the_weighted_misfit_is_that_of_the_noise_alone():
    std = np.exp(2 * RNG.standard_normal((6, 6)))
    left = []
    for _ in range(60):
        matrix = 1e4 * np.outer(complex_normal(6), complex_normal(6)) + std * complex_normal(6, 6) / np.sqrt(2)
        rows, columns = fit_products(matrix, std**-2, 1)
        left.append(np.sum(np.abs(matrix - rows @ columns.T) ** 2 / std**2))
    assert_allclose(np.mean(left), 25, rtol=0.1)  # 36 complex numbers less 11 of a product


def test_nothing_is_fitted_where_nothing_weighs():
    rows, columns = fit_products(np.ones((3, 2), complex), np.zeros((3, 2)), 1)
    assert not (rows @ columns.T).any()
