"""MATLAB files, version 4 to 7.3: sparse or full matrices by name, as MATLAB, COMSOL's LiveLink and SciPy save them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import lazy_loader
import numpy as np
from scipy import sparse

from frf_ipz.fe.matrices.named_arrays import read_named
from frf_ipz.fe.matrices.stored import MOST_BYTES, MatrixFormat, MatrixRequest, StoredMatrix
from frf_ipz.foreign_errors import errors_of_reader
from frf_ipz.hdf5_files import SIGNATURE, Hdf5Tree, open_tree
from frf_ipz.input_files import open_input
from frf_ipz.matlab_files import read_matlab
from frf_ipz.numerics.compressed_places import require_places

if TYPE_CHECKING:
    from pathlib import Path

h5py = lazy_loader.load("h5py")  # slow to load, and most models do not need it

KIND = "a MATLAB file"
DEEPEST = 4  # structures within structures


def _fits(path: Path, head: bytes) -> bool:
    return path.suffix.lower() == ".mat" or head.startswith(b"MATLAB") or _is_hdf5(head)


def _is_hdf5(head: bytes) -> bool:
    return SIGNATURE in {head[:8], head[512:520]}


def _read(request: MatrixRequest) -> StoredMatrix:
    with open_input(request.path) as stream:
        is_hdf5 = _is_hdf5(stream.read(520))
    if is_hdf5:
        arrays = _arrays_of_hdf5(request.path)
        with errors_of_reader(request.path, KIND):
            return read_named(arrays, request)
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
    found: dict[str, Any] = {}
    with open_tree(path, "a MATLAB file of version 7.3", most_bytes=MOST_BYTES) as tree:
        for name, member in tree.members(tree.file):
            if name.startswith("#"):
                continue
            if isinstance(member, h5py.Dataset):
                found[name] = _numbers(tree, member)
            elif isinstance(member.get("data"), h5py.Dataset) and "jc" in member and "ir" in member:
                found[name] = _sparse(tree, member)
    return found


def _numbers(tree: Hdf5Tree, dataset: Any) -> Any:  # noqa: ANN401 - h5py has no types
    """Give an array with its axes as MATLAB has them; texts as one text a row."""
    values = tree.read(dataset).T
    if dataset.attrs.get("MATLAB_class") == b"char" and values.dtype.kind in "iu":
        return np.array(["".join(map(chr, row)) for row in np.atleast_2d(values)])
    return values


def _sparse(tree: Hdf5Tree, group: Any) -> Any:  # noqa: ANN401
    """Assemble a sparse matrix, whose places are checked first: SciPy trusts them."""
    columns = np.asarray(tree.read(group["jc"]), np.int64).ravel()
    n_rows = int(group.attrs["MATLAB_sparse"])
    values = tree.read(group["data"]).ravel()
    rows = np.asarray(tree.read(group["ir"]), np.int64).ravel()
    matrix: Any = sparse.csc_array((values, rows, columns), shape=(n_rows, len(columns) - 1))
    require_places(matrix)
    return sparse.csr_array(matrix)
