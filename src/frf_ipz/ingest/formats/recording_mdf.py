"""Recordings as ASAM MDF, versions 3 and 4: channels by name, each on the time of its group.

Numbers are converted by factor and offset only; a conversion by a formula of the file would be run as code, and is not:
such a channel cannot be read, and the others can.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.foreign_errors import require_reader
from frf_ipz.ingest.formats.file_arrays import MOST_EXPANDED
from frf_ipz.ingest.formats.signal_table import Signal, SignalFormat, SignalTable
from frf_ipz.reader_process import read_in_process

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.ingest.formats.recording import TableKeys

PROCESS = "frf_ipz.ingest.formats.mdf_process"
KIND = "an MDF file"


def _recognises(head: bytes) -> bool:
    return head.startswith((b"MDF     ", b"UnFinMF "))


def _read(path: Path, keys: TableKeys) -> SignalTable:
    del keys
    require_reader(path, "asammdf", kind=KIND, extra="mdf")
    found = read_in_process(path, PROCESS, kind=KIND, most_bytes=2 * MOST_EXPANDED)
    signals = tuple(
        Signal(name=name, unit=unit, values=found.arrays[f"values {place}"], time=found.arrays[f"time {place}"])
        for place, (name, unit) in enumerate(found.said["signals"])
    )
    return SignalTable(path=path, signals=signals, notes=tuple(found.said["notes"]), unread=found.said["unread"])


FORMAT = SignalFormat(rank=10, recognises=_recognises, read=_read)
