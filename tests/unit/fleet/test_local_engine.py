"""Processes that are killed: what they were at is tried again, alone, and a machine that kills each is a row."""

from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pytest

from frf_ipz.fleet.engines import local
from frf_ipz.fleet.machine_record import MachineRecord
from frf_ipz.fleet.machine_run import MachineTask

NAMES = ("m1", "m2", "m3", "m4")


def tasks():
    return [
        MachineTask(machine=name, pipeline=Path(f"{name}.toml"), folder=Path(name), until="export") for name in NAMES
    ]


class Processes:
    """Two at a time; `deaths` says how often the process of a machine is killed, and takes the other one with it."""

    def __init__(self, **deaths):
        self.deaths, self.batches = deaths, []

    def __call__(self, batch, _shared, _jobs, at_work):
        self.batches.append([task.machine for task in batch])
        left = list(batch)
        while left:
            pair, left = left[:2], left[2:]
            at_work.update(task.machine for task in pair)
            for task in pair:
                if self.deaths.get(task.machine, 0):
                    self.deaths[task.machine] -= 1
                    raise BrokenProcessPool
                yield MachineRecord(machine=task.machine, status="done")


def run(monkeypatch, **deaths):
    processes = Processes(**deaths)
    monkeypatch.setattr(local, "_in_processes", processes)
    records = list(local.run_local(tasks(), None, jobs=2))
    assert sorted(record.machine for record in records) == list(NAMES)
    return {record.machine: record for record in records}, processes.batches


@pytest.mark.parametrize("deaths", [{"m1": 1}, {"m1": 1, "m3": 1}, {"m2": 2}])
def test_killed_processes_lose_nothing(monkeypatch, deaths):
    records, _ = run(monkeypatch, **deaths)
    assert {record.status for record in records.values()} == {"done"}


def test_a_machine_that_kills_every_process_is_a_row_and_stops_no_other(monkeypatch):
    records, batches = run(monkeypatch, m1=99)
    assert {name for name, record in records.items() if record.status == "failed"} == {"m1"}
    assert "--only m1 --jobs 1" in records["m1"].message
    assert batches.count(["m1"]) == local.MOST_KILLED - 1  # alone, after the first time


def test_as_many_processes_as_there_are_machines_at_most(monkeypatch):
    monkeypatch.setattr(local, "cpu_count", lambda: 8)
    monkeypatch.setattr(local, "_fitting_memory", lambda: 3)
    assert [local.default_jobs(count) for count in (1, 2, 40)] == [1, 2, 3]
    monkeypatch.setattr(local, "_fitting_memory", lambda: 0)
    assert local.default_jobs(40) == 1
