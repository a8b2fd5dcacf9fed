"""Reads a mesh by meshio in a process of its own: ``python -m frf_ipz.meshes.meshio_process IN OUT``.

On a file that is cut off, meshio may look for its end forever.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

import numpy as np

from frf_ipz.output_files import replacing


def main() -> None:
    """Write points, and corners by the type of their elements, as a NumPy file."""
    source, target = sys.argv[1:]
    mesh = import_module("meshio").read(source)
    points = np.zeros((len(mesh.points), 3))
    points[:, : np.shape(mesh.points)[1]] = mesh.points
    arrays = {"points": points}
    for place, block in enumerate(mesh.cells):
        nodes = np.asarray(block.data)
        if nodes.ndim == 2:
            arrays[f"{place}:{block.type}"] = nodes.astype(np.int64)
    with replacing(Path(target)) as beside, beside.open("wb") as stream:
        np.savez(stream, **arrays)  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
