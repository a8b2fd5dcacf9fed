"""Decks of Nastran (``.bdf``, ``.dat``, ``.nas``): ``GRID`` and elements, in fields of 8 or 16 columns, or commas."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.errors import FileFormatError
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
    from collections.abc import Iterator
    from pathlib import Path

SUFFIXES = {".bdf", ".dat", ".nas", ".bulk", ".blk", ".pch"}
FIELD, LARGE_FIELD = 8, 16  # columns
N_FIELDS = 9  # of a line, its name among them
GRID = "GRID"
CARDS = {  # shape, and the field of the first node behind the element's number; corners stand before other nodes
    "CTRIA3": (TRIANGLE, 2),
    "CTRIA6": (TRIANGLE, 2),
    "CTRIAR": (TRIANGLE, 2),
    "CQUAD4": (QUADRILATERAL, 2),
    "CQUAD8": (QUADRILATERAL, 2),
    "CQUADR": (QUADRILATERAL, 2),
    "CSHEAR": (QUADRILATERAL, 2),
    "CTETRA": (TETRAHEDRON, 2),
    "CPYRAM": (PYRAMID, 2),
    "CPENTA": (WEDGE, 2),
    "CHEXA": (HEXAHEDRON, 2),
    "CBAR": (LINE, 2),
    "CBEAM": (LINE, 2),
    "CBEND": (LINE, 2),
    "CROD": (LINE, 2),
    "CTUBE": (LINE, 2),
    "CBUSH": (LINE, 2),
    "CONROD": (LINE, 1),
    "PLOTEL": (LINE, 1),
}


def _read(path: Path) -> StoredMesh:
    positions: dict[int, tuple[float, float, float]] = {}
    elements: list[tuple[str, tuple[int, ...]]] = []
    for number, name, fields in _cards(read_text(path).split("\n")):
        if name == GRID:
            node, system, *place = [*fields, *[""] * 5][:5]
            if system not in {"", "0"}:
                problem = "a node's position is along axes of its own; give positions as CSV: node,x,y,z"
                raise FileFormatError(path, problem, where=f"line {number}")
            positions[read_node(path, number, node)] = read_position(path, number, place)
        elif name in CARDS:
            shape, first = CARDS[name]
            corners = fields[first : first + CORNERS[shape]]
            if len(corners) == CORNERS[shape] and all(corners):
                elements.append((shape, tuple(read_node(path, number, corner) for corner in corners)))
    return StoredMesh(positions=positions, elements=elements)


FORMAT = MeshFormat(rank=10, fits=lambda path, head: path.suffix.lower() in SUFFIXES, read=_read)  # noqa: ARG005


def _cards(lines: list[str]) -> Iterator[tuple[int, str, list[str]]]:
    """Give the cards that are read: line, name, and fields behind it with those of the lines that go on."""
    begun: tuple[int, str, list[str]] | None = None
    for number, line in enumerate(lines, start=1):
        text = line.partition("$")[0].rstrip()
        name = (text.split(",")[0] if "," in text else text[:FIELD]).strip().upper()
        goes_on = text and (not name or name[0] in "+*")
        if not goes_on and begun is not None:
            yield begun
            begun = None
        if goes_on and begun is not None:
            begun[2].extend(_fields(text))
        elif name.rstrip("*") in CARDS or name.rstrip("*") == GRID:
            begun = number, name.rstrip("*"), _fields(text)
    if begun is not None:
        yield begun


def _fields(text: str) -> list[str]:
    """Give the fields of a line: eight of 8 columns, or four of 16; behind them stands the next line's name."""
    if "," in text:
        return [cell.strip() for cell in text.split(",")][1:N_FIELDS]
    width = LARGE_FIELD if "*" in text[:FIELD] else FIELD
    return [text[at : at + width].strip() for at in range(FIELD, N_FIELDS * FIELD, width)]
