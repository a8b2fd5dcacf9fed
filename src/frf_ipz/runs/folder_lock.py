"""One command at a time for a folder: a lock that the system frees when its process ends, however that is."""

from __future__ import annotations

import json
import os
import shlex
import sys
import time
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.json_files import read_json
from frf_ipz.late_imports import import_late
from frf_ipz.output_files import to_its_end, write_text

if TYPE_CHECKING:
    from collections.abc import Iterator

    import filelock
    from filelock import FileLock

    from frf_ipz.progress import Progress
else:
    filelock = import_late("filelock")
    FileLock = import_late("filelock", "FileLock")

LOCK, HOLDER = "lock", "holder.json"
WAIT_S = 10.0  # so long the second command waits
PAUSE_S = 0.1


@contextmanager
def lock_folder(path: Path, hidden: Path, *, progress: Progress) -> Iterator[None]:
    """Work in a folder alone; threads of one process count as others.

    Parameters
    ----------
    path : Path
        The folder, for messages.
    hidden : Path
        Where the lock is; made where there is none, and removed where nothing is kept there at the end.
    progress : Progress
        Told for whom it waits.

    Raises
    ------
    InputError
        If another command is still at work there after `WAIT_S`: says who.
    OSError
        If the lock cannot be made.
    """
    lock = FileLock(hidden / LOCK)
    try:
        _acquire(lock, path, hidden, progress)
        since = datetime.now().astimezone().isoformat(timespec="seconds")
        command = shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])
        write_text(hidden / HOLDER, json.dumps({"pid": os.getpid(), "command": command, "since": since}))
        yield
    finally:
        to_its_end(lambda: _leave(lock, hidden))


def _leave(lock: FileLock, hidden: Path) -> None:
    """Give the lock back; where nothing is kept in its folder, both go, before another command can take it."""
    with suppress(OSError):
        if lock.is_locked:
            (hidden / HOLDER).unlink(missing_ok=True)
            if [entry.name for entry in hidden.iterdir()] == [LOCK]:
                (hidden / LOCK).unlink()
        if not any(hidden.iterdir()):
            hidden.rmdir()
    lock.release()


def _acquire(lock: FileLock, path: Path, hidden: Path, progress: Progress) -> None:
    end = time.monotonic() + WAIT_S
    while True:
        hidden.mkdir(parents=True, exist_ok=True)
        try:
            lock.acquire(blocking=False)
        except filelock.Timeout:
            remaining = end - time.monotonic()
            if remaining <= 0:
                raise InputError(
                    f"{path}: {_holder(hidden)} is at work here; wait until it is done, or choose another --out"
                ) from None
            progress(1 - remaining / WAIT_S, f"waiting for {_holder(hidden)}")
            time.sleep(PAUSE_S)
        else:
            return


def _holder(hidden: Path) -> str:
    """Say who holds the lock, as it says itself."""
    try:
        holder = read_json(hidden / HOLDER)
    except FileFormatError:
        return "another command"
    return f"process {holder.get('pid')} ({holder.get('command')}, since {holder.get('since')})"
