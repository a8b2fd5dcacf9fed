"""NumPy's and SciPy's files: ``.npz`` of `scipy.sparse.save_npz`, or of `numpy.savez` with arrays by name; ``.npy``.

Beside matrices by name, ``dofs`` (texts such as ``1:x``, one a row) and ``coordinates`` (a row each) name the rows.
Nothing that is pickled is read.
"""

from __future__ import annotations

import io
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.lib import format as npy_format

from frf_ipz.errors import FileFormatError
from frf_ipz.fe.matrices.named_arrays import read_named
from frf_ipz.fe.matrices.stored import MOST_BYTES, MatrixFormat, MatrixRequest, StoredMatrix, errors_of_library
from frf_ipz.input_files import read_bytes

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

MAGIC, ZIP = b"\x93NUMPY", b"PK\x03\x04"
KIND = "a NumPy file"
ONLY = "matrix"  # what the one array of a file is called


def _fits(path: Path, head: bytes) -> bool:
    return (
        path.suffix.lower() in {".npz", ".npy"} or head.startswith(MAGIC) or (head.startswith(ZIP) and b".npy" in head)
    )


def _read(request: MatrixRequest) -> StoredMatrix:
    data = read_bytes(request.path, most_bytes=MOST_BYTES)
    arrays: dict[str, Any] = {}
    with errors_of_library(request.path, KIND):
        if data.startswith(MAGIC):
            arrays[ONLY] = _array(request.path, ONLY, data)
        else:
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                members = archive.infolist()
                if sum(member.file_size for member in members) > MOST_BYTES:
                    raise FileFormatError(request.path, f"expands to more than {MOST_BYTES >> 20} MB; is it damaged?")
                for member in members:
                    name = member.filename.removesuffix(".npy")
                    arrays[name] = _array(request.path, name, archive.read(member))
        return read_named(_assembled(arrays), request)


FORMAT = MatrixFormat(rank=1, fits=_fits, read=_read)


def _array(path: Path, name: str, data: bytes) -> NDArray[Any]:
    """Read one array whose header fits its size."""
    stream = io.BytesIO(data)
    version = npy_format.read_magic(stream)
    reader = npy_format.read_array_header_1_0 if version == (1, 0) else npy_format.read_array_header_2_0
    shape, _, kind = reader(stream)
    if kind.hasobject:
        raise FileFormatError(path, f"holds pickled objects in '{name}', which are not read; save numbers")
    if int(np.prod(shape, dtype=object)) * kind.itemsize > len(data):
        raise FileFormatError(path, f"'{name}' promises more numbers than there are: it is cut off; export it again")
    stream.seek(0)
    return np.asarray(npy_format.read_array(stream, allow_pickle=False))


def _assembled(arrays: dict[str, Any]) -> dict[str, Any]:
    """Put together what `scipy.sparse.save_npz` has taken apart."""
    if "format" not in arrays or "shape" not in arrays:
        return arrays
    kind = np.asarray(arrays["format"]).item()
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    return {ONLY: (kind, tuple(int(size) for size in arrays["shape"]), arrays)}
