"""How noisy each record is, read at its end."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.diagnosis.measured.preprocessing.noise_levels import _decays, measure_noise_levels
from frf_ipz.diagnosis.nonlinear.linearity import assess_linearity

RANGES = 1.0, 4.0, 1.0, 0.25  # of the recorder, record by record
NOISE = 2e-3  # of the largest response
MEDIAN = 0.45  # relative: four standard deviations of the median of some 170 independent lines


def with_noise(observations, sizes, rng):
    """Add white noise to the first channel of each record."""
    largest = max(np.abs(record.responses[0]).max() for record in observations.records)
    records = []
    for record, size in zip(observations.records, sizes, strict=True):
        noise = NOISE * largest * size * rng.standard_normal(record.n_samples)
        records.append(replace(record, responses=record.responses + np.outer([1.0, 0.0], noise)))
    return replace(observations, records=tuple(records))


@pytest.mark.slow
def test_the_level_of_each_record_is_that_of_its_noise(strike):
    noisy = with_noise(strike(), RANGES, np.random.default_rng(3))
    measured = measure_noise_levels(noisy)
    channel = noisy.records[0].sensors[0].channel
    levels = np.array([record.noise_levels[channel] for record in measured.records])
    np.testing.assert_allclose(levels, np.square(RANGES) / np.mean(np.square(RANGES)), rtol=MEDIAN)
    assert not assess_linearity(measured).is_nonlinear
    assert assess_linearity(measured).score < assess_linearity(noisy).score


def test_what_still_decays_is_no_noise(strike):
    observations = strike()
    rng = np.random.default_rng(4)
    records = []
    for record in observations.records:
        time = record.step_s * np.arange(record.n_samples)
        decaying = np.exp(-2.0 * time) * rng.standard_normal((2, record.n_samples))
        records.append(replace(record, responses=record.responses + decaying * np.abs(record.responses).max()))
    decaying_all = replace(observations, records=tuple(records))
    assert measure_noise_levels(decaying_all) is decaying_all


def test_steady_noise_that_falls_by_chance_is_no_decay():
    rng, n_lines, n_channels = np.random.default_rng(5), 400, 8
    lines = np.hanning(2 * n_lines) * rng.standard_normal((600, 4, 2, 2 * n_lines))  # tests, records, quarters
    powers = np.median(np.abs(np.fft.rfft(lines)[..., 1:-1]) ** 2, axis=-1)
    assert not any(_decays(list(map(tuple, of_test)), n_lines, n_channels) for of_test in powers)
    assert _decays([(1.0, 0.5)] * 4, n_lines, n_channels)
