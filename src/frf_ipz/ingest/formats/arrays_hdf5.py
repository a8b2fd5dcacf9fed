"""HDF5 files: every data set of numbers, and the attributes beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.hdf5_files import SIGNATURE
from frf_ipz.ingest.formats.file_arrays import MOST_EXPANDED, ArrayFormat, FileArrays
from frf_ipz.reader_process import read_in_process

if TYPE_CHECKING:
    from pathlib import Path

PROCESS = "frf_ipz.ingest.formats.hdf5_process"


def _recognises(head: bytes) -> bool:
    return head.startswith(SIGNATURE)


def _read(path: Path) -> FileArrays:
    found = read_in_process(path, PROCESS, kind="an HDF5 file", most_bytes=MOST_EXPANDED)
    texts = {place: tuple(lines) for place, lines in found.said["texts"].items()}
    return FileArrays(path=path, arrays=found.arrays, texts=texts, unread=tuple(found.said["unread"]))


FORMAT = ArrayFormat(rank=5, recognises=_recognises, read=_read)
