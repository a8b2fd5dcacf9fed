"""A run's folder and its pipeline file: what is there, what the user changes, and the run that follows from it."""

from __future__ import annotations

from functools import partial
from threading import Lock
from typing import TYPE_CHECKING, Any, Protocol

from frf_ipz.errors import FrfIpzError, InputError
from frf_ipz.input_files import read_text
from frf_ipz.runs.folder import read_manifest
from frf_ipz.runs.generations import stamp
from frf_ipz.show.changes import to_change
from frf_ipz.show.history import History
from frf_ipz.show.open_run import OpenRun
from frf_ipz.show.own_code import OwnCode, find_code
from frf_ipz.show.pipeline_text import changed_text, parse, write_text
from frf_ipz.show.worker import Cancelled, Worker

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from frf_ipz.pipeline.config import PipelineFile
    from frf_ipz.pipeline.inputs import PipelineInputs
    from frf_ipz.progress import Progress
    from frf_ipz.runs.results import Results
    from frf_ipz.show.campaign import RunPaths
    from frf_ipz.show.ghost import Ghost
    from frf_ipz.show.worker import Status

STOP_S = 5.0  # how long a run gets to notice that the server ends


class Run(Protocol):
    """Runs a pipeline file into a folder, as `pipeline.run.run_pipeline` does."""

    def __call__(self, path: Path, out: Path, *, diagnosing: bool | None, progress: Progress) -> Results:
        """Run.

        Parameters
        ----------
        path : Path
            The pipeline file.
        out : Path
            The run's folder.
        diagnosing : bool, optional
            Look for what the model left out; by default as the pipeline file says.
        progress : Progress
            Called with the fraction done and what is being done.

        Returns
        -------
        Results
            What the folder holds then.
        """


