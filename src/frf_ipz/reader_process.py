"""Compiled readers, and others that a damaged file may end or keep busy, in a process beside this one.

The process is started when the first such file is read, reads one file after another, and ends with this one; where a
file ends it, the next file starts another. What it is asked is a line of JSON and the bytes of the file; what it
answers is a line of JSON and the bytes of the arrays.
"""

from __future__ import annotations

import atexit
import json
import math
import os
import signal
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock, Timer
from typing import IO, TYPE_CHECKING, Any, Literal

import numpy as np

from frf_ipz.arrays import as_doubles
from frf_ipz.errors import FileFormatError
from frf_ipz.input_files import BLOCK_BYTES, open_input, require_expanded, require_size
from frf_ipz.json_files import parse_json
from frf_ipz.output_files import write_bytes

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

LONGEST_S, BYTES_PER_S = 30.0, 1e7  # how long a file may take: to start the process, and for its size
LONGEST_ANSWER = 200  # letters of what a library says
NUMBERS = "biufcSU"  # kinds of arrays whose bytes are all that they are
NOTHING_SAID: dict[str, Any] = {"arrays": (), "said": {}, "problem": "", "where": "", "raised": ""}
PROGRAM = "from frf_ipz.reader_process import answer_all; answer_all()"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FileContents:
    """What a reader has found.

    Parameters
    ----------
    arrays : dict of str to array
        Numbers and texts.
    said : dict
        What is no array, as JSON has it.
    """

    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)
    said: dict[str, Any] = field(default_factory=dict)


def read_in_process(path: Path, module: str, *, kind: str, most_bytes: int) -> FileContents:
    """Let the function ``read(data, path)`` of a module read a file in another process.

    Parameters
    ----------
    path : Path
        The file.
    module : str
        Has ``read``, which takes the bytes of the file, opened, and a path for messages; gives `FileContents`.
    kind : str
        What the file should be, such as ``a .full file of Ansys``.
    most_bytes : int
        What the arrays may have, where the file is smaller.

    Returns
    -------
    FileContents
        What ``read`` gave.

    Raises
    ------
    FileFormatError
        What ``read`` raised, or that the process has ended without an answer, or takes too long.
    """
    return _reader_of(os.getpid()).read(path, module, kind=kind, most_bytes=most_bytes)


@contextmanager
def as_file(data: IO[bytes], path: Path) -> Iterator[Path]:
    """Give bytes as a file, for a library that takes nothing else.

    Parameters
    ----------
    data : stream
        The bytes.
    path : Path
        Says by its end what they are.

    Yields
    ------
    Path
        A copy, as long as it is read.
    """
    with TemporaryDirectory() as folder:
        copy = Path(folder) / f"file{path.suffix.lower()}"
        write_bytes(copy, data.read())
        yield copy


@cache
def _reader_of(process: int) -> _Reader:
    """Give the reader of a process: one that was forked from another would share its answers."""
    reader = _Reader(process)
    atexit.register(reader.end)
    return reader


class _Reader:
    """The process beside this one, and the lock on it."""

    def __init__(self, owner: int) -> None:
        self._owner = owner
        self._lock = Lock()
        self._process: subprocess.Popen[bytes] | None = None

    def read(self, path: Path, module: str, *, kind: str, most_bytes: int) -> FileContents:
        """Ask for the contents of a file."""
        with self._lock, open_input(path) as stream:
            file_bytes = require_size(path)
            process = self._started()
            clock = _Clock(process, LONGEST_S + file_bytes / BYTES_PER_S)
            try:
                _ask(process, module, path, stream, file_bytes)
                answer = _line(process, path)
                sizes = (math.prod(shape) * np.dtype(form).itemsize for _, form, shape, _ in answer["arrays"])
                require_expanded(path, sum(sizes), file_bytes=file_bytes, most_bytes=most_bytes)
                arrays = {name: _array(process, form, shape, order) for name, form, shape, order in answer["arrays"]}
            except (EOFError, BrokenPipeError):
                self.end()
                late = f"keeps the library that reads it for more than {clock.longest_s:.0f} s"
                does = late if clock.has_rung else "crashes the library that reads it"
                problem = f"cannot be read as {kind}: it {does}; is it damaged? copy or export it again"
                raise FileFormatError(path, problem) from None
            except BaseException:
                self.end()  # in the middle of an answer
                raise
            finally:
                clock.stop()
        if answer["problem"]:
            raise FileFormatError(path, answer["problem"], where=answer["where"])
        if answer["raised"]:
            raise FileFormatError(path, f"cannot be read as {kind}: {answer['raised']}")
        doubles = {name: as_doubles(path, name, values) for name, values in arrays.items()}
        return FileContents(arrays=doubles, said=answer["said"])

    def _started(self) -> subprocess.Popen[bytes]:
        if self._process is None or self._process.poll() is not None:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", PROGRAM],  # -P: nothing in the user's folder is taken for a module
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        return self._process

    def end(self) -> None:
        """End the process, unless it is another's."""
        process, self._process = self._process, None
        if process is not None and os.getpid() == self._owner:
            process.kill()
            process.communicate()


