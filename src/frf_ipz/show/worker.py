"""One task at a time beside the server; a newer wish stops the one at work and begins anew."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from threading import Lock, Thread
from typing import TYPE_CHECKING

from frf_ipz.errors import FrfIpzError

if TYPE_CHECKING:
    from collections.abc import Callable

    from frf_ipz.progress import Progress

LOG = logging.getLogger(__name__)


class Superseded(Exception):  # noqa: N818  it ends a run that nobody waits for any more; nothing has gone wrong
    """A newer wish has come."""


class Cancelled(Superseded):
    """The work is wanted no more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Status:
    """How far the work is.

    Parameters
    ----------
    running : bool
        Something is at work.
    fraction : float
        The part of the step at hand that is done, 0 to 1.
    text : str
        What is being done.
    error : str
        Why the last work failed; empty where it did not.
    """

    running: bool = False
    fraction: float = 0.0
    text: str = ""
    error: str = ""


class Worker:
    """Does work in a thread."""

    def __init__(self) -> None:
        self._work: Callable[[Progress], None] | None = None
        self._lock = Lock()
        self._wish = 0
        self._status = Status()
        self._thread: Thread | None = None

    @property
    def status(self) -> Status:
        """How far the work is."""
        return self._status

    def start(self, work: Callable[[Progress], None]) -> None:
        """Work; what is at work already is given up.

        Parameters
        ----------
        work : callable
            Takes a Progress; what it raises ends up in the status.
        """
        with self._lock:
            self._work = work
            self._wish += 1
            if self._status.running:
                return
            self._status = Status(running=True, text="starting")
            self._thread = Thread(target=self._loop, name="run", daemon=True)
            self._thread.start()

    def cancel(self) -> None:
        """Give up what is at work: it ends at its next word."""
        with self._lock:
            self._wish = -1
            if self._status.running:
                self._status = replace(self._status, text="stopping")

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait until nothing is at work.

        Parameters
        ----------
        timeout_s : float, optional
            How long at most, s.
        """
        if self._thread is not None:
            self._thread.join(timeout_s)

    def _loop(self) -> None:
        while True:
            with self._lock:
                wish, work = self._wish, self._work
            error = "" if wish < 0 or work is None else self._try(wish, work)
            with self._lock:
                if self._wish in {wish, -1}:
                    self._status = Status(fraction=1.0, error=error)
                    return

    def _try(self, wish: int, work: Callable[[Progress], None]) -> str:
        def report_status(fraction: float, text: str) -> None:
            if self._wish != wish:
                raise Cancelled if self._wish < 0 else Superseded
            self._status = replace(self._status, fraction=min(max(fraction, 0.0), 1.0), text=text)

        try:
            work(report_status)
        except Superseded:
            return ""
        except FrfIpzError as error:
            return str(error)
        except Exception as error:
            LOG.exception("a fault of the program")
            return f"a fault of the program: {type(error).__name__}: {error}"
        return ""
