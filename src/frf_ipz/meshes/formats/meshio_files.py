"""Meshes of Gmsh, VTK, Medit and others, by meshio.

It keeps no numbers of nodes: they are 1, 2, ... in the order of the file.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.errors import FileFormatError
from frf_ipz.foreign_errors import require_reader
from frf_ipz.input_files import read_bytes
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

PROCESS = "frf_ipz.meshes.meshio_process"
KIND = "a mesh"
SUFFIXES = {".vtk", ".vtu", ".msh", ".mesh", ".meshb", ".su2", ".ugrid", ".avs"}
SHAPES = {  # meshio's names without the number of nodes; corners stand before other nodes
    "line": LINE,
    "triangle": TRIANGLE,
    "quad": QUADRILATERAL,
    "tetra": TETRAHEDRON,
    "pyramid": PYRAMID,
    "wedge": WEDGE,
    "hexahedron": HEXAHEDRON,
}


def _read(path: Path) -> StoredMesh:
    require_reader(path, "meshio", kind=KIND, extra="mesh")
    if b"<!ENTITY" in read_bytes(path, most_bytes=MOST_BYTES):
        raise FileFormatError(path, "defines entities, which no mesh needs; export it again")
    arrays = read_in_process(path, PROCESS, kind=KIND, most_bytes=MOST_BYTES).arrays
    positions = {node: (x, y, z) for node, (x, y, z) in enumerate(arrays["points"].tolist(), start=1)}
    elements = [
        (shape, tuple(node + 1 for node in nodes))
        for name, block in arrays.items()
        if (shape := SHAPES.get(name.partition(":")[2].rstrip("0123456789")))
        for nodes in block[:, : CORNERS[shape]].tolist()
    ]
    return StoredMesh(positions=positions, elements=elements)


FORMAT = MeshFormat(rank=20, fits=lambda path, head: path.suffix.lower() in SUFFIXES, read=_read)  # noqa: ARG005
