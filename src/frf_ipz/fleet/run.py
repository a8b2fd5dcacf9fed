"""Run a fleet: every machine on its own, then all together."""

from __future__ import annotations

import json
import os
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from frf_ipz.arguments import as_path
from frf_ipz.errors import FrfIpzError, InputError, did_you_mean
from frf_ipz.export.parquet import write_table
from frf_ipz.export.state_space_files import write_ensemble
from frf_ipz.fleet.analysis import FleetAnalysis, analyse_fleet
from frf_ipz.fleet.engines.dask import run_on_cluster
from frf_ipz.fleet.engines.local import default_jobs, run_local
from frf_ipz.fleet.fleet_file import Fleet, Machine, read_fleet
from frf_ipz.fleet.machine_record import FAILED, NOT_RUN, MachineRecord, describe_results
from frf_ipz.fleet.machine_run import EXPORT, FIT, REPORT, MachineTask
from frf_ipz.fleet.page import write_page
from frf_ipz.fleet.population import population_models
from frf_ipz.fleet.results import ENSEMBLE, MACHINES, PIPELINES, POPULATION, REDUCED, FleetResults
from frf_ipz.fleet.tables import fleet_tables
from frf_ipz.output_files import cannot_write, write_text
from frf_ipz.pipeline.config import PipelineFile
from frf_ipz.pipeline.shared_model import SharedModel, share_model
from frf_ipz.progress import Progress, silent
from frf_ipz.runs.folder_lock import lock_folder
from frf_ipz.runs.generations import HIDDEN
from frf_ipz.runs.results import open_results
from frf_ipz.toml_files import to_options
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from frf_ipz.export.state_space import StateSpaceModel

RUNNING = 0.95  # of the progress; what follows is the work of a few seconds


def run_fleet(
    path: str | Path,
    out: str | Path,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    only: Sequence[str] = (),
    progress: Progress = silent,
) -> FleetResults:
    """Run all machines of a fleet file, re-using what the folder holds, and look at them together.

    Parameters
    ----------
    path : str or Path
        ``fleet.toml``.
    out : str or Path
        The fleet's folder; made where there is none. ``machines/ID`` is a folder of results for each machine.
    jobs : int, optional
        Number of processes; as many as there are cores and memory for by default. 1 works in this process.
    scheduler : str, optional
        Address of the scheduler of a Dask cluster, as ``tcp://host:8786``, whose workers then do the work.
    only : sequence of str
        Ids of machines to run; all by default. Of the others is taken what their folders hold.
    progress : Progress
        Called with the fraction done and what is being done, after each machine.

    Returns
    -------
    FleetResults
        What the folder holds now. A machine that fails is a row with ``status = "failed"``, and stops no other.

    Raises
    ------
    InputError
        If the fleet file, the model or the common settings are wrong, or the folder cannot be written to.

    Examples
    --------
    >>> import frf_ipz
    >>> results = frf_ipz.run_fleet("fleet.toml", "results/line3")  # doctest: +SKIP
    >>> results.to_frame("fleet")[["machine", "status", "n_modes"]]  # doctest: +SKIP
      machine status  n_modes
    0     m01   done        4
    1     m02   done        4
    """
    fleet = read_fleet(as_path(path))
    chosen = _chosen(fleet, only)
    out = as_path(out)
    engine = _engine(fleet, len(chosen), jobs=jobs, scheduler=scheduler)
    with _working_in(out, progress):
        progress(0.0, "reading the model")
        shared = None if fleet.model_path is None else share_model(fleet.model_path, out.resolve() / REDUCED)
        work = _Work(fleet=fleet, out=out.resolve(), shared=shared, engine=engine, progress=progress)
        records = work.run(chosen)
        progress(RUNNING, "comparing the machines")
        analysis = analyse_fleet([records.get(machine.id) or _as_it_stands(machine, out) for machine in fleet.machines])
        if fleet.pages == "outliers":
            off = [machine for machine in chosen if machine.id in analysis.outliers]
            records |= work.write_pages(off, records)
            analysis = replace(
                analysis, records=tuple(records.get(record.machine, record) for record in analysis.records)
            )
        _write(fleet, out, analysis)
    return FleetResults(path=out)


def _chosen(fleet: Fleet, only: Sequence[str]) -> list[Machine]:
    known = {machine.id: machine for machine in fleet.machines}
    for name in only:
        if name not in known:
            raise InputError(f"{fleet.path}: there is no machine '{name}'; {did_you_mean(name, known)}")
    return [machine for machine in fleet.machines if not only or machine.id in only]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Engine:
    """Where tasks are run."""

    jobs: int = 1
    scheduler: str = ""

    def __call__(self, tasks: Sequence[MachineTask], shared: SharedModel | None) -> Iterator[MachineRecord]:
        if self.scheduler:
            return run_on_cluster(tasks, shared, scheduler=self.scheduler)
        return run_local(tasks, shared, jobs=self.jobs or default_jobs(len(tasks)))


