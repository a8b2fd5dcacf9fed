"""Columns of a table in a text file, in blocks of rows, by pyarrow.csv; faults named by line and column."""

from __future__ import annotations

import re
import time
import weakref
from contextlib import contextmanager
from itertools import islice
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from frf_ipz.errors import FileFormatError, did_you_mean
from frf_ipz.ingest.formats.text_layout import NEWLINE, decode, is_number, name_and_unit, open_text
from frf_ipz.late_imports import import_late
from frf_ipz.text_numbers import NumberError, parse_number
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    import pyarrow as pa
    import pyarrow.csv as arrow_csv

    from frf_ipz.arrays import FloatArray, IntArray
    from frf_ipz.ingest.formats.text_layout import TextLayout
else:
    pa = import_late("pyarrow")
    arrow_csv = import_late("pyarrow.csv")

CONTROL = re.compile("[\x80-\x9f]")  # in no name: bytes of another encoding that were taken for Latin-1
BLOCK_BYTES = 1 << 22
LINES_AT_ONCE = 10_000
LET_GO_S, PAUSE_S = 1.0, 1e-4  # at most, for threads of pyarrow to drop what they have read; between two looks


def column_index(layout: TextLayout, names: Sequence[str], column: str, *, key: str = "column") -> int:
    """Find a column by its name, with or without the unit in brackets behind it.

    Parameters
    ----------
    layout : TextLayout
        The file's layout, for the message.
    names : sequence of str
        The header.
    column : str
        The name.
    key : str
        Of the test that names it.

    Returns
    -------
    int
        Its index.

    Raises
    ------
    FileFormatError
        If there is no such column, or more than one.
    """
    bare_names = [name_and_unit(name)[0] for name in names]
    indices = [index for index, name in enumerate(names) if name == column]
    indices = indices or [index for index, name in enumerate(bare_names) if name == column]
    if not indices and column.isascii() and column.isdigit() and 1 <= int(column[:9]) <= len(names):
        indices = [int(column) - 1]
    if not indices:
        known = [name for name in names if name]
        where, asked = f"line {max(layout.n_before, 1)}", "" if key == "column" else f", which {key} names"
        lacks = f"has no column '{column}'{asked}"
        if CONTROL.search("".join(known)):
            problem = f"{lacks}, and its names are not in UTF-8; save it as UTF-8, or write the number"
            raise FileFormatError(layout.path, f"{problem} of the column, as in {key} = 2", where=where)
        raise FileFormatError(layout.path, f"{lacks}; {did_you_mean(column, known)}", where=where)
    if len(indices) > 1:
        raise FileFormatError(
            layout.path,
            f"has {len(indices)} columns '{column}'; give each its own name, or write the column's number, as in "
            f"{key} = {indices[0] + 1}",
        )
    return indices[0]


def read_blocks(layout: TextLayout, names: Sequence[str], types: dict[int, pa.DataType]) -> Iterator[pa.RecordBatch]:
    """Read some columns, block by block.

    Parameters
    ----------
    layout : TextLayout
        The file's layout.
    names : sequence of str
        Names of all its columns, for messages.
    types : dict of int to DataType
        Index and type of the columns to read, in the order to give them.

    Yields
    ------
    RecordBatch
        Those columns; empty fields and NaN are null.

    Raises
    ------
    FileFormatError
        If a line has too many or too few fields, or text where a number is expected.
    """
    keys = [f"{index}" for index in range(len(names))]
    n_rows = 0
    try:
        with open_text(layout.path) as stream, _let_go_of(_rows_only(stream, layout)) as rows:
            reader = arrow_csv.open_csv(
                rows.pop(),
                read_options=arrow_csv.ReadOptions(column_names=keys, block_size=BLOCK_BYTES, use_threads=False),
                parse_options=arrow_csv.ParseOptions(delimiter=_arrow_delimiter(layout)),
                convert_options=arrow_csv.ConvertOptions(
                    column_types={keys[index]: kind for index, kind in types.items()},
                    include_columns=[keys[index] for index in types],
                    decimal_point=layout.decimal,
                    strings_can_be_null=False,
                ),
            )
            try:
                for batch in reader:
                    yield batch
                    n_rows += len(batch)
            finally:
                del reader
    except pa.ArrowInvalid:
        yield from _read_line_by_line(layout, names, types, n_rows)


@contextmanager
def _let_go_of(stream: _Part | _BlankSeparated) -> Iterator[list[_Part | _BlankSeparated]]:
    """Lend a stream to pyarrow, whose threads may drop it a little later than the reader.

    Where Python ends in between, the process is aborted, and its exit status with it (apache/arrow, issue 34314).
    """
    held, lent = weakref.ref(stream), [stream]
    del stream
    try:
        yield lent
    finally:
        lent.clear()
        latest = time.monotonic() + LET_GO_S
        while held() is not None and time.monotonic() < latest:
            time.sleep(PAUSE_S)


def _read_line_by_line(
    layout: TextLayout, names: Sequence[str], types: dict[int, pa.DataType], skip: int
) -> Iterator[pa.RecordBatch]:
    """Read numbers that pyarrow does not know, as those with D exponents, or say which line is wrong."""
    lines = list(_numbered_rows(layout))
    columns: dict[int, list[float | str]] = {index: [] for index in types}
    for number, line in lines[skip:]:
        fields = layout.split(line)
        if len(fields) != len(names):
            raise _bad_length(layout, number, len(fields), len(names), is_last=number == lines[-1][0])
        for index, kind in types.items():
            text = fields[index]
            if not pa.types.is_floating(kind):
                columns[index].append(text)
                continue
            try:
                columns[index].append(parse_number(text, decimal=layout.decimal, finite=False))
            except NumberError as error:
                raise _bad_field(layout.path, number, names[index], str(error)) from None
    arrays = [pa.array(columns[index], type=kind, from_pandas=True) for index, kind in types.items()]
    yield pa.RecordBatch.from_arrays(arrays, names=[f"{index}" for index in types])


