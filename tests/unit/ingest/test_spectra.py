"""Averages of spectra: the three estimators, the coherence and the variance of H1."""

import numpy as np
import pytest

from frf_ipz.errors import ShapeError
from frf_ipz.ingest.estimation.spectra import empty_sums, estimate_coherence, estimate_frf
from frf_ipz.ingest.estimation.variance import frf_variance
from synthetic_campaign import Structure

N_LINES = 1500
LINES_HZ = np.linspace(2.0, 300.0, N_LINES)
STRUCTURE = Structure()
TRUTH = STRUCTURE.accelerance(2j * np.pi * LINES_HZ)
AWAY_FROM_ZERO = slice(100, None)  # of 0 Hz, where the accelerance vanishes
CALIBRATED = 0.15  # relative: error of the variance, averaged over all lines and campaigns
SMOOTH = 0.11  # relative: 1 / sqrt(degrees of freedom in a band), with what overlapping bands add
LOCAL = 0.35  # relative: the same at peaks and at notches alone


def complex_noise(rng, *shape):
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)


def campaign(rng, *, n_records=5, force_noise=0.0, response_noise=0.0, slope=0.0, truth=TRUTH):
    """Sum spectra of impacts of different strength; the noise of the responses may rise along the lines."""
    sums = empty_sums(N_LINES, truth.shape[1])
    color = 1.0 + slope * np.linspace(0.0, 1.0, N_LINES)
    for _ in range(n_records):
        force = rng.uniform(0.5, 2.0) * np.exp(-((LINES_HZ / 300.0) ** 2)).astype(complex)
        response = truth.T * force
        sums.add_spectra(
            force + force_noise * complex_noise(rng, N_LINES),
            response + response_noise * color * complex_noise(rng, truth.shape[1], N_LINES),
        )
    return sums


@pytest.mark.parametrize("estimator", ["H1", "H2", "Hv"])
def test_without_noise_all_estimators_give_the_transfer_function(estimator):
    sums = campaign(np.random.default_rng(1))
    np.testing.assert_allclose(estimate_frf(sums, estimator), TRUTH, rtol=1e-10)
    np.testing.assert_allclose(estimate_coherence(sums), 1.0, rtol=1e-10)


@pytest.mark.parametrize(
    ("estimator", "noise", "biased"),
    [
        ("H1", "response_noise", False),
        ("H2", "response_noise", True),
        ("H1", "force_noise", True),
        ("H2", "force_noise", False),
    ],
)
def test_each_estimator_withstands_noise_on_one_side(estimator, noise, biased):
    """With much averaging H1 is free of the noise of the responses, H2 of that of the force."""
    sums = campaign(np.random.default_rng(2), n_records=1500, **{noise: 0.6})
    ratio = np.abs(estimate_frf(sums, estimator)[AWAY_FROM_ZERO] / TRUTH[AWAY_FROM_ZERO])
    bias = abs(float(np.median(ratio)) - 1.0)
    assert (bias > 0.05) is biased
    assert biased or bias < 0.01


def test_hv_lies_between_h1_and_h2():
    sums = campaign(np.random.default_rng(3), n_records=10, force_noise=0.3, response_noise=0.3)
    h1, h2, hv = (np.abs(estimate_frf(sums, name)) for name in ("H1", "H2", "Hv"))
    assert (h1 <= hv).all()
    assert (hv <= h2).all()
    np.testing.assert_allclose(np.angle(estimate_frf(sums, "Hv")), np.angle(estimate_frf(sums)), rtol=1e-12)


def test_hv_does_not_depend_on_units():
    sums = campaign(np.random.default_rng(3), n_records=10, force_noise=0.3, response_noise=0.3)
    scaled = empty_sums(N_LINES, 2)
    scaled.force, scaled.cross, scaled.responses = sums.force * 1e6, sums.cross * 1e3 * 7.0, sums.responses * 49.0
    np.testing.assert_allclose(estimate_frf(scaled, "Hv") * 1e3 / 7.0, estimate_frf(sums, "Hv"), rtol=1e-12)


