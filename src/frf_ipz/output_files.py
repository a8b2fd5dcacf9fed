"""The one door through which files are written: each is written beside its place, and takes it whole or not at all.

A disk that is full, a process that is killed or a fault half way leaves what was there. No other module opens a file to
write to it but inside of `replacing`.
"""

from __future__ import annotations

import errno
import hashlib
import os
import platform
import re
import secrets
import shutil
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from frf_ipz.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

BESIDE = ".frf-ipz-"  # how the name begins of a file that is not whole yet; then which machine and process write it
LONGEST_SUFFIX = len(".parquet")  # an ending that a writer may look at; the name in all must not be too long
TRIES = 20  # on Windows, where a file that somebody reads this very moment cannot be replaced
PAUSE_S = 0.05
IS_WINDOWS = os.name == "nt"


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a path to write to; what is there at the end takes the place of a file.

    Parameters
    ----------
    path : Path
        The file; there may be none yet. Where it is a link, what it leads to is replaced; a device or a pipe is written
        to as it is.

    Yields
    ------
    Path
        A file beside it, with the same ending.

    Raises
    ------
    OSError
        If it cannot be written: then what was there is as it was.
    """
    target = Path(os.path.realpath(path))
    exists = target.exists()
    if exists and not target.is_file():
        yield target
        return
    if exists and not os.access(target, os.W_OK):  # to be renamed over asks for no permission
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(target))
    suffix = target.suffix if len(target.suffix) <= LONGEST_SUFFIX else ""
    beside = target.with_name(f"{BESIDE}{_machine()}-{os.getpid()}-{secrets.token_hex(8)}{suffix}")
    try:
        yield beside
        sync(beside)
        if exists:
            shutil.copymode(target, beside)
        move(beside, target)
    except BaseException:
        with suppress(OSError):
            beside.unlink(missing_ok=True)
        raise
    sync_folder(target.parent)


def remove_litter(folder: Path) -> None:
    """Remove files that were not whole yet when their process was killed.

    Only those of this machine whose process is no more: another program may write in the folder this very moment.

    Parameters
    ----------
    folder : Path
        Where they are looked for.
    """
    name = re.compile(re.escape(f"{BESIDE}{_machine()}-") + r"(?P<process>[1-9][0-9]{0,9})-[0-9a-f]{16}(\.\w+)?")
    with suppress(OSError):
        for path in list(folder.iterdir()):
            match = name.fullmatch(path.name)
            if match and path.is_file() and not path.is_symlink() and _has_ended(int(match["process"])):
                path.unlink()


def to_its_end(clear_up: Callable[[], None]) -> None:
    """Clear up, and once more where a signal came meanwhile: it is raised when all is done.

    Parameters
    ----------
    clear_up : callable
        Takes no harm from being called twice.
    """
    try:
        clear_up()
    except BaseException:
        clear_up()
        raise


def _machine() -> str:
    return hashlib.sha256(platform.node().encode(errors="surrogateescape")).hexdigest()[:8]


def _has_ended(process: int) -> bool:
    """Tell whether a process is no more, where the system can be asked; on Windows asking would end it."""
    if IS_WINDOWS:
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        return False
    return False


def write_text(path: Path, text: str, *, newline: str = "\n") -> None:
    r"""Write a text file in UTF-8.

    Parameters
    ----------
    path : Path
        The file.
    text : str
        What it says; of a name that is no UTF-8, the bytes that are none are written out, as ``\udcff``.
    newline : str
        How lines end.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    with replacing(path) as target:
        target.write_text(text, encoding="utf-8", errors="backslashreplace", newline=newline)


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file.

    Parameters
    ----------
    path : Path
        The file.
    content : bytes
        What it holds.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    with replacing(path) as target:
        target.write_bytes(content)


def move(source: Path, target: Path) -> None:
    """Let a file take the place of another in one step.

    Parameters
    ----------
    source, target : Path
        Both in the same file system.

    Raises
    ------
    OSError
        If it cannot, for example because another program on Windows has the target open.
    """
    for remaining in reversed(range(TRIES)):
        try:
            os.replace(source, target)  # noqa: PTH105  tests stand in its way
        except PermissionError:
            if not IS_WINDOWS or not remaining:
                raise
            time.sleep(PAUSE_S)
        else:
            return


def link_or_copy(source: Path, target: Path) -> None:
    """Give a file a second name; a copy where the file system knows only one name a file.

    Parameters
    ----------
    source : Path
        The file.
    target : Path
        Must not exist.

    Raises
    ------
    OSError
        If it can neither be linked nor copied.
    """
    try:
        os.link(source, target)
    except (FileExistsError, FileNotFoundError):
        raise
    except OSError:
        shutil.copyfile(source, target)
        sync(target)


def sync(path: Path) -> None:
    """Let a file reach the disk.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    OSError
        If the disk cannot take it.
    """
    with path.open("r+b") as stream:  # Windows syncs only what is open for writing
        os.fsync(stream.fileno())


def sync_folder(path: Path) -> None:
    """Let the names in a folder reach the disk, where the system knows how.

    Parameters
    ----------
    path : Path
        The folder.
    """
    with suppress(OSError):  # Windows opens no folder; some file systems sync none
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def cannot_write(path: Path, error: OSError) -> InputError:
    """Say why a file or a folder cannot be written, and what to do.

    Parameters
    ----------
    path : Path
        What the user knows it as.
    error : OSError
        What the system says.

    Returns
    -------
    InputError
        One line.
    """
    reason = error.strerror or str(error)
    advice = {
        errno.EACCES: f"{reason}; close it where another program has it open, or choose another --out",
        errno.ENOSPC: "the disk is full; free some space or choose another --out",
        errno.EDQUOT: "the quota is used up; free some space or choose another --out",
        errno.ENOENT: "its folder is gone; was it deleted or renamed while this was at work?",
    }.get(error.errno or 0, f"{reason}; choose another --out that can be written to")
    return InputError(f"{path}: cannot be written: {advice}")
