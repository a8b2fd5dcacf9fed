"""``run.json``, read as what anybody may have written: every key is what it should be, or the file is damaged."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from frf_ipz.errors import FileFormatError
from frf_ipz.json_files import read_json
from frf_ipz.runs.codec import RESULTS

if TYPE_CHECKING:
    from pathlib import Path

MANIFEST = "run.json"
STAGE_NAMES = frozenset({*RESULTS, "files", "report"})
FILE_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]*\.[a-z0-9]+")  # what a stage writes: in the run's own folder
TEXTS = ("frf_ipz", "python", "when", "pipeline", "name")
TABLES = ("packages", "test", "configuration", "inputs", "stages")


def load_manifest(folder: Path) -> dict[str, Any]:
    """Read `run.json`, and refuse what cannot be one.

    Parameters
    ----------
    folder : Path
        The run's folder.

    Returns
    -------
    dict
        What it says; keys that the program does not know stay as they are.

    Raises
    ------
    FileFormatError
        If it is missing or damaged: names the key.
    """
    path = folder / MANIFEST
    manifest = read_json(path)
    for name in TEXTS:
        _require(path, name, manifest.get(name, ""), str)
    for name in TABLES:
        _require(path, name, manifest.get(name, {}), dict)
    notes = manifest.get("notes", [])
    _require(path, "notes", notes, list)
    for note in notes:
        _require(path, "notes", note, str)
    for name in ("packages", "test", "inputs"):
        for key, value in manifest.get(name, {}).items():
            _require(path, f"{name}.{key}", value, str)
    for name, stage in manifest.get("stages", {}).items():
        if name not in STAGE_NAMES:
            raise _damaged(path, f"stages.{name}", "is no stage of this program")
        _require(path, f"stages.{name}", stage, dict)
        _check_stage(path, f"stages.{name}", stage)
    return manifest


def _check_stage(path: Path, where: str, stage: dict[str, Any]) -> None:
    _require(path, f"{where}.key", stage.get("key", ""), str)
    _require(path, f"{where}.stale", stage.get("stale", False), bool)
    seconds = stage.get("seconds", 0.0)
    _require(path, f"{where}.seconds", 0.0 if type(seconds) is int else seconds, float)
    files = stage.get("files", [])
    _require(path, f"{where}.files", files, list, dict)
    digests = stage.get("digests", {})
    _require(path, f"{where}.digests", digests, dict)
    for name, value in digests.items():
        _require(path, f"{where}.digests.{name}", value, str)
    for name in files:
        if not isinstance(name, str) or name == MANIFEST or not FILE_NAME.fullmatch(name):
            raise _damaged(path, f"{where}.files", f"{name!r:.60} is no file that a stage writes")


def _require(path: Path, where: str, value: object, *kinds: type) -> None:
    if not isinstance(value, kinds):
        raise _damaged(path, where, f"is {value!r:.60}")


def _damaged(path: Path, where: str, problem: str) -> FileFormatError:
    return FileFormatError(
        path, f"{problem}; the file is damaged: delete the folder or run again", where=f"key '{where:.100}'"
    )
