"""Memory does not grow with the number of records, and progress is reported."""

import tracemalloc

import numpy as np
import pytest

from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.ingest.recording_files import RecordingFiles
from frf_ipz.ingest.records import read_records
from synthetic_campaign import HIT, Structure, hammer_campaign, impact, pulse, write_csv, write_test

STEP_S = 1 / 2048
N_SAMPLES = 2048
BYTES_OF_A_RECORD = 4 * 8 * N_SAMPLES


def campaign(folder, n_records):
    signals = impact(Structure(), n_samples=N_SAMPLES)
    for number in range(n_records):
        write_csv(folder / "hits" / f"{number:03d}.csv", (1 + 0.01 * number) * signals, STEP_S)
    return read_test(write_test(folder, HIT))


def peak_bytes(test):
    tracemalloc.start()
    estimate_frfs(test, options=IngestOptions())
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return peak


@pytest.mark.slow
def test_memory_does_not_grow_with_the_number_of_records(tmp_path, monkeypatch):
    monkeypatch.setattr("frf_ipz.ingest.recording_files.BUDGET", 3 * BYTES_OF_A_RECORD)
    small, large = campaign(tmp_path / "small", 8), campaign(tmp_path / "large", 16)
    estimate_frfs(
        small, options=IngestOptions()
    )  # what is loaded once does not count; 8 records give all responses to draw
    assert peak_bytes(large) - peak_bytes(small) < 3 * BYTES_OF_A_RECORD  # 8 of them are what it would grow by


def test_impacts_of_one_long_file_are_read_one_at_a_time(tmp_path, monkeypatch):
    monkeypatch.setattr("frf_ipz.ingest.recording_files.BUDGET", 0)
    force = np.zeros(20 * 2048)
    for start in range(500, len(force), 2048):
        force += pulse(len(force), STEP_S, at_s=start * STEP_S)
    write_csv(tmp_path / "hits" / "all.csv", impact(Structure(), force=force), STEP_S)
    test = read_test(write_test(tmp_path, HIT))
    records = read_records(RecordingFiles(test=test), IngestOptions())
    first = next(records)
    assert (first.name, first.n_samples) == ("hits/all.csv#1", pytest.approx(2048, abs=64))
    assert sum(1 for _ in records) == 19


def test_progress_rises_to_the_end(tmp_path):
    reports = []
    test = read_test(hammer_campaign(tmp_path, n_samples=1024))
    estimate_frfs(test, options=IngestOptions(), progress=lambda fraction, text: reports.append((fraction, text)))
    fractions = [fraction for fraction, _ in reports]
    assert fractions == sorted(fractions)
    assert (fractions[0], fractions[-1]) == (0.0, 1.0)
    assert reports[0][1] == "reading p7_01.csv"
