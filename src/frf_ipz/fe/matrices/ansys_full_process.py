"""Reads a ``.full`` file of Ansys in a process of its own: ``python -m frf_ipz.fe.matrices.ansys_full_process IN OUT``.

The reader of ansys-mapdl-reader is compiled and follows the numbers of the file; one that is damaged may end the
process that it runs in, and this is not the user's.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from frf_ipz.output_files import replacing


def main() -> None:
    """Write the entries of both matrices and the labels of the rows as a NumPy file."""
    source, target = sys.argv[1:]
    file = import_module("ansys.mapdl.reader").read_binary(source)
    labels, stiffness, mass = file.load_km(sort=False)
    arrays: dict[str, Any] = {"labels": np.asarray(labels)}
    for name, matrix in (("stiffness", stiffness), ("mass", mass)):
        if matrix is not None:
            entries = matrix.tocoo()
            arrays |= {f"{name}_rows": entries.row, f"{name}_columns": entries.col, f"{name}_values": entries.data}
    with replacing(Path(target)) as beside, beside.open("wb") as stream:
        np.savez(stream, **arrays)


if __name__ == "__main__":
    main()
