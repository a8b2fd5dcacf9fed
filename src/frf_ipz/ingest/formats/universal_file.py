"""Universal files (UFF): their data sets 58 (functions), ASCII or binary, and the units of data sets 164.

No package reads them here, since every number has to be read whole: FORTRAN's D exponents, fields without blanks
between them, entity names that shift the columns behind them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import complex_array
from frf_ipz.dofs import DIRECTIONS, Dof
from frf_ipz.errors import FileFormatError
from frf_ipz.text_numbers import NumberError, parse_numbers
from frf_ipz.universal_sets import UNOPENED

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from frf_ipz.arrays import ComplexArray, FloatArray, IntArray

END = b"-1"  # alone on its line: a data set begins or ends
N_HEAD = 11  # lines of a data set 58 before its numbers
TIME_RESPONSE, FRF, COHERENCE = 1, 4, 6  # types of functions
FUNCTION_TYPES = {
    0: "general",
    1: "time response",
    2: "auto spectrum",
    3: "cross spectrum",
    4: "frequency response function",
    6: "coherence",
    9: "power spectral density",
    12: "spectrum",
}
LITTLE_ENDIAN, BIG_ENDIAN = 1, 2
IEEE = 2
# Ordinate type: parts of a value, bytes of a part, widths of the fields in a line with even and with uneven abscissae.
SINGLE, DOUBLE = 13, 20
ORDINATES: dict[int, tuple[int, int, tuple[int, ...], tuple[int, ...]]] = {
    2: (1, 4, (SINGLE,) * 6, (SINGLE,) * 6),
    4: (1, 8, (DOUBLE,) * 4, (SINGLE, DOUBLE) * 2),
    5: (2, 4, (SINGLE,) * 6, (SINGLE,) * 6),
    6: (2, 8, (DOUBLE,) * 4, (SINGLE, DOUBLE, DOUBLE)),
}
NAMES_AND_NODES = (5, 10, 5, 10, 1, 10, 10, 4, 1, 10, 10, 4)  # widths of the fields of record 6
INTEGERS = (0, 1, 2, 3, 6, 7, 10, 11)  # those of them that are integers
BEGINS_SET = re.compile(r"164|58(b .*)?", re.IGNORECASE)
INTEGER = re.compile(r"[+-]?[0-9]{1,18}")
N_TOKENS = 10  # of record 6, where no name has a blank


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """What an axis of a function is: type of data, its label and that of its unit."""

    data_type: int
    label: str
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UniversalFunction:
    """One data set 58.

    Parameters
    ----------
    number : int
        Which data set of the file it is, from 1; all kinds count.
    line : int
        Line on which it begins.
    function_type : int
        4 for a frequency response function, 6 for a coherence.
    response_node, response_direction, reference_node, reference_direction : int
        What it connects; directions are 1 to 6 for x to rz with a sign, 0 for none.
    abscissa, ordinate, denominator : Axis
        Its axes.
    x : (n_points,) array
        Abscissae, as the file has them.
    values : (n_points,) complex array
        Ordinates.
    point_lines : (n_points,) int array
        Lines on which the numbers of the points begin; of binary numbers, where the data set does.
    units : pair of float, optional
        Factors of length and force from SI to the file's units, where a data set 164 states them.
    """

    number: int
    line: int
    function_type: int
    response_node: int
    response_direction: int
    reference_node: int
    reference_direction: int
    abscissa: Axis
    ordinate: Axis
    denominator: Axis
    x: FloatArray
    values: ComplexArray
    point_lines: IntArray
    units: tuple[float, float] | None

    @property
    def ends(self) -> tuple[int, int, int, int]:
        """Node and direction of the response, node and direction of the reference."""
        return self.response_node, self.response_direction, self.reference_node, self.reference_direction


def find_dof(node: int, direction: int) -> Dof | None:
    """Make the DOF of an end of a function.

    Parameters
    ----------
    node : int
        Its node; 0 is the ground.
    direction : int
        1 to 6 for x to rz, with a sign; 0 for none.

    Returns
    -------
    Dof or None
        None where the file names no node, or no direction.
    """
    if node < 1 or not 1 <= abs(direction) <= len(DIRECTIONS):
        return None
    return Dof(node, DIRECTIONS[abs(direction) - 1], 1 if direction > 0 else -1)


def read_functions(path: Path, data: bytes) -> tuple[UniversalFunction, ...]:
    """Read all data sets 58 of a universal file.

    Parameters
    ----------
    path : Path
        The file, for messages.
    data : bytes
        Its content.

    Returns
    -------
    tuple of UniversalFunction
        In their order; empty where there is none.

    Raises
    ------
    FileFormatError
        If a data set is cut off or holds what is no number: names the line.
    """
    lines = _Lines(path, data)
    functions: list[UniversalFunction] = []
    units: tuple[float, float] | None = None
    number = 0
    while lines.skip_to_begin_mark():
        if not lines.remaining:
            break
        head = lines.take()
        kind = head.strip().lower()
        number += 1
        if kind == "164":
            units = _read_units(lines)
        elif kind == "58" or kind.startswith("58b"):
            functions.append(_read_function(lines, number, head, units))
        else:
            lines.skip_to_end_mark()
    return tuple(functions)


class _Lines:
    """Lines of a file one after the other, with their numbers; binary numbers may stand between them."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path = path
        self._data = data
        self._position = 0
        self._newline = b"\r" if b"\n" not in data[:400] else b"\n"
        self.number = 0

    @property
    def remaining(self) -> int:
        return len(self._data) - self._position

    def take(self) -> str:
        """Give the next line."""
        if not self.remaining:
            raise self.fault("the file is cut off; copy or export it again")
        end = self._data.find(self._newline, self._position)
        end = len(self._data) if end < 0 else end
        line = self._data[self._position : end]
        self._position = min(end + 1, len(self._data))
        self.number += 1
        return line.rstrip(b"\r").decode("latin-1")

    def take_bytes(self, count: int) -> bytes:
        """Give bytes as they are."""
        data = self._data[self._position : self._position + count]
        self._position = min(self._position + count, len(self._data))
        return data

    def is_at_end_mark(self) -> bool:
        end = self._data.find(self._newline, self._position)
        return self._data[self._position : end if end >= 0 else None].strip() == END

    def skip_to_end_mark(self) -> bool:
        """Go behind the next line that begins or ends a data set; False where there is none."""
        while self.remaining:
            if self.take().strip() == "-1":
                return True
        return False

    def skip_to_begin_mark(self) -> bool:
        """Go behind the next line that begins a data set; False where there is none."""
        while self.remaining:
            text = self.take().strip()
            if text == "-1":
                return True
            if BEGINS_SET.fullmatch(text):
                raise self.fault(UNOPENED.format(text[:3].strip()))
        return False

    def fault(self, problem: str, line: int = 0) -> FileFormatError:
        return FileFormatError(self.path, problem, where=f"line {line or self.number}")


