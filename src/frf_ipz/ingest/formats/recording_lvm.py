"""Recordings as LabVIEW writes them (LVM): channels by name, units and rate from the head of each segment.

Segments that go on where the one before ended are one recording. Channels of others have the number of their segment
behind their names, as in ``force #2``: each is a record of its own, for a ``[[hit]]`` with ``variables``.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import lazy_loader
import numpy as np

from frf_ipz.foreign_errors import errors_of_reader
from frf_ipz.ingest.formats.signal_table import SAME_RATE, Signal, SignalFormat, SignalTable, even_times
from frf_ipz.ingest.formats.text_layout import decode, name_and_unit
from frf_ipz.input_files import read_bytes
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import pyarrow as pa
    import pyarrow.csv as arrow_csv

    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.formats.recording import TableKeys
else:
    pa = import_late("pyarrow")
    arrow_csv = import_late("pyarrow.csv")

lvm_read = lazy_loader.load("lvm_read")

KIND = "a LabVIEW measurement file"
ABSCISSA, COMMENT = "X_Value", "Comment"
MOST_CHANNELS = 4096
NAMES_LINE = re.compile(r"^X_Value([\t,;]).*\r?\n", re.MULTILINE)
SAME_STEP = 0.5  # of a step: a segment that begins nearer to the end of the one before goes on


def _recognises(head: bytes) -> bool:
    return head.lstrip(b"\xef\xbb\xbf").startswith(b"LabVIEW Measurement")


def _read(path: Path, keys: TableKeys) -> SignalTable:
    del keys
    with errors_of_reader(path, KIND):
        content = _read_content(decode(read_bytes(path).removeprefix(b"\xef\xbb\xbf")))
        segments = [_segment_signals(content[number]) for number in range(content["Segments"])]
    joined = [segments[0]] if segments else []
    for segment in segments[1:]:
        if _goes_on(joined[-1], segment):
            joined[-1] = [_append(first, other) for first, other in zip(joined[-1], segment, strict=True)]
        else:
            joined.append(segment)
    signals = list(joined[0]) if joined else []
    for number, segment in enumerate(joined[1:], start=2):
        signals += [
            Signal(name=f"{signal.name} #{number}", values=signal.values, unit=signal.unit, time=signal.time)
            for signal in segment
        ]
    note = f"{len(joined)} segments; those after the first are named as in '{signals[-1].name}'" if joined[1:] else ""
    return SignalTable(path=path, signals=tuple(signals), notes=(note,) if note else ())


FORMAT = SignalFormat(rank=10, recognises=_recognises, read=_read)


def _read_content(text: str) -> dict[Any, Any]:
    """Give what `lvm_read` does: it reads the heads, and rows too where not all of a segment's fields are numbers."""
    heads, rows, end = [], [], 0
    while names := NAMES_LINE.search(text, end):
        heads.append(text[end : names.end()])
        stop = re.compile(rf"^{names[1]}?\r?$", re.MULTILINE).search(text, names.end())
        end = stop.start() if stop else len(text)
        rows.append((names[1], text[names.end() : end]))
    content: dict[Any, Any] = lvm_read.read_str("".join([*heads, text[end:]]))
    segments = [number for number in range(content["Segments"]) if "data" in content[number]]
    try:
        tables = [_read_rows(*row, content["Decimal_Separator"]) for row in rows]
    except pa.ArrowInvalid:
        tables = []
    if not tables or len(tables) != len(segments):
        whole: dict[Any, Any] = lvm_read.read_str(text)
        return whole
    for number, table in zip(segments, tables, strict=True):
        content[number]["data"] = table[:, 1:] if content.get("X_Columns") == "No" else table
    return content


def _read_rows(separator: str, text: str, decimal: str) -> FloatArray:
    """Read rows of as many numbers each, where an empty field is no number; a hundred times faster than `lvm_read`."""
    if not text.strip():
        return np.empty((0, 0))
    names = [f"{number}" for number in range(text.partition("\n")[0].count(separator) + 1)]
    reader = arrow_csv.open_csv(
        pa.BufferReader(text.encode()),
        read_options=arrow_csv.ReadOptions(column_names=names, use_threads=False),
        parse_options=arrow_csv.ParseOptions(delimiter=separator),
        convert_options=arrow_csv.ConvertOptions(
            column_types=dict.fromkeys(names, pa.float64()), decimal_point=decimal
        ),
    )
    return np.column_stack([column.to_numpy() for column in reader.read_all().columns])


def _segment_signals(segment: dict[str, Any]) -> list[Signal]:
    """Give the channels of a segment, on the abscissa that stands before each, or on its start and step."""
    names: list[str] = segment["Channel names"][:MOST_CHANNELS]
    data = np.atleast_2d(segment["data"])
    channels = [
        (place, name)
        for place, name in enumerate(names)
        if not name.startswith((ABSCISSA, COMMENT)) and place < data.shape[1]
    ]
    abscissae = [place for place, name in enumerate(names) if name.startswith(ABSCISSA)]
    units = _of_each(segment.get("Y_Unit_Label", []), len(channels))
    steps = [float(text) for text in _of_each(segment.get("Delta_X", []), len(channels))]
    steps = steps if steps and min(steps) > 0.0 else []
    starts = [float(text) for text in _of_each(segment.get("X0", []), len(channels))]
    signals = []
    for number, (place, name) in enumerate(channels):
        column = data[:, place]
        used = len(column) - int(np.argmax(np.isfinite(column[::-1]))) if np.isfinite(column).any() else 0
        before = [abscissa for abscissa in abscissae if abscissa < place]
        time = data[:used, before[-1]] if before else None
        stated = even_times(used, 1.0 / steps[number], starts[number] if starts else 0.0) if steps else None
        if stated is not None and (time is None or _is_same_step(time, stated)):
            time = stated  # all of its digits
        bare, unit = name_and_unit(name.strip())
        signals.append(Signal(name=bare, values=column[:used], unit=units[number] if units else unit, time=time))
    return signals


def _is_same_step(time: FloatArray, stated: FloatArray) -> bool:
    """Tell whether the head's step is that of the abscissa: one that was thinned out afterwards has another."""
    if len(time) < 2:
        return True
    step = (time[-1] - time[0]) / (len(time) - 1)
    return bool(abs(step - (stated[1] - stated[0])) <= SAME_RATE * abs(step)) or not np.isfinite(step)


def _of_each(values: Sequence[Any], count: int) -> list[Any]:
    """Give one value a channel; a file with an abscissa a channel leaves fields between them empty."""
    stated = [value for value in values if value == value and str(value).strip()]  # noqa: PLR0124 - NaN is not itself
    return stated[:count] if len(stated) >= count else []


def _goes_on(first: Sequence[Signal], other: Sequence[Signal]) -> bool:
    if [signal.name for signal in first] != [signal.name for signal in other]:
        return False
    for before, after in zip(first, other, strict=True):
        if before.time is None or after.time is None or len(before.time) < 2 or len(after.time) < 1:
            return False
        step = before.time[1] - before.time[0]
        if abs(after.time[0] - before.time[-1] - step) > SAME_STEP * step:
            return False
    return True


def _append(first: Signal, other: Signal) -> Signal:
    if first.time is None or other.time is None:
        return first
    return Signal(
        name=first.name,
        values=np.concatenate([first.values, other.values]),
        unit=first.unit,
        time=np.concatenate([first.time, other.time]),
    )
