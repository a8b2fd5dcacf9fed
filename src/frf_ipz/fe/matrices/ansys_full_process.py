"""Reads a ``.full`` file of Ansys in a process of its own.

The reader of ansys-mapdl-reader is compiled and follows the numbers of the file; one that is damaged may end the
process that it runs in, and this is not the user's.
"""

from __future__ import annotations

from importlib import import_module
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from frf_ipz.reader_process import FileContents, as_file

if TYPE_CHECKING:
    from pathlib import Path


def read(data: IO[bytes], path: Path) -> FileContents:
    """Read the entries of both matrices and the labels of the rows.

    Parameters
    ----------
    data : stream
        The file.
    path : Path
        Its name.

    Returns
    -------
    FileContents
        ``labels``, and of each matrix ``stiffness_rows``, ``stiffness_columns`` and ``stiffness_values``.
    """
    with as_file(data, path) as copy:
        labels, stiffness, mass = import_module("ansys.mapdl.reader").read_binary(str(copy)).load_km(sort=False)
    arrays: dict[str, Any] = {"labels": np.asarray(labels)}
    for name, matrix in (("stiffness", stiffness), ("mass", mass)):
        if matrix is not None:
            entries = matrix.tocoo()
            arrays |= {f"{name}_rows": entries.row, f"{name}_columns": entries.col, f"{name}_values": entries.data}
    return FileContents(arrays=arrays)
