"""MATLAB files that may come from anybody: read only where their values fit into memory.

A file of a few megabytes can hold gigabytes of zeros, compressed. So each part is expanded up to a limit, and its
structure walked through, before SciPy sees it.
"""

from __future__ import annotations

import struct
import zlib
from io import BytesIO
from typing import TYPE_CHECKING, Any

from frf_ipz.errors import FileFormatError
from frf_ipz.foreign_errors import errors_of_reader
from frf_ipz.input_files import read_bytes
from frf_ipz.late_imports import import_late
from frf_ipz.matlab_elements import COMPRESSED, HEADER_BYTES, TAG_BYTES, DamagedError, require_elements

if TYPE_CHECKING:
    from pathlib import Path

    from scipy.io import loadmat
else:
    loadmat = import_late("scipy.io", "loadmat")

KIND = "a MATLAB file of version 4 to 7.2"
LOSSES = ("corrupt", "Unreadable", "Duplicate")  # words of SciPy's warnings where a variable is not what the file means
MOST_BYTES = 1 << 28  # of one file, expanded: half of what looking at any folder may take
ORDERS = {b"IM": "<", b"MI": ">"}  # how the header says in which order the bytes of a number stand


def read_matlab(path: Path, *, most_bytes: int = MOST_BYTES) -> dict[str, Any]:
    """Read the variables of a MATLAB file of version 4 to 7.2.

    Parameters
    ----------
    path : Path
        The file.
    most_bytes : int, optional
        What it may hold, expanded.

    Returns
    -------
    dict
        Name and value of each variable, as SciPy gives them.

    Raises
    ------
    FileFormatError
        If it is missing, no such file, damaged, or holds more.
    """
    data = read_bytes(path, most_bytes=most_bytes)
    order = ORDERS.get(data[HEADER_BYTES - 2 : HEADER_BYTES])
    if order is not None:  # version 5
        data = _expanded(data, order, path, most_bytes)
        try:
            require_elements(data, order)
        except DamagedError as error:
            raise FileFormatError(path, f"is damaged: {error}; write it again") from None
    stream: Any = BytesIO(data)
    with errors_of_reader(path, KIND, losses=LOSSES):
        try:
            values: dict[str, Any] = loadmat(stream)
        except (MemoryError, OverflowError, RecursionError):
            raise FileFormatError(path, "says that it holds more than memory takes; is it damaged?") from None
    return values


def _expanded(data: bytes, order: str, path: Path, most_bytes: int) -> bytes:
    """Give the content of a file of version 5 with nothing compressed."""
    parts = [data[:HEADER_BYTES]]
    room = most_bytes
    start = HEADER_BYTES
    while start + TAG_BYTES <= len(data):
        kind, length = struct.unpack_from(f"{order}II", data, start)
        end = start + TAG_BYTES + length
        part = data[start:end]
        if kind == COMPRESSED:
            try:
                part = zlib.decompressobj().decompress(part[TAG_BYTES:], room + 1)
            except zlib.error as error:
                raise FileFormatError(path, f"is damaged: a part of it cannot be expanded ({error})") from None
        room -= len(part)
        if room < 0:
            raise FileFormatError(
                path, f"holds more than {most_bytes >> 20} MB, expanded, and that is not read; is it damaged?"
            )
        parts.append(part)
        start = end
    return b"".join(parts)