def _read_units(lines: _Lines) -> tuple[float, float]:
    lines.take()  # their name
    tokens: list[str] = []
    while lines.remaining and not lines.is_at_end_mark():
        tokens += lines.take().split()
    lines.skip_to_end_mark()
    try:
        length, force = parse_numbers(tokens[:2]).tolist()
    except (NumberError, ValueError) as error:
        raise lines.fault(f"the units of data set 164 cannot be read: {error}") from None
    if length <= 0.0 or force <= 0.0:
        raise lines.fault(f"the units of data set 164 are {length:g} and {force:g}; they are positive factors")
    return length, force


def _read_function(lines: _Lines, number: int, kind: str, units: tuple[float, float] | None) -> UniversalFunction:
    first = lines.number
    for _ in range(5):
        lines.take()
    function_type, *ends = _read_ends(lines)
    ordinate_type, n_points, spacing, start, step = _read_sizes(lines)
    abscissa, ordinate, denominator = (_read_axis(lines) for _ in range(3))
    lines.take()
    if ordinate_type not in ORDINATES:
        raise lines.fault(f"the type of the ordinates is {ordinate_type}; known are 2, 4, 5 and 6", first + N_HEAD - 4)
    if not 0 < n_points <= max(lines.remaining, 1):
        raise lines.fault(
            f"the data set should hold {n_points} values; the file is cut off or none", first + N_HEAD - 4
        )
    parts, *_ = ORDINATES[ordinate_type]
    is_even = spacing != 0
    read = _read_binary if "b" in kind.lower() else _read_text
    numbers, on_lines = read(lines, kind, ordinate_type, is_even, n_points * (parts + (not is_even)))
    table = numbers.reshape(n_points, -1)
    x = start + step * np.arange(n_points) if is_even else table[:, 0]
    columns = table[:, -parts:]
    return UniversalFunction(
        number=number,
        line=first,
        function_type=function_type,
        response_node=ends[0],
        response_direction=ends[1],
        reference_node=ends[2],
        reference_direction=ends[3],
        abscissa=abscissa,
        ordinate=ordinate,
        denominator=denominator,
        x=np.asarray(x, np.float64),
        values=complex_array(columns[:, 0], columns[:, 1] if parts == 2 else 0.0),
        point_lines=on_lines.reshape(n_points, -1)[:, 0] if len(on_lines) else np.full(n_points, first),
        units=units,
    )


