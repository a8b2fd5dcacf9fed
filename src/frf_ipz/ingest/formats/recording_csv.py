"""Recordings as text: CSV with a header, or numbers alone whose columns are called 1, 2, 3 and so on.

A unit stands in brackets behind a column's name, or in a row of units under the header.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import FileFormatError
from frf_ipz.ingest.formats.column_words import TIME
from frf_ipz.ingest.formats.recording import LARGEST, RawRecording, RecordingContents, SignalColumn
from frf_ipz.ingest.formats.signal_table import SAME_CLOCK, SAME_RATE
from frf_ipz.ingest.formats.text_columns import (
    find_columns,
    no_time,
    printed_resolution,
    seconds_of_day,
    unwrap_days,
)
from frf_ipz.ingest.formats.text_layout import is_number, name_and_unit, sniff
from frf_ipz.ingest.formats.text_table import column_index, line_of_row, not_a_number, read_blocks
from frf_ipz.ingest.units import unit_factor
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    import pyarrow as pa

    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.formats.recording import TableKeys
    from frf_ipz.ingest.formats.text_columns import TextColumns
    from frf_ipz.ingest.formats.text_layout import TextLayout
else:
    pa = import_late("pyarrow")


class _CsvRecordings:
    """Reads any text; the format to fall back on."""

    rank = 100

    def fits(self, path: Path, head: bytes) -> bool:
        del path, head
        return True

    def open(self, path: Path, columns: Sequence[str], keys: TableKeys) -> RawRecording:
        layout = sniff(path, header_row=keys.header_row)
        found = find_columns(layout, keys, columns=columns)
        if found.time is None and keys.sample_rate_hz is None:
            raise no_time(layout, found)
        indices = [column_index(layout, found.names, column) for column in columns]
        time_unit = "" if found.time is None or keys.sample_rate_hz is not None else found.units[found.time]
        blocks = _read_numbers(layout, found, indices)
        if keys.sample_rate_hz is not None:
            blocks = _by_rate(layout, found, blocks, keys.sample_rate_hz)
        return RawRecording(
            path=path,
            units=(time_unit, *(found.units[index] for index in indices)),
            blocks=blocks,
            line_of_row=lambda row: line_of_row(layout, row),
            time_column="time" if found.time is None else found.names[found.time],
        )

    def look(self, path: Path, keys: TableKeys) -> RecordingContents:
        layout = sniff(path, header_row=keys.header_row)
        found = find_columns(layout, keys)
        columns = []
        for index, (name, unit) in enumerate(zip(found.names, found.units, strict=True)):
            is_time = index == found.time or TIME.match(name) or (index == 0 and found.counts_samples)
            if is_time or not any(is_number(fields[index]) for fields in layout.rows if index < len(fields)):
                continue
            written = name if name and found.names.count(name) == 1 else str(index + 1)
            columns.append(SignalColumn(name=written, unit=unit, label=name_and_unit(name)[0]))
        return RecordingContents(columns=tuple(columns), has_time=found.time is not None)


FORMAT = _CsvRecordings()


def _by_rate(
    layout: TextLayout, found: TextColumns, blocks: Iterator[FloatArray], sample_rate_hz: float
) -> Iterator[FloatArray]:
    """Put the time of the stated rate in the place of the file's, which may not contradict it."""
    n_rows, first, last = 0, np.nan, np.nan
    for block in blocks:
        first = block[0, 0] if n_rows == 0 and len(block) else first
        last = block[-1, 0] if len(block) else last
        block[:, 0] = (n_rows + np.arange(len(block))) / sample_rate_hz
        n_rows += len(block)
        yield block
    if found.time is None or n_rows < 2 or last <= first:
        return
    unit = found.units[found.time]
    step_s = (last - first) / (n_rows - 1) * (unit_factor(unit, "time") if unit else 1.0)
    rounded = SAME_RATE if found.holds_stamps else printed_resolution(layout, found.time) / (last - first)
    if abs(step_s * sample_rate_hz - 1.0) > SAME_CLOCK + rounded * step_s * sample_rate_hz:
        problem = (
            f"[test] sample_rate_hz = {sample_rate_hz:g}, but its column '{found.names[found.time]}' has a mean step "
            f"of {step_s:.6g} s, which is {1.0 / step_s:.6g} Hz; correct sample_rate_hz, or leave it out"
        )
        raise FileFormatError(layout.path, problem)


def _read_numbers(layout: TextLayout, found: TextColumns, columns: list[int]) -> Iterator[FloatArray]:
    """Give blocks of rows; rows that are empty to the last field may only stand at the end."""
    indices = columns if found.time is None else [found.time, *columns]
    types = {index: pa.string() if found.holds_stamps and index == found.time else pa.float64() for index in indices}
    order = [list(types).index(index) for index in indices]
    n_rows, first_empty, last_s = 0, -1, np.nan
    for batch in read_blocks(layout, found.names, types):
        arrays = [_to_numbers(batch.column(position)) for position in order]
        block = np.column_stack([np.zeros(len(batch)), *arrays] if found.time is None else arrays)
        is_finite = np.asarray(np.abs(block) < LARGEST)
        is_empty = np.asarray(np.isnan(block[:, -len(indices) :]).all(axis=1))
        if first_empty < 0 and is_empty.any():
            first_empty = n_rows + int(np.argmax(is_empty))
        is_bad = ~is_finite.all(axis=1) & ~is_empty
        if is_bad.any():
            raise not_a_number(layout, found.names, indices, n_rows + int(np.argmax(is_bad)))
        if first_empty >= 0 and not is_empty[max(first_empty - n_rows, 0) :].all():
            raise not_a_number(layout, found.names, indices, first_empty)
        n_rows += len(block)
        block = block[~is_empty]
        if found.holds_stamps and len(block):
            block[:, 0] = unwrap_days(block[:, 0], last_s)
            last_s = block[-1, 0]
        yield block


def _to_numbers(column: pa.Array) -> FloatArray:
    if pa.types.is_string(column.type):
        return seconds_of_day(column.to_pylist())
    return np.asarray(column.to_numpy(zero_copy_only=False))
