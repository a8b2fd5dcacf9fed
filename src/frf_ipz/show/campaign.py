"""What a folder holds to look at and to work on: one run, or a campaign with its pipelines and their runs.

A campaign is a folder of test, model and pipeline files with their recordings, or a folder of such folders. A pipeline
that has not been run yet gets a folder for its results beside it: ``results/NAME`` for ``NAME.toml``.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from frf_ipz.errors import InputError
from frf_ipz.pipeline.pipeline_folder import pipelines_in
from frf_ipz.runs.folder import holds_run, read_manifest
from frf_ipz.runs.manifest import MANIFEST

if TYPE_CHECKING:
    from collections.abc import Iterator

RESULTS = "results"
DEEPEST = 3  # folders below the one that is given: campaign, its results, a run


@dataclass(frozen=True, slots=True, kw_only=True)
class RunPaths:
    """Where a run is, or will be once it has been made.

    Parameters
    ----------
    folder : Path
        The run's folder; there may be none yet.
    pipeline : Path
        Its pipeline file.
    """

    folder: Path
    pipeline: Path


def find_runs(folder: Path) -> tuple[RunPaths, ...]:
    """Look for runs and pipelines in a folder.

    Parameters
    ----------
    folder : Path
        A run, or a campaign.

    Returns
    -------
    tuple of RunPaths
        One where the folder is itself a run; else the runs of each pipeline, and pipelines without a run.

    Raises
    ------
    InputError
        If there is neither a run nor a pipeline.
    """
    folder = folder.resolve()
    runs, pipelines = [], []
    for here in _folders(folder):
        runs += [_run_in(here)] if holds_run(here) else []
        pipelines += pipelines_in(here)
    ran = {run.pipeline for run in runs}
    new = [RunPaths(folder=file.parent / RESULTS / file.stem, pipeline=file) for file in pipelines if file not in ran]
    if not runs and not new:
        raise InputError(
            f"{folder}: there is no run here (no {MANIFEST}) and no pipeline; write one with 'frf-ipz init {folder}', "
            f"or make a run with 'frf-ipz run PIPELINE --out {folder}'"
        )
    return tuple(sorted((*runs, *new), key=lambda run: (str(run.pipeline), str(run.folder))))


def _folders(folder: Path) -> Iterator[Path]:
    """Give the folders that may hold a run or a pipeline, from the top; nothing is searched inside a run."""
    for path, below, _ in os.walk(folder):
        here = Path(path)
        is_run, depth = holds_run(here), len(here.relative_to(folder).parts)
        names = [] if is_run or depth >= DEEPEST else [name for name in sorted(below) if not name.startswith(".")]
        below[:] = names
        yield here


def _run_in(folder: Path) -> RunPaths:
    return RunPaths(folder=folder, pipeline=Path(str(read_manifest(folder).get("pipeline", ""))))
