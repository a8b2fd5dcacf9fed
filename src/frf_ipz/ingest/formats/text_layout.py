"""How a text file is laid out: encoding, delimiter, decimal sign, header, row of units, first line of numbers."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain, pairwise
from typing import TYPE_CHECKING, BinaryIO

from frf_ipz import text_numbers
from frf_ipz.errors import FileFormatError
from frf_ipz.ingest.formats.spreadsheet import is_spreadsheet, spreadsheet_text
from frf_ipz.input_files import open_input, read_bytes

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

POINTER = b"version https://git-lfs.github.com/"
HEAD = 1 << 16  # bytes from which the layout is found
LONGEST_HEAD = 1 << 22  # bytes that may stand before the numbers
BOM = b"\xef\xbb\xbf"
EMPTY = "is empty; measure or export it again"
DELIMITERS = (";", "\t", ",", " ")  # in the order they are tried; the blank stands for any run of blanks
NEWLINE = re.compile(rb"\r\n|\n|\r")
TWO_NUMBERS = re.compile(r"\d\s+[+-]?[\d.]")
DECIMAL_COMMA = re.compile(r"^[+-]?\d*,\d+([eEdD][+-]?\d+)?$")
OPENING = {"]": "[", ")": "("}
CLOCK = r"(?:(?P<hours>\d{1,2}):)?(?P<minutes>\d{1,2}):(?P<seconds>\d{1,2})(?:[.,:](?P<fraction>\d+))?"
DATE = r"(?:\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}|\d{1,2}[-/.][^\W\d_]{3,9}\.?[-/.]\d{2,4})"  # 27.03.2025, 27-Mar-2025
STAMP = re.compile(rf"(?:{DATE}[T ,]\s*)?{CLOCK}\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?:Z|UTC|[+-]\d\d:?\d\d)?")
ONLY_DATE = re.compile(DATE)
COMMENT = re.compile(r"^\s*(?:#|%|//)+\s*")
SAMPLE = 250  # lines from which the delimiter is found


@dataclass(frozen=True, slots=True, kw_only=True)
class TextLayout:
    """The layout of a table in a text file.

    Parameters
    ----------
    path : Path
        The file.
    delimiter : str
        Between columns; a blank stands for any run of blanks.
    decimal : str
        Point or comma.
    n_before : int
        Lines before the first line of numbers.
    header : tuple of tuples of str
        Fields of the lines of text before the numbers, without signs of comments; empty lines are left out.
    header_lines : tuple of int
        The lines of the file that they stand in, from 1.
    rows : tuple of tuples of str
        Fields of the first lines of numbers.
    n_columns : int
        Fields of the first line of numbers.
    start, stop : int
        Bytes at which the numbers begin and end; text behind them is no part of the table.
    """

    path: Path
    delimiter: str
    decimal: str
    n_before: int
    header: tuple[tuple[str, ...], ...]
    header_lines: tuple[int, ...]
    rows: tuple[tuple[str, ...], ...]
    n_columns: int
    start: int
    stop: int

    def split(self, line: str) -> list[str]:
        """Split a line into its fields.

        Parameters
        ----------
        line : str
            A line of the file.

        Returns
        -------
        list of str
            Fields without quotes and blanks around them.
        """
        return split_line(line, self.delimiter)


def sniff(path: Path, *, skip_rows: int = 0, header_row: int | None = None) -> TextLayout:
    """Find out how a table in a text file is laid out.

    Parameters
    ----------
    path : Path
        The file.
    skip_rows : int
        Lines at the start to skip.
    header_row : int, optional
        The line that names the columns, from 1, where it is known: lines of numbers above it are none of the table.

    Returns
    -------
    TextLayout
        The layout.

    Raises
    ------
    FileFormatError
        If the file is missing, empty, no text, or holds no line of numbers.
    """
    with open_text(path) as stream:
        for size in (HEAD, LONGEST_HEAD):
            stream.seek(0)
            head = stream.read(size)
            _check_text(path, head)
            if len(head) == size:
                head = head[: max(head.rfind(b"\n"), head.rfind(b"\r")) + 1]
            offsets, lines = _split_lines(head)
            kept = [index for index, line in enumerate(lines) if line.strip() and index >= skip_rows]
            delimiter = _find_delimiter([lines[index] for index in kept[:SAMPLE] + kept[SAMPLE:][-SAMPLE:]])
            split = {index: split_line(lines[index], delimiter) for index in kept}
            first = _first_row(_below_header(kept, split, header_row), split)
            if first is not None:
                break
        else:
            raise FileFormatError(path, "holds no line that begins with a number; expected is a table of numbers")
        stop = _find_stop(stream, offsets[first], delimiter, len(split[first]))
    header = [index for index in kept if index < first]
    rows = [split[index] for index in kept if index >= first and offsets[index] < stop]
    has_commas = delimiter != "," and any(DECIMAL_COMMA.match(field) for fields in rows for field in fields)
    return TextLayout(
        path=path,
        delimiter=delimiter,
        decimal="," if has_commas else ".",
        n_before=first,
        header=tuple(tuple(split_line(COMMENT.sub("", lines[index]), delimiter)) for index in header),
        header_lines=tuple(index + 1 for index in header),
        rows=tuple(map(tuple, rows[:SAMPLE])),
        n_columns=len(split[first]),
        start=offsets[first],
        stop=stop,
    )


@contextmanager
def open_text(path: Path) -> Iterator[BinaryIO]:
    """Open a text file as bytes in UTF-8 or Latin-1: from its first letter; UTF-16 and spreadsheets brought to UTF-8.

    Parameters
    ----------
    path : Path
        The file.

    Yields
    ------
    BinaryIO
        Can be moved in.
    """
    with open_input(path) as stream:
        head = stream.read(HEAD)
        encoding = _wide_encoding(head[:4])
        if not encoding and not is_spreadsheet(head):
            stream.seek(0)
            yield stream
            return
    if not encoding:
        yield io.BytesIO(spreadsheet_text(path, read_bytes(path)))
        return
    try:
        text = read_bytes(path).decode(encoding).removeprefix("\ufeff")
    except UnicodeDecodeError:
        raise FileFormatError(path, "begins as text in UTF-16 but is none; export it as CSV") from None
    yield io.BytesIO(text.encode())


def _wide_encoding(mark: bytes) -> str:
    if mark.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16-le" if mark.startswith(codecs.BOM_UTF16_LE) else "utf-16-be"
    zeros = "".join("0" if byte == 0 else "x" for byte in mark)  # of letters of ASCII
    return {"x0x0": "utf-16-le", "0x0x": "utf-16-be"}.get(zeros, "")


def read_head(path: Path) -> bytes:
    """Read the first bytes of a file; of a spreadsheet, those of its text.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    bytes
        At most 64 KiB.

    Raises
    ------
    FileFormatError
        If there is no such file, it cannot be read, is empty, or stands for a file that was not fetched.
    """
    with open_input(path) as stream:
        head = stream.read(HEAD)
    if not head.strip():
        raise FileFormatError(path, EMPTY)
    if head.startswith(POINTER):
        raise FileFormatError(path, "is a pointer of Git LFS and not the file itself; run: git lfs pull")
    return spreadsheet_text(path, read_bytes(path))[:HEAD] if is_spreadsheet(head) else head


def decode(data: bytes) -> str:
    """Read bytes as text: UTF-8, else Latin-1, in which any bytes are text.

    Parameters
    ----------
    data : bytes
        Whole lines.

    Returns
    -------
    str
        The text.
    """
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def is_stamp(field: str) -> bool:
    """Tell whether a field is a time of day, with a date or without.

    Parameters
    ----------
    field : str
        Text without blanks around it.

    Returns
    -------
    bool
        True for ``27/03/2025 10:51:13,497``, ``2025-03-27T10:51:13.497Z``, ``10:51:13`` and the like.
    """
    return STAMP.fullmatch(field) is not None


def is_number(field: str) -> bool:
    """Tell whether a field is a number, with a decimal point or comma.

    Parameters
    ----------
    field : str
        Text without blanks around it.

    Returns
    -------
    bool
        True for a number.
    """
    return text_numbers.is_number(field) or text_numbers.is_number(field, decimal=",")


def split_line(line: str, delimiter: str) -> list[str]:
    """Split a line into its fields.

    Parameters
    ----------
    line : str
        A line.
    delimiter : str
        A blank stands for any run of blanks.

    Returns
    -------
    list of str
        Fields without quotes and blanks around them; at least one.
    """
    if delimiter == " ":
        return [field.strip('"') for field in line.split()] or [""]
    line = line.replace("\r", " ")
    fields = next(csv.reader([line], delimiter=delimiter), []) if '"' in line else line.split(delimiter)
    return [field.strip() for field in fields] or [""]


def name_and_unit(text: str) -> tuple[str, str]:
    """Take the unit in brackets off a column's name.

    Parameters
    ----------
    text : str
        Such as ``force [N]``.

    Returns
    -------
    name, unit : str
        The unit is empty where there is none.

    Examples
    --------
    >>> name_and_unit("force [N]"), name_and_unit("Real [(m/s^2)/N]")
    (('force', 'N'), ('Real', '(m/s^2)/N'))
    """
    closing = text[-1:]
    if closing not in OPENING:
        return text, ""
    depth = 0
    for place in range(len(text) - 1, 0, -1):
        depth += (text[place] == closing) - (text[place] == OPENING[closing])
        if depth == 0:
            name = text[:place].rstrip()
            return (name, text[place + 1 : -1].strip()) if name else (text, "")
    return text, ""


def _check_text(path: Path, head: bytes) -> None:
    if not head.strip(b" \t\r\n" + BOM):
        raise FileFormatError(path, EMPTY)
    if b"\0" in head:
        raise FileFormatError(path, "is no text in UTF-8, UTF-16 or Latin-1 (it holds zero bytes); export it as CSV")


def _split_lines(data: bytes) -> tuple[list[int], list[str]]:
    """Give the byte that each line begins at, and its text."""
    begins = len(BOM) if data.startswith(BOM) else 0
    text = data.decode("ascii") if data.isascii() else None  # the whole of it is faster than line by line
    offsets, lines = [], []
    for match in NEWLINE.finditer(data, begins):
        offsets.append(begins)
        lines.append(decode(data[begins : match.start()]) if text is None else text[begins : match.start()])
        begins = match.end()
    if begins < len(data):
        offsets.append(begins)
        lines.append(decode(data[begins:]) if text is None else text[begins:])
    return offsets, lines


def _begins_row(field: str) -> bool:
    return is_number(field) or is_stamp(field) or ONLY_DATE.fullmatch(field) is not None


def _is_entry(field: str) -> bool:
    return _begins_row(field) or text_numbers.is_not_finite(field)


def _below_header(kept: Sequence[int], split: dict[int, list[str]], header_row: int | None) -> Sequence[int]:
    """Keep the lines below the one that names the columns; all where that is a line of numbers, or the last one."""
    if header_row is None or header_row - 1 not in split or _begins_row(split[header_row - 1][0]):
        return kept
    return [index for index in kept if index >= header_row] or kept


def _first_row(kept: Sequence[int], split: dict[int, list[str]]) -> int | None:
    """Find the first line of numbers: the next one begins with a number and has as many fields.

    A line above it that begins with a number, but has fewer numbers and text below it, is one of the text. So is a
    table of as many columns that nothing names, above a longer one that has names.
    """
    begins = [index for index in kept if _begins_row(split[index][0])]
    widths = Counter(len(split[index]) for index in begins)
    usual = max(widths, key=lambda width: widths[width], default=0)
    numbers = {index: sum(map(_is_entry, split[index])) for index in begins if len(split[index]) == usual}
    counts = Counter(numbers.values())
    most = max(counts, key=lambda count: counts[count], default=0)
    rows = [index for index in numbers if numbers[index] >= most]
    whole = _first_of_table(kept, split, rows)
    text = max((index for index in kept if index < whole and index not in numbers), default=-1)
    begins = [index for index in begins if index > text]
    begins = [index for index in begins if len(split[index]) == usual]
    following = {index: split.get(after) for index, after in pairwise([*kept, -1])}
    goes_on = (index for index in begins if _begins_as_row(following[index]))
    holds_numbers = (index for index in begins if any(map(_begins_row, following[index] or ["0"])))
    return next(chain(goes_on, holds_numbers, begins), None)


def _first_of_table(kept: Sequence[int], split: dict[int, list[str]], rows: Sequence[int]) -> int:
    """Give the first of some lines of numbers, but below the names of the longest run of them where they have names."""
    places = {index: place for place, index in enumerate(kept)}
    runs: list[list[int]] = []
    for index in rows:
        if runs and places[index] == places[runs[-1][-1]] + 1:
            runs[-1].append(index)
        else:
            runs.append([index])
    if not runs:
        return -1
    above = {kept[place]: split[kept[place - 1]] for place in range(1, len(kept))}
    named = next((run for run in runs if _are_names(above.get(run[0], []), len(split[run[0]]))), None)
    is_longest = named is not None and all(len(run) < len(named) for run in runs if run[0] < named[0])
    return named[0] if named is not None and is_longest else rows[0]


def _are_names(fields: Sequence[str], n_columns: int) -> bool:
    """Tell a line that names columns: as many texts with letters, no two alike."""
    with_letters = {field for field in fields if any(map(str.isalpha, field)) and not _is_entry(field)}
    return len(fields) == len(with_letters) == n_columns > 1


def _begins_as_row(fields: list[str] | None) -> bool:
    """Tell a line of numbers, the first of which may be missing, and the end of the file, from text with numbers."""
    return fields is None or not fields[0] or _is_entry(fields[0])


def _find_stop(stream: BinaryIO, start: int, delimiter: str, n_columns: int) -> int:
    """Find where the numbers end: behind the last line that is none of text alone."""
    size = stream.seek(0, io.SEEK_END)
    length = HEAD
    while True:
        offset = max(start, size - length)
        stream.seek(offset)
        tail = stream.read()
        offsets, lines = _split_lines(tail)
        whole = range(0 if offset == start else 1, len(lines))
        for index in reversed(whole):
            if lines[index].strip() and not _is_footer(split_line(lines[index], delimiter), n_columns):
                return size if index == len(lines) - 1 else offset + offsets[index + 1]
        if offset == start:
            return size
        length *= 4


def _is_footer(fields: Sequence[str], n_columns: int) -> bool:
    """Tell a line of text below the table from a line of numbers that has a fault."""
    first = fields[0]
    if _begins_row(first) or text_numbers.is_not_finite(first):
        return False
    if len(fields) == n_columns and any(map(is_number, fields[1:])):
        return not any(letter.isdigit() for letter in first)
    return True


def _find_delimiter(lines: Sequence[str]) -> str:
    """Take the first delimiter that splits most lines of numbers sensibly."""
    for delimiter in DELIMITERS:
        split = [split_line(line, delimiter) for line in lines]
        numeric = [fields for fields in split if _begins_row(fields[0])]
        sensible = [fields for fields in numeric if len(fields) > 1 and not any(map(_is_crowded, fields))]
        if len(sensible) > len(lines) // 2 or (sensible and len(sensible) == len(numeric)):
            return delimiter
    return ","


def _is_crowded(field: str) -> bool:
    return TWO_NUMBERS.search(field) is not None and not is_stamp(field)
