"""Impacts count by their noise: a loud one hardly, equal ones equally, and an impact beside its point as before."""

import numpy as np
import pytest

import frf_ipz
from frf_ipz.ingest.survey.noise_weights import noise_weights
from synthetic_campaign import Structure, impact, in_memory

STRUCTURE = Structure()
HEIGHTS = (100.0, 60.0, 150.0, 80.0, 120.0)
NOISE, LOUD = 0.02, 37.0
BAND_HZ = (5.0, 400.0)


def estimate(seed, n_impacts=5, loudness=LOUD, loud=1, **options):
    """Estimate FRFs of impacts, one channel of one of which is noisy."""
    rng = np.random.default_rng(seed)
    impacts = []
    for number, height in enumerate(HEIGHTS[:n_impacts]):
        signals = impact(STRUCTURE, height=height, noise=NOISE, rng=rng)
        if number == loud:
            signals[1] += NOISE * np.sqrt(loudness**2 - 1.0) * rng.standard_normal(signals.shape[1])
        impacts.append(signals)
    test = in_memory(impacts)
    return frf_ipz.estimate_frfs(test, options=frf_ipz.IngestOptions(**options))


def relative_errors(frfs):
    """Give errors over their stated deviations, and the median relative error, of the first FRF."""
    band = frfs.in_band(BAND_HZ)
    truth = STRUCTURE.accelerance(frfs.s[band])[:, 0]
    error = np.abs(frfs.values[band, 0] - truth)
    return error / np.sqrt(frfs.variance[band, 0]), np.median(error / np.abs(truth))


@pytest.mark.parametrize("n_impacts", [2, 3, 5])
def test_a_loud_impact_costs_no_more_than_to_leave_it_out(n_impacts):
    result = estimate(4, n_impacts)
    over_std, median = relative_errors(result.frfs)
    quiet = [height for number, height in enumerate(HEIGHTS[:n_impacts]) if number != 1]
    _, median_of_all = relative_errors(estimate(4, n_impacts, loudness=1.0).frfs)
    best = median_of_all * np.linalg.norm(HEIGHTS[:n_impacts]) / np.linalg.norm(quiet)
    assert median < 1.2 * best  # 16 times as large where it has full weight; chance in 800 lines is 5 %
    assert np.sqrt(np.mean(over_std**2)) == pytest.approx(1.0, abs=0.3)
    assert "output 1 is noisier than in the other impacts" in result.records.marks[1]
    assert result.records.weight[1] < 0.6 * HEIGHTS[1] ** 2 / np.sum(np.square(HEIGHTS[:n_impacts]))


def test_impacts_of_equal_noise_count_as_before():
    result = estimate(5, loudness=1.0)
    without = np.zeros(len(result.frfs.frequency_hz)), 0.0
    for number in range(5):
        names = tuple(name for place, name in enumerate(result.records.record) if place != number)
        frf = estimate(5, loudness=1.0, drop=names, force_window_s=0.02).frfs.values[:, 0]
        without = without[0] + HEIGHTS[number] ** 2 * frf, without[1] + HEIGHTS[number] ** 2
    band = result.frfs.in_band(BAND_HZ)
    difference = np.abs(result.frfs.values[band, 0] - without[0][band] / without[1])
    assert np.median(difference / np.sqrt(result.frfs.variance[band, 0])) < 0.1
    assert not any("noisier" in mark for mark in result.records.marks)


def test_noise_that_grows_with_the_impact_makes_none_noisier():
    """An amplifier that chooses its range: the strongest impact has most noise, and an FRF as good as the others."""
    rng = np.random.default_rng(6)
    impacts = [impact(STRUCTURE, height=height, noise=NOISE * height / 100.0, rng=rng) for height in HEIGHTS]
    marks = frf_ipz.estimate_frfs(in_memory(impacts)).records.marks
    assert not any("noisier" in mark for mark in marks), list(marks)


def test_noise_that_explains_little_of_the_scatter_weighs_nothing():
    """Errors of impacts beside their point are common to all lines, and none of them shows in the record's noise."""
    offsets = np.array([0.05, -0.1, 1.0])[:, None]
    response = 1.0 + offsets * np.sqrt(1.5) * np.ones((3, 256))
    relative = np.array([0.001, 0.001, 0.02])[:, None] * np.ones(256)
    weights = noise_weights(np.ones((3, 256), complex), response.astype(complex), relative, 1.0)
    np.testing.assert_allclose(weights, 1.0, atol=0.05)


def test_noise_that_grows_with_the_level_is_followed():
    rng = np.random.default_rng(6)
    power = np.array([1.0, 4.0, 9.0, 36.0])[:, None]
    force = np.array([1.0, 2.0, 3.0, 6.0])[:, None] * np.ones((4, 512), complex)
    noise = np.sqrt(0.5 * power) * rng.standard_normal((4, 512, 2)).view(complex)[..., 0]
    share = power / power.sum()  # of the force's squares, too
    scatter = np.sum(power * (1.0 - share)) / 3
    relative, root = power / scatter * np.ones(512), np.sqrt(scatter)
    weights = noise_weights(force / root, (force + noise) / root, relative, 1.0)
    np.testing.assert_allclose(weights * power / (weights * power).mean(axis=0), 1.0, atol=0.2)
