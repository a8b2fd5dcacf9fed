"""Reads an MDF file in a process of its own, which the compiled parts of asammdf may end where it is damaged."""

from __future__ import annotations

import io
from collections import Counter
from importlib import import_module
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from frf_ipz.errors import FileFormatError
from frf_ipz.foreign_errors import errors_of_reader
from frf_ipz.ingest.formats.file_arrays import MOST_EXPANDED
from frf_ipz.input_files import require_expanded
from frf_ipz.reader_process import FileContents

if TYPE_CHECKING:
    from pathlib import Path

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


def read(data: IO[bytes], path: Path) -> FileContents:
    """Read every channel that is a row of numbers.

    Parameters
    ----------
    data : stream
        The file.
    path : Path
        Its name, for messages.

    Returns
    -------
    FileContents
        Values and times by the channel's place, ``values 0`` and ``time 0``; said are ``signals``, name and unit of
        each, ``notes``, and by name why channels are ``unread``.
    """
    asammdf = import_module("asammdf")
    content_bytes = data.read()
    arrays: dict[str, Any] = {}
    signals: list[tuple[str, str]] = []
    unread: dict[str, str] = {}
    with (
        errors_of_reader(path, KIND, losses=LOSSES) as said,
        asammdf.MDF(_BytesThatEnd(path, content_bytes)) as content,
    ):
        linear = LINEAR.get(content.version[0], set())
        sizes = [group.channel_group.cycles_nr * 8 * len(group.channels) for group in content.groups]
        require_expanded(path, sum(sizes), file_bytes=len(content_bytes), most_bytes=MOST_EXPANDED)
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
                    arrays[f"values {len(signals)}"] = values.astype(np.float64)
                    arrays[f"time {len(signals)}"] = np.asarray(signal.timestamps, np.float64)
                    signals.append((name, str(signal.unit or "").strip()))
    notes = [f"MDF: {text}" for text in said]
    if unread:
        notes.append(f"MDF: not read, for the file converts them by {BEYOND}: {', '.join(unread)}")
    return FileContents(arrays=arrays, said={"signals": signals, "notes": notes, "unread": unread})


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


def _physical(signal: Any, linear: set[int]) -> Any:  # noqa: ANN401 - as asammdf has them
    """Give the values in their unit; None where more than factor and offset leads to them."""
    if signal.conversion is None:
        return np.asarray(signal.samples)
    if signal.conversion.conversion_type not in linear:
        return np.asarray(signal.samples) if signal.samples.dtype.kind not in "biuf" else None
    return np.asarray(signal.physical().samples)
