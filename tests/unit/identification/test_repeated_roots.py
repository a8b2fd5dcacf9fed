"""Two modes at one frequency are told by the rank of their residues."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.identification.fit import fit_modes
from frf_ipz.identification.options import FitOptions
from frf_ipz.identification.results.repeated_roots import BEYOND_DOUBT, _probability_of_rank_two
from frf_ipz.identification.results.shapes import mode_shapes
from synthetic_frfs import Modes, accelerances, frf_set, labels_of, random_modes, with_noise

LINES_HZ = np.arange(40, 401) * 0.5
SHAPES = np.array([[1.0, 0.2, -0.7, 0.4], [-0.3, 1.0, 0.5, 0.6], [0.5, -0.6, 0.4, 1.0]]).T
SEED = 3_930


def two_at(distance_hz, *, n_inputs=2):
    frequency_hz = np.array([80.0, 80.0 + distance_hz, 150.0])
    return Modes(frequency_hz, np.full(3, 0.01), SHAPES, SHAPES[:n_inputs])


def fit_of(truth, *, noise=1e-3, known=True):
    frfs = accelerances(truth, LINES_HZ, noise=noise, seed=SEED)
    return frfs, fit_modes(frfs if known else frf_set(LINES_HZ, frfs.values, frfs.labels), options=FitOptions())


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("distance_hz", [0.0, 0.05])
def test_two_modes_at_one_frequency(distance_hz, known):
    truth = two_at(distance_hz)
    frfs, fit = fit_of(truth, known=known)
    assert fit.n_modes == 3
    np.testing.assert_allclose(fit.modes["frequency_hz"], truth.frequency_hz, rtol=1e-4, atol=0)
    assert ("share the frequency" in " ".join(fit.warnings)) == (distance_hz == 0)
    used = fit.used_lines
    error = np.abs(fit.model(frfs.s[used]) - frfs.values[used]) / np.sqrt(frfs.variance[used])
    assert np.sqrt(np.mean(error**2)) < 1.05


def test_their_shapes_span_those_of_the_truth():
    _, fit = fit_of(two_at(0.0))
    shapes = mode_shapes(fit).shapes[:, :2]
    assert np.abs(shapes.imag).max() < 0.02 * np.abs(shapes).max()
    # what any rotation of the two leaves is the sum of their products
    np.testing.assert_allclose(shapes @ shapes.T, SHAPES[:, :2] @ SHAPES[:, :2].T, rtol=0, atol=0.01)


def test_their_covariance_is_that_of_two_estimates():
    _, fit = fit_of(two_at(0.0))
    pair = fit.covariance[np.ix_(range(4), range(4))]
    alone = fit_of(two_at(0.0, n_inputs=1))[1].covariance
    assert np.linalg.eigvalsh(pair).min() > 0
    mean = (pair[:2, :2] + pair[2:, 2:] + pair[:2, 2:] + pair[2:, :2]) / 4
    np.testing.assert_allclose(pair[:2, :2], 2 * mean, rtol=1e-6, atol=0)
    assert np.trace(mean) < np.trace(alone[:2, :2])  # two inputs say more than one
    assert fit.covariance.shape == (2 * (3 + len(fit.zeros.values)),) * 2


def test_one_input_does_not_tell():
    _, fit = fit_of(two_at(0.0, n_inputs=1))
    assert fit.n_modes == 2


def test_modes_of_rank_one_stay_one():
    for seed in range(5):
        truth = random_modes([60.0, 110.0, 160.0], 0.01, n_outputs=5, n_inputs=3, seed=seed)
        fit = fit_modes(accelerances(truth, LINES_HZ, noise=3e-3, seed=seed), options=FitOptions())
        assert fit.n_modes == 3


def test_shapes_that_differ_by_the_mounting_are_no_second_mode():
    truth = random_modes([60.0, 110.0, 160.0], 0.01, n_outputs=5, n_inputs=3, seed=SEED)
    frfs = accelerances(truth, LINES_HZ, noise=1e-4, seed=SEED)
    gains = 1 + 0.05 * np.random.default_rng(SEED).standard_normal(frfs.n_frfs)
    fit = fit_modes(replace(frfs, values=frfs.values * gains), options=FitOptions())
    assert fit.n_modes == 3


def disc(gains):
    """Two pairs of equal modes, of two and of three nodal diameters, and one mode without any."""
    at = [np.radians(angles) for angles in ([0.0, 40.0, 130.0, 220.0, 280.0, 340.0], [0.0, 35.0, 100.0])]
    outputs, inputs = (
        np.array([np.cos(2 * a), np.sin(2 * a), 0.8 + 0 * a, np.cos(3 * a), np.sin(3 * a)]).T for a in at
    )
    truth = Modes(np.array([70.0, 70.0, 110.0, 160.0, 160.0]), np.full(5, 0.003), outputs, inputs)
    frfs = accelerances(truth, LINES_HZ, noise=1e-3, seed=SEED)
    return replace(frfs, values=frfs.values * (1 + gains * np.random.default_rng(1).standard_normal(frfs.n_frfs)))


@pytest.mark.parametrize("gains", [0.0, 0.01, 0.03])
def test_each_of_two_repeated_roots_is_found(gains):
    """What other modes leave of one product tells how far gains differ, unless these are repeated roots too."""
    fit = fit_modes(disc(gains), options=FitOptions())
    np.testing.assert_allclose(fit.modes["frequency_hz"], [70.0, 70.0, 110.0, 160.0, 160.0], rtol=2e-4, atol=0)


@pytest.mark.parametrize(("gains", "noise"), [(0.0, 1.0), (0.02, 1.0), (0.1, 1.0), (0.03, 3.0)])
def test_gains_and_noise_make_no_second_mode_and_hide_none(gains, noise):
    """Of residues of one to eight modes, in grids of any size, with noise as stated and larger."""
    rng, found, n_repeated = np.random.default_rng(SEED), 0, 0
    for _ in range(40):
        n_modes, shape = rng.integers(1, 9), (rng.integers(2, 9), rng.integers(2, 5))
        repeated = rng.random(n_modes) < 0.3
        first, second = (
            rng.standard_normal((n_modes, shape[0], 1)) * rng.standard_normal((n_modes, 1, shape[1])) for _ in range(2)
        )
        exact = (first + repeated[:, None, None] * second) * np.exp(rng.uniform(-1, 1, (n_modes, 1, 1)))
        std = np.abs(exact).mean(axis=(1, 2), keepdims=True) * np.exp(rng.uniform(-9, -4)) + 0 * exact
        error = std / np.sqrt(2) * (rng.standard_normal(exact.shape) + 1j * rng.standard_normal(exact.shape))
        products = exact * (1 + gains * rng.standard_normal(shape)) + noise * error
        is_found = _probability_of_rank_two(products, std**2) > BEYOND_DOUBT
        assert not np.any(is_found & ~repeated)
        found, n_repeated = found + is_found.sum(), n_repeated + repeated.sum()
    assert found > 0.7 * n_repeated


def test_residues_without_an_error_are_told_too():
    rng = np.random.default_rng(SEED)
    first, second = (rng.standard_normal((3, 4, 1)) * rng.standard_normal((3, 1, 3)) for _ in range(2))
    products = first + np.array([0.0, 1.0, 0.0])[:, None, None] * second
    probability = _probability_of_rank_two(products.astype(complex), np.zeros(products.shape))
    assert (probability > BEYOND_DOUBT).tolist() == [False, True, False]


def two_axes(*, repeated, seed):
    """Vertical and horizontal ports: what crosses over is a thousand times smaller, and its noise as well."""
    truth = random_modes([60.0, 110.0, 110.0 if repeated else 130.0, 160.0], 0.01, n_outputs=6, n_inputs=6, seed=seed)
    crossing = np.where(np.arange(6) < 3, 1.0, 1e-3)
    truth = Modes(truth.frequency_hz, truth.damping_ratio, truth.outputs * crossing[:, None], truth.inputs)
    exact = truth.receptance(2j * np.pi * LINES_HZ) * (2j * np.pi * LINES_HZ[:, None]) ** 2
    exact = exact.reshape(-1, 6, 6) * np.where(np.arange(6) < 3, 1.0, 1e-3)
    std = np.sqrt(np.mean(np.abs(exact) ** 2, axis=0)) * 1e-3
    std[3:, 3:] *= 1e3  # no product of a row and a column
    return with_noise(LINES_HZ, exact.reshape(-1, 36), labels_of(6, 6), std.ravel(), np.random.default_rng(seed))


@pytest.mark.parametrize("repeated", [True, False])
def test_noise_that_differs_over_a_grid_of_two_axes_is_weighed(repeated):
    fit = fit_modes(two_axes(repeated=repeated, seed=SEED), options=FitOptions())
    assert fit.n_modes == 4
    assert ("share the frequency" in " ".join(fit.warnings)) == repeated


@pytest.mark.parametrize("seed", [1, 2])
def test_strong_modes_above_the_band_make_no_false_mode(seed):
    """Three fixed poles are too few here: one seed had a false mode, FRFs of low level four times their noise left."""
    modes = random_modes([60.0, 110.0, 160.0, 190.0, 209.0, 230.0, 260.0], 0.005, n_outputs=4, n_inputs=4, seed=seed)
    fit = fit_modes(accelerances(modes, LINES_HZ, noise=1e-4, seed=seed), options=FitOptions())
    assert fit.n_modes == 4
    assert fit.misfit["ratio"].max() < 2.0
