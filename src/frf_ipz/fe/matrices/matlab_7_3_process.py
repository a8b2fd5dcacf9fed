"""Reads matrices of a MATLAB file of version 7.3 in a process of its own, which the library of HDF5 may end."""

from __future__ import annotations

from typing import IO, TYPE_CHECKING, Any

import lazy_loader
import numpy as np

from frf_ipz.fe.matrices.stored import MOST_BYTES
from frf_ipz.hdf5_files import Hdf5Tree, open_tree
from frf_ipz.reader_process import NUMBERS, FileContents

if TYPE_CHECKING:
    from pathlib import Path

h5py = lazy_loader.load("h5py")  # slow to load; only the names below are needed elsewhere

KIND = "a MATLAB file of version 7.3"
DATA, ROWS, COLUMNS, N_ROWS = "/data", "/ir", "/jc", "/n_rows"  # of a sparse matrix, behind its name


def read(data: IO[bytes], path: Path) -> FileContents:
    """Read every variable that is an array or a sparse matrix.

    Parameters
    ----------
    data : stream
        The file.
    path : Path
        Its name, for messages.

    Returns
    -------
    FileContents
        Arrays by name, texts as one text a row; of a sparse matrix four, ``K/data`` for one.
    """
    found: dict[str, Any] = {}
    with open_tree(data, path, KIND, most_bytes=MOST_BYTES) as tree:
        for name, member in tree.members(tree.file):
            if name.startswith("#"):
                continue
            if isinstance(member, h5py.Dataset):
                found[name] = _numbers(tree, member)
            elif isinstance(member.get("data"), h5py.Dataset) and "jc" in member and "ir" in member:
                for part in (DATA, ROWS, COLUMNS):
                    found[name + part] = tree.read(member[part[1:]]).ravel()
                found[name + N_ROWS] = np.asarray(int(member.attrs["MATLAB_sparse"]))
    return FileContents(arrays={name: values for name, values in found.items() if values.dtype.kind in NUMBERS})


def _numbers(tree: Hdf5Tree, dataset: Any) -> Any:  # noqa: ANN401 - h5py has no types
    """Give an array with its axes as MATLAB has them; texts as one text a row."""
    values = tree.read(dataset).T
    if dataset.attrs.get("MATLAB_class") == b"char" and values.dtype.kind in "iu":
        return np.array(["".join(map(chr, row)) for row in np.atleast_2d(values)])
    return values
