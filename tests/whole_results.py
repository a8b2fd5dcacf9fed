"""Whether a results folder is whole: the results of one command after another, each with its own files, no litter."""

import json
from pathlib import Path

from frf_ipz.errors import FileFormatError
from frf_ipz.input_files import digest_file
from frf_ipz.runs.folder_lock import LOCK
from frf_ipz.runs.generations import GENERATIONS, HIDDEN, POINTER, current_folder
from frf_ipz.runs.results import open_results
from frf_ipz.runs.stage_file import SUFFIX, read_stage_file

DATED = ("report.html", "statespace.mat")  # say when they were made


def results_of(folder):
    """What the program reads there: key and digests of every stage; None where there is no run."""
    current = current_folder(folder)
    if not (current / "run.json").is_file():
        return None
    stages = json.loads((current / "run.json").read_text(encoding="utf-8"))["stages"]
    kept = ("key", "files", "stale")
    return {
        name: {key: stage[key] for key in kept if key in stage}
        | {"digests": {file: digest for file, digest in stage["digests"].items() if file not in DATED}}
        for name, stage in stages.items()
    }


def faults_of_reading(folder):
    """What is wrong with what the program reads: a file that is not its stage's, or what cannot be opened."""
    if results_of(folder) is None:
        return []
    current = current_folder(folder)
    try:
        return _faults_of(folder, current)
    except FileFormatError:
        if current_folder(folder) == current:
            raise
        return faults_of_reading(folder)  # a command has put new results in their place meanwhile


def _faults_of(folder, current):
    stages = json.loads((current / "run.json").read_text())["stages"]
    faults = []
    for place, (name, stage) in enumerate(stages.items()):
        later = [stages[other] for other in list(stages)[place:]]
        for file, _ in stage["digests"].items():
            allowed = {other["digests"][file] for other in later if file in other["digests"]}
            if digest_file(current / file) not in allowed:
                faults.append(f"{file} is not that of the stage {name}")
        kept = current / "stages" / f"{name}{SUFFIX}"
        if name != "report" and read_stage_file(kept).key != stage["key"]:
            faults.append(f"{kept.name} carries the key of another run")
    open_results(folder).load().summary()
    return faults


def faults_after_a_command(folder):
    """What is wrong once a command has come to its end: also what users open, and what lies about."""
    faults, current = faults_of_reading(folder), current_folder(folder)
    if results_of(folder) is None:
        return [*faults, *(f"{path} lies about" for path in Path(folder).rglob("*"))]
    whole, opened = (content(path) for path in (current, folder))
    faults += [f"{name} is not that of the results" for name in whole if opened.pop(name, None) != whole[name]]
    faults += [f"{name} lies about" for name in opened if name != "own.txt"]
    hidden = {path.relative_to(folder / HIDDEN).as_posix() for path in (folder / HIDDEN).rglob("*")}
    known = {LOCK, POINTER, GENERATIONS, f"{GENERATIONS}/{current.name}"}
    extra = hidden - known - {f"{GENERATIONS}/{current.name}/{name}" for name in (*whole, "stages")}
    return [*faults, *(f"{name} lies about" for name in sorted(extra))]


def content(folder):
    """Every file that users open, by name."""
    files = (path for path in Path(folder).rglob("*") if path.is_file())
    names = {path.relative_to(folder).as_posix(): path for path in files}
    return {name: path.read_bytes() for name, path in names.items() if not name.startswith(f"{HIDDEN}/")}
