"""Columns of a table in a text file, in blocks of rows, by pyarrow.csv; faults named by line and column."""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

import pyarrow as pa
import pyarrow.csv as arrow_csv

from frf_ipz.errors import FileFormatError, did_you_mean
from frf_ipz.ingest.formats.text_layout import BOM, decode, is_number, name_and_unit
from frf_ipz.input_files import open_input

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from frf_ipz.ingest.formats.text_layout import TextLayout

BLOCK_BYTES = 1 << 22


def column_index(layout: TextLayout, names: Sequence[str], column: str) -> int:
    """Find a column by its name, with or without the unit in brackets behind it.

    Parameters
    ----------
    layout : TextLayout
        The file's layout, for the message.
    names : sequence of str
        The header.
    column : str
        The name.

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
    if not indices:
        known = [name for name in names if name]
        where = f"line {max(layout.n_before, 1)}"
        raise FileFormatError(layout.path, f"has no column '{column}'; {did_you_mean(column, known)}", where=where)
    if len(indices) > 1:
        raise FileFormatError(layout.path, f"has {len(indices)} columns '{column}'; give each its own name")
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
    try:
        with open_input(layout.path) as stream:
            reader = arrow_csv.open_csv(
                _prepare_stream(stream, layout),
                read_options=arrow_csv.ReadOptions(
                    column_names=keys, skip_rows=layout.n_before, block_size=BLOCK_BYTES, use_threads=False
                ),
                parse_options=arrow_csv.ParseOptions(delimiter=_arrow_delimiter(layout)),
                convert_options=arrow_csv.ConvertOptions(
                    column_types={keys[index]: kind for index, kind in types.items()},
                    include_columns=[keys[index] for index in types],
                    decimal_point=layout.decimal,
                    strings_can_be_null=False,
                ),
            )
            yield from reader
    except pa.ArrowInvalid as error:
        numeric = [index for index, kind in types.items() if pa.types.is_floating(kind)]
        raise _explain_error(layout, names, numeric, str(error)) from None


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
            return _bad_field(layout.path, line, names[index], field)
    return FileFormatError(
        layout.path, "holds a value that is infinite or absurdly large; correct the file", where=f"line {line}"
    )


def _explain_error(layout: TextLayout, names: Sequence[str], numeric: Sequence[int], reason: str) -> FileFormatError:
    """Find the first line that cannot be read, and say what is wrong with it."""
    lines = list(_numbered_rows(layout))
    for number, line in lines:
        fields = layout.split(line)
        if len(fields) != len(names):
            return _bad_length(layout, number, len(fields), len(names), is_last=number == lines[-1][0])
        for index in numeric:
            if fields[index] and not is_number(fields[index]) and not _is_special(fields[index]):
                return _bad_field(layout.path, number, names[index], fields[index])
    return FileFormatError(layout.path, f"cannot be read as a table of numbers: {reason.splitlines()[0]}")


def _bad_length(layout: TextLayout, number: int, length: int, expected: int, *, is_last: bool) -> FileFormatError:
    where = f"line {number}"
    if is_last and length < expected:
        return FileFormatError(
            layout.path,
            f"the last line has {length} of {expected} values: the file is cut off; copy or export it again",
            where=where,
        )
    hint = "; a decimal comma needs semicolons or tabs between the columns" if layout.delimiter == "," else ""
    return FileFormatError(
        layout.path, f"has {length} values where the table has {expected} columns{hint}", where=where
    )


def _bad_field(path: Path, line: int, name: str, field: str) -> FileFormatError:
    content = f"'{field}'" if field else "nothing"
    problem = f"holds {content} where a number is expected; correct the file, or leave it out by [ingest] drop"
    return FileFormatError(path, problem, where=f"line {line}, column '{name}'")


def _is_special(field: str) -> bool:
    return field.lower().lstrip("+-") in {"nan", "inf", "infinity", "null", "n/a", "#n/a"}


def _numbered_rows(layout: TextLayout) -> Iterator[tuple[int, str]]:
    """Give the lines of numbers with their line numbers."""
    number = 0
    with open_input(layout.path) as stream:
        for lines in stream:
            for line in lines.rstrip(b"\r\n").split(b"\r"):
                number += 1
                if number > layout.n_before and line.strip():
                    yield number, decode(line)


def _arrow_delimiter(layout: TextLayout) -> str:
    return "\t" if layout.delimiter == " " else layout.delimiter


def _prepare_stream(stream: BinaryIO, layout: TextLayout) -> BinaryIO | _BlankSeparated:
    if layout.starts_with_bom:
        stream.seek(len(BOM))
    return _BlankSeparated(stream) if layout.delimiter == " " else stream


class _BlankSeparated:
    """A file whose runs of blanks are single tabs, for a reader that knows only single delimiters."""

    closed = False

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._buffer = b""

    def read(self, size: int = -1) -> bytes:
        while size < 0 or len(self._buffer) < size:
            lines = self._stream.readlines(BLOCK_BYTES)
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
