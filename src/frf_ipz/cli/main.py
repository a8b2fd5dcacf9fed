"""The entry point of ``frf-ipz``: errors and signals into one line, and the exit status.

Signals are caught from the first line on, before anything large is imported. SIGTERM and a closed terminal do what
Ctrl-C does: what is at work clears up, and the exit status is 128 and the number of the signal.
"""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
import time
import weakref
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

# Of linear algebra: on small matrices more than one only wait for each other.
THREADS = "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"
NO_PLUGINS = "PYDANTIC_DISABLE_PLUGINS", "__all__"  # looking for some reads the metadata of all installed packages
SIGNALS = "SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK"  # each system has some of them
STOPPED = "stopped; results are those of the last command that came to its end"
PAUSE_S = 0.01  # what drops an exception has gone on by then


class Stopped(BaseException):
    """A signal asks the program to end; no `KeyboardInterrupt`, which packages turn into exit status 1."""


class Stopping:
    """Raises `Stopped` in the main thread for a signal, and again where it is dropped on its way, as imports may do."""

    def __init__(self) -> None:
        self.received = 0
        self._is_over = False
        self._raised: weakref.ref[Stopped] | None = None

    def __call__(self, number: int, frame: FrameType | None = None) -> None:
        """Handle a signal, as `signal.signal` calls it."""
        del frame
        if self._is_over:
            return
        self.received = self.received or number
        stopped = Stopped()
        self._raised = weakref.ref(stopped, self._raise_again)
        try:
            raise stopped
        finally:
            del stopped  # else its own traceback keeps it

    def end(self) -> None:
        """Take note that it has come to where it is reported."""
        self._is_over = True

    def _raise_again(self, _: object) -> None:
        if not self._is_over:  # not from here, where it would be dropped once more
            threading.Thread(target=self._interrupt_main, daemon=True).start()

    def _interrupt_main(self) -> None:
        time.sleep(PAUSE_S)
        if not self._is_over:
            _thread.interrupt_main(signal.Signals(self.received))


def main() -> None:
    """Run the command line; the exit status says how it went."""
    stopping = Stopping()
    try:
        with _handling_signals(stopping):
            try:
                _run()
            finally:
                stopping.end()
    except BaseException:  # an import that was cut short raises anything
        stopping.end()
        if not stopping.received:
            raise
    if stopping.received:
        from frf_ipz.cli.printing import say_error

        say_error(STOPPED)
        sys.exit(128 + stopping.received)


def _run() -> None:
    for name in THREADS:  # NumPy reads them when it is loaded, by the command; what the user has chosen stays
        os.environ.setdefault(name, "1")
    os.environ.setdefault(*NO_PLUGINS)
    from frf_ipz.late_imports import import_late

    app = import_late("frf_ipz.cli.commands").app  # NumPy is in it
    from frf_ipz.cli.printing import guard_streams, say_error
    from frf_ipz.errors import FrfIpzError, NumericalError

    guard_streams()
    try:
        app()
    except FrfIpzError as error:
        say_error(str(error))
        sys.exit(1 if isinstance(error, NumericalError) else 2)


@contextmanager
def _handling_signals(stopping: Stopping) -> Iterator[None]:
    """Let a function handle the signals that end a program, but those that are ignored, as ``nohup`` asks."""
    if threading.current_thread() is not threading.main_thread():  # Python gives signals to no other
        yield
        return
    numbers = [getattr(signal, name) for name in SIGNALS if hasattr(signal, name)]
    before = {number: signal.getsignal(number) for number in numbers}
    report_unraisable = sys.unraisablehook

    def report_others(unraisable: sys.UnraisableHookArgs) -> None:
        if not issubclass(unraisable.exc_type, Stopped):  # it came while an object was being destroyed
            report_unraisable(unraisable)

    try:
        sys.unraisablehook = report_others
        for number, handler in before.items():
            if handler is not signal.SIG_IGN:
                signal.signal(number, stopping)
        yield
    finally:
        sys.unraisablehook = report_unraisable
        for number, handler in before.items():
            signal.signal(number, handler)


if __name__ == "__main__":
    main()
