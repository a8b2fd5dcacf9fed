"""The one door through which files that others wrote are opened; what is wrong with one is said in one line.

Only regular files are opened: a device never ends, a pipe waits for ever. No other module opens a file to read it.

What a result depends on is known by digests of the files that it was made from. So that these are digests of what was
read, and not of what somebody has saved in the meantime, a command keeps a `Ledger`: within `entering` each file that
is opened is digested through the opening that is then read from, and one that is no longer what it was is refused.
"""

from __future__ import annotations

import errno
import hashlib
import os
import stat
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from frf_ipz.errors import FileFormatError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from io import BufferedReader
    from pathlib import Path

MISSING = "there is no such file"
FOLDER = "is a folder, but a file is expected: name one inside it"
MOST_TEXT_BYTES = 1 << 26  # of settings and tables that people write: two million lines
BLOCK_BYTES = 1 << 20  # of a file that has more bytes than it says, as those of the system have
MB = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Ledger:
    """What was in each file when it was read first.

    Parameters
    ----------
    entries : dict of str to tuple
        By the path of the file: the digest of its content, and the marks by which the system tells that it has changed.
    """

    entries: dict[str, tuple[str, tuple[int, ...]]] = field(default_factory=dict)

    def enter(self, path: Path, stream: BufferedReader) -> None:
        """Digest what is about to be read.

        Parameters
        ----------
        path : Path
            The file.
        stream : BufferedReader
            Its opening; stands at the beginning afterwards.

        Raises
        ------
        FileFormatError
            If it is no longer what it was.
        """
        marks = _marks(stream)
        known, known_marks = self.entries.get(str(path), ("", ()))
        if marks == known_marks:
            return
        content = hashlib.file_digest(stream, "sha256").hexdigest()
        stream.seek(0)
        if known not in {"", content}:
            raise _changed(path)
        self.entries[str(path)] = (content, marks)

    def require_unchanged(self, path: Path, stream: BufferedReader) -> None:
        """Refuse what was written to while it was read.

        Parameters
        ----------
        path : Path
            The file.
        stream : BufferedReader
            Its opening.

        Raises
        ------
        FileFormatError
            If it is no longer what it was.
        """
        if _marks(stream) != self.entries[str(path)][1]:
            raise _changed(path)


LEDGER: ContextVar[Ledger | None] = ContextVar("LEDGER", default=None)


@contextmanager
def entering(ledger: Ledger) -> Iterator[None]:
    """Enter every file that is read into a ledger.

    Parameters
    ----------
    ledger : Ledger
        With what was read before.

    Yields
    ------
    None
        While files are read.
    """
    token = LEDGER.set(ledger)
    try:
        yield
    finally:
        LEDGER.reset(token)


def digest_file(path: Path) -> str:
    """Digest a file's content; within `entering` what it was when it was read first.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    str
        SHA-256, hexadecimal.

    Raises
    ------
    FileFormatError
        If it cannot be read, or is no longer what it was.
    """
    ledger = LEDGER.get()
    with open_input(path) as stream:
        if ledger is not None:
            return ledger.entries[str(path)][0]
        return hashlib.file_digest(stream, "sha256").hexdigest()


def require_regular_file(path: Path) -> int:
    """Refuse what is no file with content: a folder, a device, a pipe, a link in a circle, nothing at all.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    int
        Its size in bytes.

    Raises
    ------
    FileFormatError
        If it is missing, is something else, or cannot be reached.
    """
    require_text_name(path)
    try:
        with _errors_of_system(path):
            status = path.stat()
    except FileFormatError:
        raise
    except ValueError:  # a NUL in the name, or letters that no file system can hold
        raise FileFormatError(ascii(str(path)), "is no name that a file can have") from None
    if stat.S_ISDIR(status.st_mode):
        raise FileFormatError(path, FOLDER)
    if not stat.S_ISREG(status.st_mode):
        raise FileFormatError(path, "is a device or a pipe; a file is needed: copy what it gives to one")
    return status.st_size


