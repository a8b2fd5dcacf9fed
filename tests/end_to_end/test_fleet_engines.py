"""Machines on this machine and on a real Dask cluster whose workers are killed: nothing lost, nothing twice.

MACHINES=40 is the long proof.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pyarrow.parquet as pq
import pytest

import frf_ipz
from fleet_case import write_fleet
from frf_ipz.cli.main import STOPPED
from frf_ipz.runs.generations import stamp
from small_campaign import write_quick_campaign

pytestmark = pytest.mark.slow

COUNT = int(os.environ.get("MACHINES", "10"))
TABLES = ("fleet", "fleet_poles", "fleet_zeros", "fleet_parameters", "fleet_findings")
PATIENCE_S = 300.0
DASK = (sys.executable, "-m", "distributed.cli")


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    return write_fleet(folder, COUNT, more='pages = "none"\n', write=write_quick_campaign)


@pytest.fixture(scope="module")
def alone(fleet):
    """The fleet in this process, one machine after the other, whose imports are done."""
    out = fleet.parent / "alone"
    frf_ipz.run_fleet(fleet, out, jobs=1, only=["m01"])
    shutil.rmtree(out)
    return frf_ipz.run_fleet(fleet, out, jobs=1)


def tables_of(results):
    """All tables, without the time that machines have taken."""
    tables = {name: pq.read_table(results.path / f"{name}.parquet") for name in TABLES}
    return tables | {"fleet": tables["fleet"].drop_columns(["cpu_s"])}


def assert_same_tables(first, second):
    others = tables_of(second)
    for name, table in tables_of(first).items():
        assert table.equals(others[name]), name


def whole_results(out):
    """Stamps of the results of machines: those that count, and not what is about to."""
    folders = [pointer.parents[1] for pointer in out.glob("machines/*/.frf_ipz/current")]
    return {folder.name: text for folder in folders if (text := stamp(folder))}


class Killer:
    """Kills a worker twice, when some machines are done; knows the results that were whole by then."""

    def __init__(self, out, workers):
        self.out, self.workers, self.kills, self.whole = out, workers, 0, {}

    def __call__(self, _fraction, text):
        done = text.partition(" of ")[0]
        if self.kills < 2 and done.isdigit() and int(done) >= COUNT // 5 * (1 + self.kills):
            self.whole = whole_results(self.out) | self.whole
            os.kill(self.workers()[0], signal.SIGKILL)
            self.kills += 1

    def assert_nothing_twice(self):
        assert self.kills == 2
        assert len(self.whole) >= COUNT // 5
        assert {name: stamp(self.out / "machines" / name) for name in self.whole} == self.whole


def children():
    """Processes of loky that this one has."""
    of_this = Path(f"/proc/{os.getpid()}/task").glob("*/children")
    found = [int(number) for file in of_this for number in file.read_text().split()]
    return [number for number in found if b"popen_loky_posix" in Path(f"/proc/{number}/cmdline").read_bytes()]


@pytest.mark.skipif(sys.platform != "linux", reason="finds processes by /proc")
def test_killed_processes_lose_nothing_and_repeat_nothing(fleet, alone, tmp_path):
    killer = Killer(tmp_path / "out", children)
    results = frf_ipz.run_fleet(fleet, tmp_path / "out", jobs=2, progress=killer)
    assert (results.to_frame()["status"] == "done").sum() == COUNT
    killer.assert_nothing_twice()
    assert len(list((results.path / "reduced").glob("*.result"))) == 1
    assert_same_tables(alone, results)


@contextmanager
def cluster(folder):
    """A scheduler and two workers on this machine; gives its address, and the processes of the workers."""
    file = folder / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    started = [
        subprocess.Popen(
            [*DASK[:2], "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
             "--scheduler-file", str(file)], **quiet,
        )
    ]  # fmt: skip
    try:
        until = time.monotonic() + PATIENCE_S
        while not file.is_file() or not file.read_text():
            assert time.monotonic() < until
            time.sleep(0.1)

        def start_worker():
            command = [*DASK[:2], "distributed.cli.dask_worker", "--scheduler-file", str(file)]
            started.append(subprocess.Popen([*command, "--nthreads", "1", "--no-nanny", "--no-dashboard"], **quiet))

        for _ in range(2):
            start_worker()

        def workers():
            """Those that are alive; another one starts for the one that is about to be killed."""
            alive = [process.pid for process in started[1:] if process.poll() is None]
            start_worker()
            return alive

        yield json.loads(file.read_text())["address"], workers
    finally:
        for process in started:
            process.kill()
            process.wait()


def test_a_cluster_whose_workers_are_killed_gives_the_same_tables(fleet, alone, tmp_path):
    pytest.importorskip("distributed")
    with cluster(tmp_path) as (address, workers):
        killer = Killer(tmp_path / "out", workers)
        results = frf_ipz.run_fleet(fleet, tmp_path / "out", scheduler=address, progress=killer)
    assert (results.to_frame()["status"] == "done").sum() == COUNT
    killer.assert_nothing_twice()
    assert_same_tables(alone, results)


def test_a_scheduler_that_does_not_answer_is_one_line(fleet, tmp_path):
    dask = pytest.importorskip("dask")
    pytest.importorskip("distributed")
    refused = pytest.raises(frf_ipz.InputError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9")
    with dask.config.set({"distributed.comm.timeouts.connect": "1s"}), refused:
        frf_ipz.run_fleet(fleet, tmp_path / "out", scheduler="tcp://127.0.0.1:9")


@pytest.mark.skipif(sys.platform == "win32", reason="signals of a terminal")
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_ctrl_c_leaves_what_is_done(fleet, tmp_path, jobs):
    out = tmp_path / "out"
    command = [sys.executable, "-m", "frf_ipz", "fleet", str(fleet), "--out", str(out), "--jobs", jobs]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    heeding = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # a shell has what it puts behind ignore it
    process = subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, env=environment, start_new_session=True, preexec_fn=heeding
    )
    until = time.monotonic() + PATIENCE_S
    while len(whole_results(out)) < 3:
        assert time.monotonic() < until
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    _, error = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 128 + signal.SIGINT
    assert error.strip().splitlines()[-1] == f"frf-ipz: {STOPPED}"
    assert "Traceback" not in error
    whole = whole_results(out)
    assert 2 <= len(whole) < COUNT  # the last one may be taken back while it takes its place
    results = frf_ipz.run_fleet(fleet, out, jobs=1)
    assert (results.to_frame()["status"] == "done").sum() == COUNT
    assert {name: stamp(out / "machines" / name) for name in whole} == whole
