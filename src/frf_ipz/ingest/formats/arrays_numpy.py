"""NumPy's files: ``.npz`` with named arrays, ``.npy`` with one. Nothing that is pickled is read."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import as_doubles
from frf_ipz.ingest.formats.file_arrays import MOST_EXPANDED, ArrayFormat, FileArrays
from frf_ipz.numpy_files import is_numpy_file, read_numpy

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.ingest.formats.file_arrays import NumericArray

ONLY = "values"  # what the array of a file with one is called
MOST_TEXTS = 1000


def _read(path: Path) -> FileArrays:
    found = read_numpy(path, only=ONLY, most_bytes=MOST_EXPANDED)
    arrays: dict[str, NumericArray] = {}
    texts: dict[str, tuple[str, ...]] = {}
    unread = [f"{name} (pickled objects; save it as numbers)" for name in found.pickled]
    for name, values in found.arrays.items():
        kind = values.dtype
        fields = {f"{name}.{part}": values[part] for part in kind.names} if kind.names else {name: values}
        for part, numbers in fields.items():
            if numbers.dtype.kind in "biufc":
                arrays[part] = as_doubles(path, part, numbers)
            elif numbers.dtype.kind in "US" and 0 < numbers.size <= MOST_TEXTS:
                texts[part] = tuple(
                    str(np.char.decode(item) if item.dtype.kind == "S" else item) for item in numbers.flat
                )
            else:
                unread.append(part)
    return FileArrays(path=path, arrays=arrays, texts=texts, unread=tuple(unread))


FORMAT = ArrayFormat(rank=5, recognises=is_numpy_file, read=_read)
