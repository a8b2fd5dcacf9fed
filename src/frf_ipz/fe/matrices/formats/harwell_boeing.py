"""Harwell-Boeing files, as Ansys's HBMAT writes them: assembled, real, symmetric or not.

Duff, Grimes, Lewis, *Users' Guide for the Harwell-Boeing Sparse Matrix Collection*, 1992: five header lines, then the
pointers of the columns, the rows and the values in columns of a fixed width.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from frf_ipz.arrays import as_whole_numbers
from frf_ipz.errors import FileFormatError, InputError, errors_of_file
from frf_ipz.fe.matrices.stored import MatrixFormat, MatrixRequest, StoredMatrix, as_matrix, both_triangles
from frf_ipz.input_files import read_bytes
from frf_ipz.text_numbers import parse_number

if TYPE_CHECKING:
    from pathlib import Path

FORMATS = re.compile(
    r"\(\s*(?:[0-9]*P\s*,?\s*)?([0-9]{1,4})\s*([IEDFG])\s*([0-9]{1,3})(?:\.[0-9]+)?(?:[ED][0-9]+)?\s*\)"
)
TYPE = re.compile(r"^[RCP][SUHZR][AE]$")
SUFFIXES = {".hb", ".hbm", ".rsa", ".rua", ".matrix"}


def _fits(path: Path, head: bytes) -> bool:
    lines = head.decode("latin-1").split("\n")
    has_type = len(lines) > 4 and TYPE.match(lines[2][:3].upper()) is not None
    return path.suffix.lower() in SUFFIXES or (has_type and FORMATS.search(lines[3].upper()) is not None)


def _read(request: MatrixRequest) -> StoredMatrix:
    path = request.path
    lines = read_bytes(path).decode("latin-1").replace("\r\n", "\n").split("\n")
    if len(lines) < 5:
        raise FileFormatError(path, "is no Harwell-Boeing file: it has fewer than five lines")
    kind = lines[2][:3].upper()
    counts = [int(word[:12]) for word in lines[1].split() if word.isdecimal()]
    sizes = [int(word[:12]) for word in lines[2][3:].split() if word.isdecimal()]
    formats = FORMATS.findall(lines[3].upper())
    if TYPE.match(kind) is None or len(counts) < 4 or len(sizes) < 3 or len(formats) < 3:
        raise FileFormatError(path, "is no Harwell-Boeing file: its first lines say no type, sizes and formats")
    if kind[0] != "R" or kind[2] != "A" or kind[1] not in "SU":
        raise FileFormatError(path, f"is of the type {kind}; RSA and RUA are read: real, symmetric or not, assembled")
    n_rows, n_columns, n_entries = sizes[:3]
    if n_rows != n_columns:
        raise FileFormatError(path, f"is {n_rows} x {n_columns}; a square matrix is needed")
    start = 4 + (1 if len(counts) > 4 and counts[4] > 0 else 0)
    cells = _Cells(path, lines)
    pointers = cells.take(start, counts[1], formats[0], n_columns + 1)
    rows = cells.take(start + counts[1], counts[2], formats[1], n_entries)
    values = cells.take(start + counts[1] + counts[2], counts[3], formats[2], n_entries)
    with errors_of_file(path):
        places = (as_whole_numbers(pointers, "its pointers") - 1, as_whole_numbers(rows, "its rows") - 1)
    is_ordered = places[0][0] == 0 and places[0][-1] == n_entries and (np.diff(places[0]) >= 0).all()
    if not is_ordered or (n_entries and not 0 <= places[1].min() <= places[1].max() < n_rows):
        raise FileFormatError(path, "has rows or columns outside the matrix; export it again")
    matrix: Any = sparse.csc_array((values, places[1], places[0]), shape=(n_rows, n_columns))
    if kind[1] == "U":
        return StoredMatrix(matrix=as_matrix(matrix, request))
    return StoredMatrix(matrix=both_triangles(as_matrix(matrix, request), path).matrix)


FORMAT = MatrixFormat(rank=6, fits=_fits, read=_read)


class _Cells:
    """Numbers that blanks part, or else columns of a fixed width."""

    def __init__(self, path: Path, lines: list[str]) -> None:
        self.path = path
        self.lines = lines

    def take(self, start: int, n_lines: int, layout: tuple[str, str, str], count: int) -> Any:  # noqa: ANN401 - numbers
        per_line, width = int(layout[0]), int(layout[2])
        lines = self.lines[start : start + n_lines]
        cells = [(start + row + 1, word) for row, line in enumerate(lines) for word in line.split()]
        if len(cells) != count:
            places = [slice(place * width, (place + 1) * width) for place in range(per_line)]
            cells = [(start + row + 1, line[place]) for row, line in enumerate(lines) for place in places]
            cells = [(row, cell) for row, cell in cells if cell.strip()]
        if len(cells) != count:
            raise FileFormatError(self.path, f"announces {count} numbers from line {start + 1} on; {len(cells)} follow")
        found = np.empty(count)
        for place, (row, cell) in enumerate(cells):
            try:
                found[place] = parse_number(cell.strip())
            except InputError as error:
                raise FileFormatError(self.path, str(error), where=f"line {row}") from None
        return found