class Workbench:
    """A run to look at and to work on.

    Every change is written to the pipeline file, and what depends on it is run anew; causes are looked for only when
    somebody asks for that. A change that the run refuses, or that is cancelled, is taken back, so that the file never
    asks for what cannot be done.

    Parameters
    ----------
    paths : RunPaths
        The run's folder and its pipeline file.
    run : Run
        Runs a pipeline.
    read : callable
        Reads a pipeline file and all that it names, as `pipeline.inputs.read_inputs` does.
    opened : OpenRun, optional
        Where results are kept in memory; shared by all runs of a campaign.
    """

    def __init__(
        self, paths: RunPaths, run: Run, read: Callable[[Path], PipelineInputs], opened: OpenRun | None = None
    ) -> None:
        self.folder = paths.folder.resolve()
        self.pipeline = paths.pipeline
        self.read = read
        self._run = run
        self._changing = Lock()
        self._before: str | None = None
        self._written: str | None = None
        self._opened = opened or OpenRun()
        self._allowed = ""
        self._history = History()
        self._worker = Worker()

    @property
    def status(self) -> Status:
        """How far the run is that is at work."""
        return self._worker.status

    @property
    def stamp(self) -> str:
        """Another one whenever the folder holds other results; empty before the first run."""
        return stamp(self.folder)

    @property
    def manifest(self) -> dict[str, Any]:
        """What ``run.json`` says; empty before the first run."""
        return read_manifest(self.folder)

    def contents(self) -> Results:
        """Read what the folder holds, once while nobody looks at another run.

        Returns
        -------
        Results
            Results of all stages.

        Raises
        ------
        InputError
            If there is no run yet, or a file is damaged.
        """
        return self._opened.results(self.folder, self.stamp)

    def ghost(self) -> Ghost | None:
        """Give what was predicted before the results that `contents` gives, where they have been looked at.

        Returns
        -------
        Ghost or None
            None where there is nothing to compare with.
        """
        return self._opened.ghost(self.folder)

    def text(self) -> str:
        """Read the pipeline file.

        Returns
        -------
        str
            What it says.

        Raises
        ------
        InputError
            If it is gone.
        """
        if not self.pipeline.is_file():
            raise InputError(f"{self.pipeline}: the pipeline file of this run is gone, so nothing can be changed")
        return read_text(self.pipeline)

    def choices(self) -> PipelineFile:
        """Read what the user has chosen.

        Returns
        -------
        PipelineFile
            All sections of the pipeline file.

        Raises
        ------
        InputError
            If the file is gone or wrong.
        """
        return parse(self.text(), self.pipeline)

    def change(self, wish: object) -> None:
        """Write a change to the pipeline file, and run what depends on it.

        Parameters
        ----------
        wish : object
            A table with its ``kind`` and what that kind takes.

        Raises
        ------
        InputError
            If it makes no sense: then nothing has changed.
        """
        with self._changing:
            self._require_consent()
            text = self.text()
            changed = changed_text(text, to_change(wish, self.pipeline), self.pipeline)
            if changed != text:
                self._write(text, changed)
                self._history.record(text, changed)
            self._start_after_change()

    def undo(self) -> None:
        """Take the last change back, and run what depends on it.

        Raises
        ------
        InputError
            If there is none, or another program has changed the file since.
        """
        self._step(self._history.before, -1, "undo")

    def redo(self) -> None:
        """Make the change again that was undone last, and run what depends on it.

        Raises
        ------
        InputError
            If there is none, or another program has changed the file since.
        """
        self._step(self._history.after, 1, "redo")

    def steps(self) -> tuple[bool, bool]:
        """Tell what the history holds.

        Returns
        -------
        pair of bool
            There is a change to undo, and one to redo.
        """
        text = self.text()
        return self._history.before(text) is not None, self._history.after(text) is not None

    def run(self) -> None:
        """Run the pipeline file as it stands, and as the command line runs it.

        Raises
        ------
        InputError
            If it names code that nobody has allowed.
        """
        self._require_consent()
        self._worker.start(partial(self._work, diagnosing=None))

    def diagnose(self) -> None:
        """Run the pipeline file, and look for what the model left out, in any time.

        Raises
        ------
        InputError
            If there is no FE model, or it names code that nobody has allowed.
        """
        if self.choices().pipeline.model is None:
            raise InputError(f"{self.pipeline}: there is no FE model to compare with; name it as [pipeline] model")
        self._require_consent()
        self._worker.start(partial(self._work, diagnosing=True))

    def cancel(self) -> None:
        """Give up what is at work; a change that it was made for is taken back."""
        self._worker.cancel()

    def _step(self, find: Callable[[str], str | None], by: int, verb: str) -> None:
        with self._changing:
            self._require_consent()
            text = self.text()
            other = find(text)
            if other is None:
                raise InputError(f"there is nothing to {verb}: no change of this page, or the file was changed since")
            self._write(text, other)
            self._history.step(by)
            self._start_after_change()

    def _write(self, text: str, changed: str) -> None:
        if text != self._written:
            self._before = text
        write_text(self.pipeline, changed)
        self._written = changed

    def _start_after_change(self) -> None:
        """Run without a search for causes; where one corrects the model, it is a part of the run."""
        diagnosing = None if self.choices().diagnose.apply else False
        self._worker.start(partial(self._work, diagnosing=diagnosing))

    def code_to_allow(self) -> OwnCode | None:
        """Find code that a run would execute and that nobody has allowed yet.

        Returns
        -------
        OwnCode or None
            None where there is none.

        Raises
        ------
        InputError
            If the pipeline file, or a file that it names, cannot be read.
        """
        code = find_code(self.choices(), self.pipeline.parent)
        return None if code is None or code.digest == self._allowed else code

    def allow_code(self, wish: object) -> None:
        """Allow the code that the pipeline file names, until the server ends or the code changes.

        Parameters
        ----------
        wish : object
            A table with the ``digest`` of what was shown.

        Raises
        ------
        InputError
            If the code is no longer what was shown.
        """
        code = self.code_to_allow()
        if code is None:
            return
        if not isinstance(wish, dict) or wish.get("digest") != code.digest:
            raise InputError("this code has changed since the page was loaded: load the page again")
        self._allowed = code.digest

    def _require_consent(self) -> None:
        code = self.code_to_allow()
        if code is not None:
            raise InputError(
                f"{self.pipeline}: [diagnose] extra_effects names code ({', '.join(code.names)}), and a run executes "
                "it: allow it at 'Your choices', or run it from the command line"
            )

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait for the run that is at work.

        Parameters
        ----------
        timeout_s : float, optional
            How long at most, s.
        """
        self._worker.wait(timeout_s)

    def close(self) -> None:
        """Give up what is at work; the folder keeps what it held."""
        self._worker.cancel()
        self._worker.wait(STOP_S)

    def _work(self, progress: Progress, *, diagnosing: bool | None) -> None:
        with self._changing:
            requested = self._written
        self._require_consent()
        try:
            self._run(self.pipeline, self.folder, diagnosing=diagnosing, progress=progress)
        except Cancelled:
            self._take_back()
            raise
        except FrfIpzError as error:
            raise InputError(f"{error}{self._take_back()}") from None
        with self._changing:
            if self._written == requested:
                self._before = self._written = None
            else:
                self._before = requested

    def _take_back(self) -> str:
        """Restore the pipeline file, unless somebody else has changed it since."""
        with self._changing:
            before, written, self._before, self._written = self._before, self._written, None, None
            if before is None or not self.pipeline.is_file() or read_text(self.pipeline) != written:
                return ""
            write_text(self.pipeline, before)
            self._history.take_back(before)
        return " (the change was taken back)"
