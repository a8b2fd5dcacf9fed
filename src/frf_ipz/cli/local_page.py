"""The page to work on, from the command line."""

from __future__ import annotations

import os
import sys
import webbrowser
from typing import TYPE_CHECKING

from frf_ipz.cli.printing import say
from frf_ipz.show.server import serve

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.pipeline.inputs import PipelineInputs
    from frf_ipz.progress import Progress
    from frf_ipz.runs.results import Results


def serve_page(folder: Path, *, port: int, browser: bool | None) -> None:
    """Serve the page of a run or a campaign until the user stops it.

    Parameters
    ----------
    folder : Path
        The run's folder, or the campaign's.
    port : int
        Where to listen; 0 for any free port.
    browser : bool, optional
        Open the page in a browser; where it is left out, if there is a desktop.

    Raises
    ------
    InputError
        If there is no run and no pipeline in the folder, or the port is taken.
    """

    def announce(address: str) -> None:
        say(f"{address}\nstop with Ctrl-C")
        if _has_desktop() if browser is None else browser:
            webbrowser.open(address)

    serve(folder, _run, _read, port=port, announce=announce)


def _run(path: Path, out: Path, *, diagnosing: bool | None, progress: Progress) -> Results:
    """Run a pipeline; the stages are imported with the first change, so that the page is there at once."""
    from frf_ipz.pipeline.run import run_pipeline

    return run_pipeline(path, out, diagnosing=diagnosing, progress=progress)


def _read(path: Path) -> PipelineInputs:
    """Read a pipeline; what reads tests and models is imported with the first page that needs it."""
    from frf_ipz.pipeline.inputs import read_inputs

    return read_inputs(path)


def _has_desktop() -> bool:
    if not sys.stdout.isatty():
        return False
    return sys.platform in {"win32", "darwin"} or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
