"""Nastran's OUTPUT4 files, text or binary, with any number of matrices, by pyyeti."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from frf_ipz.errors import FileFormatError
from frf_ipz.fe.matrices.fortran_records import check_records
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

if TYPE_CHECKING:
    from collections.abc import Iterator

KIND = "an OUTPUT4 file of Nastran"
MOST_ROWS = 10**7


def _read(request: MatrixRequest) -> StoredMatrix:
    path = request.path
    with _copied(path) as (op4, copy):
        _sizes(path, op4, copy)
        names, matrices, *_ = op4.load(copy, into="list", sparse=True)
    known = _square(names, matrices, request.order)
    return both_triangles(as_matrix(known[request.choose(known)], request), path)


def _names(path: Path) -> tuple[str, ...]:
    with _copied(path) as (op4, copy):
        return tuple(dict.fromkeys(name for name, size in _sizes(path, op4, copy) if len(set(size)) == 1))


FORMAT = MatrixFormat(rank=3, fits=lambda path, head: path.suffix.lower() == ".op4", read=_read, names=_names)  # noqa: ARG005


@contextmanager
def _copied(path: Path) -> Iterator[tuple[Any, str]]:
    """Give pyyeti, which takes paths, a copy that is checked and unpacked."""
    op4 = import_reader(path, "pyyeti.nastran.op4", kind=KIND, extra="nastran")
    with TemporaryDirectory() as folder, errors_of_reader(path, KIND):
        copy, content = Path(folder) / "matrices.op4", read_bytes(path, most_bytes=MOST_BYTES)
        check = check_records if 0 in content[:4] else _check_counts  # pyyeti tells binary files so
        check(path, content)
        write_bytes(copy, content)
        yield op4, str(copy)


def _check_counts(path: Path, content: bytes) -> None:
    """Check that no column has more numbers than the file: pyyeti reads on where the file has ended."""
    for number, line in enumerate(content.split(b"\n"), start=1):
        count = _count(line)
        if count > len(content):
            raise FileFormatError(path, f"line {number}: says that {count} numbers follow; is the file damaged?")


def _count(line: bytes) -> int:
    """Numbers that follow a line of column, row and count, or of count and row, each eight wide; 0 after others."""
    try:
        first, last = int(line[:8]), line[16:24].strip()
        return int(last) if last else first
    except ValueError:
        return 0


def _sizes(path: Path, op4: Any, copy: str) -> list[tuple[str, tuple[int, int]]]:  # noqa: ANN401 - a module
    names, sizes, *_ = op4.dir(copy, verbose=False)
    if any(max(size) > MOST_ROWS for size in sizes):
        raise FileFormatError(path, f"says that a matrix has more than {MOST_ROWS} rows; is it damaged?")
    return list(zip(names, sizes, strict=True))


def _square(names: list[str], matrices: list[Any], order: int | None) -> dict[str, Any]:
    """Square matrices by name; of one order where some have that which is needed. Names of several get a number."""
    square = [(name, matrix) for name, matrix in zip(names, matrices, strict=True) if len(set(matrix.shape)) == 1]
    fitting = [(name, matrix) for name, matrix in square if matrix.shape[0] == order]
    known: dict[str, Any] = {}
    for name, matrix in fitting or square:
        copies = sum(1 for other in known if other.partition("(")[0] == name)
        known[f"{name}({copies + 1})" if copies else name] = matrix
    return known
