"""CPU time and memory of averaging impacts of a hammer, against pyFRF on the same arrays.

Run with ``pytest tests/benchmarks --benchmark-only -s``; numbers are CPU seconds of one thread.
"""

import time
import tracemalloc

import numpy as np
import pytest

from frf_ipz.ingest.estimation.spectra import empty_sums, estimate_coherence, estimate_frf

N_RECORDS, N_OUTPUTS, N_SAMPLES, RATE_HZ = 200, 8, 32768, 8192
SAME = 1e-12  # relative to the largest value: both divide the same sums
FASTER = 2.0  # times
MOST_BYTES = 60e6  # above the data


@pytest.fixture(scope="module")
def records():
    """(n_records, 1 + n_outputs, n_samples): half sines on eight decaying tones, noise on everything."""
    rng = np.random.default_rng(3)
    time_s = np.arange(N_SAMPLES) / RATE_HZ
    tones = np.exp(-2.0 * time_s) * np.sin(2 * np.pi * np.outer(100.0 + 90.0 * np.arange(N_OUTPUTS), time_s))
    kernels = np.fft.rfft(tones)
    records = np.empty((N_RECORDS, 1 + N_OUTPUTS, N_SAMPLES))
    for record in records:
        length_s, start_s = 0.8e-3 * (1 + 0.1 * rng.standard_normal()), 0.02 + 0.002 * rng.random()
        inside = (time_s > start_s) & (time_s < start_s + length_s)
        record[0] = np.where(inside, 100.0 * np.sin(np.pi * (time_s - start_s) / length_s), 0.0)
        record[1:] = np.fft.irfft(kernels * np.fft.rfft(record[0]), N_SAMPLES)
        record[1:] += 0.01 * record[1:].std(axis=1, keepdims=True) * rng.standard_normal((N_OUTPUTS, N_SAMPLES))
        record[0] += 0.02 * rng.standard_normal(N_SAMPLES)
    return records


def average(records):
    sums = empty_sums(N_SAMPLES // 2 + 1, N_OUTPUTS)
    for record in records:
        sums.add(record[0], record[1:])
    return estimate_frf(sums), estimate_coherence(sums)


def by_pyfrf(module, records):
    frf = module.FRF(
        sampling_freq=RATE_HZ,
        exc=records[:, 0],
        resp=records[:, 1:],
        exc_type="f",
        resp_type="a",
        window="none",
        frf_estimator="H1",
    )
    return np.squeeze(frf.get_FRF(frf_form="accelerance")).T, np.squeeze(frf.get_coherence()).T


def median_cpu_seconds(work):
    """Give the median time of five runs, and the result of the last."""
    times = []
    for _ in range(5):
        start = time.process_time()
        result = work()
        times.append(time.process_time() - start)
    return float(np.median(times)), result


def test_averaging(benchmark, records):
    frf, coherence = benchmark.pedantic(lambda: average(records), rounds=3)
    assert np.isfinite(frf).all()
    assert (coherence <= 1.0).all()


def test_memory_above_the_data(benchmark, records):
    tracemalloc.start()
    benchmark.pedantic(lambda: average(records), rounds=1)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    print(f"\n  averaging: {peak / 1e6:.0f} MB above the data of {records.nbytes / 1e6:.0f} MB")
    assert peak < MOST_BYTES


def test_against_pyfrf(benchmark, timings, records):
    pyfrf = pytest.importorskip("pyFRF", reason="needs pyFRF of the extra 'peers'")
    theirs = median_cpu_seconds(lambda: by_pyfrf(pyfrf, records))
    ours = median_cpu_seconds(lambda: average(records))
    benchmark.pedantic(lambda: average(records), rounds=1)
    frf, reference = ours[1][0][1:], theirs[1][0][1:]  # pyFRF divides by zero at 0 Hz
    error = np.abs(frf - reference).max() / np.abs(reference).max()
    timings.add("FRFs from impacts", f"{N_RECORDS} records, pyFRF", theirs[0] / ours[0], FASTER)
    print(f"\n  {N_RECORDS} records: {ours[0]:.2f} s here, {theirs[0]:.2f} s by pyFRF")
    print(f"  FRFs differ by {error:.1e} of the peak")
    assert error < SAME
    assert ours[0] * FASTER < theirs[0]
