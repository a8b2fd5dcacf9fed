"""Meshes of Gmsh, VTK, Medit and others, by meshio.

It keeps no numbers of nodes: they are 1, 2, ... in the order of the file.
"""

from __future__ import annotations

import io
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from frf_ipz.errors import FileFormatError
from frf_ipz.foreign_errors import errors_of_reader, import_reader
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
from frf_ipz.output_files import write_bytes

KIND = "a mesh"
SUFFIXES = {".vtk", ".vtu", ".msh", ".mesh", ".meshb", ".ply", ".off", ".su2", ".ugrid", ".avs", ".tec"}
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
    meshio = import_reader(path, "meshio", kind=KIND, extra="mesh")
    data = read_bytes(path, most_bytes=MOST_BYTES)
    if b"<!ENTITY" in data:
        raise FileFormatError(path, "defines entities, which no mesh needs; export it again")
    with TemporaryDirectory() as folder, errors_of_reader(path, KIND):
        copy = Path(folder) / f"mesh{path.suffix.lower()}"
        write_bytes(copy, data)
        mesh = _silently(meshio, copy)
        points = mesh.points
        positions = {
            number: (float(x), float(y), float(z))
            for number, (x, y, z) in enumerate(((*row, 0.0, 0.0)[:3] for row in points.tolist()), start=1)
        }
        elements = [
            (shape, tuple(node + 1 for node in nodes))
            for block in mesh.cells
            if (shape := SHAPES.get(block.type.rstrip("0123456789")))
            for nodes in block.data[:, : CORNERS[shape]].tolist()
        ]
    return StoredMesh(positions=positions, elements=elements)


def _silently(meshio: Any, path: Path) -> Any:  # noqa: ANN401 - a mesh of meshio
    """Read a file; what it prints before it ends the program is the reason that it cannot be read."""
    said = io.StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):
            return meshio.read(path)
    except SystemExit:
        raise ValueError(said.getvalue().replace(str(path.parent), "")) from None


FORMAT = MeshFormat(rank=20, fits=lambda path, head: path.suffix.lower() in SUFFIXES, read=_read)  # noqa: ARG005
