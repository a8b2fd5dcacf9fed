"""Commands of ``frf-ipz`` in processes of their own: killed, or refused by the system, before any change on the disk.

A process is made by copying one that has loaded the package, so that a test may start hundreds. What it does to the
disk is seen by an audit hook, before it is done, and counted. A hook sees only what Python does itself: rename, link,
remove, make a folder, open a file anew. What Arrow writes is part of the file that was opened before it.
"""

import multiprocessing
import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

from frf_ipz.cli.main import main
from frf_ipz.cli.printing import say_error
from frf_ipz.errors import FrfIpzError
from frf_ipz.runs import folder_lock

CHANGES = {"os.rename", "os.link", "os.remove", "os.mkdir", "os.rmdir", "os.symlink", "os.truncate"}
NEED_ROOM = {"open", "os.link", "os.mkdir", "os.symlink"}
LOADED = (
    "frf_ipz.cli.commands",
    "frf_ipz.cli.terminal",
    "frf_ipz.cli.pictures",
    "frf_ipz.cli.local_page",
    "frf_ipz.diagnosis.apply",  # from here on what the package imports when it is used
    "frf_ipz.diagnosis.diagnose",
    "frf_ipz.identification.fit",
    "frf_ipz.pipeline.stages.causes",
    "frf_ipz.pipeline.stages.hints",
    "frf_ipz.pipeline.stages.modelling",
    "frf_ipz.pipeline.stages.outputs",
    "frf_ipz.universal_sets",
    "lvm_read",
    "pandas",
    "pyarrow.compute",
    "pyarrow.csv",
    "pyarrow.pandas_compat",
    "pyarrow.parquet",
    "pydantic.dataclasses",
    "scipy.ndimage",
    "scipy.optimize",
    "small_results",
    "typer._adapters",
)
PAUSE_S = 0.01
LONGEST_S = 120.0  # a command takes seconds


class Command:
    """A command that is at work in a process of its own.

    `killed_before` kills it before the change of that number, `stopped_before` asks it to stop; `refused` is an
    ``errno`` by which the system refuses the change `refused_at`, or all that need room on the disk from `refused_from`
    on. Numbers are counted among the changes below `within`. No file gets larger than `most_bytes`. Other
    `work` than the command line is a function.
    """

    def __init__(self, *arguments, log, work=None, within=None, most_bytes=None, **faults):
        self.log, self.counter = Path(log), _context().Value("i", 0)
        self.log.unlink(missing_ok=True)  # what an earlier command has said there is not what this one says
        options = {
            "faults": {"within": None if within is None else os.fspath(Path(within).resolve()), **faults},
            "most_bytes": most_bytes,
            "work": work or command_line,
        }
        given = [os.fspath(argument) for argument in arguments]
        self._process = _context().Process(target=_work, args=(given, os.fspath(log), self.counter, options))
        self._process.start()

    def signal(self, number):
        """Send a signal, if it is still at work."""
        with suppress(ProcessLookupError):  # it may have come to its end since it was asked
            if self._process.is_alive():
                os.kill(self._process.pid, number)

    def wait(self):
        """Wait for the end; its exit status, negative for a signal."""
        self._process.join(LONGEST_S)
        if self._process.is_alive():
            self._process.kill()
            raise AssertionError(f"at work after {LONGEST_S} s: {self.said}")
        return self._process.exitcode

    def wait_for(self, n_changes):
        """Wait until it has made so many changes, or has come to its end."""
        end = time.monotonic() + LONGEST_S
        while self.counter.value < n_changes and self.is_at_work and time.monotonic() < end:
            self.pause()

    def wait_for_begin(self, *, words=False):
        """Wait until it has begun, or has said something, or has come to its end."""
        end = time.monotonic() + LONGEST_S
        while not (self.said if words else self.log.exists()) and self.is_at_work and time.monotonic() < end:
            self.pause()

    @property
    def is_at_work(self):
        """Whether it has not come to its end."""
        return self._process.is_alive()

    @staticmethod
    def pause():
        """Let it work for a moment."""
        time.sleep(PAUSE_S)

    @property
    def said(self):
        """All that it has printed."""
        return self.log.read_text(encoding="utf-8", errors="replace") if self.log.exists() else ""


def run(*arguments, log, **options):
    """Run a command to its end; its exit status, what it said, and how many changes it has made."""
    command = Command(*arguments, log=log, **options)
    status = command.wait()
    return status, command.said, command.counter.value


def _context():
    context = multiprocessing.get_context("spawn" if sys.platform == "win32" else "forkserver")
    if sys.platform != "win32":
        context.set_forkserver_preload(list(LOADED))
    return context


def _work(arguments, log, counter, options):
    sys.dont_write_bytecode = True
    # A job in the background inherits that it is ignored; before the command listens there is nothing to clear up.
    signal.signal(signal.SIGINT, lambda number, _: os._exit(128 + number))
    descriptor = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for stream in (1, 2):
        os.dup2(descriptor, stream)
    if options["most_bytes"] is not None:
        import resource

        resource.setrlimit(resource.RLIMIT_FSIZE, (options["most_bytes"],) * 2)
    _watch(counter, **options["faults"])
    try:
        options["work"](*arguments)
    except FrfIpzError as error:  # as the command line does
        say_error(str(error))
        sys.exit(2)


def command_line(*arguments):
    """``frf-ipz`` with these arguments."""
    sys.argv = ["frf-ipz", *arguments]
    main()


def patient(*arguments):
    """``frf-ipz`` with these arguments; it waits for another command however slow the machine is."""
    folder_lock.WAIT_S = LONGEST_S
    command_line(*arguments)


def impatient(*arguments):
    """``frf-ipz`` with these arguments; where another command is at work it does not wait."""
    folder_lock.WAIT_S = 0.0
    command_line(*arguments)


def _watch(
    counter, *, within, killed_before=None, stopped_before=None, refused=None, refused_at=None, refused_from=None
):
    def note(event, arguments):
        if not _changes(event, arguments, within):
            return
        number, counter.value = counter.value, counter.value + 1
        if number == killed_before:
            os.kill(os.getpid(), signal.SIGKILL)
        if number == stopped_before:
            os.kill(os.getpid(), signal.SIGINT)
        is_full = refused_from is not None and number >= refused_from and event in NEED_ROOM
        if number == refused_at or is_full:
            raise OSError(refused, os.strerror(refused), str(arguments[0]))

    sys.addaudithook(note)


def _changes(event, arguments, within):
    if event == "open":
        path, _, flags = arguments
        if not isinstance(path, str | bytes) or not flags & (os.O_CREAT | os.O_TRUNC):
            return False
    elif event in CHANGES:
        path = arguments[0]
    else:
        return False
    place = os.fsdecode(path)  # a name alone is one in a folder that has been opened: where something is removed
    return within is None or not Path(place).is_absolute() or place.startswith(within)
