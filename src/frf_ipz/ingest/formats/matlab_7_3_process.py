"""Reads a MATLAB file of version 7.3 in a process of its own, as the library of HDF5 may end the one that it runs in.

It is an HDF5 file in which structures are groups, cells are references, and axes stand in the opposite order.
"""

from __future__ import annotations

from typing import IO, TYPE_CHECKING, Any

import lazy_loader
import numpy as np

from frf_ipz.errors import FileFormatError
from frf_ipz.hdf5_files import Hdf5Tree, open_tree
from frf_ipz.ingest.formats.arrays_matlab import KIND, MatlabContents
from frf_ipz.ingest.formats.file_arrays import MOST_EXPANDED
from frf_ipz.reader_process import FileContents

if TYPE_CHECKING:
    from pathlib import Path

h5py = lazy_loader.load("h5py")

DEEPEST = 32  # structures within structures


def read(data: IO[bytes], path: Path) -> FileContents:
    """Read every variable.

    Parameters
    ----------
    data : stream
        The file.
    path : Path
        Its name, for messages.

    Returns
    -------
    FileContents
        The arrays; said is all else of `MatlabContents`.
    """
    found = MatlabContents()
    with open_tree(data, path, KIND, most_bytes=MOST_EXPANDED) as tree:
        for name, member in tree.members(tree.file):
            if not name.startswith("#"):
                _take(tree, name, member, found, 0)
    said = {"texts": found.texts, "unread": found.unread, "has_objects": found.has_objects}
    return FileContents(arrays=found.arrays, said=said)


def _take(tree: Hdf5Tree, name: str, member: Any, found: MatlabContents, depth: int) -> None:  # noqa: ANN401 - of h5py
    if depth > DEEPEST:
        raise FileFormatError(tree.path, f"has structures more than {DEEPEST} deep; save the arrays themselves")
    matlab_class = member.attrs.get("MATLAB_class", b"")
    matlab_class = matlab_class.decode() if isinstance(matlab_class, bytes) else str(matlab_class)
    if "MATLAB_object_decode" in member.attrs or matlab_class == "function_handle":
        found.unread.append(name)
        found.has_objects = True
    elif isinstance(member, h5py.Group):
        if "MATLAB_sparse" in member.attrs:
            found.unread.append(name)
            return
        for part, content in tree.members(member):
            _take(tree, f"{name}.{part}", content, found, depth + 1)
    elif member.attrs.get("MATLAB_empty", 0):
        return
    elif h5py.check_ref_dtype(member.dtype) is not None:
        _take_references(tree, name, member, found, depth)
    elif matlab_class == "char":
        rows = np.atleast_2d(tree.read(member).T)
        found.texts[name] = tuple(row.astype(np.uint16).tobytes().decode("utf-16-le", "replace") for row in rows)
    else:
        values = tree.read(member)
        if values.dtype.kind in "biufc":
            found.arrays[name] = values.T


def _take_references(tree: Hdf5Tree, name: str, member: Any, found: MatlabContents, depth: int) -> None:  # noqa: ANN401
    """Follow references: those of a cell, or of a field of an array of structures."""
    is_cell = "MATLAB_class" in member.attrs
    inner = MatlabContents()
    for number, reference in enumerate(tree.read(member).ravel(), start=1):
        tree.count()
        if reference:
            way, _, part = name.rpartition(".")
            place = f"{name}{{{number}}}" if is_cell or not way else f"{way}({number}).{part}"
            _take(tree, place, tree.file[reference], inner, depth + 1)
    if is_cell and inner.texts and not inner.arrays:
        found.texts[name] = tuple(text for texts in inner.texts.values() for text in texts)
    else:
        found.texts |= inner.texts
    found.arrays |= inner.arrays
    found.unread += inner.unread
    found.has_objects |= inner.has_objects