def _read_ends(lines: _Lines) -> list[int]:
    """Read type, nodes and directions: by columns, or by blanks where a long name has shifted the columns."""
    line = lines.take()
    fields = _split_by_widths(line, NAMES_AND_NODES)
    by_columns = _integers([fields[index] for index in INTEGERS], aligned=True) if len(fields) > max(INTEGERS) else None
    tokens = line.split()
    by_blanks = _integers([*tokens[:4], *tokens[5:7], *tokens[8:]]) if len(tokens) == N_TOKENS else None
    if by_columns is None and by_blanks is None:
        raise lines.fault(f"'{line.strip()}' does not say which nodes and directions the function connects")
    if by_columns and by_blanks and by_columns != by_blanks:
        problem = f"'{line.strip()}' names other nodes by its columns than by its blanks; shorten the entities' names"
        raise lines.fault(problem)
    integers = by_columns or by_blanks or []
    return [integers[0], *integers[4:]]


def _integers(fields: Sequence[str], *, aligned: bool = False) -> list[int] | None:
    """Read integers; None where one is none. FORTRAN writes them to the right end of their columns."""
    integers = []
    for field in fields:
        text = field.strip(" ")
        if not INTEGER.fullmatch(text) or (aligned and field.endswith(" ")):
            return None
        integers.append(int(text))
    return integers


def _read_sizes(lines: _Lines) -> tuple[int, int, int, float, float]:
    line = lines.take()
    fields = _split_by_widths(line, (10, 10, 10, 13, 13, 13))
    for candidate in (fields, line.split()):
        integers = _integers(candidate[:3])
        try:
            start, step = parse_numbers(candidate[3:5]).tolist()
        except (NumberError, ValueError):
            continue
        if integers is not None and len(integers) == 3:
            return integers[0], integers[1], integers[2], start, step
    raise lines.fault(f"'{line.strip()}' does not say how many values of which type stand below")


def _read_axis(lines: _Lines) -> Axis:
    """Read type and unit of an axis; the label of the axis stands between them."""
    line = lines.take()
    fields = _split_by_widths(line, (10, 5, 5, 5, 1, 20, 1, 20))
    data_type = _integers(fields[:1])
    if not data_type:
        raise lines.fault(f"'{line.strip()}' does not begin with the type of an axis")
    return Axis(data_type=data_type[0], label=line[26:46].strip(), unit=line[47:].strip())