def require_text_name(path: Path) -> None:
    """Refuse a name that is no text: tables, JSON and pages cannot say it.

    Parameters
    ----------
    path : Path
        A file or a folder.

    Raises
    ------
    FileFormatError
        If a part of it is not UTF-8.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise FileFormatError(path, "its name is not in UTF-8; rename the file or the folder") from None


@contextmanager
def open_input(path: Path) -> Iterator[BufferedReader]:
    """Open a file to read it in parts.

    Parameters
    ----------
    path : Path
        The file.

    Yields
    ------
    BufferedReader
        Its bytes.

    Raises
    ------
    FileFormatError
        If it is missing, is no file, or cannot be read.
    """
    require_regular_file(path)
    ledger = LEDGER.get()
    with _errors_of_system(path), path.open("rb") as stream:
        if ledger is not None:
            ledger.enter(path, stream)
        yield stream
        if ledger is not None:
            ledger.require_unchanged(path, stream)


def require_size(path: Path, *, most_bytes: int | None = None) -> int:
    """Refuse a file that is too large, before it is read.

    Parameters
    ----------
    path : Path
        The file.
    most_bytes : int, optional
        A larger file is refused; by default one that is larger than the memory of the machine.

    Returns
    -------
    int
        Its size, bytes.

    Raises
    ------
    FileFormatError
        If it is missing, is no file, or is too large.
    """
    size = require_regular_file(path)
    limit = _memory_bytes() if most_bytes is None else most_bytes
    if size > limit:
        raise _too_large(path, size, limit)
    return size


def read_bytes(path: Path, *, most_bytes: int | None = None) -> bytes:
    """Read a whole file.

    Parameters
    ----------
    path : Path
        The file.
    most_bytes : int, optional
        A larger file is refused; by default one that is larger than the memory of the machine.

    Returns
    -------
    bytes
        Its content.

    Raises
    ------
    FileFormatError
        If it is missing, is no file, is too large, or cannot be read.
    """
    limit = _memory_bytes() if most_bytes is None else most_bytes
    size = require_size(path, most_bytes=limit)
    with open_input(path) as stream:
        try:
            data = stream.read(size + 1)  # not of the limit: as many bytes as are asked for are allocated
            while len(data) <= limit and (rest := stream.read(BLOCK_BYTES)):
                data += rest
        except MemoryError:
            raise _too_large(path, size, limit) from None
    if len(data) > limit:  # it has grown, or does not say how large it is
        raise _too_large(path, len(data), limit)
    return data


def require_expanded(path: Path, n_bytes: int, *, file_bytes: int, most_bytes: int) -> None:
    """Refuse what is much larger unpacked than the file is, before it is unpacked.

    Parameters
    ----------
    path : Path
        The file.
    n_bytes : int
        Unpacked.
    file_bytes : int
        The file's own size.
    most_bytes : int
        What a smaller file may hold.

    Raises
    ------
    FileFormatError
        If it is more than either.
    """
    if n_bytes > max(most_bytes, file_bytes):
        problem = f"it would be {n_bytes / MB:.0f} MB of numbers in a file of {file_bytes / MB:.3g} MB"
        raise FileFormatError(path, f"{problem}; export less, or without compression")


def read_text(path: Path) -> str:
    """Read a text file in UTF-8 (with or without a BOM), else in Latin-1.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    str
        Its text; lines end with LF.

    Raises
    ------
    FileFormatError
        If it is missing, is no file, is too large for a text, or cannot be read.
    """
    data = read_bytes(path, most_bytes=MOST_TEXT_BYTES)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.replace("\r\n", "\n")


@contextmanager
def _errors_of_system(path: Path) -> Iterator[None]:
    """Turn what the system says about a path into one line."""
    try:
        yield
    except FileNotFoundError:
        raise FileFormatError(path, MISSING) from None
    except IsADirectoryError:
        raise FileFormatError(path, FOLDER) from None
    except OSError as error:
        circle = error.errno == errno.ELOOP
        reason = "is a link that leads in a circle" if circle else f"cannot be read: {error.strerror or error}"
        raise FileFormatError(path, reason) from None


def _marks(stream: BufferedReader) -> tuple[int, ...]:
    status = os.fstat(stream.fileno())
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns


def _changed(path: Path) -> FileFormatError:
    return FileFormatError(path, "has been changed while this command was at work; give the command again")


def _too_large(path: Path, size: int, limit: int) -> FileFormatError:
    return FileFormatError(
        path, f"has {size / MB:.0f} MB; at most {limit / MB:.0f} MB can be read: is it the right file?"
    )


def _memory_bytes() -> int:
    """Give the memory of the machine; where it does not say, the largest size of a file in 32 bits."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return 1 << 32
