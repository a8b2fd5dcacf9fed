"""How the work of all stages grows with the number of FRFs: exponents over a decade, and the memory of the update.

Run with ``pytest tests/benchmarks/test_many_frfs_speed.py --benchmark-only -s``; numbers are CPU seconds of one thread
(set OPENBLAS_NUM_THREADS=1). The plate has 3000 DOFs, 20 modes in the band, 1000 lines and three inputs.
"""

import time
import tracemalloc
from functools import partial

import numpy as np
import pytest

from frf_ipz.assessment.assess import assess
from frf_ipz.assessment.evidence import Evidence
from frf_ipz.identification.fit import fit_modes
from frf_ipz.pairing.pair import pair_roots
from frf_ipz.pipeline.inputs import read_inputs
from frf_ipz.pipeline.run import run_in_memory
from frf_ipz.pipeline.sensors import unweighed_sensors
from frf_ipz.prediction.predict import predict_frfs
from frf_ipz.report.page import write_report
from frf_ipz.updating.parameters import make_structural_basis
from frf_ipz.updating.update import update_model
from large_campaign import write_campaign

OUTPUTS = (10, 100)
EXPONENT = 1.2  # in FRFs, of fit, pairing and update
PAGE_BYTES_AN_FRF = 10e6 / 900
PAIRING_S, UPDATE_S = 8.0, 120.0  # of 300 FRFs
UPDATE_BYTES = 1.0e9  # of 300 FRFs


def cpu_seconds(work):
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def seconds_of(folder, n_outputs):
    """CPU seconds of each stage, bytes of the page, and largest memory that the update takes beside its input."""
    inputs = read_inputs(write_campaign(folder, n_outputs))
    run = run_in_memory(inputs, until="pair", diagnosing=False)
    fit, reduced = run.fit, run.reduced_model
    seconds = {"fit": cpu_seconds(lambda: fit_modes(run.frfs))[0]}
    seconds["pairing"], pairs = cpu_seconds(lambda: pair_roots(fit, reduced))
    basis = make_structural_basis(inputs.fe_model, reduced, sensors=unweighed_sensors(inputs.test, fit.labels))
    tracemalloc.start()
    seconds["update"], updated = cpu_seconds(lambda: update_model(fit, reduced, pairs=pairs, basis=basis))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    frfs, model = run.frfs, inputs.fe_model
    predict = partial(predict_frfs, fit, updated, points=inputs.points)
    seconds["prediction"], prediction = cpu_seconds(predict)
    evidence = Evidence(frfs=frfs, fit=fit, fe_model=model, pairs=pairs, updated_model=updated, prediction=prediction)
    seconds["assessment"], _ = cpu_seconds(lambda: assess(evidence))
    seconds["page"], _ = cpu_seconds(lambda: write_report(run, folder / "report.html"))
    return seconds, (folder / "report.html").stat().st_size, peak


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    return [seconds_of(tmp_path_factory.mktemp("plate"), count) for count in OUTPUTS]


def test_exponents_in_frfs(benchmark, measured):
    (few, *_), (many, *_) = measured
    growth = np.log(OUTPUTS[1] / OUTPUTS[0])
    exponents = {name: float(np.log(many[name] / few[name]) / growth) for name in few}
    for name, exponent in exponents.items():
        print(
            f"\n{name}: {few[name]:.2f} -> {many[name]:.2f} CPU s from 30 to 300 FRFs: exponent {exponent:.2f}", end=""
        )
    benchmark.extra_info.update(exponents)
    benchmark.pedantic(lambda: None, rounds=1)
    assert many["pairing"] < PAIRING_S
    assert many["update"] < UPDATE_S
    for name in ("fit", "pairing", "update", "prediction", "assessment"):
        assert exponents[name] < EXPONENT, name


def test_memory_of_the_update(benchmark, measured):
    peak = measured[1][2]
    print(f"\nthe update of {3 * OUTPUTS[1]} FRFs takes {peak / 1e9:.2f} GB (at most {UPDATE_BYTES / 1e9:g})")
    benchmark.extra_info.update(bytes=peak)
    benchmark.pedantic(lambda: None, rounds=1)
    assert peak < UPDATE_BYTES


def test_size_of_the_page(benchmark, measured):
    size = measured[1][1] / (3 * OUTPUTS[1])
    print(f"\n{size / 1e3:.1f} kB a FRF on a page of {3 * OUTPUTS[1]} (at most {PAGE_BYTES_AN_FRF / 1e3:.1f} at 900)")
    benchmark.extra_info.update(bytes_an_frf=size)
    benchmark.pedantic(lambda: None, rounds=1)
    assert size < 2 * PAGE_BYTES_AN_FRF  # curves of few FRFs have more points each
