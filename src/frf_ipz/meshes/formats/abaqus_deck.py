"""Decks of Abaqus and CalculiX (``.inp``): ``*NODE`` and ``*ELEMENT``."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from frf_ipz.input_files import read_text
from frf_ipz.meshes.mesh_file import MeshFormat, StoredMesh
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
from frf_ipz.meshes.text_decks import read_node, read_position

if TYPE_CHECKING:
    from pathlib import Path

SUFFIX = ".inp"
SOLID = re.compile(r"(?:A?C3D|DC3D|SC)(\d+)")  # and continuum shells; the number is that of the nodes
SHELL = re.compile(r"(?:S|DS|M3D|CPS|CPE|CPEG|CAX|CGAX|STRI|R3D|SFM3D)(\d+)")
BAR = re.compile(r"(?:B\d|T\dD|PIPE\d|R2D|RB\dD|FRAME\dD)(\d)|SPRINGA|DASHPOTA|U1")
SOLIDS = {4: TETRAHEDRON, 10: TETRAHEDRON, 5: PYRAMID, 13: PYRAMID, 6: WEDGE, 15: WEDGE, 8: HEXAHEDRON, 20: HEXAHEDRON}
SHELLS = {3: TRIANGLE, 6: TRIANGLE, 65: TRIANGLE, 4: QUADRILATERAL, 8: QUADRILATERAL, 9: QUADRILATERAL}


def shape_of(kind: str) -> str:
    """Give the shape of an element, whose corners stand before its other nodes.

    Parameters
    ----------
    kind : str
        Type, such as ``C3D20R``.

    Returns
    -------
    str
        As `outer_faces` knows it; empty for one that is not drawn.

    Examples
    --------
    >>> shape_of("C3D20R"), shape_of("S4"), shape_of("B31"), shape_of("MASS")
    ('hexahedron', 'quadrilateral', 'line', '')
    """
    solid, shell = SOLID.match(kind), SHELL.match(kind)
    if solid:
        return SOLIDS.get(int(solid[1]), "")
    if shell:
        return SHELLS.get(int(shell[1]), "")
    return LINE if BAR.match(kind) else ""


def _read(path: Path) -> StoredMesh:
    positions: dict[int, tuple[float, float, float]] = {}
    elements: list[tuple[str, tuple[int, ...]]] = []
    card, shape, is_continued = "", "", False
    nodes: list[int] = []
    for number, line in enumerate(read_text(path).split("\n"), start=1):
        if line.startswith("**") or not line.strip():
            continue
        if line.startswith("*"):
            words = [word.strip().upper() for word in line[1:].split(",")]
            card, is_continued = words[0], False
            kinds = [word.partition("=")[2].strip() for word in words[1:] if word.partition("=")[0].strip() == "TYPE"]
            shape = shape_of(kinds[0]) if card == "ELEMENT" and kinds else ""
            continue
        cells = [cell.strip() for cell in line.split(",")]
        if card == "NODE":
            positions[read_node(path, number, cells[0])] = read_position(path, number, cells[1:])
        elif shape:
            nodes = [] if not is_continued else nodes
            fresh = [read_node(path, number, cell) for cell in cells if cell]
            nodes += fresh if is_continued else fresh[1:]
            is_continued = not cells[-1]
            if not is_continued:
                elements += _element(shape, nodes)
    return StoredMesh(positions=positions, elements=elements)


def _element(shape: str, nodes: list[int]) -> list[tuple[str, tuple[int, ...]]]:
    if shape == LINE:  # a quadratic one has its middle between its ends
        return [(LINE, (nodes[0], nodes[-1]))] if len(nodes) > 1 else []
    count = CORNERS[shape]
    return [(shape, tuple(nodes[:count]))] if len(nodes) >= count else []


FORMAT = MeshFormat(rank=10, fits=lambda path, head: path.suffix.lower() == SUFFIX, read=_read)  # noqa: ARG005
