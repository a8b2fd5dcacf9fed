"""How far a long command is: a bar on a terminal; where output goes to a file, a line a minute.

Both say how long it has taken and, once that can be told, how long it will take: by the time of what is done.
"""

from __future__ import annotations

import sys
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from frf_ipz.cli.printing import say_progress
from frf_ipz.late_imports import import_late
from frf_ipz.visible_text import one_line

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from frf_ipz.progress import Progress as Report
else:
    Console = import_late("rich.console", "Console")
    BarColumn = import_late("rich.progress", "BarColumn")
    Progress = import_late("rich.progress", "Progress")
    TextColumn = import_late("rich.progress", "TextColumn")
    TimeElapsedColumn = import_late("rich.progress", "TimeElapsedColumn")

REFRESHES_A_SECOND = 2.0
LINE_EVERY_S = 60.0
LEAST_DONE = 0.05  # of the work, from which on an estimate is more than a guess
WIDTH = 60  # letters of what is being done


class Estimate:
    """What is done of a command, and how long the rest will take."""

    def __init__(self) -> None:
        self._started = time.monotonic()
        self.fraction, self.text = 0.0, "reading"

    def update(self, fraction: float, text: str) -> None:
        """Take note of the progress."""
        self.fraction, self.text = fraction, one_line(text)

    @property
    def elapsed_s(self) -> float:
        """Time since the start, s."""
        return time.monotonic() - self._started

    @property
    def remaining(self) -> str:
        """The time that is left, in words; empty as long as nobody can know."""
        if not LEAST_DONE <= self.fraction < 1:
            return ""
        return f"about {in_words(self.elapsed_s * (1 - self.fraction) / self.fraction)} left"

    @property
    def line(self) -> str:
        """One line of plain text."""
        parts = [self.text, f"{in_words(self.elapsed_s)} so far", self.remaining]
        return ", ".join(filter(None, parts))


def in_words(seconds: float) -> str:
    """Write a time as people say it.

    Parameters
    ----------
    seconds : float
        The time.

    Returns
    -------
    str
        In the two largest units at most.

    Examples
    --------
    >>> in_words(42.4), in_words(200), in_words(7500)
    ('42 s', '3 min', '2 h 05 min')
    """
    if seconds < 60:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"


@contextmanager
def showing_progress(*, quiet: bool) -> Iterator[Report]:
    """Show the progress of a command on the standard error.

    Parameters
    ----------
    quiet : bool
        Show nothing.

    Yields
    ------
    Progress
        To hand to the command.
    """
    estimate = Estimate()
    with _bar(estimate) if sys.stderr.isatty() and not quiet else _lines(estimate, quiet=quiet) as show:
        yield show


@contextmanager
def _bar(estimate: Estimate) -> Iterator[Report]:
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=24),
        TimeElapsedColumn(),
        TextColumn("{task.fields[remaining]}", markup=False),
    )
    console = Console(stderr=True, highlight=False)
    with Progress(*columns, console=console, transient=True, refresh_per_second=REFRESHES_A_SECOND) as bar:
        task = bar.add_task("reading", total=1.0, remaining="")

        def show(fraction: float, text: str) -> None:
            estimate.update(fraction, text)
            described = estimate.text[:WIDTH].ljust(WIDTH)
            bar.update(task, completed=fraction, description=described, remaining=estimate.remaining)

        yield show


@contextmanager
def _lines(estimate: Estimate, *, quiet: bool) -> Iterator[Report]:
    """Print a line a minute, whether or not anything has happened in it: a log shows that the command is alive."""
    is_over = threading.Event()

    def print_lines() -> None:
        while not is_over.wait(LINE_EVERY_S):
            say_progress(estimate.line)

    thread = threading.Thread(target=print_lines, daemon=True)
    if not quiet:
        thread.start()
    try:
        yield estimate.update
    finally:
        is_over.set()
