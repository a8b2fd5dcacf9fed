"""Data sets of universal files (UFF) that are text, as lines with their numbers.

What the records hold: Universal File Datasets Summary, Structural Dynamics Research Laboratory, University of
Cincinnati.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from frf_ipz.errors import FileFormatError
from frf_ipz.input_files import read_bytes
from frf_ipz.text_numbers import NumberError, parse_numbers

if TYPE_CHECKING:
    from collections.abc import Collection
    from pathlib import Path

END = "-1"  # alone on its line: a data set begins or ends
UNOPENED = "a data set {} begins without the line of -1 above it; put it there, or export the file again"
LARGEST = 999_999_999  # integer of a field of ten columns


def is_universal(head: bytes) -> bool:
    """Tell whether a file is a universal file.

    Parameters
    ----------
    head : bytes
        Its first bytes.

    Returns
    -------
    bool
        True if its first line that is not empty is ``-1`` and its second a number of a data set.
    """
    lines = head.lstrip(b"\r\n \t").replace(b"\r", b"\n").split(b"\n", 3)
    lines = [line.strip() for line in lines if line.strip()]
    return len(lines) > 1 and lines[0] == b"-1" and lines[1][:1].isdigit()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DataSet:
    """Lines of one data set.

    Parameters
    ----------
    path : Path
        The file, for messages.
    lines : list of str
        All lines of the file.
    kind : str
        Number of the kind of data set.
    first, end : int
        The first line behind that number, and the one behind the last; from 0.
    advice : str
        What to do where it is damaged.
    """

    path: Path
    lines: list[str]
    kind: str
    first: int
    end: int
    advice: str

    def numbers(self, line: int, width: int, count: int, what: str) -> list[float]:
        """Read numbers by the blanks between them, or by columns where they touch.

        Parameters
        ----------
        line : int
            Which line, from 0.
        width : int
            Of a column.
        count : int
            How many there are at least.
        what : str
            Names them, for messages.

        Returns
        -------
        list of float
            All of the line.

        Raises
        ------
        FileFormatError
            If there are fewer.
        """
        text = self.lines[line] if line < self.end else ""
        for fields in (text.split(), [text[at : at + width] for at in range(0, len(text.rstrip()), width)]):
            try:
                values = parse_numbers([field.strip() for field in fields])
            except NumberError:
                continue
            if len(values) >= count:
                return [float(value) for value in values]
        problem = f"{what} should stand there, {count} numbers at least; the file is cut off, or none"
        raise self.fault(problem, line)

    def integers(self, line: int, width: int, count: int, what: str) -> list[int]:
        """Read integers of at most nine digits.

        Parameters
        ----------
        line, width, count, what
            As `numbers` takes them.

        Returns
        -------
        list of int
            As many as `count`.

        Raises
        ------
        FileFormatError
            If there are fewer, or others.
        """
        values = self.numbers(line, width, count, what)
        if any(value != round(value) or abs(value) > LARGEST for value in values[:count]):
            raise self.fault(f"{what} should stand there, as integers", line)
        return [round(value) for value in values[:count]]

    def fault(self, problem: str, line: int) -> FileFormatError:
        """Make an error that names a line.

        Parameters
        ----------
        problem : str
            What is wrong.
        line : int
            Which line, from 0.

        Returns
        -------
        FileFormatError
            With the advice.
        """
        return FileFormatError(self.path, f"{problem}; {self.advice}", where=f"line {min(line, self.end - 1) + 1}")


def read_data_sets(path: Path, kinds: Collection[str], *, advice: str) -> list[DataSet]:
    """Find the data sets of some kinds.

    Parameters
    ----------
    path : Path
        A universal file.
    kinds : collection of str
        Their numbers.
    advice : str
        What to do where one is damaged.

    Returns
    -------
    list of DataSet
        In their order.

    Raises
    ------
    FileFormatError
        If one begins without its mark.
    """
    lines = read_bytes(path).decode("latin-1").splitlines()
    marks = [number for number, line in enumerate(lines) if line.strip() == END]
    for end, begin in zip(marks[1::2], [*marks[2::2], len(lines)], strict=False):
        unopened = next((number for number in range(end + 1, begin) if lines[number].strip() in kinds), None)
        if unopened is not None:
            raise FileFormatError(path, UNOPENED.format(lines[unopened].strip()), where=f"line {unopened + 1}")
    return [
        DataSet(path=path, lines=lines, kind=kind, first=begin + 2, end=end, advice=advice)
        for begin, end in zip(marks[::2], [*marks[1::2], len(lines)], strict=False)
        if begin + 1 < len(lines) and (kind := lines[begin + 1].strip()) in kinds
    ]
