"""A run's folder: results that are re-used where hashes agree, tables that appear whole or not at all.

Everything is first written to a staging folder inside the run's folder, and moved into place when the whole command
has succeeded. A reader never sees half a file, and a run that fails leaves what was there.
"""

from __future__ import annotations

import ctypes
import errno
import json
import os
import shutil
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from frf_ipz import __version__
from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.runs.codec import load_result, save_result
from frf_ipz.runs.manifest import MANIFEST, load_manifest
from frf_ipz.runs.stage_file import SUFFIX

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

STAGES = "stages"
STAGING = ".partial-"

# Names of the Windows interface to processes
SYNCHRONIZE, WAIT_TIMEOUT, ACCESS_DENIED = 0x00100000, 0x102, 5
# Every key of run.json; * stands for a name of the user's or the program's.
JSON_KEYS = {
    "frf_ipz": "version of frf_ipz",
    "python": "version of Python",
    "packages.*": "version of each package that numbers depend on",
    "when": "start of the run, UTC, ISO 8601",
    "pipeline": "path of the pipeline file; what was given in Python otherwise",
    "name": "name of the run",
    "configuration": "every option of the run, defaults included, by section of pipeline.toml",
    "inputs.*": "SHA-256 digest of each input file, by its path relative to the pipeline file",
    "assessment.verdict": "usable, with care or not usable: the worst of the checks",
    "assessment.checks": "list of the checks, the worst first",
    "assessment.checks.*.name": "what was looked at",
    "assessment.checks.*.verdict": "usable, with care or not usable",
    "assessment.checks.*.figure": "what was found; null where there is no number",
    "assessment.checks.*.limit": "from where on it costs the verdict; null where there is no number",
    "assessment.checks.*.unit": "unit of both",
    "assessment.checks.*.where": "where it is worst: an FRF, a mode, a part",
    "assessment.checks.*.says": "what was found, with the reason for the limit",
    "assessment.checks.*.advice": "what to do; may be empty",
    "assessment.likely_cause": "what most likely has to be corrected; null where no mistake is more likely than not",
    "assessment.likely_cause.says": "the mistake, and what to write instead",
    "assessment.likely_cause.file": "the file in which it stands",
    "assessment.likely_cause.line_or_key": "the key or line in it",
    "assessment.likely_cause.probability": "that it is this, given what was measured",
    "stages.*.key": "digest of everything that the result of the stage depends on",
    "stages.*.seconds": "computing time, s",
    "stages.*.files": "files that the stage has written",
    "stages.*.stale": "true where an earlier stage has been run anew since",
}

Result = TypeVar("Result")
Writers: TypeAlias = "Mapping[str, Callable[[Path], None]]"