class _Clock:
    """Ends a process when its time is over."""

    def __init__(self, process: subprocess.Popen[bytes], longest_s: float) -> None:
        self.longest_s = longest_s
        self.has_rung = False
        self._process = process
        self._timer = Timer(longest_s, self._ring)
        self._timer.daemon = True
        self._timer.start()

    def _ring(self) -> None:
        self.has_rung = True
        self._process.kill()

    def stop(self) -> None:
        self._timer.cancel()


def _ask(process: subprocess.Popen[bytes], module: str, path: Path, stream: IO[bytes], file_bytes: int) -> None:
    asked: Any = process.stdin
    asked.write(json.dumps({"module": module, "name": path.name, "n_bytes": file_bytes}).encode() + b"\n")
    left = file_bytes
    while left and (block := stream.read(min(BLOCK_BYTES, left))):
        asked.write(block)
        left -= len(block)
    if left:
        raise FileFormatError(path, "has become shorter while it was read; try again")
    asked.flush()


def _line(process: subprocess.Popen[bytes], path: Path) -> dict[str, Any]:
    answers: Any = process.stdout
    line = answers.readline()
    if not line.endswith(b"\n"):
        raise EOFError
    return NOTHING_SAID | parse_json(line, path)


def _array(process: subprocess.Popen[bytes], form: str, shape: list[int], order: Literal["C", "F"]) -> NDArray[Any]:
    data = bytearray(math.prod(shape) * np.dtype(form).itemsize)
    answers: Any = process.stdout
    place = memoryview(data)
    while place:
        n_bytes = answers.readinto(place)
        if not n_bytes:
            raise EOFError
        place = place[n_bytes:]
    values: NDArray[Any] = np.frombuffer(data, form).reshape(shape, order=order)
    return values


def answer_all() -> None:
    """Read one file after another, as they are asked for, until nobody asks any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it ends with the process that asks
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what a library prints is no answer
    for line in sys.stdin.buffer:
        asked = parse_json(line, Path("what is asked"))
        data = BytesIO(sys.stdin.buffer.read(asked["n_bytes"]))
        _answer(answers, asked["module"], data, Path(asked["name"]))


def _answer(answers: IO[bytes], module: str, data: IO[bytes], path: Path) -> None:
    blocks: list[NDArray[Any]] = []
    answer: dict[str, Any] = {}
    try:
        contents: FileContents = import_module(module).read(data, path)
        blocks, forms = _forms(contents.arrays)
        answer = {"said": contents.said, "arrays": forms}
    except FileFormatError as error:
        answer = {"problem": error.problem, "where": error.where}
    except Exception as error:
        answer = {"raised": " ".join(str(error).split())[-LONGEST_ANSWER:] or type(error).__name__}
    answers.write(json.dumps(answer).encode() + b"\n")
    for block in blocks:
        answers.write(block.view(np.uint8).data)
    answers.flush()


def _forms(arrays: dict[str, NDArray[Any]]) -> tuple[list[NDArray[Any]], list[tuple[str, str, tuple[int, ...], str]]]:
    """Give the arrays as they lie in memory, and what says how they are read."""
    blocks: list[NDArray[Any]] = []
    forms: list[tuple[str, str, tuple[int, ...], str]] = []
    for name, values in arrays.items():
        if values.dtype.kind not in NUMBERS:
            raise TypeError(f"'{name}' is an array of {values.dtype}")
        order: Literal["C", "F"] = "F" if values.flags.f_contiguous else "C"
        blocks.append(values.ravel(order=order))
        forms.append((name, values.dtype.str, values.shape, order))
    return blocks, forms
