"""MATLAB files, versions 4 to 7.3: numbers, texts, structures and cells; objects only MATLAB itself can read."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.foreign_errors import errors_of_reader
from frf_ipz.hdf5_files import SIGNATURE
from frf_ipz.ingest.formats.file_arrays import MOST_EXPANDED, ArrayFormat, FileArrays
from frf_ipz.ingest.formats.text_layout import read_head
from frf_ipz.input_files import require_regular_file
from frf_ipz.late_imports import import_late
from frf_ipz.matlab_files import read_matlab
from frf_ipz.reader_process import read_in_process

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from scipy.io import matlab

    from frf_ipz.ingest.formats.file_arrays import NumericArray
else:
    matlab = import_late("scipy.io.matlab")

KIND = "a MATLAB file"
PROCESS = "frf_ipz.ingest.formats.matlab_7_3_process"
N_HEADER = 128  # bytes before the first element, from version 5 on
HDF5_OFFSET = 512  # bytes before the HDF5 file in one of version 7.3
MOST_ITEMS = 20_000  # arrays and texts; a recording has some hundred
V4_BYTES = 20  # of the header of an array
OBJECTS = "these are objects (tables, timetables, frd, idfrd and the like): in MATLAB save arrays, or s = struct(sys)"


def _recognises(head: bytes) -> bool:
    is_newer = head[:6] == b"MATLAB" and b"MAT-file" in head[:N_HEADER]
    return is_newer or head[HDF5_OFFSET : HDF5_OFFSET + len(SIGNATURE)] == SIGNATURE or _is_version_4(head)


def _is_version_4(head: bytes) -> bool:
    """Tell a file of version 4, which has no signature, by its first header: type, sizes, and a name."""
    for order, first in (("<", 0), (">", 1000)):
        if len(head) < V4_BYTES:
            return False
        kind, n_rows, n_columns, is_complex, n_name = struct.unpack_from(f"{order}5i", head)
        name = head[V4_BYTES : V4_BYTES + max(n_name, 0)]
        fits = first <= kind <= first + 52 and kind % 10 <= 2 and min(n_rows, n_columns) >= 0 and is_complex in {0, 1}
        if fits and 2 <= n_name <= 64 and name[-1:] == b"\0" and name[:-1].decode("latin-1").isidentifier():
            return True
    return False


def _read(path: Path) -> FileArrays:
    if read_head(path)[HDF5_OFFSET : HDF5_OFFSET + len(SIGNATURE)] == SIGNATURE:
        contents = read_in_process(path, PROCESS, kind=KIND, most_bytes=MOST_EXPANDED)
        return MatlabContents(arrays=contents.arrays, **contents.said).as_arrays(path)
    found = MatlabContents()
    size = require_regular_file(path)
    with errors_of_reader(path, KIND):
        values = read_matlab(path, most_bytes=max(MOST_EXPANDED, size))
    for name, value in values.items():
        if name in {"None", "__function_workspace__"}:  # the contents of objects, which have no name
            found.has_objects = True
        elif not name.startswith("__"):
            found.add(name, value)
    return found.as_arrays(path)


FORMAT = ArrayFormat(rank=4, recognises=_recognises, read=_read)


@dataclass(kw_only=True)
class MatlabContents:
    """Numbers and texts, by their way through structures and cells.

    Parameters
    ----------
    arrays : dict of str to array
        Numbers.
    texts : dict of str to sequence of str
        Texts, and lists of texts.
    unread : list of str
        What cannot be read.
    has_objects : bool
        What cannot be read are objects, some at least.
    """

    arrays: dict[str, NumericArray] = field(default_factory=dict)
    texts: dict[str, Sequence[str]] = field(default_factory=dict)
    unread: list[str] = field(default_factory=list)
    has_objects: bool = False

    def as_arrays(self, path: Path) -> FileArrays:
        """Give them as those of a file of arrays."""
        hint = (OBJECTS,) if self.has_objects else ()
        texts = {place: tuple(lines) for place, lines in self.texts.items()}
        unread = (*dict.fromkeys(self.unread), *hint)
        return FileArrays(path=path, arrays=self.arrays, texts=texts, counts_from_one=True, unread=unread)

    def add(self, name: str, value: object) -> None:
        """Take a value as SciPy gives it."""
        if len(self.arrays) + len(self.texts) > MOST_ITEMS or sparse.issparse(value):
            self.unread.append(name)
        elif not isinstance(value, np.ndarray) or isinstance(value, (matlab.MatlabFunction, matlab.MatlabOpaque)):
            self.unread.append(name)
            self.has_objects = True
        elif value.dtype.names:
            self._add_fields(name, value)
        elif value.dtype.kind == "O":
            self._add_cells(name, value)
        elif value.dtype.kind in "US":
            self.texts[name] = tuple(str(text) for text in value.ravel())
        elif value.dtype.kind in "biufc":
            self.arrays[name] = value

    def _add_fields(self, name: str, value: NumericArray) -> None:
        elements = value.ravel(order="F")
        for number, element in enumerate(elements, start=1):
            place = name if len(elements) == 1 else f"{name}({number})"
            for part in value.dtype.names or ():
                self.add(f"{place}.{part}", element[part])

    def _add_cells(self, name: str, value: NumericArray) -> None:
        cells = value.ravel(order="F")
        said = [_one_text(cell) for cell in cells]
        if len(said) and all(text is not None for text in said):
            self.texts[name] = tuple(text or "" for text in said)
            return
        for number, cell in enumerate(cells, start=1):
            self.add(f"{name}{{{number}}}", cell)


def _one_text(cell: object) -> str | None:
    if isinstance(cell, np.ndarray) and cell.dtype.kind in "US" and cell.size <= 1:
        return str(cell.ravel()[0]) if cell.size else ""
    return None
