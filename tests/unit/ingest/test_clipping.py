"""Signals that were cut on one side are told by that side, however far the other goes; whole ones are not."""

import numpy as np
import pytest

import frf_ipz
from frf_ipz.ingest.signals.clipping import is_clipped
from synthetic_campaign import Structure, impact, in_memory

SEEDS = range(12)


def print_digits(signal, digits):
    return np.array([float(f"{value:.{digits - 1}e}") for value in signal])


def response(seed, noise=0.0):
    """A response whose modes, dampings and noise are drawn anew."""
    rng = np.random.default_rng(seed)
    return impact(
        Structure(
            frequency_hz=tuple(rng.uniform((20, 80, 160), (60, 140, 300))),
            damping_ratio=tuple(rng.uniform(0.004, 0.02, 3)),
        ),
        noise=noise,
        rng=rng,
    )[1]


RECORDED = [
    pytest.param(lambda signal: signal, id="fine"),
    pytest.param(lambda signal: signal.astype(np.float32).astype(float), id="single precision"),
    pytest.param(lambda signal: print_digits(signal, 5), id="five digits"),
    pytest.param(lambda signal: np.round(signal / np.abs(signal).max() * 32768), id="16 bits"),
    pytest.param(lambda signal: np.round(signal / np.abs(signal).max() * 2048), id="12 bits"),
]


@pytest.mark.parametrize("record", RECORDED)
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("share", [0.08, 0.15, 0.3, 0.6])
def test_a_response_that_was_cut_on_one_side_is_clipped(record, sign, share):
    for seed in SEEDS:
        signal = response(seed, noise=0.01)
        cut = record(sign * np.minimum(signal, share * np.abs(signal).max()))
        assert is_clipped(cut)


@pytest.mark.parametrize("record", RECORDED)
@pytest.mark.parametrize("noise", [0.0, 0.01, 0.5])
def test_whole_responses_are_not_clipped(record, noise):
    for seed in SEEDS:
        signal = response(seed, noise)
        assert not is_clipped(record(signal))
        for far_side in (0.01, 0.1, 0.2):  # a motion that goes one way for the most part
            lopsided = np.where(signal > 0.0, far_side, 1.0) * signal
            assert not is_clipped(record(lopsided))


def test_a_signal_that_rests_at_its_lowest_value_before_it_moves_is_not_clipped():
    since = np.maximum(np.arange(3000.0) - 100.0, 0.0)
    for rise in (5.0, 50.0):
        moved = 0.1 * (1.0 - np.exp(-since / rise)) + np.exp(-since / 300) * np.sin(0.05 * since) ** 2
        assert moved.min() == 0.0 < np.median(moved)
        assert not is_clipped(moved)


def test_the_noise_beside_a_pulse_says_nothing_of_its_top():
    rng = np.random.default_rng(5)
    force = 1e-3 * rng.standard_normal(4096)
    force[100:120] += np.sin(np.pi * np.arange(20.3)[:20] / 20.3)
    assert not is_clipped(np.maximum(force, -0.5e-3), goes_one_way=True)
    assert is_clipped(np.minimum(force, 0.8), goes_one_way=True)


@pytest.mark.parametrize("level", [0.2, 0.4, 0.7])
def test_an_overload_in_every_impact_is_restored_and_its_error_is_in_the_variance(level):
    structure, rng = Structure(), np.random.default_rng(8)
    records = []
    for height in (100.0, 60.0, 80.0):
        signals = impact(structure, height=height)[:2]
        signals += 2e-4 * np.abs(signals).max(axis=1, keepdims=True) * rng.standard_normal(signals.shape)
        signals[1] = np.minimum(signals[1], level * signals[1].max())
        records.append(signals)
    result = frf_ipz.estimate_frfs(in_memory(records, output_dofs=("1:+z",)))
    frfs = result.frfs
    band = frfs.in_band((15.0, 250.0))
    error = np.abs(frfs.values[band, 0] - structure.accelerance(frfs.s[band])[:, 0])
    assert np.sqrt(np.mean(error**2 / frfs.variance[band, 0])) < 1.3
    assert np.sqrt(np.mean(error**2 / frfs.variance[band, 0])) > 0.3
    assert any("half of that counts as its error" in text for text in result.warnings)
