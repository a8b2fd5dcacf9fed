"""Reads an archive of Ansys in a process of its own: ``python -m frf_ipz.meshes.ansys_archive_process IN OUT``."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

import numpy as np

from frf_ipz.output_files import replacing


def main() -> None:
    """Write nodes, kinds of elements and elements, one behind the other, as a NumPy file."""
    source, target = sys.argv[1:]
    archive = import_module("mapdl_archive").Archive(source, parse_vtk=False)
    rows = [np.asarray(row, np.int64) for row in archive.elem]
    arrays = {
        "nodes": np.asarray(archive.nnum, np.int64),
        "positions": np.asarray(archive.nodes, float)[:, :3],
        "kinds": np.asarray(archive.ekey, np.int64).reshape(-1, 2),
        "elements": np.concatenate([np.zeros(0, np.int64), *rows]),
        "sizes": np.array([len(row) for row in rows], np.int64),
    }
    with replacing(Path(target)) as beside, beside.open("wb") as stream:
        np.savez(stream, **arrays)  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
