"""Reads an HDF5 file in a process of its own, which the library of HDF5 may end where it is damaged."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import IO, TYPE_CHECKING, Any

import lazy_loader
import numpy as np

from frf_ipz.hdf5_files import Hdf5Tree, open_tree, texts_of
from frf_ipz.ingest.formats.file_arrays import MOST_EXPANDED
from frf_ipz.reader_process import FileContents

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.ingest.formats.file_arrays import NumericArray

h5py = lazy_loader.load("h5py")

KIND = "an HDF5 file"
MOST_ITEMS = 1000  # of an attribute, and of a list of texts


def read(data: IO[bytes], path: Path) -> FileContents:
    """Read every data set of numbers, and the attributes beside it.

    Parameters
    ----------
    data : stream
        The file.
    path : Path
        Its name, for messages.

    Returns
    -------
    FileContents
        The arrays; said are ``texts`` by their ways, and the ways of what is ``unread``.
    """
    found = _Found()
    with open_tree(data, path, KIND, most_bytes=MOST_EXPANDED) as tree:
        _walk(tree, tree.file, "", found)
    return FileContents(arrays=found.arrays, said={"texts": found.texts, "unread": found.unread})


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    arrays: dict[str, NumericArray] = field(default_factory=dict)
    texts: dict[str, tuple[str, ...]] = field(default_factory=dict)
    unread: list[str] = field(default_factory=list)


def _walk(tree: Hdf5Tree, group: Any, way: str, found: _Found) -> None:  # noqa: ANN401 - h5py has no types
    _read_attributes(group, way, found)
    for name, member in tree.members(group):
        place = f"{way}/{name}" if way else name
        if isinstance(member, h5py.Group):
            _walk(tree, member, place, found)
            continue
        if not isinstance(member, h5py.Dataset):
            continue
        _read_attributes(member, place, found)
        if h5py.check_string_dtype(member.dtype) is not None and member.size <= MOST_ITEMS:
            found.texts[place] = texts_of(member[()]) or ()
        elif member.dtype.names not in {None, ("r", "i"), ("real", "imag")}:
            table = tree.read(member)
            for part in member.dtype.names:
                if table[part].dtype.kind in "biufc":
                    found.arrays[f"{place}.{part}"] = table[part]
        elif member.dtype.kind in "biufcV":
            found.arrays[place] = tree.read(member)
        else:
            found.unread.append(place)


def _read_attributes(member: Any, way: str, found: _Found) -> None:  # noqa: ANN401
    """Take attributes as arrays and texts of their own, behind the name of what they belong to."""
    for name in member.attrs:
        attribute = member.attrs.get_id(name)
        if attribute.dtype.kind not in "biufSO" or int(np.prod(attribute.shape, dtype=np.int64)) > MOST_ITEMS:
            continue
        values = member.attrs[name]
        said = texts_of(values)
        if said is not None:
            found.texts[f"{way}@{name}"] = said
        elif np.asarray(values).dtype.kind in "biuf":
            found.arrays[f"{way}@{name}"] = np.asarray(values)
