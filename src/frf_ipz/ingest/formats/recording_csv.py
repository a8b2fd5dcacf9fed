"""Recordings as text: CSV with a header, or numbers alone whose columns are called 1, 2, 3 and so on.

The first column is the time. A unit stands in brackets behind a column's name, or in a row of units under the header.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from frf_ipz.errors import FileFormatError
from frf_ipz.ingest.formats.recording import RawRecording
from frf_ipz.ingest.formats.text_layout import is_number, name_and_unit, sniff
from frf_ipz.ingest.formats.text_table import column_index, line_of_row, not_a_number, read_blocks

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.formats.text_layout import TextLayout

LARGEST = 1e100  # a larger value is no measurement, and its square may overflow
TIME = re.compile(r"^t(ime)?\b", re.IGNORECASE)


class _CsvRecordings:
    """Reads any text; the format to fall back on."""

    rank = 100

    def fits(self, path: Path, head: bytes) -> bool:
        del path, head
        return True

    def open(self, path: Path, columns: Sequence[str]) -> RawRecording:
        layout = sniff(path)
        names, units = _read_header(layout)
        indices = [0, *(column_index(layout, names, column) for column in columns)]
        return RawRecording(
            path=path,
            units=tuple(units[index] for index in indices),
            blocks=_read_numbers(layout, names, indices),
            line_of_row=lambda row: line_of_row(layout, row),
        )


FORMAT = _CsvRecordings()


def _read_header(layout: TextLayout) -> tuple[list[str], list[str]]:
    """Give the name and the unit of each column."""
    if not layout.header:
        return [str(index + 1) for index in range(layout.n_columns)], [""] * layout.n_columns
    header_row = next((index for index, fields in enumerate(layout.header) if TIME.match(fields[0])), None)
    if header_row is None:
        columns = ", ".join(field for field in layout.header[-1] if field)
        problem = f"has no column 'time'; the first column must be the time in s, and the header says {columns}"
        raise FileFormatError(layout.path, problem, where=f"line {layout.n_before}")
    names = _match_width(layout, layout.header[header_row])
    units = [name_and_unit(name)[1] for name in names]
    rows_below = layout.header[header_row + 1 :]
    if rows_below:
        units = [row_unit or unit for row_unit, unit in zip(_read_units_row(layout, rows_below), units, strict=True)]
    return names, units


def _read_units_row(layout: TextLayout, rows_below: tuple[tuple[str, ...], ...]) -> list[str]:
    """Take the line under the header as a row of units, unless it is a line of numbers with a fault."""
    if len(rows_below) > 1 or any(is_number(field) for field in rows_below[0]):
        problem = (
            f"holds '{rows_below[0][0]}' where a number is expected; under the header only one row of units may stand"
        )
        raise FileFormatError(
            layout.path, problem, where=f"line {layout.n_before - len(rows_below) + 1}, column 'time'"
        )
    return [field.strip("[]() ") for field in _match_width(layout, rows_below[0])]


def _match_width(layout: TextLayout, fields: Sequence[str]) -> list[str]:
    """Make a line of the header as wide as the numbers where a delimiter at the end is all that differs."""
    row = list(fields)
    while len(row) > layout.n_columns and not row[-1]:
        row.pop()
    if len(row) == layout.n_columns - 1:
        row.append("")
    if len(row) != layout.n_columns:
        problem = f"has {layout.n_columns} values where the header has {len(fields)} columns"
        hint = "; a decimal comma needs semicolons or tabs between the columns" if layout.delimiter == "," else ""
        raise FileFormatError(layout.path, problem + hint, where=f"line {layout.n_before + 1}")
    return row


def _read_numbers(layout: TextLayout, names: list[str], indices: list[int]) -> Iterator[FloatArray]:
    """Give blocks of rows; rows that are empty to the last field may only stand at the end."""
    types = dict.fromkeys(dict.fromkeys(indices), pa.float64())
    order = [list(types).index(index) for index in indices]
    n_rows, first_empty = 0, -1
    for batch in read_blocks(layout, names, types):
        block = np.column_stack([batch.column(position).to_numpy(zero_copy_only=False) for position in order])
        is_finite = np.abs(block) < LARGEST
        is_empty = ~is_finite.any(axis=1) & np.isnan(block).all(axis=1)
        if first_empty < 0 and is_empty.any():
            first_empty = n_rows + int(np.argmax(is_empty))
        is_bad = ~is_finite.all(axis=1) & ~is_empty
        if is_bad.any():
            raise not_a_number(layout, names, indices, n_rows + int(np.argmax(is_bad)))
        if first_empty >= 0 and not is_empty[max(first_empty - n_rows, 0) :].all():
            raise not_a_number(layout, names, indices, first_empty)
        n_rows += len(block)
        yield block[~is_empty]
