"""What the columns of a recording in a text file are: their names and units, and which one is the time.

The one answer to this for `init`, `check` and `run`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import FileFormatError, errors_of_file
from frf_ipz.ingest.formats.column_words import FREQUENCY, TIME, frf_role
from frf_ipz.ingest.formats.text_layout import DELIMITERS, STAMP, is_number, is_stamp, name_and_unit, split_line
from frf_ipz.ingest.formats.text_table import column_index
from frf_ipz.ingest.formats.time_stamps import DAY_S, unit_of_stamps
from frf_ipz.ingest.units import is_unit
from frf_ipz.text_numbers import NumberError, parse_number
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.formats.recording import TableKeys
    from frf_ipz.ingest.formats.text_layout import TextLayout

OTHER_HEADER = "; where another line names the columns, write header_row = ... under [test]"
EVEN = 0.02  # of the step between printed times: twice what the contract allows, since digits are rounded
LETTERS_SHOWN, NAMES_SHOWN = 40, 10  # of names of columns, in a message
FEWEST_ROWS = 3  # two steps can be compared
TIME_UNIT = re.compile(
    r"(?:^|[ _/.,])(s|sec|secs|seconds?|ms|msec|millis|milliseconds?|us|µs|micros|microseconds?|ns|min|h|hours?|d|"
    r"days?)$",
    re.IGNORECASE,
)
PRINTED = re.compile(r"[-+]?[0-9]*(?:[.,]([0-9]*))?(?:[eEdD]([-+]?[0-9]{1,3}))?")
ENCODINGS = (  # of names that are not in UTF-8, beside Latin-1: of Windows, of DOS, of Macs
    *("cp1252", "cp932", "gb18030", "cp950", "cp949", "euc_jp", "cp1250", "cp1251", "cp1253", "cp1254", "cp1255"),
    *("cp437", "cp850", "cp852", "cp866", "koi8_r", "mac_roman"),
)
NUMBER_WITH_UNIT = re.compile(r"([-+]?[0-9.,]+(?:[eE][-+]?[0-9]+)?) ?([^\W\d].*)")
REMARK = re.compile(r"comments?|kommentare?|remarks?", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class TextColumns:
    """The columns of a recording.

    Parameters
    ----------
    names, units : tuple of str
        Of each column; a unit is empty where the file states none.
    time : int, optional
        Which one is the time; None where there is none, and the rate has to be stated.
    counts_samples : bool
        The first column counts the samples.
    holds_stamps : bool
        The time is a time of day.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    time: int | None
    counts_samples: bool
    holds_stamps: bool


def find_columns(layout: TextLayout, keys: TableKeys, *, columns: Sequence[str] = ()) -> TextColumns:
    """Find out what the columns of a recording are.

    Parameters
    ----------
    layout : TextLayout
        How the file is laid out.
    keys : TableKeys
        What the test says about it.
    columns : sequence of str
        Names that are looked for; they tell the header from other lines of text.

    Returns
    -------
    TextColumns
        Their names, units, and the time.

    Raises
    ------
    FileFormatError
        If the header does not fit the numbers, or the column of the time is not there.
    """
    layout = _in_encoding_of(layout, columns)
    names, units = _read_header(layout, keys.header_row, columns)
    taken = {index for index, name in enumerate(names) if name in columns or name_and_unit(name)[0] in columns}
    counts_samples = _counts_samples(layout, names, units, 0) and 0 not in taken
    if keys.time_column:
        time: int | None = column_index(layout, names, keys.time_column, key="time_column")
    else:
        time = _find_time(layout, names, units, taken, counts_samples=counts_samples)
    holds_stamps = time is not None and is_stamp(layout.rows[0][time])
    if time is not None:
        stated = "s" if holds_stamps else units[time] or _unit_of_time(names[time])
        with errors_of_file(layout.path, where=f"column '{names[time]}'"):
            units[time] = stated or unit_of_stamps(_column(layout, time), keys.sample_rate_hz)
    return TextColumns(
        names=tuple(names), units=tuple(units), time=time, counts_samples=counts_samples, holds_stamps=holds_stamps
    )


def no_time(layout: TextLayout, found: TextColumns) -> FileFormatError:
    """Make the error for a file without a column of time.

    Parameters
    ----------
    layout : TextLayout
        How the file is laid out.
    found : TextColumns
        Its columns.

    Returns
    -------
    FileFormatError
        Says what to write.
    """
    first_name, *_ = names = [name[:LETTERS_SHOWN] for name in found.names]
    listed = [f"'{name}'" for name in names if name]
    shown = ", ".join([*listed[:NAMES_SHOWN], *(["..."] if len(listed) > NAMES_SHOWN else [])])
    first = f"the first column '{first_name}'" if first_name else "the first column"
    behaves = "counts the samples" if found.counts_samples else "does not grow by equal steps"
    if not _is_time_unit(found.units[0]):
        behaves = f"is in '{found.units[0]}'"
    problem = (
        f"has no column 'time', and {first} {behaves}; write sample_rate_hz = ... under [test], or time_column = ... "
        f"where another one is the time: {shown}"
    )
    return FileFormatError(layout.path, problem, where=f"line {max(layout.n_before, 1)}")


