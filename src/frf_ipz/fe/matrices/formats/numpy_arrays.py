"""NumPy's and SciPy's files: ``.npz`` of `scipy.sparse.save_npz`, or of `numpy.savez` with arrays by name; ``.npy``.

Beside matrices by name, ``dofs`` (texts such as ``1:x``, one a row) and ``coordinates`` (a row each) name the rows.
Nothing that is pickled is read.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.arrays import as_whole_numbers
from frf_ipz.errors import FileFormatError, errors_of_file
from frf_ipz.fe.matrices.named_arrays import read_named
from frf_ipz.fe.matrices.stored import MOST_BYTES, MatrixFormat, MatrixRequest, StoredMatrix
from frf_ipz.foreign_errors import errors_of_reader
from frf_ipz.numpy_files import KIND, is_numpy_file, read_numpy

if TYPE_CHECKING:
    from pathlib import Path

ONLY = "matrix"  # what the one array of a file is called


def _fits(path: Path, head: bytes) -> bool:
    return path.suffix.lower() in {".npz", ".npy"} or is_numpy_file(head)


def _read(request: MatrixRequest) -> StoredMatrix:
    found = read_numpy(request.path, only=ONLY, most_bytes=MOST_BYTES)
    for name in found.pickled:
        raise FileFormatError(request.path, f"holds pickled objects in '{name}', which are not read; save numbers")
    with errors_of_reader(request.path, KIND), errors_of_file(request.path):
        return read_named(_assembled(found.arrays), request)


FORMAT = MatrixFormat(rank=1, fits=_fits, read=_read)


def _assembled(arrays: dict[str, Any]) -> dict[str, Any]:
    """Put together what `scipy.sparse.save_npz` has taken apart."""
    if "format" not in arrays or "shape" not in arrays:
        return arrays
    kind = np.asarray(arrays["format"]).item()
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    return {ONLY: (kind, tuple(as_whole_numbers(arrays["shape"], "the sizes of the matrix").ravel().tolist()), arrays)}
