"""MATLAB files, version 4 to 7.3: sparse or full matrices by name, as MATLAB, COMSOL's LiveLink and SciPy save them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from scipy import sparse

from frf_ipz.arrays import as_whole_numbers
from frf_ipz.errors import errors_of_file
from frf_ipz.fe.matrices.matlab_7_3_process import COLUMNS, DATA, N_ROWS, ROWS
from frf_ipz.fe.matrices.named_arrays import read_named
from frf_ipz.fe.matrices.stored import MOST_BYTES, MatrixFormat, MatrixRequest, StoredMatrix
from frf_ipz.foreign_errors import errors_of_reader
from frf_ipz.hdf5_files import SIGNATURE
from frf_ipz.input_files import open_input
from frf_ipz.matlab_files import read_matlab
from frf_ipz.numerics.compressed_places import require_places
from frf_ipz.reader_process import read_in_process

if TYPE_CHECKING:
    from pathlib import Path

KIND = "a MATLAB file"
PROCESS = "frf_ipz.fe.matrices.matlab_7_3_process"
DEEPEST = 4  # structures within structures


def _fits(path: Path, head: bytes) -> bool:
    return path.suffix.lower() == ".mat" or head.startswith(b"MATLAB") or _is_hdf5(head)


def _is_hdf5(head: bytes) -> bool:
    return SIGNATURE in {head[:8], head[512:520]}


def _read(request: MatrixRequest) -> StoredMatrix:
    with open_input(request.path) as stream:
        is_hdf5 = _is_hdf5(stream.read(520))
    if is_hdf5:
        with errors_of_reader(request.path, KIND):
            return read_named(_arrays_of_hdf5(request.path), request)
    variables = read_matlab(request.path, most_bytes=MOST_BYTES)
    with errors_of_reader(request.path, KIND):
        return read_named(_flattened("", variables, 0), request)


FORMAT = MatrixFormat(rank=2, fits=_fits, read=_read)


def _flattened(way: str, variables: dict[str, Any], depth: int) -> dict[str, Any]:
    """Name the fields of structures by their way, ``fem.K``, and by their own name where that is free."""
    found: dict[str, Any] = {}
    for name, value in variables.items():
        if name.startswith("__"):
            continue
        names = getattr(getattr(value, "dtype", None), "names", None)
        if names and getattr(value, "size", 0) == 1 and depth < DEEPEST:
            record = value.ravel()[0]
            inner = _flattened(f"{way}{name}.", {field: record[field] for field in names}, depth + 1)
            found |= {key: item for key, item in inner.items() if key not in found}
            continue
        found[f"{way}{name}"] = value
        if way:
            found.setdefault(name, value)
    return found


def _arrays_of_hdf5(path: Path) -> dict[str, Any]:
    arrays = read_in_process(path, PROCESS, kind=KIND, most_bytes=MOST_BYTES).arrays
    found = {name: values for name, values in arrays.items() if "/" not in name}
    for name in (way.removesuffix(ROWS) for way in arrays if way.endswith(ROWS)):
        with errors_of_file(path):
            found[name] = _sparse(*(arrays[name + part] for part in (DATA, ROWS, COLUMNS, N_ROWS)))
    return found


def _sparse(values: Any, rows: Any, columns: Any, n_rows: Any) -> Any:  # noqa: ANN401 - arrays of any numbers
    """Assemble a sparse matrix, whose places are checked first: SciPy trusts them."""
    shape = (int(n_rows), len(columns) - 1)
    places = (
        as_whole_numbers(rows, "rows of a sparse matrix"),
        as_whole_numbers(columns, "columns of a sparse matrix"),
    )
    matrix: Any = sparse.csc_array((values, *places), shape=shape)
    require_places(matrix)
    return sparse.csr_array(matrix)
