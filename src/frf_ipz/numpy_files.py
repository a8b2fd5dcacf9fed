"""NumPy files that may come from anybody: nothing pickled is read, and nothing larger than it says.

A ``.npz`` is an archive of arrays by name, a ``.npy`` one array. The sizes that an archive and each array state are
compared with what is there before memory is taken.
"""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.lib import format as npy_format

from frf_ipz.arrays import as_doubles
from frf_ipz.errors import FileFormatError
from frf_ipz.foreign_errors import errors_of_reader
from frf_ipz.input_files import read_bytes, require_expanded

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

MAGIC, ZIP = b"\x93NUMPY", b"PK\x03\x04"
KIND = "a NumPy file"
MOST_BYTES = 1 << 28  # of one file, expanded: half of what looking at any folder may take
HEADERS: dict[tuple[int, int], Callable[[BinaryIO], tuple[tuple[int, ...], bool, np.dtype]]] = {
    (1, 0): npy_format.read_array_header_1_0,
    (2, 0): npy_format.read_array_header_2_0,
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NumpyArrays:
    """The arrays of a file.

    Parameters
    ----------
    arrays : dict of str to array
        By name; the one array of a ``.npy`` has the name that was asked for.
    pickled : tuple of str
        Names of arrays of pickled objects, which are not read.
    """

    arrays: dict[str, NDArray[Any]]
    pickled: tuple[str, ...]


def is_numpy_file(head: bytes) -> bool:
    """Tell whether a file is one of NumPy's, by its first bytes."""
    return head.startswith(MAGIC) or (head.startswith(ZIP) and b".npy" in head[:1000])


def read_numpy(path: Path, *, only: str, most_bytes: int = MOST_BYTES) -> NumpyArrays:
    """Read the arrays of a file.

    Parameters
    ----------
    path : Path
        The file.
    only : str
        Name for the array of a file that has one without a name.
    most_bytes : int, optional
        What it may hold, expanded; more where the file itself is larger.

    Returns
    -------
    NumpyArrays
        All of them but pickled ones.

    Raises
    ------
    FileFormatError
        If it is missing, no such file, damaged, or holds more.
    """
    data = read_bytes(path)
    with errors_of_reader(path, KIND):
        if data.startswith(MAGIC):
            contents = {only: data}
        else:
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                n_bytes = sum(member.file_size for member in archive.infolist())
                require_expanded(path, n_bytes, file_bytes=len(data), most_bytes=most_bytes)
                contents = {member.filename.removesuffix(".npy"): archive.read(member) for member in archive.infolist()}
        found = {name: _array(path, name, content) for name, content in contents.items()}
    arrays = {name: values for name, values in found.items() if values is not None}
    return NumpyArrays(arrays=arrays, pickled=tuple(name for name, values in found.items() if values is None))


def _array(path: Path, name: str, data: bytes) -> NDArray[Any] | None:
    """Read one array whose header fits its size; None for objects."""
    stream = io.BytesIO(data)
    version = npy_format.read_magic(stream)
    shape, _, kind = HEADERS.get(version, npy_format.read_array_header_2_0)(stream)
    if kind.hasobject:
        return None
    if int(np.prod(shape, dtype=object)) * kind.itemsize > len(data):
        raise FileFormatError(path, f"'{name}' promises more numbers than there are: it is cut off; export it again")
    stream.seek(0)
    return as_doubles(path, name, npy_format.read_array(stream, allow_pickle=False))
