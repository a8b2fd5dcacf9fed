"""Reads an archive of Ansys in a process of its own: the reader of mapdl-archive is compiled."""

from __future__ import annotations

from importlib import import_module
from typing import IO, TYPE_CHECKING

import numpy as np

from frf_ipz.reader_process import FileContents, as_file

if TYPE_CHECKING:
    from pathlib import Path


def read(data: IO[bytes], path: Path) -> FileContents:
    """Read nodes, kinds of elements and elements, one behind the other.

    Parameters
    ----------
    data : stream
        The file.
    path : Path
        Its name.

    Returns
    -------
    FileContents
        ``nodes``, their ``positions``, ``kinds`` [type, kind], ``elements`` and the ``sizes`` of these.
    """
    with as_file(data, path) as copy:
        archive = import_module("mapdl_archive").Archive(str(copy), parse_vtk=False)
    rows = [np.asarray(row, np.int64) for row in archive.elem]
    return FileContents(
        arrays={
            "nodes": np.asarray(archive.nnum, np.int64),
            "positions": np.asarray(archive.nodes, float)[:, :3],
            "kinds": np.asarray(archive.ekey, np.int64).reshape(-1, 2),
            "elements": np.concatenate([np.zeros(0, np.int64), *rows]),
            "sizes": np.array([len(row) for row in rows], np.int64),
        }
    )
