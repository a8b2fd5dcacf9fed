"""Archives of Ansys (``.cdb``, by ``CDWRITE``), by mapdl-archive."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.foreign_errors import require_reader
from frf_ipz.input_files import require_size
from frf_ipz.meshes.mesh_file import MOST_BYTES, MeshFormat, StoredMesh
from frf_ipz.meshes.outer_faces import (
    CORNERS,
    HEXAHEDRON,
    LINE,
    PYRAMID,
    QUADRILATERAL,
    TETRAHEDRON,
    TRIANGLE,
    WEDGE,
)
from frf_ipz.reader_process import read_in_process

if TYPE_CHECKING:
    from pathlib import Path

PROCESS = "frf_ipz.meshes.ansys_archive_process"
KIND = "an archive of Ansys"
FIRST_NODE = 10  # of a row of an element; its material, type and so on stand before
TYPE = 1
BARS = {1, 3, 4, 8, 10, 14, 16, 21, 33, 39, 40, 44, 54, 180, 188, 189, 288, 289, 290}
SHELLS = {25, 28, 41, 42, 43, 63, 82, 83, 91, 93, 99, 131, 132, 143, 150, 157, 163, 181, 182, 183, 208, 209, 281}
TETRAHEDRA = {72, 87, 92, 98, 123, 127, 148, 168, 187, 227, 232, 237, 285, 291}


def _read(path: Path) -> StoredMesh:
    require_reader(path, "mapdl_archive", kind=KIND, extra="mesh")
    require_size(path, most_bytes=MOST_BYTES)
    arrays = read_in_process(path, PROCESS, kind=KIND, most_bytes=MOST_BYTES).arrays
    places = zip(arrays["nodes"].tolist(), arrays["positions"].tolist(), strict=True)
    kinds = dict(arrays["kinds"].tolist())
    rows = np.split(arrays["elements"], np.cumsum(arrays["sizes"])[:-1]) if len(arrays["sizes"]) else []
    return StoredMesh(
        positions={node: (x, y, z) for node, (x, y, z) in places},
        elements=[
            element
            for row in rows
            if len(row) > FIRST_NODE
            for element in _element(kinds.get(int(row[TYPE]), 0), row[FIRST_NODE:].tolist())
        ],
    )


def _element(kind: int, nodes: list[int]) -> list[tuple[str, tuple[int, ...]]]:
    """Give an element's shape and corners; what has collapsed to another shape names a corner twice."""
    if kind in BARS:
        return [(LINE, (nodes[0], nodes[1]))] if len(nodes) > 1 and nodes[1] else []
    if kind in SHELLS:
        shape = QUADRILATERAL if len(nodes) >= CORNERS[QUADRILATERAL] else TRIANGLE
    elif kind in TETRAHEDRA or len(nodes) in {4, 10}:
        shape = TETRAHEDRON
    elif len(nodes) >= CORNERS[HEXAHEDRON]:
        shape = HEXAHEDRON
    else:
        shape = {6: WEDGE, 5: PYRAMID, 3: TRIANGLE, 2: LINE}.get(len(nodes), "")
    return [(shape, tuple(nodes[: CORNERS[shape]]))] if shape and len(nodes) >= CORNERS[shape] else []


FORMAT = MeshFormat(rank=20, fits=lambda path, head: path.suffix.lower() == ".cdb", read=_read)  # noqa: ARG005
