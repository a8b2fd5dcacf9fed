"""MATLAB files, version 4 to 7.3: sparse or full matrices by name, as MATLAB, COMSOL's LiveLink and SciPy save them."""

from __future__ import annotations

import io
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from frf_ipz.errors import FileFormatError
from frf_ipz.fe.matrices.named_arrays import read_named
from frf_ipz.fe.matrices.stored import MOST_BYTES, MatrixFormat, MatrixRequest, StoredMatrix
from frf_ipz.foreign_errors import errors_of_reader
from frf_ipz.input_files import read_bytes
from frf_ipz.matlab_files import read_matlab

if TYPE_CHECKING:
    from pathlib import Path

SIGNATURE = b"\x89HDF\r\n\x1a\n"
KIND = "a MATLAB file"
DEEPEST = 4  # structures within structures


def _fits(path: Path, head: bytes) -> bool:
    is_hdf5 = SIGNATURE in {head[:8], head[512:520]}
    return path.suffix.lower() == ".mat" or head.startswith(b"MATLAB") or is_hdf5


def _read(request: MatrixRequest) -> StoredMatrix:
    data = read_bytes(request.path, most_bytes=MOST_BYTES)
    if SIGNATURE in {data[:8], data[512:520]}:
        with errors_of_reader(request.path, "a MATLAB file of version 7.3"):
            return read_named(_arrays_of_hdf5(request.path, data), request)
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


def _arrays_of_hdf5(path: Path, data: bytes) -> dict[str, Any]:
    h5py = import_module("h5py")  # late: slow to load
    found: dict[str, Any] = {}
    budget = MOST_BYTES
    with h5py.File(io.BytesIO(data), "r") as file:
        for name in file:
            if name.startswith("#") or not isinstance(file.get(name, getlink=True), h5py.HardLink):
                continue
            member = file[name]
            parts = (
                [member] if isinstance(member, h5py.Dataset) else [member.get(part) for part in ("data", "ir", "jc")]
            )
            if not all(isinstance(part, h5py.Dataset) for part in parts[:1] + parts[2:]):
                continue
            for part in parts:
                if part is not None and (part.external or part.is_virtual):
                    raise FileFormatError(path, f"'{name}' lies in another file; copy the data into this one")
            budget -= sum(int(part.size) * part.dtype.itemsize for part in parts if part is not None)
            if budget < 0:
                raise FileFormatError(path, f"holds more than {MOST_BYTES >> 20} MB; is it damaged?")
            found[name] = _numbers(member) if isinstance(member, h5py.Dataset) else _sparse(member)
    return found


def _numbers(dataset: Any) -> Any:  # noqa: ANN401 - h5py has no types
    """Give an array with its axes as MATLAB has them; texts as one text a row."""
    values = np.asarray(dataset[()])
    if values.dtype.names in {("real", "imag"), ("r", "i")}:
        first, second = values.dtype.names
        values = values[first] + 1j * values[second]
    values = values.T
    if dataset.attrs.get("MATLAB_class") == b"char" and values.dtype.kind in "iu":
        return np.array(["".join(map(chr, row)) for row in np.atleast_2d(values)])
    return values


def _sparse(group: Any) -> Any:  # noqa: ANN401
    """Assemble a sparse matrix, whose places are checked first: SciPy trusts them."""
    columns = np.asarray(group["jc"][()], np.int64).ravel()
    values = _numbers(group["data"]).ravel()
    rows = np.asarray(group["ir"][()], np.int64).ravel()
    shape = (int(group.attrs["MATLAB_sparse"]), len(columns) - 1)
    matrix: Any = sparse.csc_array((values, rows, columns), shape=shape)
    matrix.check_format(full_check=True)
    return sparse.csr_array(matrix)