@dataclass(kw_only=True, eq=False)
class RunFolder:
    """What a run has left in a folder, and what the command at work will add to it.

    Parameters
    ----------
    path : Path
        The folder.
    staging : Path
        Where files are written until the command has succeeded.
    manifest : dict
        What `run.json` says.
    computed : list of str
        Stages that the command has computed.
    abandoned : set of str
        Files that these stages had written before.
    """

    path: Path
    staging: Path
    manifest: dict[str, Any]
    computed: list[str] = field(default_factory=list)
    abandoned: set[str] = field(default_factory=set)

    @property
    def name(self) -> str:
        """Where the results are, for people."""
        return str(self.path)

    def stage(self, name: str, key: str, compute: Callable[[], Result], files: Callable[[Result], Writers]) -> Result:
        """Give the result of a stage: the one in the folder where the key agrees, else a new one.

        Parameters
        ----------
        name : str
            The stage.
        key : str
            Digest of all that the result depends on.
        compute : callable
            Gives the result.
        files : callable
            Gives what writes each file that users read, by name.

        Returns
        -------
        object
            The result.
        """
        stored = self.path / STAGES / f"{name}{SUFFIX}"
        if self._is_current(name, key) and stored.is_file():
            try:
                result: Result = load_result(stored)
            except FileFormatError:
                pass
            else:
                self.manifest["stages"][name].pop("stale", None)
                return result
        started = time.perf_counter()
        result = compute()
        named = files(result)
        self._write({f"{STAGES}/{name}{SUFFIX}": lambda path: save_result(result, path), **named})
        self._note(name, key, started, named)
        return result

    def page(self, name: str, key: str, files: Writers) -> None:
        """Write files that no later stage reads, unless they are there and the key agrees.

        Parameters
        ----------
        name : str
            The stage.
        key : str
            Digest of all that the files depend on.
        files : mapping of str to callable
            What writes each file, by name.
        """
        if self._is_current(name, key) and all((self.path / file).is_file() for file in files):
            return
        started = time.perf_counter()
        self._write(files)
        self._note(name, key, started, files)

    @contextmanager
    def writing(self, name: str) -> Iterator[Path]:
        """Give the path to write a file of the run to.

        Parameters
        ----------
        name : str
            Its name inside the run's folder.

        Yields
        ------
        Path
            Where to write it for now.

        Raises
        ------
        InputError
            If it cannot be written, for want of space or permission.
        """
        target = self.staging / name
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            yield target
        except OSError as error:
            raise _cannot_write(self.path / name, error) from None

    def write_text(self, name: str, text: str) -> None:
        """Write a text file of the run.

        Parameters
        ----------
        name : str
            Its name inside the run's folder.
        text : str
            What it says.

        Raises
        ------
        InputError
            If it cannot be written.
        """
        with self.writing(name) as target:
            target.write_text(text, encoding="utf-8", newline="\n")

    def mark_stale(self, names: Iterable[str]) -> None:
        """Note that results were made from something that has been computed anew since.

        Parameters
        ----------
        names : iterable of str
            The stages; those that never ran are passed over.
        """
        for name in names:
            if name in self.manifest.get("stages", {}):
                self.manifest["stages"][name]["stale"] = True

    def is_stale(self, name: str) -> bool:
        """Tell whether a stage's result was made from something else than what the folder holds now.

        Parameters
        ----------
        name : str
            The stage.

        Returns
        -------
        bool
            True if an earlier stage has been run anew since.
        """
        return bool(self.manifest.get("stages", {}).get(name, {}).get("stale", False))

    def load(self, name: str) -> Any:  # noqa: ANN401  every stage has a result of its own type
        """Give a stage's result as it stands in the folder, whatever it was made from.

        Parameters
        ----------
        name : str
            The stage.

        Returns
        -------
        object
            The result, or None where the stage has not run.

        Raises
        ------
        FileFormatError
            If the file is damaged.
        """
        staged, stored = (folder / STAGES / f"{name}{SUFFIX}" for folder in (self.staging, self.path))
        place = staged if staged.is_file() else stored
        return load_result(place) if place.is_file() else None

    def _is_current(self, name: str, key: str) -> bool:
        stage = self.manifest.get("stages", {}).get(name, {})
        return bool(stage.get("key") == key and all(self._has(file) for file in stage.get("files", [])))

    def _has(self, file: str) -> bool:
        return any((folder / file).is_file() for folder in (self.staging, self.path))

    def _write(self, files: Writers) -> None:
        for file, write in files.items():
            with self.writing(file) as target:
                write(target)

    def _note(self, name: str, key: str, started: float, files: Iterable[str]) -> None:
        self.computed.append(name)
        seconds = round(time.perf_counter() - started, 3)
        stages = self.manifest.setdefault("stages", {})
        self.abandoned.update(stages.get(name, {}).get("files", []))
        stages[name] = {"key": key, "seconds": seconds, "files": sorted(files)}

    def commit(self) -> None:
        """Move everything that was written into place, `run.json` last.

        Raises
        ------
        InputError
            If a file cannot be moved.
        """
        self.write_text(MANIFEST, json.dumps(self.manifest, indent=1, ensure_ascii=False) + "\n")
        files = sorted(file for file in self.staging.rglob("*") if file.is_file())
        files.sort(key=lambda file: file.name == MANIFEST)
        for file in files:
            with file.open("r+b") as stream:  # Windows syncs only what is open for writing
                os.fsync(stream.fileno())
        self._invalidate_stored_stages()
        for file in files:
            with _reporting_write_errors(self.path / file.relative_to(self.staging)) as target:
                target.parent.mkdir(parents=True, exist_ok=True)
                file.replace(target)
        written = {file for stage in self.manifest.get("stages", {}).values() for file in stage.get("files", [])}
        for name in self.abandoned - written:  # a file that its stage no longer writes would tell of an older result
            with _reporting_write_errors(self.path / Path(name).name) as target:
                target.unlink(missing_ok=True)

    def _invalidate_stored_stages(self) -> None:
        """Drop the keys of stages whose files are about to change, in the `run.json` that is in place.

        Where the files cannot all be moved, because one is open in another program or the process is killed, new
        results would otherwise stand under old keys.
        """
        stored = read_manifest(self.path)
        outdated = [name for name in self.computed if "key" in stored.get("stages", {}).get(name, {})]
        for name in outdated:
            del stored["stages"][name]["key"]
        if outdated:
            self.write_text(MANIFEST + ".invalid", json.dumps(stored, indent=1, ensure_ascii=False) + "\n")
            with _reporting_write_errors(self.path / MANIFEST) as target:
                (self.staging / (MANIFEST + ".invalid")).replace(target)


