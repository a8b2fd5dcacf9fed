"""Looks at the heaps of texts in an HDF5 file before its library does, which may never return from a damaged one.

A global heap collection is a list of objects, each with its size; free space is the object of index 0, whose size
includes its head (HDF5 File Format Specification 3.0, III.E). The library goes from each to the next, and where one has
no size, it stays.
"""

from __future__ import annotations

import mmap
from typing import TYPE_CHECKING

from frf_ipz.errors import FileFormatError

if TYPE_CHECKING:
    from io import BufferedReader
    from pathlib import Path

SIGNATURE = b"GCOL\x01\0\0\0"
WORD = 8  # bytes; everything in a heap is a multiple of it
FILE = b"\x89HDF\r\n\x1a\n"  # where the file begins, which may be behind a text of another program


def require_heaps(path: Path, stream: BufferedReader) -> None:
    """Look at all global heaps of a file.

    Parameters
    ----------
    path : Path
        An HDF5 file.
    stream : BufferedReader
        Its bytes, opened.

    Raises
    ------
    FileFormatError
        If an object of a heap has no size, or one that leaves the heap.
    """
    if not stream.peek(1):
        return  # there is nothing to map
    with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        begin = max(data.find(FILE), 0)
        n_length = _bytes_of_length(data[begin : begin + 2 * WORD])
        start = data.find(SIGNATURE)
        while start >= 0:
            if not _is_whole(data, start, n_length):
                raise FileFormatError(path, "is damaged: a heap of its texts has no end; write it again")
            start = data.find(SIGNATURE, start + WORD)


def _bytes_of_length(first: bytes) -> int:
    """How many bytes a length has, which the superblock says: 8 in nearly all files."""
    version = first[8] if len(first) > 8 else 0
    place = 14 if version < 2 else 10
    return first[place] if len(first) > place else WORD


def _is_whole(data: mmap.mmap, start: int, n_length: int) -> bool:
    def length(place: int) -> int:
        return int.from_bytes(data[place : place + n_length], "little")

    def rounded(size: int) -> int:
        return -(-size // WORD) * WORD

    head = rounded(WORD + n_length)
    end = min(start + length(start + WORD), len(data))
    place = start + head
    while place + head <= end:
        is_object = any(data[place : place + 2])
        size = length(place + WORD)
        step = head + rounded(size) if is_object else size
        if not head <= step <= end - place:
            return False
        place += step
    return True