def test_the_coherence_is_the_share_of_power_that_the_force_explains():
    noise = 0.5
    sums = campaign(np.random.default_rng(4), n_records=3000, response_noise=noise)
    signal = sums.responses.T / sums.counts - noise**2
    expected = signal / (signal + noise**2)
    np.testing.assert_allclose(estimate_coherence(sums)[AWAY_FROM_ZERO], expected[AWAY_FROM_ZERO], atol=0.05, rtol=0.0)


def test_one_record_has_neither_coherence_nor_scatter():
    sums = campaign(np.random.default_rng(5), n_records=1)
    assert np.isnan(estimate_coherence(sums)).all()
    assert np.isnan(frf_variance(sums)).all()


def test_lines_without_force_have_no_variance_and_no_frf():
    sums = campaign(np.random.default_rng(5), response_noise=0.1)
    sums.force[:, 7], sums.cross[:, 7] = 0.0, 0.0
    assert np.isnan(frf_variance(sums)[7]).all()
    assert (estimate_frf(sums)[7] == 0).all()


def test_shapes_that_do_not_fit_are_refused():
    sums = empty_sums(9, 2)
    with pytest.raises(ShapeError):
        sums.add(np.zeros(16), np.zeros((3, 16)))
    with pytest.raises(ShapeError):
        sums.add(np.zeros(20), np.zeros((2, 20)))


@pytest.mark.parametrize("n_records", [2, 3, 8])
@pytest.mark.parametrize(
    "noise",
    [
        {"response_noise": 0.02},
        {"force_noise": 0.02},
        {"response_noise": 0.02, "force_noise": 0.02, "slope": 5.0},
    ],
    ids=["responses", "force", "both, coloured"],
)
def test_the_variance_is_the_mean_square_of_the_error(n_records, noise):
    """Monte Carlo against the true transfer function, over all lines and at peaks and notches alone."""
    rng = np.random.default_rng(6)
    size = np.abs(TRUTH[:, 0])
    peaks, notches = (
        size > np.quantile(size, 0.97),
        (size < np.quantile(size[AWAY_FROM_ZERO], 0.03)) & (LINES_HZ > 25.0),
    )
    ratios = []
    for _ in range(30):
        sums = campaign(rng, n_records=n_records, **noise)
        ratios.append(np.abs(estimate_frf(sums) - TRUTH)[:, 0] ** 2 / frf_variance(sums)[:, 0])
    mean = np.mean(ratios, axis=0)
    for lines, tolerance in ((slice(20, None), CALIBRATED), (peaks, LOCAL), (notches, LOCAL)):
        assert np.mean(mean[lines]) == pytest.approx(1.0, abs=tolerance)


@pytest.mark.parametrize("n_records", [2, 3])
def test_the_variance_is_smooth_where_the_scatter_of_few_records_is_not(n_records):
    """The raw scatter of two records varies by 1 over its mean, that of three by 0.7."""
    rng = np.random.default_rng(7)
    variations = []
    for _ in range(4):
        variance = frf_variance(campaign(rng, n_records=n_records, response_noise=0.02))[AWAY_FROM_ZERO, 0]
        expected = frf_variance(campaign(rng, n_records=300, response_noise=0.02))[AWAY_FROM_ZERO, 0]
        variations.append(np.std(variance / expected) / np.mean(variance / expected))
    assert np.mean(variations) < SMOOTH


def test_hum_sticks_out_of_the_variance():
    rng = np.random.default_rng(8)
    sums = empty_sums(N_LINES, 1)
    for _ in range(6):
        force = np.ones(N_LINES, complex)
        response = force * TRUTH[:, 0] + 0.01 * complex_noise(rng, N_LINES)
        response[700] += 3.0 * np.exp(2j * np.pi * rng.random())
        sums.add_spectra(force, response[None])
    variance = frf_variance(sums)[:, 0]
    assert variance[700] > 0.2 * 9.0 / 6
    assert variance[699] < 1e-3 * variance[700]
