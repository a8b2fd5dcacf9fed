"""What a file says of a mesh, and the interface of its formats."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.meshes.outer_faces import LINE, edges_of, outer_faces
from frf_ipz.structure import Geometry, Mesh

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

MOST_BYTES = 2_000_000_000  # of a file


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoredMesh:
    """A mesh as a file has it.

    Parameters
    ----------
    positions : mapping of int to (3,) tuple
        Of the nodes, in the file's unit.
    elements : sequence of (str, tuple of int)
        Shape and corners, as `outer_faces` takes them; ``line`` for two nodes.
    unit_m : float, optional
        The file's unit, m, where it says so.
    """

    positions: Mapping[int, tuple[float, float, float]]
    elements: Sequence[tuple[str, tuple[int, ...]]] = field(default_factory=tuple)
    unit_m: float | None = None

    def drawn(self, unit_m: float = 1.0) -> Mesh | None:
        """Give what is drawn: elements whose nodes have positions.

        Parameters
        ----------
        unit_m : float
            Unit of positions, m, where the file does not say it.

        Returns
        -------
        Mesh or None
            None where nothing lies between nodes.
        """
        known = [(shape, nodes) for shape, nodes in self.elements if all(node in self.positions for node in nodes)]
        if not known:
            return None
        faces = outer_faces(known)
        lines = edges_of(faces, [(nodes[0], nodes[1]) for shape, nodes in known if shape == LINE])
        nodes = np.unique(np.concatenate([faces.ravel(), lines.ravel()]))
        places = np.array([self.positions[node] for node in nodes.tolist()], float).reshape(-1, 3)
        return Mesh(nodes=nodes, coordinates_m=(self.unit_m or unit_m) * places, lines=lines, faces=faces)

    def geometry(self) -> Geometry:
        """Give nodes with what is drawn between them; where the file does not say its unit, it is m.

        Returns
        -------
        Geometry
            All nodes.
        """
        mesh = self.drawn()
        nodes = np.array(sorted(self.positions), np.int64)
        places = np.array([self.positions[node] for node in nodes.tolist()], float).reshape(-1, 3)
        lines = np.zeros((0, 2), np.int64) if mesh is None else mesh.lines
        return Geometry(nodes=nodes, coordinates_m=(self.unit_m or 1.0) * places, lines=lines, mesh=mesh)


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshFormat:
    """Interface of a format of meshes.

    Parameters
    ----------
    rank : int
        Formats are asked in this order.
    fits : callable
        Tells from path and first bytes whether a file is of this format.
    read : callable
        Reads it.
    """

    rank: int
    fits: Callable[[Path, bytes], bool]
    read: Callable[[Path], StoredMesh]
