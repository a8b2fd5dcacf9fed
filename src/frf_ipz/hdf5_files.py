"""Walks through an HDF5 file without leaving it: no links to other files, no circles, sizes known before reading."""

from __future__ import annotations

import os
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import IO, TYPE_CHECKING, Any

import lazy_loader
import numpy as np

from frf_ipz.errors import FileFormatError
from frf_ipz.foreign_errors import errors_of_reader
from frf_ipz.input_files import require_expanded

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

h5py = lazy_loader.load("h5py")  # slow to load, and most runs do not need it

SIGNATURE = b"\x89HDF\r\n\x1a\n"
DEEPEST = 32  # groups within groups
MOST_OBJECTS = 20_000  # groups and data sets; a measurement or a model has some hundred
MOST_TEXTS = 1000  # texts of a list, such as names of channels


@dataclass(kw_only=True)
class Hdf5Tree:
    """An open file, and how much of it may still be read.

    Parameters
    ----------
    path : Path
        The file.
    file : File
        As h5py has it.
    file_bytes : int
        Its size.
    most_bytes : int
        What may be read of it, where it is smaller.
    """

    path: Path
    file: Any
    file_bytes: int
    most_bytes: int
    _n_objects: int = 0
    _n_bytes: int = 0
    _ancestors: list[Any] = field(default_factory=list)

    def members(self, group: Any) -> Iterator[tuple[str, Any]]:  # noqa: ANN401 - h5py has no types
        """Give what lies in a group; links to other files are left out.

        Parameters
        ----------
        group : Group
            As h5py has it.

        Yields
        ------
        name, object
            Groups and data sets.

        Raises
        ------
        FileFormatError
            If there are too many, or groups lie too deep in one another, as in a circle of links.
        """
        if len(self._ancestors) > DEEPEST:
            raise FileFormatError(self.path, f"has groups more than {DEEPEST} deep, or in a circle; export it flat")
        self._ancestors.append(group)
        for name in group:
            if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
                continue
            self.count()
            member = group.get(name)
            if member is not None:
                yield str(name), member
        self._ancestors.pop()

    def count(self) -> None:
        """Count one more object.

        Raises
        ------
        FileFormatError
            If these are more than any file of measurements or matrices has.
        """
        self._n_objects += 1
        if self._n_objects > MOST_OBJECTS:
            raise FileFormatError(self.path, f"holds more than {MOST_OBJECTS} objects; is it the right file?")

    def read(self, dataset: Any) -> NDArray[Any]:  # noqa: ANN401
        """Read a data set of numbers.

        Parameters
        ----------
        dataset : Dataset
            As h5py has it.

        Returns
        -------
        array
            Numbers; parts ``real`` and ``imag`` are made complex.

        Raises
        ------
        FileFormatError
            If it lies in another file, or is too large.
        """
        if dataset.external or dataset.is_virtual:
            raise FileFormatError(self.path, f"'{dataset.name}' lies in another file; copy the data into this one")
        self._n_bytes += int(dataset.size) * dataset.dtype.itemsize
        require_expanded(self.path, self._n_bytes, file_bytes=self.file_bytes, most_bytes=self.most_bytes)
        values = np.asarray(dataset[()])
        names = values.dtype.names
        if names in {("real", "imag"), ("r", "i")}:
            return np.asarray(values[names[0]] + 1j * values[names[1]])
        return values


@contextmanager
def open_tree(data: IO[bytes], path: Path, kind: str, *, most_bytes: int) -> Iterator[Hdf5Tree]:
    """Open an HDF5 file, in a process that its library may end.

    Parameters
    ----------
    data : stream
        The file.
    path : Path
        Its name, for messages.
    kind : str
        What it should be, for messages.
    most_bytes : int
        What may be read of it, where it is smaller.

    Yields
    ------
    Hdf5Tree
        To be walked through.

    Raises
    ------
    FileFormatError
        If it is none, or is damaged.
    """
    file_bytes = data.seek(0, os.SEEK_END)
    with errors_of_reader(path, kind), h5py.File(data, "r") as file:
        yield Hdf5Tree(path=path, file=file, file_bytes=file_bytes, most_bytes=most_bytes)


def texts_of(values: object) -> tuple[str, ...] | None:
    """Read a text or a list of texts.

    Parameters
    ----------
    values : object
        What h5py gives for an attribute or a data set of texts.

    Returns
    -------
    tuple of str or None
        None where it is no text.
    """
    items = np.asarray(values, dtype=object).ravel()
    if not 0 < len(items) <= MOST_TEXTS or not all(isinstance(item, (bytes, str)) for item in items):
        return None
    return tuple(item.decode("utf-8", "replace") if isinstance(item, bytes) else str(item) for item in items)
