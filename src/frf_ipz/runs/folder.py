"""A run's folder: results that are re-used where keys agree, and a command that changes all of it or nothing.

What a command writes becomes the next generation of the folder when the command has succeeded (`generations`), under a
lock (`folder_lock`). A stage is taken from the folder where its key agrees, its file is whole and carries that key, and
each of its tables agrees with its digest; a table that does not is written again from the result, and a result that is
damaged is computed anew.
"""

from __future__ import annotations

import json
import time
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from frf_ipz import __version__
from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.input_files import digest_file
from frf_ipz.output_files import cannot_write, to_its_end, write_text
from frf_ipz.progress import silent
from frf_ipz.runs.codec import load_result, save_result
from frf_ipz.runs.folder_lock import lock_folder
from frf_ipz.runs.generations import HIDDEN, Generations, current_folder, forget_empty
from frf_ipz.runs.manifest import MANIFEST, load_manifest
from frf_ipz.runs.stage_file import SUFFIX

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from frf_ipz.progress import Progress

STAGES = "stages"

# Every key of run.json; * stands for a name of the user's or the program's.
JSON_KEYS = {
    "frf_ipz": "version of frf_ipz",
    "python": "version of Python",
    "packages.*": "version of each package that numbers depend on",
    "when": "start of the run, UTC, ISO 8601",
    "pipeline": "path of the pipeline file; what was given in Python otherwise",
    "name": "name of the run",
    "test.name": "name of the test",
    "test.kind": "hammer, random or frf",
    "test.operator": "who measured, as the test says; absent where it does not, as the keys below",
    "test.date": "when",
    "test.equipment": "with what",
    "test.customer": "for whom",
    "test.serial_number": "of the machine that was measured",
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
    "assessment.deviations": "how far the models are from what was measured, at the points of interest first",
    "assessment.deviations.*.at": "points of interest or measured points",
    "assessment.deviations.*.frf": "the FRF that the updated model meets worst",
    "assessment.deviations.*.band_hz": "first and last line that was compared",
    "assessment.deviations.*.nominal_db": "median difference of magnitudes before updating",
    "assessment.deviations.*.updated_db": "the same after updating",
    "assessment.deviations.*.with_causes_db": "the same with what the diagnosis found; null where that is not known",
    "notes": "what was damaged in the folder and has been made again; absent where nothing was",
    "stages.*.key": "digest of everything that the result of the stage depends on",
    "stages.*.seconds": "computing time, s",
    "stages.*.files": "files that the stage has written",
    "stages.*.digests.*": "SHA-256 digest of each file of the stage, by its name",
    "stages.*.stale": "true where an earlier stage has been run anew since",
}

Result = TypeVar("Result")
Writers: TypeAlias = "Mapping[str, Callable[[Path], None]]"


class SupersededError(InputError):
    """The results have been made anew since they were opened."""


@dataclass(kw_only=True, eq=False)
class RunFolder:
    """What a run has left in a folder, and what the command at work will add to it.

    Parameters
    ----------
    path : Path
        The folder.
    current : Path
        Where its results are whole.
    staging : Path, optional
        Where files are written until the command has succeeded; None for who only reads.
    manifest : dict
        What `run.json` says.
    computed : list of str
        Stages that the command has computed.
    """

    path: Path
    current: Path
    staging: Path | None = None
    manifest: dict[str, Any]
    computed: list[str] = field(default_factory=list)

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
        if self._entry(name).get("key") == key:
            with suppress(FileFormatError):
                result: Result = load_result(self.current / _stage_file(name), stage=name, key=key)
                damaged = self._damaged(name)
                if damaged:
                    writers = files(result)
                    self._write(name, {file: writers[file] for file in damaged if file in writers})
                    self._say_repaired(damaged)
                self.manifest["stages"][name].pop("stale", None)
                return result
            self._say_repaired([_stage_file(name)])
        started = time.perf_counter()
        result = compute()
        named = files(result)
        self._note(name, key, named)
        self._write(name, {_stage_file(name): lambda path: save_result(result, path, key=key), **named})
        self.manifest["stages"][name]["seconds"] = round(time.perf_counter() - started, 3)
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
        if self._entry(name).get("key") == key:
            damaged = self._damaged(name)
            if not damaged:
                return
            self._say_repaired(damaged)
        started = time.perf_counter()
        self._note(name, key, files)
        self._write(name, files)
        self.manifest["stages"][name]["seconds"] = round(time.perf_counter() - started, 3)

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
        file = _stage_file(name)
        try:
            place = self._place(file)
            return load_result(place, stage=name) if place.is_file() else self._require_current()
        except FileFormatError:
            self._require_current()
            raise

    def commit(self, generations: Generations) -> None:
        """Let what was written become what the folder holds.

        Parameters
        ----------
        generations : Generations
            Of the folder.

        Raises
        ------
        OSError
            If a file cannot be written or replaced: then the folder is as it was.
        """
        before = read_manifest(self.current)
        if self.current != self.path:
            self._say_repaired(generations.out_of_place())
            if not self.computed and _lasting(before) == _lasting(self.manifest):
                return  # who has opened the results reads on
        text = json.dumps(self.manifest, indent=1, ensure_ascii=False) + "\n"
        write_text(generations.staging / MANIFEST, text)
        generations.adopt([MANIFEST, *_names(before)])
        generations.keep(_names(self.manifest))
        generations.commit()

    def _require_current(self) -> None:
        """Say so where the results that were opened are no longer there."""
        if self.staging is None and current_folder(self.path) != self.current:
            raise SupersededError(
                f"{self.path}: the results have been made anew since they were opened; open them again"
            )

    def _entry(self, name: str) -> dict[str, Any]:
        entry: dict[str, Any] = self.manifest.get("stages", {}).get(name, {})
        return entry

    def _place(self, file: str) -> Path:
        """Where a file is now: written by this command, or left by an earlier one."""
        staged = self.current if self.staging is None else self.staging
        return staged / file if (staged / file).is_file() else self.current / file

    def _damaged(self, name: str) -> list[str]:
        """Files of a stage that are gone, or differ from what this stage or a later one has written."""
        stages = list(self.manifest["stages"])
        later = [self._entry(stage) for stage in stages[stages.index(name) :]]
        damaged = []
        for file in self._entry(name).get("files", []):
            written = [entry.get("digests", {}).get(file) for entry in later if file in entry.get("files", [])]
            try:
                content = digest_file(self._place(file))
            except FileFormatError:
                content = ""
            damaged += [] if content in written else [file]
        return damaged

    def _say_repaired(self, files: Iterable[str]) -> None:
        said = self.manifest.get("notes", [])
        notes = [f"{file} was damaged or gone, and has been made again" for file in files]
        if notes:
            self.manifest["notes"] = list(dict.fromkeys([*said, *notes]))

    def _write(self, name: str, files: Writers) -> None:
        if self.staging is None:
            raise TypeError("a folder that was opened for reading is not written to")
        for file, write in files.items():
            target = self.staging / file
            with _reporting_write_errors(self.path / file):
                if file.startswith(STAGES):
                    target.parent.mkdir(exist_ok=True)
                write(target)
                self._entry(name)["digests"][file] = digest_file(target)

    def _note(self, name: str, key: str, files: Iterable[str]) -> None:
        self.computed.append(name)
        self.manifest.setdefault("stages", {})[name] = {
            "key": key,
            "seconds": 0.0,
            "files": sorted(files),
            "digests": {},
        }