def _engine(fleet: Fleet, n_machines: int, *, jobs: int | None, scheduler: str | None) -> _Engine:
    if jobs is not None and (isinstance(jobs, bool) or not isinstance(jobs, int) or jobs < 1):
        raise InputError(f"the number of jobs is {jobs!r}; needed is a whole number from 1")
    if scheduler is None and fleet.engine == "local":
        return _Engine(jobs=0 if jobs is None else min(jobs, n_machines))
    if not scheduler:
        raise InputError(
            f"{fleet.path}: [fleet] engine = 'dask' needs the address of a scheduler: --scheduler tcp://HOST:PORT"
        )
    if jobs is not None:
        raise InputError("a cluster has the workers that it has: leave the number of jobs out, or the scheduler")
    return _Engine(scheduler=scheduler)


@contextmanager
def _working_in(out: Path, progress: Progress) -> Iterator[None]:
    """Work in a folder alone."""
    try:
        with lock_folder(out, out / HIDDEN, progress=progress):
            yield
    except OSError as error:
        raise cannot_write(out, error) from None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Work:
    """What is to be done for machines of a fleet."""

    fleet: Fleet
    out: Path
    shared: SharedModel | None
    engine: _Engine
    progress: Progress

    def run(self, machines: Sequence[Machine]) -> dict[str, MachineRecord]:
        """Run machines, and tell how it goes."""
        (self.out / PIPELINES).mkdir(parents=True, exist_ok=True)
        first = FIT if self.shared is None else EXPORT
        tasks = [self._task(machine, REPORT if self.fleet.pages == "all" else first) for machine in machines]
        records: dict[str, MachineRecord] = {}
        self.progress(0.0, _how_far(records, len(tasks)))
        for record in self.engine(tasks, self.shared):
            records[record.machine] = record
            self.progress(RUNNING * len(records) / len(tasks), _how_far(records, len(tasks)))
        return records

    def write_pages(self, machines: Sequence[Machine], records: dict[str, MachineRecord]) -> dict[str, MachineRecord]:
        """Write the pages of machines that have been run."""
        written = {}
        for record in self.engine([self._task(machine, REPORT) for machine in machines], self.shared):
            written[record.machine] = replace(record, cpu_s=record.cpu_s + records[record.machine].cpu_s)
            self.progress(RUNNING, f"{len(written)} of {len(machines)} pages of outliers")
        return written

    def _task(self, machine: Machine, until: str) -> MachineTask:
        pipeline = self.out / PIPELINES / f"{machine.id}.toml"
        self.fleet.write_pipeline(machine, pipeline)
        return MachineTask(
            machine=machine.id,
            pipeline=pipeline,
            folder=self.out / MACHINES / machine.id,
            until=until,
            has_page_of_failure=self.fleet.pages != "none",
            particulars=dict(machine.particulars),
            process=os.getpid(),
        )


def _how_far(records: dict[str, MachineRecord], total: int) -> str:
    failed = sum(record.status == FAILED for record in records.values())
    return f"{len(records)} of {counted(total, 'machine')}" + (f", {failed} failed" if failed else "")


def _as_it_stands(machine: Machine, out: Path) -> MachineRecord:
    """Say what the folder of a machine holds that was not to be run."""
    try:
        record = describe_results(machine.id, open_results(out / MACHINES / machine.id))
    except FrfIpzError:
        return MachineRecord(machine=machine.id, status=NOT_RUN, particulars=dict(machine.particulars))
    return replace(record, particulars={**record.particulars, **machine.particulars})


def _write(fleet: Fleet, out: Path, analysis: FleetAnalysis) -> None:
    for name, table in fleet_tables(analysis).items():
        write_table(table, out / name)
    text = json.dumps(analysis.population.to_json(), indent=1, ensure_ascii=False, allow_nan=False)
    write_text(out / POPULATION, f"{text}\n")
    _write_ensemble(fleet, out, analysis)
    write_page(fleet.name, analysis, out)


def _write_ensemble(fleet: Fleet, out: Path, analysis: FleetAnalysis) -> None:
    """Write models of machines of this kind; of those with one reduced model, which most have."""
    of = [record for record in analysis.records if record.machine in analysis.population.machines]
    commonest = Counter(record.reduction for record in of).most_common(1)
    machines = [record.machine for record in of if record.reduction == commonest[0][0]]
    models: tuple[StateSpaceModel, ...] = ()
    if machines:
        options = to_options(fleet.pipeline_of(fleet.machines[0]), PipelineFile, fleet.path)
        results = [open_results(out / MACHINES / machine) for machine in machines]
        models = population_models(results, options=options.export, members=options.update.ensemble)
    if models:
        write_ensemble(models, out / ENSEMBLE)
    else:
        (out / ENSEMBLE).unlink(missing_ok=True)
