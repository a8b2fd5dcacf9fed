"""Run a pipeline file into a folder."""

from __future__ import annotations

import platform
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from frf_ipz import __version__
from frf_ipz.arguments import as_path
from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.numerics.one_thread import on_one_thread
from frf_ipz.pipeline.chain import STAGES, chain
from frf_ipz.pipeline.inputs import PipelineInputs, read_inputs
from frf_ipz.progress import Progress, silent
from frf_ipz.runs.digests import plain
from frf_ipz.runs.folder import open_run
from frf_ipz.runs.memory import RunMemory
from frf_ipz.runs.results import Results, open_results
from frf_ipz.runs.software import package_versions

if TYPE_CHECKING:
    from frf_ipz.pipeline.stage_runner import RunStore


def run_pipeline(
    path: str | Path,
    out: str | Path,
    *,
    until: str = "report",
    diagnosing: bool | None = None,
    progress: Progress = silent,
) -> Results:
    """Run the chain of a pipeline file, re-using what the folder holds.

    Parameters
    ----------
    path : str or Path
        ``pipeline.toml``, or a folder that holds exactly one pipeline.
    out : str or Path
        The run's folder; made where there is none. A run that fails leaves what was there.
    until : str
        The last stage to run: ``ingest``, ``fit``, ``diagnose``, ``pair``, ``update``, ``predict``, ``export`` or
        ``report``.
    diagnosing : bool, optional
        Look for what the model left out, without a limit of time unless one is stated; False: do not, and take what
        was found of these very inputs before. Where it is left out, ``[diagnose] run`` says whether, and the time is
        limited.
    progress : Progress
        Called with the fraction done and what is being done.

    Returns
    -------
    Results
        What the folder holds now.

    Raises
    ------
    InputError
        If the input is wrong; the message says what to do.

    Examples
    --------
    >>> import frf_ipz
    >>> results = frf_ipz.run_pipeline("pipelines/cantilever.toml", "results/cantilever")  # doctest: +SKIP
    >>> results.state_space.nstates  # doctest: +SKIP
    16
    """
    _require_stage(until)
    inputs = read_inputs(as_path(path))
    with open_run(as_path(out), progress=progress) as folder:
        run_chain(inputs, folder, until=until, diagnosing=diagnosing, progress=progress)
    return open_results(out)


def run_in_memory(
    inputs: PipelineInputs, *, until: str = "report", diagnosing: bool | None = None, progress: Progress = silent
) -> Results:
    """Run the chain without a folder.

    Parameters
    ----------
    inputs : PipelineInputs
        What to work on.
    until, diagnosing, progress
        As for `run_pipeline`.

    Returns
    -------
    Results
        Of all stages.

    Raises
    ------
    InputError
        If the input is wrong.
    """
    _require_stage(until)
    memory = RunMemory()
    run_chain(inputs, memory, until=until, diagnosing=diagnosing, progress=progress)
    return Results(memory)


@on_one_thread
def run_chain(
    inputs: PipelineInputs, store: RunStore, *, until: str, diagnosing: bool | None, progress: Progress
) -> None:
    """Run the chain into a folder or into memory.

    Parameters
    ----------
    inputs : PipelineInputs
        What to work on.
    store : RunFolder or RunMemory
        Where results are kept.
    until, diagnosing, progress
        As for `run_pipeline`.

    Raises
    ------
    InputError
        If a stage needs an FE model and there is none, or an effect of the user's ends the program.
    """
    if inputs.fe_model is None and until not in {"ingest", "fit", "report"}:
        raise InputError(f"{inputs.source}: the stage '{until}' needs an FE model; name it as [pipeline] model")
    store.manifest.update(_provenance(inputs))
    try:
        for stage in chain(inputs, store, until=until, diagnosing=diagnosing, progress=progress):
            if stage == until:
                break
        if store.is_stale("assess"):
            store.manifest.pop("assessment", None)  # it was said of results that are no more
    except SystemExit as error:  # nothing of the package ends the program here
        raise InputError(f"{inputs.source}: an effect of your own ended the program (exit {error.code})") from error


def _require_stage(until: str) -> None:
    if until not in STAGES:
        raise InputError(f"there is no stage '{until}'; {did_you_mean(until, STAGES)}")


def _provenance(inputs: PipelineInputs) -> dict[str, Any]:
    return {
        "frf_ipz": __version__,
        "python": platform.python_version(),
        "packages": package_versions(),
        "when": datetime.now(UTC).isoformat(timespec="seconds"),
        "pipeline": inputs.source,
        "name": inputs.name,
        "test": {"name": inputs.test.name, "kind": inputs.test.kind, **inputs.test.particulars},
        "configuration": plain(inputs.options),
        "inputs": dict(inputs.digests),
    }
