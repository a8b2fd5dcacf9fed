"""Progress and summary on a terminal."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from frf_ipz.cli.printing import say
from frf_ipz.pipeline.run import run_pipeline
from frf_ipz.visible_text import one_line


def run_with_progress(pipeline: Path, out: Path, *, until: str, diagnosing: bool | None, quiet: bool) -> None:
    """Run a pipeline, show how far it is, and sum up.

    Parameters
    ----------
    pipeline : Path
        The pipeline file.
    out : Path
        The run's folder.
    until : str
        Last stage.
    diagnosing : bool, optional
        Look for what the model left out.
    quiet : bool
        Show nothing.

    Raises
    ------
    FrfIpzError
        If the run cannot be done.
    """
    console = Console(stderr=True, quiet=quiet, highlight=False)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(bar_width=24), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=quiet or not console.is_terminal) as bar:
        task = bar.add_task("reading", total=1.0)

        def show(fraction: float, text: str) -> None:
            bar.update(task, completed=fraction, description=one_line(text)[:60].ljust(60))

        run = run_pipeline(pipeline, out, until=until, diagnosing=diagnosing, progress=show)
    if not quiet:
        say(run.summary())
