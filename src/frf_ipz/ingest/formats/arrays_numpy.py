"""NumPy's files: ``.npz`` with named arrays, ``.npy`` with one. Nothing that is pickled is read."""

from __future__ import annotations

import io
import zipfile
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.lib import format as npy_format

from frf_ipz.errors import FileFormatError
from frf_ipz.ingest.formats.file_arrays import ArrayFormat, FileArrays, require_size
from frf_ipz.ingest.formats.foreign_errors import errors_of_reader
from frf_ipz.input_files import open_input

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from frf_ipz.ingest.formats.file_arrays import NumericArray

MAGIC = b"\x93NUMPY"
ZIP = b"PK\x03\x04"
KIND = "a NumPy file"
ONLY = "values"  # what the array of a file with one is called
HEADERS: dict[tuple[int, int], Callable[[BinaryIO], tuple[tuple[int, ...], bool, np.dtype]]] = {
    (1, 0): npy_format.read_array_header_1_0,
    (2, 0): npy_format.read_array_header_2_0,
}


def _recognises(head: bytes) -> bool:
    return head.startswith(MAGIC) or (head.startswith(ZIP) and b".npy" in head[:1000])


def _read(path: Path) -> FileArrays:
    arrays: dict[str, NumericArray] = {}
    texts: dict[str, tuple[str, ...]] = {}
    unread: list[str] = []
    file_bytes = path.stat().st_size
    with open_input(path) as stream, errors_of_reader(path, KIND):
        if stream.read(len(MAGIC)) == MAGIC:
            stream.seek(0)
            _take(path, ONLY, stream, file_bytes, arrays, texts, unread)
        else:
            with zipfile.ZipFile(stream) as archive:
                members = archive.infolist()
                require_size(path, sum(member.file_size for member in members), file_bytes)
                for member in members:
                    name = member.filename.removesuffix(".npy")
                    content = io.BytesIO(archive.read(member))
                    _take(path, name, content, member.file_size, arrays, texts, unread)
    return FileArrays(path=path, arrays=arrays, texts=texts, unread=tuple(unread))


FORMAT = ArrayFormat(rank=5, recognises=_recognises, read=_read)


def _take(
    path: Path,
    name: str,
    stream: BinaryIO,
    n_bytes: int,
    arrays: dict[str, NumericArray],
    texts: dict[str, tuple[str, ...]],
    unread: list[str],
) -> None:
    """Read one array whose header fits its size; objects and what is no array are not read."""
    version = npy_format.read_magic(stream)
    shape, _, kind = HEADERS.get(version, npy_format.read_array_header_2_0)(stream)
    if kind.hasobject:
        unread.append(f"{name} (pickled objects; save it as numbers)")
        return
    if int(np.prod(shape, dtype=object)) * kind.itemsize > n_bytes:
        raise FileFormatError(path, f"'{name}' promises more numbers than there are: it is cut off; export it again")
    stream.seek(0)
    values = np.lib.format.read_array(stream, allow_pickle=False)
    fields = {f"{name}.{part}": values[part] for part in kind.names} if kind.names else {name: values}
    for part, numbers in fields.items():
        if numbers.dtype.kind in "biufc":
            arrays[part] = numbers
        elif numbers.dtype.kind in "US" and 0 < numbers.size <= 1000:
            texts[part] = tuple(str(np.char.decode(item) if item.dtype.kind == "S" else item) for item in numbers.flat)
        else:
            unread.append(part)