def line_of_row(layout: TextLayout, row: int) -> int:
    """Return the line of the file that a row of numbers stands in.

    Parameters
    ----------
    layout : TextLayout
        The file's layout.
    row : int
        Row, from 0; empty lines do not count.

    Returns
    -------
    int
        Line, from 1.
    """
    for count, (number, _) in enumerate(_numbered_rows(layout)):
        if count == row:
            return number
    return 0


def not_a_number(layout: TextLayout, names: Sequence[str], numeric: Sequence[int], row: int) -> FileFormatError:
    """Make the error for a row that holds an empty field, NaN or infinity.

    Parameters
    ----------
    layout : TextLayout
        The file's layout.
    names : sequence of str
        Names of all columns.
    numeric : sequence of int
        Indices of the columns that must be numbers.
    row : int
        The row.

    Returns
    -------
    FileFormatError
        Names line, column and content.
    """
    line = line_of_row(layout, row)
    fields = next((layout.split(text) for number, text in _numbered_rows(layout) if number == line), [])
    for index in numeric:
        field = fields[index] if index < len(fields) else ""
        if not is_number(field):
            content = f"'{field}'" if field else "nothing"
            problem = f"holds {content} where a number is expected; correct the file"
            return _bad_field(layout.path, line, names[index], problem)
    return FileFormatError(
        layout.path, "holds a value that is infinite or absurdly large; correct the file", where=f"line {line}"
    )


def require_once(layout: TextLayout, name: str, values: FloatArray, rows: Sequence[int] | IntArray, owner: str) -> None:
    """Refuse a value that stands in two rows.

    Parameters
    ----------
    layout : TextLayout
        The file's layout.
    name : str
        Of the column.
    values : (n,) array
        Its values in some rows.
    rows : (n,) sequence of int
        The rows.
    owner : str
        What may have each value once, for the message.

    Raises
    ------
    FileFormatError
        If one comes again; names both lines.
    """
    order = np.argsort(values, kind="stable")
    again = np.flatnonzero(np.diff(values[order]) == 0.0)
    if again.size:
        first, second = (line_of_row(layout, int(rows[order[again[0] + place]])) for place in (0, 1))
        problem = f"has {values[order[again[0]]]:g} of {owner} a second time, after line {first}; take one of them out"
        raise FileFormatError(layout.path, problem, where=f"line {second}, column '{name}'")


def _bad_length(layout: TextLayout, number: int, length: int, expected: int, *, is_last: bool) -> FileFormatError:
    where = f"line {number}"
    if is_last and length < expected:
        return FileFormatError(
            layout.path,
            f"the last line has {length} of {counted(expected, 'value')}: the file is cut off; copy or export it again",
            where=where,
        )
    hint = "; a decimal comma needs semicolons or tabs between the columns" if layout.delimiter == "," else ""
    return FileFormatError(
        layout.path,
        f"has {counted(length, 'value')} where the table has {counted(expected, 'column')}{hint}",
        where=where,
    )


def _bad_field(path: Path, line: int, name: str, problem: str) -> FileFormatError:
    return FileFormatError(path, f"{problem}, or leave the file out of the test", where=f"line {line}, column '{name}'")


def _numbered_rows(layout: TextLayout) -> Iterator[tuple[int, str]]:
    """Give the lines of numbers with their line numbers."""
    number = layout.n_before
    with open_text(layout.path) as stream:
        for data in _Part(stream, layout).lines():
            number += 1
            if data.strip():
                yield number, decode(data)


def _arrow_delimiter(layout: TextLayout) -> str:
    return "\t" if layout.delimiter == " " else layout.delimiter


def _rows_only(stream: BinaryIO, layout: TextLayout) -> _Part | _BlankSeparated:
    part = _Part(stream, layout)
    return _BlankSeparated(part) if layout.delimiter == " " else part


class _Part:
    """The part of a file that holds the numbers."""

    closed = False

    def __init__(self, stream: BinaryIO, layout: TextLayout) -> None:
        self._stream = stream
        self._left = layout.stop - layout.start
        stream.seek(layout.start)

    def read(self, size: int = -1) -> bytes:
        data = self._stream.read(self._left if size < 0 else min(size, self._left))
        self._left -= len(data)
        return data

    def lines(self) -> Iterator[bytes]:
        rest = b""
        while data := self.read(BLOCK_BYTES):
            if data.endswith(b"\r"):  # its LF may follow
                data += self.read(1)
            *lines, rest = NEWLINE.split(rest + data)
            yield from lines
        if rest:
            yield rest

    def readable(self) -> bool:
        return True

    def close(self) -> None:
        self.closed = True


class _BlankSeparated:
    """Rows whose runs of blanks are single tabs, for a reader that knows only single delimiters."""

    closed = False

    def __init__(self, part: _Part) -> None:
        self._lines = part.lines()
        self._buffer = b""

    def read(self, size: int = -1) -> bytes:
        while size < 0 or len(self._buffer) < size:
            lines = list(islice(self._lines, LINES_AT_ONCE))
            if not lines:
                break
            self._buffer += b"".join(b"\t".join(line.split()) + b"\n" for line in lines)
        size = len(self._buffer) if size < 0 else size
        result, self._buffer = self._buffer[:size], self._buffer[size:]
        return result

    def readable(self) -> bool:
        return True

    def close(self) -> None:
        self.closed = True