@contextmanager
def open_run(path: Path) -> Iterator[RunFolder]:
    """Open a run's folder for a command, and commit when the command succeeds.

    Parameters
    ----------
    path : Path
        The folder; made where there is none.

    Yields
    ------
    RunFolder
        To compute and write with.

    Raises
    ------
    InputError
        If the folder cannot be made or written to.
    """
    is_new = not path.exists()
    staging = path / f"{STAGING}{os.getpid()}"
    try:
        path.mkdir(parents=True, exist_ok=True)
        _sweep(path)
        staging.mkdir()
    except OSError as error:
        raise _cannot_write(path, error) from None
    succeeded = False
    try:
        folder = RunFolder(path=path, staging=staging, manifest=read_manifest(path))
        yield folder
        folder.commit()
        succeeded = True
    finally:
        shutil.rmtree(path if is_new and not succeeded else staging, ignore_errors=True)


def read_run(path: Path) -> RunFolder:
    """Open a run's folder for reading only.

    Parameters
    ----------
    path : Path
        The folder.

    Returns
    -------
    RunFolder
        To load results from.

    Raises
    ------
    InputError
        If no run has been made there, `run.json` is damaged, or another version made it, with results of another form.
    """
    if not (path / MANIFEST).is_file():
        raise InputError(
            f"{path}: there is no run here (no {MANIFEST}); make one with 'frf-ipz run PIPELINE --out {path}'"
        )
    manifest = load_manifest(path)
    made_by = str(manifest.get("frf_ipz", __version__))
    if made_by.split(".")[:2] != __version__.split(".")[:2]:
        pipeline = manifest.get("pipeline", "PIPELINE")
        raise InputError(
            f"{path}: these results were made by frf_ipz {made_by}, and this is {__version__}: make them again with "
            f"'frf-ipz run {pipeline} --out {path}'; its tables can still be read as Parquet"
        )
    return RunFolder(path=path, staging=path / STAGING, manifest=manifest)


def read_manifest(path: Path) -> dict[str, Any]:
    """Read `run.json`.

    Parameters
    ----------
    path : Path
        The run's folder.

    Returns
    -------
    dict
        What it says; empty where there is none or it is damaged, so that everything is computed anew.
    """
    try:
        return load_manifest(path)
    except FileFormatError:
        return {}


def _sweep(path: Path) -> None:
    """Remove what commands that were killed have left."""
    for leftover in path.glob(f"{STAGING}*"):
        owner = leftover.name.removeprefix(STAGING)
        if not owner.isdigit() or int(owner) == os.getpid() or not _is_running(int(owner)):
            shutil.rmtree(leftover, ignore_errors=True)


def _is_running(process: int) -> bool:
    if sys.platform == "win32":  # there, signal 0 is no question but Ctrl-C for all that share the console
        return _is_running_on_windows(process)
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def _is_running_on_windows(process: int) -> bool:
    kernel: Any = ctypes.WinDLL("kernel32", use_last_error=True)  # type: ignore[attr-defined,unused-ignore]
    kernel.OpenProcess.restype = ctypes.c_void_p
    handle = kernel.OpenProcess(SYNCHRONIZE, 0, process)
    if not handle:
        return bool(ctypes.get_last_error() == ACCESS_DENIED)  # type: ignore[attr-defined,unused-ignore]
    try:
        return bool(kernel.WaitForSingleObject(ctypes.c_void_p(handle), 0) == WAIT_TIMEOUT)
    finally:
        kernel.CloseHandle(ctypes.c_void_p(handle))


@contextmanager
def _reporting_write_errors(path: Path) -> Iterator[Path]:
    try:
        yield path
    except OSError as error:
        raise _cannot_write(path, error) from None


def _cannot_write(path: Path, error: OSError) -> InputError:
    advice = {
        errno.EACCES: f"{error.strerror}; close it where another program has it open, or choose another --out",
        errno.ENOSPC: "the disk is full; free some space or choose another --out",
        errno.EDQUOT: "the quota is used up; free some space or choose another --out",
    }.get(error.errno or 0, f"{error.strerror}; choose another --out that can be written to")
    return InputError(f"{path}: cannot be written: {advice}")
