"""Processes on this machine, by joblib's loky.

A process that is killed takes the others of its pool with it. What it was at is tried again, alone, so that a machine
that kills its process each time, for want of memory say, is known for certain, and stops no other.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from typing import TYPE_CHECKING

from joblib import Parallel, cpu_count, delayed, parallel_config

from frf_ipz.fleet.machine_record import FAILED, MachineRecord
from frf_ipz.fleet.machine_run import MachineTask, run_machine

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from frf_ipz.pipeline.shared_model import SharedModel

RSS_BYTES = 1 if sys.platform == "darwin" else 1024  # in which the system counts memory
MOST_KILLED = 3  # processes at one machine, of which all but the first had nothing else to do


def run_local(tasks: Sequence[MachineTask], shared: SharedModel | None, *, jobs: int) -> Iterator[MachineRecord]:
    """Run machines in processes of this machine; with one job, in this process.

    Parameters
    ----------
    tasks : sequence of MachineTask
        What is to be done.
    shared : SharedModel, optional
        The FE model of the fleet.
    jobs : int
        Number of processes.

    Yields
    ------
    MachineRecord
        Of each machine as soon as it is done.
    """
    waiting = {task.machine: task for task in tasks}
    killed: Counter[str] = Counter()
    while waiting:
        suspects = [task for task in waiting.values() if killed[task.machine]]
        batch = suspects[:1] or list(waiting.values())
        at_work: set[str] = set()
        try:
            for record in _in_processes(batch, shared, jobs if not suspects else 2, at_work):
                at_work.discard(record.machine)
                del waiting[record.machine]
                yield record
        except BrokenProcessPool:
            killed.update(at_work)
            for machine in [name for name in at_work if killed[name] >= MOST_KILLED]:
                del waiting[machine]
                yield MachineRecord(machine=machine, status=FAILED, message=_was_killed(machine))


def default_jobs(n_machines: int) -> int:
    """Give as many processes as there are cores, memory and machines for.

    Parameters
    ----------
    n_machines : int
        Of the fleet.

    Returns
    -------
    int
        At least 1.
    """
    return max(1, min(int(cpu_count()), n_machines, _fitting_memory()))


def _fitting_memory() -> int:
    """Each process holds what this one has held at most, the FE model above all, and as much again to work with it."""
    try:
        resource = import_module("resource")  # not on Windows
        memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (ImportError, AttributeError, ValueError, OSError):
        return int(cpu_count())
    held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * RSS_BYTES
    return int(memory // (2 * held))


def _in_processes(
    tasks: Sequence[MachineTask], shared: SharedModel | None, jobs: int, at_work: set[str]
) -> Iterator[MachineRecord]:
    """Run tasks; `at_work` holds those that a process has been given, and more only once one is done."""

    def handed_out() -> Iterator[object]:
        for task in tasks:
            at_work.add(task.machine)
            yield delayed(run_machine)(task, shared)

    with parallel_config(backend="loky", inner_max_num_threads=1):
        yield from Parallel(n_jobs=jobs, batch_size=1, pre_dispatch=jobs, return_as="generator_unordered")(handed_out())


def _was_killed(machine: str) -> str:
    return (
        f"its process was killed {MOST_KILLED} times, for want of memory most often; run it alone with "
        f"--only {machine} --jobs 1 to see why"
    )
