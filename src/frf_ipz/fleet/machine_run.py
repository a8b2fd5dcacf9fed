"""One machine of a fleet as a task: an ordinary run into a folder of its own, wherever it is computed."""

from __future__ import annotations

import os
import signal
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from threadpoolctl import threadpool_limits

from frf_ipz.errors import FrfIpzError
from frf_ipz.fleet.machine_record import FAILED, MachineRecord, describe_results
from frf_ipz.pipeline.inputs import read_inputs
from frf_ipz.pipeline.run import run_chain
from frf_ipz.progress import silent
from frf_ipz.runs.folder import open_run
from frf_ipz.runs.results import open_results

if TYPE_CHECKING:
    from collections.abc import Mapping

    from frf_ipz.pipeline.inputs import PipelineInputs
    from frf_ipz.pipeline.shared_model import SharedModel

EXPORT, REPORT = "export", "report"
FIT = "fit"


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineTask:
    """What is to be done for one machine.

    Parameters
    ----------
    machine : str
        Its id.
    pipeline : Path
        Its pipeline file.
    folder : Path
        Its folder of results.
    until : str
        The last stage: ``export``, ``report`` with the page, or ``fit`` for a fleet without an FE model.
    has_page_of_failure : bool
        Where it fails, write a page of what was measured.
    particulars : mapping of str to str
        What the fleet file states of its test.
    process : int
        Of the command: what is to be ended by Ctrl-C.
    """

    machine: str
    pipeline: Path
    folder: Path
    until: str
    has_page_of_failure: bool = False
    particulars: Mapping[str, str] = field(default_factory=dict)
    process: int = 0


def run_machine(task: MachineTask, shared: SharedModel | None) -> MachineRecord:
    """Run one machine; whatever goes wrong with it is in the record.

    Parameters
    ----------
    task : MachineTask
        What is to be done.
    shared : SharedModel, optional
        The FE model of the fleet.

    Returns
    -------
    MachineRecord
        What became of it.
    """
    _leave_interrupts_to(task.process)
    started = time.thread_time()  # a worker may have several threads
    with threadpool_limits(1):
        try:
            record = _run(task, shared)
        except FrfIpzError as error:
            record = _failed(task, shared, str(error))
        except Exception as error:
            record = _failed(task, shared, f"fault of the program: {type(error).__name__}: {error}")
    return replace(record, cpu_s=time.thread_time() - started)


def _leave_interrupts_to(process: int) -> None:
    """Let Ctrl-C, which every process of a terminal is told, be the command's: it ends its workers itself."""
    if os.getpid() != process and threading.current_thread() is threading.main_thread():
        with suppress(ValueError):
            signal.signal(signal.SIGINT, signal.SIG_IGN)


def _inputs(task: MachineTask, shared: SharedModel | None) -> PipelineInputs:
    inputs = read_inputs(task.pipeline, shared=shared)
    test = replace(inputs.test, particulars={**inputs.test.particulars, **task.particulars})
    return replace(inputs, test=test)


def _run(task: MachineTask, shared: SharedModel | None) -> MachineRecord:
    inputs = _inputs(task, shared)
    with open_run(task.folder) as folder:
        run_chain(inputs, folder, until=task.until, diagnosing=None, progress=silent)
    return replace(describe_results(task.machine, open_results(task.folder)), computed=tuple(folder.computed))


def _failed(task: MachineTask, shared: SharedModel | None, message: str) -> MachineRecord:
    if task.has_page_of_failure:
        with suppress(Exception):  # what was measured may be what is wrong
            inputs = replace(_inputs(task, shared), fe_model=None, points=(), reference=None, reference_name="")
            with open_run(task.folder) as folder:
                run_chain(inputs, folder, until=REPORT, diagnosing=None, progress=silent)
    return MachineRecord(machine=task.machine, status=FAILED, message=message, particulars=dict(task.particulars))
