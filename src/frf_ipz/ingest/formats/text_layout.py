"""How a text file is laid out: encoding, delimiter, decimal sign, header, row of units, first line of numbers."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from frf_ipz.errors import FileFormatError
from frf_ipz.input_files import open_input

if TYPE_CHECKING:
    from pathlib import Path

HEAD = 1 << 16  # bytes from which the layout is found
BOM = b"\xef\xbb\xbf"
EMPTY = "is empty; measure or export it again"
DELIMITERS = (";", "\t", ",", " ")  # in the order they are tried; the blank stands for any run of blanks
NUMBER = re.compile(r"^[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?$")
NEWLINE = re.compile(r"\r\n|\n|\r")  # str.splitlines breaks at more
TWO_NUMBERS = re.compile(r"\d\s+[+-]?[\d.]")
DECIMAL_COMMA = re.compile(r"^[+-]?\d*,\d+([eE][+-]?\d+)?$")
NAME_AND_UNIT = re.compile(r"^(?P<name>.+?)\s*[\[(](?P<unit>[^\])]*)[\])]$")
MAX_HEADER = 200  # lines
SAMPLE = MAX_HEADER + 50  # lines from which the delimiter is found


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
        Fields of the lines of text before the numbers.
    n_columns : int
        Fields of the first line of numbers.
    starts_with_bom : bool
        UTF-8 byte order mark.
    """

    path: Path
    delimiter: str
    decimal: str
    n_before: int
    header: tuple[tuple[str, ...], ...]
    n_columns: int
    starts_with_bom: bool

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


def sniff(path: Path, *, skip_rows: int = 0) -> TextLayout:
    """Find out how a table in a text file is laid out.

    Parameters
    ----------
    path : Path
        The file.
    skip_rows : int
        Lines at the start to skip.

    Returns
    -------
    TextLayout
        The layout.

    Raises
    ------
    FileFormatError
        If the file is missing, empty, no text, or holds no line of numbers.
    """
    head = read_head(path)
    _check_text(path, head)
    whole_lines = head[: head.rfind(b"\n") + 1] if len(head) == HEAD else head
    lines = NEWLINE.split(decode(whole_lines.removeprefix(BOM)))
    rows = [(index, line) for index, line in enumerate(lines) if line.strip() and index >= skip_rows]
    delimiter = _find_delimiter([line for _, line in rows[:SAMPLE]])
    first = next((index for index, line in rows if is_number(split_line(line, delimiter)[0])), None)
    if first is None or first > MAX_HEADER + skip_rows:
        raise FileFormatError(path, "holds no line that begins with a number; expected is a table of numbers")
    header = tuple(tuple(split_line(line, delimiter)) for index, line in rows if index < first)
    fields = split_line(lines[first], delimiter)
    has_commas = delimiter != "," and any(
        DECIMAL_COMMA.match(field) for _, line in rows[:50] for field in split_line(line, delimiter)
    )
    return TextLayout(
        path=path,
        delimiter=delimiter,
        decimal="," if has_commas else ".",
        n_before=first,
        header=header,
        n_columns=len(fields),
        starts_with_bom=head.startswith(BOM),
    )


def read_head(path: Path) -> bytes:
    """Read the first bytes of a file.

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
        If there is no such file, it cannot be read, or is empty.
    """
    with open_input(path) as stream:
        head = stream.read(HEAD)
    if not head.strip():
        raise FileFormatError(path, EMPTY)
    return head


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
    return NUMBER.match(field) is not None


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
    fields = next(csv.reader([line.replace("\r", " ")], delimiter=delimiter), [])
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
    >>> name_and_unit("force [N]")
    ('force', 'N')
    """
    match = NAME_AND_UNIT.match(text)
    return (match["name"], match["unit"].strip()) if match else (text, "")


def _check_text(path: Path, head: bytes) -> None:
    if not head.strip(b" \t\r\n" + BOM):
        raise FileFormatError(path, EMPTY)
    if b"\0" in head:
        raise FileFormatError(path, "is no text in UTF-8 or Latin-1 (it holds zero bytes); export it as CSV")


def _find_delimiter(lines: list[str]) -> str:
    """Take the first delimiter that splits most lines of numbers sensibly."""
    for delimiter in DELIMITERS:
        split = [split_line(line, delimiter) for line in lines]
        numeric = [fields for fields in split if is_number(fields[0])]
        sensible = [fields for fields in numeric if len(fields) > 1 and not any(map(TWO_NUMBERS.search, fields))]
        if len(sensible) > len(lines) // 2 or (sensible and len(sensible) == len(numeric)):
            return delimiter
    return ","
