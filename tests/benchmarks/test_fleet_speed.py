"""CPU time of a machine of a fleet against a run in a process that has run before: the model is read and reduced once.

Run with ``pytest tests/benchmarks --benchmark-only -s``; numbers are CPU seconds.
"""

import statistics
import time

import frf_ipz
from fleet_case import write_fleet

COUNT = 40
MOST_CPU = 1.1  # of a run in a process that has run before


def test_a_machine_takes_no_more_than_a_run_in_a_process_that_has_run_before(benchmark, tmp_path):
    fleet = write_fleet(tmp_path / "fleet", COUNT, more='pages = "none"\n')
    results = benchmark.pedantic(lambda: frf_ipz.run_fleet(fleet, tmp_path / "out", jobs=2), rounds=1)
    spent = []
    for number, pipeline in enumerate(sorted((results.path / "pipelines").glob("*.toml"))[:10]):
        started = time.thread_time()
        frf_ipz.run_pipeline(pipeline, tmp_path / f"run{number}", until="export")
        spent.append(time.thread_time() - started)
    of_machines = results.to_frame()["cpu_s"].median()
    alone = statistics.median(spent[1:])  # the first imports
    print(f"\n{of_machines:.2f} s for a machine of a fleet, {alone:.2f} s for a run alone")
    benchmark.extra_info.update(of_machines=of_machines, alone=alone)
    assert of_machines <= MOST_CPU * alone