def printed_resolution(layout: TextLayout, index: int) -> float:
    """Say how finely the numbers of a column are given.

    Parameters
    ----------
    layout : TextLayout
        How the file is laid out.
    index : int
        The column.

    Returns
    -------
    float
        The last digit that is printed, or the distance to the next double where that is larger.
    """
    printed = [PRINTED.fullmatch(fields[index].strip()) for fields in layout.rows if index < len(fields)]
    last_digit = min((int(match[2] or 0) - len(match[1] or "") for match in printed if match), default=0)
    return max(float(f"1e{last_digit}"), float(np.spacing(np.abs(_column(layout, index)).max(initial=0.0))))


def seconds_of_day(stamps: Sequence[str]) -> FloatArray:
    """Read times of day.

    Parameters
    ----------
    stamps : sequence of str
        Such as ``27/03/2025 10:51:13,497``; the date is not looked at.

    Returns
    -------
    (n_stamps,) array
        Seconds since midnight; NaN where a text is no time.

    Examples
    --------
    >>> seconds_of_day(["27/03/2025 10:51:13,500", "00:00:01", "yesterday"]).tolist()
    [39073.5, 1.0, nan]
    """
    values = np.full(len(stamps), np.nan)
    for position, stamp in enumerate(stamps):
        match = STAMP.fullmatch(stamp.strip())
        if match is None:
            continue
        hours = int(match["hours"] or 0)
        if match["half"]:
            hours = hours % 12 + 12 * (match["half"][0] in "pP")
        seconds = float(f"{match['seconds']}.{match['fraction'] or 0}")
        values[position] = 3600 * hours + 60 * int(match["minutes"]) + seconds
    return values


def unwrap_days(seconds: FloatArray, last: float) -> FloatArray:
    """Let times of day grow on over midnight.

    Parameters
    ----------
    seconds : (n,) array
        Since midnight.
    last : float
        The time before the first of them, s; NaN where there is none.

    Returns
    -------
    (n,) array
        Since the first midnight.
    """
    steps = np.diff(seconds, prepend=seconds[0] if np.isnan(last) else last)
    first = seconds[0] if np.isnan(last) else last
    return np.asarray(first + np.cumsum(steps - DAY_S * np.rint(steps / DAY_S)))


def _in_encoding_of(layout: TextLayout, columns: Sequence[str]) -> TextLayout:
    """Read names in the encoding in which those that the test writes stand there; as they were where none is that."""
    if not columns or any(_holds(fields, columns) for fields in layout.header):
        return layout
    for encoding in ENCODINGS:
        try:
            header = tuple(
                tuple(field.encode("latin-1").decode(encoding) for field in fields) for fields in layout.header
            )
        except UnicodeError:
            continue
        if any(_holds(fields, columns) for fields in header):
            return replace(layout, header=header)
    return layout


def _holds(fields: Sequence[str], columns: Sequence[str]) -> bool:
    return set(columns) <= {*fields, *(name_and_unit(field)[0] for field in fields)}


def _read_header(layout: TextLayout, header_row: int | None, columns: Sequence[str]) -> tuple[list[str], list[str]]:
    """Give the name and the unit of each column."""
    rows = [_match_width(layout, fields) for fields in layout.header]
    position = _header_position(layout, rows, header_row, columns)
    if position is None:
        return [str(index + 1) for index in range(layout.n_columns)], [""] * layout.n_columns
    names = rows[position] or []
    below = layout.header[position + 1 :]
    units = [name_and_unit(name)[1] for name in names]
    faulty = next((index for index, fields in enumerate(below) if any(map(_is_value, fields))), None)
    if faulty is not None:
        line = layout.header_lines[position + 1 + faulty]
        problem = f"holds '{below[faulty][0]}' where a number is expected; correct the line, or take it out"
        problem += OTHER_HEADER
        raise FileFormatError(layout.path, problem, where=f"line {line}, column '{names[0]}'")
    wide = [row for row in rows[position + 1 :] if row is not None]
    unit_rows = wide if len(below) == 1 else [row for row in wide if _is_row_of_units(row)]
    for row in unit_rows[:1]:
        units = [field.strip("[]() ") or unit for field, unit in zip(row, units, strict=True)]
    return names, units


def _header_position(
    layout: TextLayout, rows: Sequence[list[str] | None], header_row: int | None, columns: Sequence[str]
) -> int | None:
    """Find the line of names among the lines of text; None where there is none."""
    if header_row is not None:
        if header_row not in layout.header_lines:
            problem = f"[test] header_row = {header_row}, where no text stands before the numbers"
            raise FileFormatError(layout.path, f"{problem}; the numbers begin in line {layout.n_before + 1}")
        position = layout.header_lines.index(header_row)
        if rows[position] is None:
            raise _wrong_width(layout, layout.header[position])
        return position
    wide = [position for position, row in enumerate(rows) if row is not None]
    holding = [position for position in wide if _holds(rows[position] or (), columns)]
    if columns and holding:
        return holding[-1]
    if not wide:
        if not layout.header or (columns and all(column.isdigit() for column in columns)):
            return None
        raise _wrong_width(layout, layout.header[-1])
    timed = [position for position in wide if any(TIME.match(name) for name in (rows[position] or ())[:2])]
    above = [position for position in wide if not _is_row_of_units(rows[position] or [])]
    both = [position for position in timed if position in above]
    return (both or timed or above or wide)[-1]


