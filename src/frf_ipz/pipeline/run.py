"""Run a pipeline file into a folder."""

from __future__ import annotations

import platform
from datetime import UTC, datetime
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from frf_ipz import __version__
from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.pipeline.chain import STAGES, chain
from frf_ipz.pipeline.inputs import PipelineInputs, read_inputs
from frf_ipz.progress import Progress, silent
from frf_ipz.runs.digests import plain
from frf_ipz.runs.folder import RunFolder, open_run, read_run

if TYPE_CHECKING:
    from pathlib import Path

PACKAGES = ("numpy", "scipy", "pandas", "pyarrow", "control")


def run_pipeline(
    path: Path, out: Path, *, until: str = "report", diagnosing: bool | None = None, progress: Progress = silent
) -> RunFolder:
    """Run the chain of a pipeline file, re-using what the folder holds.

    Parameters
    ----------
    path : Path
        ``pipeline.toml``.
    out : Path
        The run's folder; made where there is none. A run that fails leaves what was there.
    until : str
        The last stage to run, one of `chain.STAGES`.
    diagnosing : bool, optional
        Look for what the model left out; where it is left out, if the file has a section ``[diagnose]``.
    progress : Progress
        Called with the fraction done and what is being done.

    Returns
    -------
    RunFolder
        What the folder holds now: ``run.load("fit")`` gives a stage's result.

    Raises
    ------
    InputError
        If the input is wrong; the message says what to do.
    """
    if until not in STAGES:
        raise InputError(f"there is no stage '{until}'; {did_you_mean(until, STAGES)}")
    inputs = read_inputs(path)
    is_diagnosing = inputs.pipeline.file.diagnose is not None if diagnosing is None else diagnosing
    if inputs.model is None and until not in {"ingest", "fit", "report"}:
        raise InputError(f"{path}: the stage '{until}' needs an FE model; name it as [pipeline] model")
    with open_run(out) as folder:
        folder.manifest.update(_provenance(inputs))
        for stage in chain(inputs, folder, until=until, diagnosing=is_diagnosing, progress=progress):
            if stage == until:
                break
    return read_run(out)


def _provenance(inputs: PipelineInputs) -> dict[str, Any]:
    return {
        "frf_ipz": __version__,
        "python": platform.python_version(),
        "packages": {name: version(name) for name in PACKAGES},
        "when": datetime.now(UTC).isoformat(timespec="seconds"),
        "pipeline": str(inputs.pipeline.path),
        "name": inputs.pipeline.name,
        "configuration": plain(inputs.pipeline.file),
        "inputs": dict(inputs.digests),
    }
