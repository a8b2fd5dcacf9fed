"""Time of a diagnosis from FRFs, of its widest search (hypotheses a second), and of the stage on simulated machines.

Run with ``pytest tests/benchmarks --benchmark-only -s``; numbers are CPU seconds of one thread. The stage is what
``frf-ipz diagnose`` spends between FRFs and result, the records of the test included, without a limit of time. It is
sampled every 10 ms of processor time: the functions that it spent most in are printed, all that they call included.
"""

import signal
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import frf_ipz
from diagnosed import beam, labels, measured, observed, problem_of
from frf_ipz import DiagnoseOptions, diagnose
from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.search.component_search import fit_null_model
from frf_ipz.diagnosis.search.global_scan import scan_globally
from frf_ipz.fe.changes import with_point_masses
from frf_ipz.ingest.recording_files import RecordingFiles
from frf_ipz.pipeline.inputs import read_inputs
from frf_ipz.pipeline.stage_runner import StageRunner
from frf_ipz.pipeline.stages import measurement, mismatch
from frf_ipz.progress import silent
from frf_ipz.runs.memory import RunMemory
from frf_testbench.simulator.cases.case import make_case

DIAGNOSIS_S = 10.0  # of a linear case
SEEN = labels(("61:+z", "30:-z"), ("21:+z",))
MEDIAN_S, MOST_S, LONGEST_S = 5.0, 15.0, 60.0  # of the stage: half of the machines, 95 % of them, all
FIRST_SEED = 1_130_000
CONCEALED = (
    "boundary_compliance",
    "added_mass",
    "local_stiffness",
    "global_stiffness",
    "grounded_spring",
    "coupling_spring",
    "attached_resonator",
    "axial_load",
    "shear_rotary_inertia",
    "damping_level",
    "local_damper",
    "structural_damping",
    "viscoelastic_joint",
    "time_delay",
    "sensor_dynamics",
    "sensor_gain",
    "sensor_misplaced",
    "null",
    "null",
    "null",
)
N_SHOWN = 40  # functions
SAMPLED_S = 0.01
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


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timer of processor time")
def test_the_stage_on_simulated_machines(benchmark, tmp_path):
    spent, seconds = Counter(), []

    def diagnose_all():
        for number, effect in enumerate(CONCEALED):
            folder = tmp_path / f"{number:02d}_{effect}"
            make_case(FIRST_SEED + number, effect).write(folder, tmp_path / f"{folder.name}.json")
            seconds.append(stage_seconds(folder, spent))
            print(f"{seconds[-1]:6.1f} s {folder.name}", flush=True)

    benchmark.pedantic(diagnose_all, rounds=1)
    most = float(np.quantile(seconds, 0.95))
    print(f"median {np.median(seconds):.1f} s, 95 % {most:.1f} s, longest {max(seconds):.1f} s")
    for name, of_function in spent.most_common(N_SHOWN):
        print(f"{of_function:8.1f} s {name}")
    assert np.median(seconds) < MEDIAN_S
    assert most < MOST_S
    assert max(seconds) < LONGEST_S


def stage_seconds(folder, spent):
    """Processor time of the stage; what each function of the package spent is added."""
    inputs = read_inputs(folder / "pipeline.toml")
    runner = StageRunner(inputs=inputs, recordings=RecordingFiles(test=inputs.test), store=RunMemory(), progress=silent)
    frfs = measurement.ingest(runner).frfs
    package, latest = str(Path(frf_ipz.__file__).parent), [time.process_time()]

    def sample(_, frame):
        now = time.process_time()
        names = set()
        while frame is not None:
            if frame.f_code.co_filename.startswith(package):
                names.add(f"{Path(frame.f_code.co_filename).relative_to(package).as_posix()}: {frame.f_code.co_name}")
            frame = frame.f_back
        spent.update(dict.fromkeys(names, now - latest[0]))
        latest[0] = now

    before = signal.signal(signal.SIGPROF, sample)
    signal.setitimer(signal.ITIMER_PROF, SAMPLED_S, SAMPLED_S)
    start = time.process_time()
    try:
        mismatch.diagnose(runner, inputs.fe_model, frfs, is_asked=True)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
    return time.process_time() - start