def _is_row_of_units(row: Sequence[str]) -> bool:
    stated = [field.strip("[]() ") for field in row if field.strip("[]() ")]
    return bool(stated) and all(map(is_unit, stated))


def _is_value(field: str) -> bool:
    return is_number(field) and not field.isdigit()


def _match_width(layout: TextLayout, fields: Sequence[str]) -> list[str] | None:
    """Make a line of text as wide as the numbers where a delimiter at the end is all that differs."""
    row = list(fields)
    while len(row) > layout.n_columns and (not row[-1] or REMARK.fullmatch(row[-1])):
        row.pop()
    if len(row) == layout.n_columns - 1 and not any(fields[-1] for fields in layout.rows if fields):
        row.append("")
    return row if len(row) == layout.n_columns else None


def _wrong_width(layout: TextLayout, fields: Sequence[str]) -> FileFormatError:
    cell = _cell_with_unit(" ".join(layout.rows[0]))
    if cell:
        problem = f"has units in its cells, as in '{cell}', where numbers alone are read: export it without them, and "
        problem += "write the units behind the names in the header, as in 'force [N]'"
        return FileFormatError(layout.path, problem, where=f"line {layout.n_before + 1}")
    problem = f"has {counted(layout.n_columns, 'value')} where the header has {counted(len(fields), 'column')}"
    hint = "; a decimal comma needs semicolons or tabs between the columns" if layout.delimiter == "," else ""
    return FileFormatError(layout.path, problem + hint + OTHER_HEADER, where=f"line {layout.n_before + 1}")


def _cell_with_unit(line: str) -> str:
    """Find a cell that holds a number and its unit behind it; empty where not all cells of a line are so."""
    for delimiter in DELIMITERS[:-1]:
        matches = [NUMBER_WITH_UNIT.fullmatch(cell) for cell in split_line(line, delimiter)]
        if len(matches) > 1 and all(match and is_number(match[1]) and is_unit(match[2]) for match in matches):
            return split_line(line, delimiter)[-1]
    return ""


def _find_time(
    layout: TextLayout, names: Sequence[str], units: Sequence[str], taken: set[int], *, counts_samples: bool
) -> int | None:
    free = [index for index in range(len(names)) if index not in taken]
    for index in free:
        if TIME.match(names[index]) and _is_time_unit(units[index]) and (index or not counts_samples):
            return index
    for index in free:
        if _holds_stamps(layout, index):
            return index
    place = 1 if counts_samples else 0
    if place not in free or frf_role(names[place]) == FREQUENCY or not _is_time_unit(units[place]):
        return None
    return place if _grows(layout, place) and not _counts_samples(layout, names, units, place) else None


def _counts_samples(layout: TextLayout, names: Sequence[str], units: Sequence[str], index: int) -> bool:
    """Tell a column of 0, 1, 2, ... where nothing says that these are seconds; 'time' alone does not."""
    if units[index] or _unit_of_time(names[index]):
        return False
    values = _column(layout, index)
    return (
        len(values) >= FEWEST_ROWS and bool((np.diff(values) == 1.0).all()) and bool((values == np.rint(values)).all())
    )


def _holds_stamps(layout: TextLayout, index: int) -> bool:
    """Tell a column of times of day, whatever it is called and whatever stands before it: dates, numbers of lines."""
    return all(is_stamp(fields[index]) for fields in layout.rows if index < len(fields))


def _grows(layout: TextLayout, index: int) -> bool:
    """Tell whether a column grows from row to row, by steps that are equal but for a few."""
    steps = np.diff(_column(layout, index))
    if len(steps) < FEWEST_ROWS - 1 or not (steps > 0.0).all():
        return False
    median = float(np.median(steps))
    equal = np.abs(steps - median) <= EVEN * median + 2.0 * printed_resolution(layout, index)
    return 2 * int(equal.sum()) > len(equal)


def _column(layout: TextLayout, index: int) -> FloatArray:
    values = np.full(len(layout.rows), np.nan)
    for row, fields in enumerate(layout.rows):
        try:
            values[row] = parse_number(fields[index], decimal=layout.decimal)
        except (NumberError, IndexError):
            continue
    return np.asarray(values[np.isfinite(values)])


def _is_time_unit(unit: str) -> bool:
    """Tell a unit that may be of time from one that is of something else."""
    return not (is_unit(unit) and not TIME_UNIT.search(unit.strip()))


def _unit_of_time(name: str) -> str:
    match = TIME_UNIT.search(name)
    return match[1] if match else ""
