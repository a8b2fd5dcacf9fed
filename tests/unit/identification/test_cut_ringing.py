"""Records that begin just before the pulse: what the analyser's filter rang before is no delay."""

import numpy as np
import pytest

import frf_ipz
from frf_ipz.ingest.signals.faults import find_missing_ringing
from frf_ipz.ingest.signals.pulses import find_pulse
from synthetic_campaign import Structure, impact, in_memory

STEP_S, BEFORE = 1 / 2048, 512
HEIGHTS = (100.0, 60.0, 150.0, 80.0)
BAND_HZ = (20.0, 280.0)


def filtered_force(height, onset, n_samples=8192):
    """Give a sine squared through a filter of linear phase: one to 0.8 of its band, nothing at its end."""
    fine = 64
    time = np.arange(n_samples * fine) / fine - BEFORE - onset
    width = 2.6
    pulse = height * np.where((time > 0) & (time < width), np.sin(np.pi * time / width) ** 2, 0.0)
    spectrum = np.fft.rfft(pulse)[: n_samples // 2 + 1] / fine
    rest = np.clip((np.arange(n_samples // 2 + 1) / (n_samples / 2) - 0.8) / 0.2, 0.0, 1.0)
    return np.fft.irfft(spectrum * 0.5 * (1 + np.cos(np.pi * rest)), n_samples)


def estimate(seed=1):
    rng = np.random.default_rng(seed)
    structure = Structure()
    records = []
    for height in HEIGHTS:
        signals = impact(structure, force=filtered_force(height, 0.6 + 0.01 * rng.standard_normal()), n_samples=8192)
        signals = signals[:, BEFORE : BEFORE + 4096]
        scales = np.abs(signals).max(axis=1, keepdims=True)
        records.append(signals + 1e-4 * scales * rng.standard_normal(signals.shape))
    return structure, frf_ipz.estimate_frfs(in_memory(records))


def test_ringing_that_is_cut_off_before_the_pulse_is_no_delay():
    _, result = estimate()
    fitted = frf_ipz.fit_modes(result.frfs, options=frf_ipz.FitOptions(band_hz=BAND_HZ))
    assert not [text for text in fitted.warnings if "later" in text]


def test_what_is_cut_off_before_the_pulse_is_in_the_variance():
    structure, result = estimate()
    frfs = result.frfs
    band = frfs.in_band(BAND_HZ)
    truth = structure.accelerance(frfs.s[band])
    error, deviation = np.abs(frfs.values[band] - truth), np.sqrt(frfs.variance[band])
    assert np.sqrt(np.mean((error / deviation) ** 2)) == pytest.approx(1.0, abs=0.3)


def test_what_a_force_does_after_its_pulse_is_not_before_it():
    """A pulse that rises from nothing, and a hammer that swings after it for longer than the record has before."""
    after = np.arange(-75, 8117)
    force = 250.0 * np.exp(-((after / 12.0) ** 2)) + 5.0 * (after > 0) * np.exp(-after / 400.0) * np.sin(after / 40.0)
    missing = find_missing_ringing(force, find_pulse(force, threshold=0.04 * 250))
    assert np.abs(missing).max() < 1e-6
