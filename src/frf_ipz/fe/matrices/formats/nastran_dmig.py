"""Nastran's punch files with DMIG cards, which name their rows, by pyyeti."""

from __future__ import annotations

import io
import re
from numbers import Real
from typing import TYPE_CHECKING, Any

from frf_ipz.dofs import DIRECTIONS, GENERALISED, Dof
from frf_ipz.errors import FileFormatError
from frf_ipz.fe.matrices.stored import (
    MatrixFormat,
    MatrixRequest,
    StoredMatrix,
    as_matrix,
    both_triangles,
)
from frf_ipz.foreign_errors import errors_of_reader, import_reader
from frf_ipz.input_files import read_text

if TYPE_CHECKING:
    from pathlib import Path

KIND = "a punch file of Nastran with DMIG cards"
CARD = re.compile(rb"(?m)^DMIG[ *,]")
HEADER = re.compile(r"(?mi)^DMIG[ ,]+(\w{1,8})[ ,]+0[ ,]")


def _fits(path: Path, head: bytes) -> bool:
    return path.suffix.lower() in {".pch", ".dmig"} or CARD.search(head) is not None


def _read(request: MatrixRequest) -> StoredMatrix:
    path = request.path
    bulk = import_reader(path, "pyyeti.nastran.bulk", kind=KIND, extra="nastran")
    text = read_text(path)
    names = _names_in(text)
    if not names:
        raise FileFormatError(path, "has no header card of a DMIG matrix; punch it again, or export OUTPUT4")
    chosen = request.choose(dict.fromkeys(names))
    with errors_of_reader(path, KIND):
        frames = bulk.rddmig(io.StringIO(text), chosen, square=True, follow_includes=False)
        frame: Any = next(frame for name, frame in frames.items() if name.lower() == chosen)
        values, labels = frame.to_numpy(), frame.index.tolist()
    unbound = MatrixRequest(path=path, what=request.what)
    stored = both_triangles(as_matrix(values, unbound), path)
    dofs = tuple(_dof(path, *label) for label in labels)
    return StoredMatrix(matrix=stored.matrix, dofs=dofs, notes=stored.notes)


def _dof(path: Path, node: Any, number: Any) -> Dof:  # noqa: ANN401 - as pyyeti understood the card
    numbers = [value for value in (node, number) if isinstance(value, Real) and float(value).is_integer()]
    if len(numbers) < 2 or node < 1:
        raise FileFormatError(
            path,
            f"names the row of grid point {node!r}, component {number!r}: both must be whole numbers, the first above "
            "0; punch it again, or export OUTPUT4",
        )
    return Dof(int(node), DIRECTIONS[int(number) - 1] if 1 <= number <= len(DIRECTIONS) else GENERALISED)


FORMAT = MatrixFormat(rank=4, fits=_fits, read=_read, names=lambda path: _names_in(read_text(path)))


def _names_in(text: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name.lower() for name in HEADER.findall(text)))
