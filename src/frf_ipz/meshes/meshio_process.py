"""Reads a mesh by meshio in a process of its own: on a file that is cut off, it may look for the end for ever."""

from __future__ import annotations

from importlib import import_module
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from frf_ipz.arrays import as_whole_numbers
from frf_ipz.reader_process import FileContents, as_file

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


def read(data: IO[bytes], path: Path) -> FileContents:
    """Read points, and corners by the type of their elements.

    Parameters
    ----------
    data : stream
        The file.
    path : Path
        Says by its end which format it is.

    Returns
    -------
    FileContents
        ``points`` [node, coordinate], and blocks of elements [element, corner] by ``NUMBER:TYPE``.
    """
    with as_file(data, path) as copy:
        mesh = import_module("meshio").read(copy)
    points = np.zeros((len(mesh.points), 3))
    points[:, : np.shape(mesh.points)[1]] = mesh.points
    arrays: dict[str, NDArray[Any]] = {"points": points}
    for place, block in enumerate(mesh.cells):
        nodes = np.asarray(block.data)
        if nodes.ndim == 2:
            arrays[f"{place}:{block.type}"] = as_whole_numbers(nodes, "nodes of elements")
    return FileContents(arrays=arrays)