def _read_text(
    lines: _Lines,
    kind: str,
    ordinate_type: int,
    is_even: bool,  # noqa: FBT001
    count: int,
) -> tuple[FloatArray, IntArray]:
    """Read numbers by the blanks between them, or by columns where they touch; and the line of each."""
    del kind
    widths = ORDINATES[ordinate_type][2] if is_even else ORDINATES[ordinate_type][3]
    first = lines.number + 1
    rows: list[str] = []
    while lines.remaining and not lines.is_at_end_mark():
        rows.append(lines.take())
    is_cut = not lines.remaining
    lines.skip_to_end_mark()
    fault: Exception | None = None
    splits: list[Callable[[str], list[str]]] = [str.split]
    if all(len(row.rstrip()) <= sum(widths) for row in rows):  # else columns would lose what stands beyond them
        splits.append(lambda row: _split_by_widths(row.rstrip(), widths))
    for split in splits:
        tokens = [split(row) for row in rows]
        n_tokens = sum(map(len, tokens))
        try:
            values = parse_numbers([token for row in tokens for token in row], finite=False)
        except NumberError as error:
            line = first + int(np.searchsorted(list(accumulate(map(len, tokens))), error.position, side="right"))
            fault = fault or lines.fault(str(error), line)
            continue
        if n_tokens == count:
            return values, np.repeat(first + np.arange(len(rows)), [len(row) for row in tokens])
        problem = "the file is cut off" if is_cut and n_tokens < count else "the data set is damaged"
        wrong_count = lines.fault(
            f"holds {n_tokens} numbers where its head promises {count}: {problem}; export it again"
        )
        fault = fault if n_tokens > count and fault else wrong_count
    raise fault or lines.fault("holds no numbers")


def _read_binary(
    lines: _Lines,
    kind: str,
    ordinate_type: int,
    is_even: bool,  # noqa: FBT001
    count: int,
) -> tuple[FloatArray, IntArray]:
    tokens = _integers(kind.lower().partition("b")[2].split())
    if tokens is None or len(tokens) < 4:
        raise lines.fault(f"'{kind.strip()}' does not say how its binary numbers are written")
    order, number_format, n_lines, n_bytes = tokens[:4]
    if order not in {LITTLE_ENDIAN, BIG_ENDIAN} or number_format != IEEE or n_lines != N_HEAD:
        raise lines.fault(f"'{kind.strip()}' is a binary format that is not read; export IEEE numbers, or ASCII")
    parts, size, *_ = ORDINATES[ordinate_type]
    letter = "<" if order == LITTLE_ENDIAN else ">"
    values = np.dtype(f"{letter}f{size}")
    mixed = np.dtype([("x", f"{letter}f4"), ("values", values, (parts,))])
    data = lines.take_bytes(n_bytes)
    lines.skip_to_end_mark()
    if len(data) == count * size:
        return np.frombuffer(data, values).astype(np.float64), np.zeros(0, np.int64)
    if not is_even and len(data) == count // (parts + 1) * mixed.itemsize:
        table = np.frombuffer(data, mixed)
        numbers = np.column_stack([table["x"], table["values"]]).astype(np.float64).ravel()
        return numbers, np.zeros(0, np.int64)
    raise lines.fault(f"holds {len(data)} bytes where its head promises {count} numbers: it is cut off or damaged")


def _split_by_widths(line: str, widths: Sequence[int]) -> list[str]:
    """Split a line into columns; those that the line does not reach are left out."""
    ends = list(accumulate(widths))
    return [line[end - width : end] for end, width in zip(ends, widths, strict=True) if end - width < len(line)]


def describe_functions(functions: Sequence[UniversalFunction]) -> str:
    """Name the kinds of functions in a file.

    Parameters
    ----------
    functions : sequence of UniversalFunction
        Those of the file.

    Returns
    -------
    str
        Such as ``2 of type 1 (time response)``.
    """
    counts: dict[int, int] = {}
    for function in functions:
        counts[function.function_type] = counts.get(function.function_type, 0) + 1
    names = (f"{count} of type {kind} ({FUNCTION_TYPES.get(kind, 'unknown')})" for kind, count in counts.items())
    return ", ".join(names) or "other data sets only"
