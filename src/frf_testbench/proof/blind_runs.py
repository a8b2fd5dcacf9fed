"""Diagnose cases by the public command, and predict points of interest with and without the finding."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import tomlkit

from frf_ipz.input_files import read_text
from frf_testbench.proof.commands import Step, compute_code_digest, find_public_command, read_outcome, run_all
from frf_testbench.proof.plan import Folders


def diagnose_all(
    names: Sequence[str], folders: Folders, *, workers: int, step: Step, command: Sequence[str] | None = None
) -> None:
    """Diagnose all cases that this code has not diagnosed yet.

    Parameters
    ----------
    names : sequence of str
        Cases.
    folders : Folders
        Where they are. Nothing of the folder of the answers is read.
    workers : int
        Cases at the same time.
    step : callable
        Called after each case.
    command : sequence of str, optional
        Instead of the public command.
    """
    command_words = list(command or find_public_command())

    def list_commands(name: str) -> list[list[str]]:
        out = folders.diagnosed / name
        shutil.rmtree(out, ignore_errors=True)
        pipeline = write_pipeline(folders, name, applies=True)
        return [[*command_words, "diagnose", str(pipeline), "--out", str(out), "--quiet"]]

    jobs = {name: partial(list_commands, name) for name in names}
    run_all(jobs, folders.diagnosed, workers=workers, code=compute_code_digest(), step=step)


def predict_all(
    names: Sequence[str], folders: Folders, *, workers: int, step: Step, command: Sequence[str] | None = None
) -> None:
    """Predict the points of interest of cases that were explained: with the finding, and by updating without it.

    Parameters
    ----------
    names : sequence of str
        Cases that `is_worth_predicting` holds for.
    folders : Folders
        Where they are.
    workers : int
        Cases at the same time.
    step : callable
        Called after each case.
    command : sequence of str, optional
        Instead of the public command.
    """
    command_words = list(command or find_public_command())

    def list_commands(name: str) -> list[list[str]]:
        commands = []
        for label, applies in (("with", True), ("without", False)):
            out = folders.predicted / name / label
            shutil.rmtree(out, ignore_errors=True)
            shutil.copytree(folders.diagnosed / name, out)  # FRFs, fit and diagnosis are used again
            pipeline = write_pipeline(folders, name, applies=applies)
            commands.append([*command_words, "predict", str(pipeline), "--out", str(out), "--quiet"])
        return commands

    jobs = {name: partial(list_commands, name) for name in names}
    run_all(jobs, folders.predicted, workers=workers, code=compute_code_digest(), step=step)


def is_worth_predicting(name: str, folders: Folders) -> bool:
    """Whether a case has points of interest and its diagnosis explained something."""
    path = folders.diagnosed / name / "diagnosis.json"
    outcome = read_outcome(folders.diagnosed, name)
    if outcome is None or outcome.status or not path.is_file():
        return False
    pipeline = tomlkit.parse(read_text(folders.cases / name / "pipeline.toml"))
    verdict = json.loads(path.read_text(encoding="utf-8")).get("verdict")
    return verdict == "explained" and bool(pipeline.get("predict", {}).get("points"))


def write_pipeline(folders: Folders, name: str, *, applies: bool) -> Path:
    """Write a case's pipeline file anew, with or without a diagnosis that flows on; the case itself stays as it is.

    Parameters
    ----------
    folders : Folders
        Where the case is.
    name : str
        Of the case.
    applies : bool
        Whether the run diagnoses, and its finding flows on into updating and prediction.

    Returns
    -------
    Path
        The file, with absolute paths.
    """
    case = (folders.cases / name).resolve()
    document = tomlkit.parse(read_text(case / "pipeline.toml"))
    head = document["pipeline"]
    for key in ("test", "model"):
        if key in head:
            head[key] = str(case / head[key])
    options = document.pop("diagnose", tomlkit.table()) if applies else tomlkit.table()
    options.update({"apply": True} if applies else {"run": "never"})
    document["diagnose"] = options
    path = folders.root / "pipelines" / f"{name}_{'with' if applies else 'without'}.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(tomlkit.dumps(document), encoding="utf-8")
    return path.resolve()
