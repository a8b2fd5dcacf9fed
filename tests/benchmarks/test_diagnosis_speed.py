"""Time of a diagnosis from FRFs, and of its widest search: hypotheses a second.

Run with ``pytest tests/benchmarks --benchmark-only -s``; numbers are CPU seconds of one thread.
"""

import time

import pytest

from diagnosed import beam, labels, measured, observed, problem_of
from frf_ipz import DiagnoseOptions, diagnose
from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.search.component_search import fit_null_model
from frf_ipz.diagnosis.search.global_scan import scan_globally
from frf_ipz.fe.changes import with_point_masses

DIAGNOSIS_S = 10.0  # of a linear case
SEEN = labels(("61:+z", "30:-z"), ("21:+z",))
SCAN_S, SCANNED = 5.0, 1200  # hypotheses: a cause at a place, with all values that are tried of it


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """A beam of 60 elements, 120 DOFs, that carries a mass its model lacks, seen by two sensors."""
    model = beam(tmp_path_factory.mktemp("beam"), elements=60)
    return model, measured(with_point_masses(model, {38: 0.004}), SEEN)


def test_scanning_hypotheses(benchmark, case):
    problem = problem_of(*case, tuple(shipped_effects()))
    base = fit_null_model(problem)
    start = time.process_time()
    n_tried = len(benchmark.pedantic(scan_globally, args=(problem, base), rounds=3))
    seconds = (time.process_time() - start) / 3
    print(f"\n{n_tried} hypotheses in {seconds:.2f} s: {SCANNED} in {SCANNED / n_tried * seconds:.2f} s")
    assert n_tried > 0.5 * SCANNED
    assert SCANNED / n_tried * seconds < SCAN_S


def test_a_diagnosis(benchmark, case):
    model, frfs = case
    start = time.process_time()
    found = benchmark.pedantic(diagnose, args=(model, observed(frfs), DiagnoseOptions()), rounds=1)
    seconds = time.process_time() - start
    print(f"\na diagnosis in {seconds:.1f} s (at most {DIAGNOSIS_S:g} s)")
    assert [finding.effect for finding in found.findings] == ["added_mass"]
    assert seconds < DIAGNOSIS_S
