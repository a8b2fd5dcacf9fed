"""Recordings as ASAM MDF, versions 3 and 4: channels by name, each on the time of its group.

Numbers are converted by factor and offset only; a conversion by a formula of the file would be run as code, and is not:
such a channel cannot be read, and the others can.
"""

from __future__ import annotations

import gc
import io
import sys
import traceback
from collections import Counter
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.errors import FileFormatError
from frf_ipz.foreign_errors import errors_of_reader, import_reader
from frf_ipz.ingest.formats.file_arrays import MOST_EXPANDED
from frf_ipz.ingest.formats.signal_table import Signal, SignalFormat, SignalTable
from frf_ipz.input_files import read_bytes, require_expanded

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from frf_ipz.ingest.formats.recording import TableKeys

KIND = "an MDF file"
LOSSES = ("is outside the file size", "offset too high")  # of the messages of asammdf: blocks that are not there
BEYOND = "a formula or a table, and only factor and offset are read"
MOST_SEEKS = 100_000  # in a small file; one that can be read takes some for each of its blocks
SHORTEST_BLOCK = 4  # bytes of a file for each seek more: blocks are longer, and read a few times
LINEAR = {"3": {0, 65535}, "4": {0, 1}}  # types of conversions: by factor and offset, or none


class _BytesThatEnd(io.BytesIO):
    """Bytes of a file, for a reader that would follow a circle of blocks for ever.

    Parameters
    ----------
    path : Path
        The file.
    data : bytes
        All of it.
    """

    def __init__(self, path: Path, data: bytes) -> None:
        super().__init__(data)
        self._path = path
        self._left = MOST_SEEKS + len(data) // SHORTEST_BLOCK

    def seek(self, offset: int, whence: int = 0, /) -> int:
        """Go to a place, as often as a file of this size may ask for it."""
        self._left -= 1
        if self._left < 0:
            raise FileFormatError(self._path, "cannot be read: its blocks lead round in a circle; is it damaged?")
        return super().seek(offset, whence)


def _recognises(head: bytes) -> bool:
    return head.startswith((b"MDF     ", b"UnFinMF "))


def _read(path: Path, keys: TableKeys) -> SignalTable:
    del keys
    asammdf = import_reader(path, "asammdf", kind=KIND, extra="mdf")
    data = read_bytes(path)
    signals: list[Signal] = []
    unread: dict[str, str] = {}
    with (
        errors_of_reader(path, KIND, losses=LOSSES) as said,
        _dropping_half_made_files(),
        asammdf.MDF(_BytesThatEnd(path, data)) as content,
    ):
        linear = LINEAR.get(content.version[0], set())
        sizes = [group.channel_group.cycles_nr * 8 * len(group.channels) for group in content.groups]
        require_expanded(path, sum(sizes), file_bytes=len(data), most_bytes=MOST_EXPANDED)
        for group in content.groups:
            _require_within_records(path, group)
        names = Counter(channel.name for group in content.groups for channel in group.channels)
        for number, group in enumerate(content.groups):
            for place, channel in enumerate(group.channels):
                if place == content.masters_db.get(number):
                    continue
                signal = content.get(group=number, index=place, raw=True)
                name = channel.name if names[channel.name] == 1 else f"{channel.name} #{number + 1}"
                values = _physical(signal, linear)
                if values is None:
                    unread[name] = f"converts '{name}' by {BEYOND}; export it in physical values"
                elif values.dtype.kind in "biuf" and values.ndim == 1 and len(values):
                    signals.append(
                        Signal(
                            name=name,
                            values=values.astype(np.float64),
                            unit=str(signal.unit or "").strip(),
                            time=np.asarray(signal.timestamps, np.float64),
                        )
                    )
    notes = [f"MDF: {text}" for text in said]
    if unread:
        notes.append(f"MDF: not read, for the file converts them by {BEYOND}: {', '.join(unread)}")
    return SignalTable(path=path, signals=tuple(signals), notes=tuple(notes), unread=unread)


FORMAT = SignalFormat(rank=10, recognises=_recognises, read=_read)


def _require_within_records(path: Path, group: Any) -> None:  # noqa: ANN401 - as asammdf has them
    """Refuse channels that do not lie in their records: asammdf would read on behind the file."""
    length = group.channel_group.samples_byte_nr
    for channel in group.channels:
        if hasattr(channel, "byte_offset"):  # version 4
            first_bit = 8 * channel.byte_offset + channel.bit_offset
        else:  # short blocks of version 3 and older have no further offset
            first_bit = 8 * getattr(channel, "additional_byte_offset", 0) + channel.start_offset
        end = -(-(first_bit + channel.bit_count) // 8)
        if end > length:
            problem = f"says that '{channel.name}' ends at byte {end} of records of {length} bytes; is it damaged?"
            raise FileFormatError(path, problem)


@contextmanager
def _dropping_half_made_files() -> Iterator[None]:
    """Let go of what a damaged file was to become: closing itself, it fails once more, which Python would print."""
    try:
        yield
    except Exception as error:
        cause: BaseException | None = error
        hook = sys.unraisablehook
        sys.unraisablehook = lambda _: None
        try:
            while cause is not None:
                traceback.clear_frames(cause.__traceback__)
                cause = cause.__context__
            gc.collect()  # it refers to itself
        finally:
            sys.unraisablehook = hook
        raise


def _physical(signal: Any, linear: set[int]) -> Any:  # noqa: ANN401 - as asammdf has them
    """Give the values in their unit; None where more than factor and offset leads to them."""
    if signal.conversion is None:
        return np.asarray(signal.samples)
    if signal.conversion.conversion_type not in linear:
        return np.asarray(signal.samples) if signal.samples.dtype.kind not in "biuf" else None
    return np.asarray(signal.physical().samples)
