"""Spikes of a loose cable are named and taken off; sound recordings have none."""

import numpy as np
import pytest

import frf_ipz
from frf_ipz.ingest.signals.spikes import find_spikes
from synthetic_campaign import Structure, impact, in_memory

STRUCTURE = Structure()
HEIGHTS = (100.0, 60.0, 150.0, 80.0, 120.0)
NOISE = 0.02
BURST, AT = 12, 900  # samples, and the first of them
BAND_HZ = (5.0, 400.0)


def estimate(seed, n_impacts=5, size=20.0):
    """Estimate FRFs of impacts; the first channel of the second jumps for a moment, by so many m/s^2."""
    rng = np.random.default_rng(seed)
    impacts = []
    for number, height in enumerate(HEIGHTS[:n_impacts]):
        signals = impact(STRUCTURE, height=height, noise=NOISE, rng=rng)
        if number == min(1, n_impacts - 1):
            signals[1, AT : AT + BURST] += size * rng.standard_normal(BURST)
        impacts.append(signals)
    return frf_ipz.estimate_frfs(in_memory(impacts))


def relative_errors(frfs):
    """Give the rms of errors over their stated deviations, and the median relative error, of the first FRF."""
    band = frfs.in_band(BAND_HZ)
    truth = STRUCTURE.accelerance(frfs.s[band])[:, 0]
    error = np.abs(frfs.values[band, 0] - truth)
    return np.sqrt(np.mean(error**2 / frfs.variance[band, 0])), np.median(error / np.abs(truth))


@pytest.mark.parametrize("n_impacts", [2, 3, 5])
def test_a_burst_in_one_channel_is_named_and_costs_little(n_impacts):
    result = estimate(1, n_impacts)
    over_std, median = relative_errors(result.frfs)
    _, sound = relative_errors(estimate(1, n_impacts, size=0.0).frfs)
    assert median < 1.5 * sound  # 12 times as large where it counts fully
    assert 0.7 < over_std < 1.3
    marks = result.records.marks.tolist()
    assert f"output 1 jumps {AT / 2048:.4g} s after the beginning of its recording" in marks[1]
    assert not any("jumps" in text for number, text in enumerate(marks) if number != 1)
    assert "output 2" not in marks[1]


def test_steps_in_two_of_five_are_no_group_of_impacts():
    """What is left of two steps that were taken off is alike; the other response was not touched."""
    rng, impacts = np.random.default_rng(6), []
    for number, height in enumerate(HEIGHTS):
        signals = impact(STRUCTURE, height=height, noise=5 * NOISE, rng=rng)
        if number in (1, 3):
            signals[1, 2500:] += np.abs(signals[1]).max()
        impacts.append(signals)
    result = frf_ipz.estimate_frfs(in_memory(impacts))
    assert any("jumps" in text for text in result.warnings)
    assert not any("two groups" in text for text in result.warnings)


def test_a_single_impact_with_a_burst_has_a_variance_that_holds_it():
    result = estimate(2, 1)
    over_std, _ = relative_errors(result.frfs)
    assert "output 1 jumps" in result.records.marks[0]
    assert 0.5 < over_std < 2.0  # one burst, not an ensemble of them; 12 where it is not said


@pytest.mark.parametrize("noise", [0.0, 1e-3, 0.05])
@pytest.mark.parametrize("step", [0.0, 0.01])
def test_sound_responses_have_no_spikes(noise, step):
    rng = np.random.default_rng(3)
    response = impact(STRUCTURE, noise=noise, rng=rng)[1, 100:]
    response = step * np.round(response / step) if step else response
    assert find_spikes(response, 0, 0) == []


def test_real_impacts_have_no_spikes(recordings):
    test = frf_ipz.read_test(recordings / "raw_hammer" / "test.toml")
    assert not frf_ipz.estimate_frfs(test).records.marks.str.contains("jumps").any()


def crackling(seed, decay_s=0.05, n_jumps=8):
    """Estimate FRFs of five impacts; from the second on the first channel jumps often, and each jump decays slowly."""
    rng, impacts = np.random.default_rng(seed), []
    for number, height in enumerate(HEIGHTS):
        signals = impact(STRUCTURE, height=height, noise=NOISE, rng=rng)
        for at in rng.integers(300, 3900, n_jumps if number else 0):
            signals[1, at:] += 10.0 * rng.standard_normal() * np.exp(-np.arange(signals.shape[1] - at) / 2048 / decay_s)
        impacts.append(signals)
    return frf_ipz.estimate_frfs(in_memory(impacts))


def test_jumps_that_decay_are_taken_off_whole_and_the_channel_is_named():
    result = crackling(1)
    over_std, median = relative_errors(result.frfs)
    _, sound = relative_errors(crackling(1, n_jumps=0).frfs)
    assert median < 2.0 * sound  # 40 times as large where their beginnings alone are taken off
    assert 0.7 < over_std < 1.5
    (text,) = [text for text in result.warnings if "jumps" in text]
    assert text.startswith("1:+z jumps ")
    assert "in 4 of 5 records at 7:+z" in text
    assert "taken off" in text
