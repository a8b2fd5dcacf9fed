"""Progress and summary on a terminal, of runs and of fleets."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from frf_ipz.cli.printing import say
from frf_ipz.cli.progress_display import showing_progress
from frf_ipz.late_imports import import_late
from frf_ipz.pipeline.run import run_pipeline

if TYPE_CHECKING:
    from frf_ipz.fleet.run import run_fleet
else:
    run_fleet = import_late("frf_ipz.fleet.run", "run_fleet")


def run_with_progress(pipeline: Path, out: Path, *, until: str, diagnosing: bool | None, quiet: bool) -> None:
    """Run a pipeline, show how far it is, and sum up.

    Parameters
    ----------
    pipeline : Path
        The pipeline file.
    out : Path
        The run's folder.
    until : str
        Last stage.
    diagnosing : bool, optional
        Look for what the model left out.
    quiet : bool
        Show nothing.

    Raises
    ------
    FrfIpzError
        If the run cannot be done.
    """
    with showing_progress(quiet=quiet) as show:
        run = run_pipeline(pipeline, out, until=until, diagnosing=diagnosing, progress=show)
    if not quiet:
        say(run.summary())


def run_fleet_with_progress(
    fleet: Path, out: Path, *, jobs: int | None, scheduler: str | None, only: str, quiet: bool
) -> None:
    """Run a fleet, show how far it is, and sum up.

    Parameters
    ----------
    fleet : Path
        The fleet file.
    out : Path
        The fleet's folder.
    jobs : int, optional
        Number of processes.
    scheduler : str, optional
        Address of the scheduler of a Dask cluster.
    only : str
        Ids of the machines to run, with commas between them; empty for all.
    quiet : bool
        Show nothing.

    Raises
    ------
    FrfIpzError
        If the fleet cannot be run.
    """
    machines = [name.strip() for name in only.split(",") if name.strip()]
    with showing_progress(quiet=quiet) as show:
        results = run_fleet(fleet, out, jobs=jobs, scheduler=scheduler, only=machines, progress=show)
    if not quiet:
        say(results.summary())
