"""Texts of entries without a first line that says so: CalculiX's and Abaqus's files.

Three columns are row, column and value (CalculiX's ``.sti`` and ``.mas``, Abaqus's COORDINATE); five are node and
direction of the row, of the column, and the value (Abaqus's MATRIX INPUT and LABELS). Negative nodes are Abaqus's
multipliers and internal DOFs.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from frf_ipz.arrays import as_whole_numbers
from frf_ipz.dofs import DIRECTIONS, GENERALISED, Dof
from frf_ipz.errors import FileFormatError, InputError, errors_of_file
from frf_ipz.fe.matrices.stored import (
    MatrixFormat,
    MatrixRequest,
    StoredMatrix,
    as_matrix,
    both_triangles,
)
from frf_ipz.input_files import read_bytes
from frf_ipz.text_numbers import parse_number

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.arrays import FloatArray

SEPARATOR = rb"(?:[ \t]*+,[ \t]*+|[ \t]++)"
NUMBER = rb"[+-]?(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)(?:[eEdDqQ][+-]?[0-9]++)?"
LINES = {
    n: re.compile(rb"(?:[ \t]*+(?:" + (rb"-?[0-9]++" + SEPARATOR) * (n - 1) + NUMBER + rb"[ \t]*+,?[ \t]*+)?\n)*+")
    for n in (3, 5)
}
FIRST = {
    n: re.compile(rb"[ \t]*+" + (rb"-?[0-9]++" + SEPARATOR) * (n - 1) + NUMBER + rb"[ \t]*+,?[ \t]*+$") for n in (3, 5)
}
COMMENT = re.compile(rb"(?m)^[ \t]*+[*%#$!][^\n]*+")
TO_E = bytes.maketrans(b"dDqQ,", b"EEEE ")
MOST_ROWS = 10**7
INTERNAL, MOST_DIRECTIONS = 10**12, 100  # numbers of internal DOFs, the same in each file
SUFFIXES = {".sti", ".mas", ".dam"}


def _fits(path: Path, head: bytes) -> bool:
    if head.startswith(b"%"):  # Matrix Market, be its first line right or wrong
        return False
    if path.suffix.lower() in SUFFIXES:
        return True
    lines = COMMENT.sub(b"", head.replace(b"\r", b"\n")).split(b"\n")
    first = next((line for line in lines if line.strip()), b"")
    return any(pattern.match(first) for pattern in FIRST.values())


def _read(request: MatrixRequest) -> StoredMatrix:
    path = request.path
    data = read_bytes(path)
    text = COMMENT.sub(b"", data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") + b"\n")
    entries = _columns(path, text)
    with errors_of_file(path):
        places, values = as_whole_numbers(entries[:, :-1], "its rows and columns"), entries[:, -1]
    if not len(values):
        raise FileFormatError(path, "holds no entry of a matrix; export it again")
    if places.shape[1] == 2:
        return _by_numbers(request, places, values)
    return _by_labels(request, places, values)


FORMAT = MatrixFormat(rank=5, fits=_fits, read=_read)


def _columns(path: Path, text: bytes) -> FloatArray:
    """Read all numbers, (n, 3 or 5); the line at fault is named."""
    for n_columns, pattern in LINES.items():
        match = pattern.match(text)
        if match is not None and match.end() == len(text):
            return np.array(text.translate(TO_E).split(), float).reshape(-1, n_columns)
    expected = 0
    for number, line in enumerate(text.split(b"\n"), start=1):
        words = line.replace(b",", b" ").decode("latin-1").split()
        if not words:
            continue
        expected = expected or len(words)
        if len(words) != expected or expected not in LINES:
            raise FileFormatError(
                path,
                f"has {len(words)} columns; 3 (row, column, value) or 5 (node and direction of row and column, value) "
                "are needed, the same in each line",
                where=f"line {number}",
            )
        try:
            [parse_number(word) for word in words]
        except InputError as error:
            raise FileFormatError(path, str(error), where=f"line {number}") from None
        if not all(word.lstrip("-").isdecimal() for word in words[:-1]):
            raise FileFormatError(path, "a row or column is no whole number", where=f"line {number}")
    raise FileFormatError(path, "holds numbers that cannot be read; export it again")


def _by_numbers(request: MatrixRequest, places: Any, values: FloatArray) -> StoredMatrix:  # noqa: ANN401
    order = int(places.max())
    if places.min() < 1 or order > MOST_ROWS:
        raise FileFormatError(request.path, f"has rows from {places.min()} to {order}; they count from 1")
    order = max(order, request.order or 0)
    entries: Any = sparse.coo_array((values, (places[:, 0] - 1, places[:, 1] - 1)), shape=(order, order))
    return both_triangles(as_matrix(sparse.csr_array(entries), request), request.path)


def _by_labels(request: MatrixRequest, places: Any, values: FloatArray) -> StoredMatrix:  # noqa: ANN401
    labels, rows = np.unique(places.reshape(-1, 2), axis=0, return_inverse=True)
    rows = rows.reshape(-1, 2)
    order = len(labels)
    dofs = _dofs(labels)
    entries: Any = sparse.coo_array((values, (rows[:, 0], rows[:, 1])), shape=(order, order))
    unbound = MatrixRequest(path=request.path, what=request.what)
    stored = both_triangles(as_matrix(sparse.csr_array(entries), unbound), request.path)
    return StoredMatrix(matrix=stored.matrix, dofs=dofs, notes=stored.notes)


def _dofs(labels: Any) -> tuple[Dof, ...]:  # noqa: ANN401
    """Name rows; a multiplier, a temperature and what else is no motion of a node is a generalised DOF."""
    return tuple(
        Dof(node, DIRECTIONS[number - 1])
        if node > 0 and 1 <= number <= len(DIRECTIONS)
        else Dof(
            INTERNAL + 2 * MOST_DIRECTIONS * abs(node) + (MOST_DIRECTIONS if node < 0 else 0) + number, GENERALISED
        )
        for node, number in labels.tolist()
    )
