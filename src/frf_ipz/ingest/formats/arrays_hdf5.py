"""HDF5 files: every data set of numbers, and the attributes beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import lazy_loader
import numpy as np

from frf_ipz.hdf5_files import SIGNATURE, open_tree, texts_of
from frf_ipz.ingest.formats.file_arrays import MOST_EXPANDED, ArrayFormat, FileArrays

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.hdf5_files import Hdf5Tree
    from frf_ipz.ingest.formats.file_arrays import NumericArray

h5py = lazy_loader.load("h5py")  # slow to load, and most recordings do not need it

KIND = "an HDF5 file"


def _recognises(head: bytes) -> bool:
    return head.startswith(SIGNATURE)


def _read(path: Path) -> FileArrays:
    arrays: dict[str, NumericArray] = {}
    texts: dict[str, tuple[str, ...]] = {}
    unread: list[str] = []
    with open_tree(path, KIND, most_bytes=MOST_EXPANDED) as tree:
        _walk(tree, tree.file, "", arrays, texts, unread)
    return FileArrays(path=path, arrays=arrays, texts=texts, unread=tuple(unread))


FORMAT = ArrayFormat(rank=5, recognises=_recognises, read=_read)


def _walk(
    tree: Hdf5Tree,
    group: Any,  # noqa: ANN401 - h5py has no types
    way: str,
    arrays: dict[str, NumericArray],
    texts: dict[str, tuple[str, ...]],
    unread: list[str],
) -> None:
    _read_attributes(group, way, arrays, texts)
    for name, member in tree.members(group):
        place = f"{way}/{name}" if way else name
        if isinstance(member, h5py.Group):
            _walk(tree, member, place, arrays, texts, unread)
            continue
        if not isinstance(member, h5py.Dataset):
            continue
        _read_attributes(member, place, arrays, texts)
        if h5py.check_string_dtype(member.dtype) is not None and member.size <= 1000:
            texts[place] = texts_of(member[()]) or ()
        elif member.dtype.names not in {None, ("r", "i"), ("real", "imag")}:
            table = tree.read(member)
            fields = {f"{place}.{part}": table[part] for part in member.dtype.names}
            arrays |= {part: values for part, values in fields.items() if values.dtype.kind in "biufc"}
        elif member.dtype.kind in "biufcV":
            arrays[place] = tree.read(member)
        else:
            unread.append(place)


def _read_attributes(
    member: Any,  # noqa: ANN401
    way: str,
    arrays: dict[str, NumericArray],
    texts: dict[str, tuple[str, ...]],
) -> None:
    """Take attributes as arrays and texts of their own, behind the name of what they belong to."""
    for name in member.attrs:
        attribute = member.attrs.get_id(name)
        if attribute.dtype.kind not in "biufSO" or int(np.prod(attribute.shape, dtype=np.int64)) > 1000:
            continue
        values = member.attrs[name]
        said = texts_of(values)
        if said is not None:
            texts[f"{way}@{name}"] = said
        elif np.asarray(values).dtype.kind in "biuf":
            arrays[f"{way}@{name}"] = np.asarray(values)
