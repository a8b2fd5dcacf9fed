"""FRFs of running records on lines closer than their own."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.measured.from_frfs import continue_frfs, survey_frfs
from frf_ipz.diagnosis.measured.from_running_records import FINEST, estimate_finer_frfs, refinement_factor
from frf_ipz.diagnosis.observations import observe
from frf_ipz.identification.options import FitOptions
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.options import IngestOptions
from synthetic_campaign import Structure, respond, write_csv, write_test

STEP_S = 1 / 1024
LIGHT = Structure(damping_ratio=(0.001, 0.001, 0.001))
RECORD = '[[record]]\ndof = "7:+z"\nfiles = ["records/*.csv"]\n'


def running(folder, n, structure, noise, seed):
    """Three records of n samples of a structure that is shaken for 8 s before."""
    rng = np.random.default_rng(seed)
    for number in range(3):
        spectrum = np.fft.rfft(rng.standard_normal(n + 8192))
        frequency = np.fft.rfftfreq(n + 8192, STEP_S)
        force = np.fft.irfft(spectrum * np.exp(-((frequency / 280.0) ** 8)), n + 8192)
        signals = np.vstack([force, respond(structure, force, STEP_S)])[:, 8192:]
        signals[1:] += noise * rng.standard_normal(signals[1:].shape)
        write_csv(folder / "records" / f"{number}.csv", signals, STEP_S)
    test = read_test(write_test(folder, RECORD, kind="random"))
    frfs = estimate_frfs(test, options=IngestOptions()).frfs
    return observe(test, ingest=IngestOptions(), frfs=frfs, fit=FitOptions(band_hz=(15.0, 250.0)))


@pytest.fixture
def running_test(tmp_path):
    """Lines are 0.34 Hz apart, the narrowest mode is 0.04 Hz wide."""
    return running(tmp_path, 3001, LIGHT, noise=1e-3, seed=5)


def test_lines_between_those_of_the_record_have_the_frf_of_their_frequency(running_test):
    finer = estimate_finer_frfs(running_test, running_test.frfs)
    in_band = running_test.frfs.in_band(running_test.band_hz)
    assert finer.n_lines == FINEST * in_band.sum()
    assert np.diff(finer.frequency_hz) == pytest.approx(1 / (3001 * STEP_S) / FINEST)
    truth = LIGHT.accelerance(finer.s)
    assert (np.abs(finer.values - truth) / np.abs(truth).max(axis=0)).max() < 0.01


def test_all_finer_lines_together_hold_no_more_information_than_the_record(running_test):
    finer = estimate_finer_frfs(running_test, running_test.frfs)
    information, information_of_record = ((1 / frfs.variance).sum() for frfs in (finer, running_test.frfs))
    assert information <= 1.05 * information_of_record
    between = [
        (frfs.frequency_hz > 105.0) & (frfs.frequency_hz < 155.0) for frfs in (finer, running_test.frfs)
    ]  # resonances
    information, information_of_record = (
        (1 / frfs.variance[lines]).sum() for frfs, lines in zip((finer, running_test.frfs), between, strict=True)
    )
    assert information == pytest.approx(
        information_of_record, rel=0.1
    )  # segments that happen to scatter more count, others do not
    assert finer.correlated_lines == FINEST


@pytest.mark.parametrize(("n_lines", "expected"), [(100, FINEST), (7000, FINEST), (20_000, 3), (100_000, 1)])
def test_a_band_of_many_lines_is_refined_less(n_lines, expected):
    assert refinement_factor(n_lines) == expected


@pytest.mark.parametrize(("finer", "max_error"), [(FINEST, 0.01), (5, 0.04)])
def test_a_resonance_a_quarter_of_a_line_wide_is_continued_off_the_axis(running_test, finer, max_error):
    spacing_hz, pole = 1 / finer, 2 * np.pi * (-0.24 + 50.03j)
    frequency_hz = np.arange(round(20 / spacing_hz), round(90 / spacing_hz)) * spacing_hz
    s = 2j * np.pi * frequency_hz
    values = np.repeat((1 / (s - pole))[:, None], len(running_test.frfs.labels), axis=1)
    even = np.full(values.shape, 1e-12)
    lines = replace(running_test.frfs, frequency_hz=frequency_hz, values=values, variance=even, coherence=even)
    survey = survey_frfs(lines, (30.0, 80.0))
    continued = continue_frfs(survey, survey.least_decay_1_s + 2j * np.pi * np.linspace(49.5, 50.5, 60))
    error = np.abs(continued.values[:, 0] * (continued.s - pole) - 1).max()
    assert max_error / 4 < error < max_error


def test_lines_with_little_force_have_larger_variance(running_test):
    finer = estimate_finer_frfs(running_test, running_test.frfs)
    error = np.abs(finer.values - LIGHT.accelerance(finer.s)) ** 2 * FINEST / finer.variance
    noisy = finer.frequency_hz > 120.0  # where noise is larger than the error of the local models
    assert np.mean(error[noisy]) == pytest.approx(1.0, abs=0.2)
    assert np.max(error[noisy]) < 40.0


def test_the_rest_of_transients_at_narrow_resonances_counts_as_error(tmp_path):
    """Records of 18 periods of a mode that is a sixth of a line wide."""
    narrow = Structure(damping_ratio=(0.009, 0.009, 0.009))
    errors = []
    for seed in range(6):
        running_test = running(tmp_path / str(seed), 614, narrow, noise=1e-2, seed=seed)
        finer = estimate_finer_frfs(running_test, running_test.frfs)
        at_resonance = np.abs(finer.frequency_hz - 31.0) < 4.0
        errors.append(
            np.abs(finer.values - narrow.accelerance(finer.s))[at_resonance] ** 2
            * FINEST
            / finer.variance[at_resonance]
        )
    assert np.mean(errors) == pytest.approx(1.5, abs=1.0)  # the records' own noise is a tenth of that


def test_split_data_continues_running_records_off_the_axis(running_test):
    data = split_data(running_test)
    for measured in (data.coarse, data.middle, data.training):
        truth = LIGHT.accelerance(measured.s)
        inner = (measured.s.imag > 2 * np.pi * 30) & (measured.s.imag < 2 * np.pi * 200)
        assert np.median(np.abs(measured.values - truth)[inner] / measured.size[inner]) < 3e-3
        assert np.max(np.abs(measured.values - truth)[inner] / measured.size[inner]) < 0.1


def test_a_running_test_is_recognised(running_test):
    assert split_data(running_test).kind == "running"
    assert split_data(replace(running_test, kind="frf")).kind == "frf"


def test_sweeps_from_rest_are_read_as_running_records_and_random_ones_are_not(running_test):
    n = 3001
    time = STEP_S * np.arange(n)
    sweep = np.sin(2 * np.pi * (5 * time + (300 - 5) * time**2 / (2 * time[-1]))) * np.minimum(time / 0.1, 1.0)
    noise = np.random.default_rng(6).standard_normal(n) * np.minimum(time / 0.1, 1.0)
    for force, kind in ((sweep, "running"), (noise, "random")):
        records = tuple(
            replace(record, force=size * force, responses=respond(LIGHT, size * force, STEP_S), starts_at_rest=True)
            for size, record in zip((1.0, 0.5, 0.3), running_test.records, strict=True)
        )
        assert split_data(replace(running_test, records=records)).kind == kind