def _stage_file(name: str) -> str:
    return f"{STAGES}/{name}{SUFFIX}"


def _names(manifest: Mapping[str, Any]) -> list[str]:
    """Files that stages have written, as `run.json` names them; those of results have the names of their stages."""
    stages = manifest.get("stages", {})
    return [*map(_stage_file, stages), *(file for stage in stages.values() for file in stage.get("files", []))]


def _lasting(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """Give what `run.json` says beside the time at which a command was given."""
    return {key: value for key, value in manifest.items() if key != "when"}


@contextmanager
def open_run(path: Path, *, progress: Progress = silent) -> Iterator[RunFolder]:
    """Open a run's folder for a command, and commit when the command succeeds.

    Parameters
    ----------
    path : Path
        The folder; made where there is none.
    progress : Progress
        Told where another command is waited for.

    Yields
    ------
    RunFolder
        To compute and write with.

    Raises
    ------
    InputError
        If the folder cannot be made or written to, or another command is at work there.
    """
    hidden = path / HIDDEN
    with ExitStack() as stack:
        with _reporting_write_errors(path):
            made = [folder for folder in (path, *path.parents) if not folder.exists()]
            stack.enter_context(_removing_if_empty(made))
            stack.enter_context(lock_folder(path, hidden, progress=progress))
            stack.enter_context(_removing_hidden(path))
            generations = Generations(path=path)
        stack.callback(generations.abandon)
        manifest = {key: value for key, value in read_manifest(path).items() if key != "notes"}
        folder = RunFolder(path=path, current=generations.current, staging=generations.staging, manifest=manifest)
        yield folder
        with _reporting_write_errors(path):
            folder.commit(generations)


@contextmanager
def _reporting_write_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise cannot_write(path, error) from None


@contextmanager
def _removing_if_empty(folders: Iterable[Path]) -> Iterator[None]:
    """Remove folders that were made for results, innermost first, where there are none."""
    try:
        yield
    finally:
        for folder in folders:
            with suppress(OSError):
                folder.rmdir()


@contextmanager
def _removing_hidden(path: Path) -> Iterator[None]:
    """Remove what the program keeps for itself, where there are no results: while it holds the lock, before others."""
    try:
        yield
    finally:
        if not holds_run(path):
            with suppress(OSError):
                to_its_end(lambda: forget_empty(path))


def holds_run(path: Path) -> bool:
    """Tell whether a run has been made in a folder.

    Parameters
    ----------
    path : Path
        The folder.

    Returns
    -------
    bool
        False too while the first one takes its place.
    """
    return (current_folder(path) / MANIFEST).is_file()


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
    current = current_folder(path)
    if not holds_run(current):
        raise InputError(
            f"{path}: there is no run here (no {MANIFEST}); make one with 'frf-ipz run PIPELINE --out {path}'"
        )
    manifest = load_manifest(current)
    made_by = str(manifest.get("frf_ipz", __version__))
    if made_by.split(".")[:2] != __version__.split(".")[:2]:
        pipeline = manifest.get("pipeline", "PIPELINE")
        raise InputError(
            f"{path}: these results were made by frf_ipz {made_by}, and this is {__version__}: make them again with "
            f"'frf-ipz run {pipeline} --out {path}'; its tables can still be read as Parquet"
        )
    return RunFolder(path=path, current=current, manifest=manifest)


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
        return load_manifest(current_folder(path))
    except FileFormatError:
        return {}
