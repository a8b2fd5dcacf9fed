"""Finds the formats of meshes: every module of `meshes.formats` with a ``FORMAT``."""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import FileFormatError
from frf_ipz.input_files import open_input
from frf_ipz.meshes import formats
from frf_ipz.meshes.mesh_file import MeshFormat, StoredMesh

if TYPE_CHECKING:
    from pathlib import Path

HEAD_BYTES = 4096
LARGEST = 1e100  # farther than any structure reaches, in any unit


def read_mesh(path: Path) -> StoredMesh:
    r"""Read where nodes are, and what lies between them.

    Parameters
    ----------
    path : Path
        A universal file, a deck of Abaqus, CalculiX or Nastran, an archive of Ansys, a mesh of any program that meshio
        reads, or a CSV ``node,x,y,z``.

    Returns
    -------
    StoredMesh
        In the unit of the file.

    Raises
    ------
    FileFormatError
        If it names no node, a position cannot be read, or is given along axes of its own.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "nodes.csv"
    ...     _ = path.write_text("node,x,y,z\n7,0.5,0,0\n")
    ...     read_mesh(path).positions
    {7: (0.5, 0.0, 0.0)}
    """
    with open_input(path) as stream:
        head = stream.read(HEAD_BYTES)
    mesh = next(candidate for candidate in _formats() if candidate.fits(path, head)).read(path)
    if not mesh.positions:
        raise FileFormatError(
            path, "names no node; expected is CSV (node,x,y,z), an .inp or Nastran deck, a universal file or a mesh"
        )
    places = np.array(list(mesh.positions.values()), float)
    if not np.isfinite(places).all() or np.abs(places).max() > LARGEST:
        raise FileFormatError(path, "a node is farther than any structure reaches; check the export")
    return mesh


@cache
def _formats() -> tuple[MeshFormat, ...]:
    modules = (import_module(f"{formats.__name__}.{info.name}") for info in pkgutil.iter_modules(formats.__path__))
    found = [module.FORMAT for module in modules if isinstance(getattr(module, "FORMAT", None), MeshFormat)]
    return tuple(sorted(found, key=lambda item: item.rank))
