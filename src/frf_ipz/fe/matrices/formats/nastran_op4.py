"""Nastran's OUTPUT4 files, text or binary, with any number of matrices, by pyyeti."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from frf_ipz.errors import FileFormatError
from frf_ipz.fe.matrices.stored import (
    MOST_BYTES,
    MatrixFormat,
    MatrixRequest,
    StoredMatrix,
    as_matrix,
    both_triangles,
)
from frf_ipz.foreign_errors import errors_of_reader, import_reader
from frf_ipz.input_files import read_bytes
from frf_ipz.output_files import write_bytes

KIND = "an OUTPUT4 file of Nastran"
MOST_ROWS = 10**7


def _read(request: MatrixRequest) -> StoredMatrix:
    path = request.path
    op4 = import_reader(path, "pyyeti.nastran.op4", kind=KIND, extra="nastran")
    with TemporaryDirectory() as folder, errors_of_reader(path, KIND):  # pyyeti takes paths
        copy = Path(folder) / "matrices.op4"
        write_bytes(copy, read_bytes(path, most_bytes=MOST_BYTES))
        _, sizes, *_ = op4.dir(str(copy), verbose=False)
        if any(max(size) > MOST_ROWS for size in sizes):
            raise FileFormatError(path, f"says that a matrix has more than {MOST_ROWS} rows; is it damaged?")
        names, matrices, *_ = op4.load(str(copy), into="list", sparse=True)
    known = _square(names, matrices, request.order)
    return both_triangles(as_matrix(known[request.choose(known)], request), path)


FORMAT = MatrixFormat(rank=3, fits=lambda path, head: path.suffix.lower() == ".op4", read=_read)  # noqa: ARG005


def _square(names: list[str], matrices: list[Any], order: int | None) -> dict[str, Any]:
    """Square matrices by name; of one order where some have that which is needed. Names of several get a number."""
    square = [(name, matrix) for name, matrix in zip(names, matrices, strict=True) if len(set(matrix.shape)) == 1]
    fitting = [(name, matrix) for name, matrix in square if matrix.shape[0] == order]
    known: dict[str, Any] = {}
    for name, matrix in fitting or square:
        copies = sum(1 for other in known if other.partition("(")[0] == name)
        known[f"{name}({copies + 1})" if copies else name] = matrix
    return known
