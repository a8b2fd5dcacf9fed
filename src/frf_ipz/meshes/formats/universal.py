"""Geometry of universal files: nodes (data sets 15, 781 and 2411), trace lines (82), elements (780 and 2412).

What the records hold: Universal File Datasets Summary, Structural Dynamics Research Laboratory, University of
Cincinnati. Positions are taken along the axes of the whole, in which analysers write them, whatever system they name.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

from frf_ipz.errors import FileFormatError
from frf_ipz.input_files import open_input
from frf_ipz.meshes.mesh_file import MeshFormat, StoredMesh
from frf_ipz.meshes.outer_faces import HEXAHEDRON, LINE, QUADRILATERAL, TETRAHEDRON, TRIANGLE, WEDGE
from frf_ipz.text_numbers import NumberError, parse_numbers
from frf_ipz.universal_sets import is_universal, read_data_sets

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.universal_sets import DataSet

    Positions = dict[int, tuple[float, float, float]]
    Elements = list[tuple[str, tuple[int, ...]]]

UNITS, SINGLE_NODES, DOUBLE_NODES, TRACE_LINES = "164", "15", ("781", "2411"), "82"
ELEMENTS = {"780": 8, "2412": 6}  # integers in the first line of an element, the last of which counts its nodes
KINDS = {UNITS, SINGLE_NODES, *DOUBLE_NODES, TRACE_LINES, *ELEMENTS}
ADVICE = "export the geometry again"
PER_LINE = 8  # nodes
HEAD_BYTES = 4096
N_TOKENS = 7  # of a node in single precision
BEAMS = (11, 21, 22, 23, 24)  # elements with a line of their cross-sections
LINES = (*BEAMS, 31, 32, 121, 136, 137, 138, 139, 141)
# Which nodes of an element are corners; between them parabolic and cubic elements have further ones, around an edge.
PLANE = {  # by the last digit of its number, 41 to 96
    1: (TRIANGLE, (0, 1, 2)),
    2: (TRIANGLE, (0, 2, 4)),
    3: (TRIANGLE, (0, 3, 6)),
    4: (QUADRILATERAL, (0, 1, 2, 3)),
    5: (QUADRILATERAL, (0, 2, 4, 6)),
    6: (QUADRILATERAL, (0, 3, 6, 9)),
}
SOLID = {
    101: (WEDGE, (0, 1, 2, 3, 4, 5)),
    104: (HEXAHEDRON, (0, 1, 2, 3, 4, 5, 6, 7)),
    111: (TETRAHEDRON, (0, 1, 2, 3)),
    112: (WEDGE, (0, 1, 2, 3, 4, 5)),
    113: (WEDGE, (0, 2, 4, 9, 11, 13)),
    115: (HEXAHEDRON, (0, 1, 2, 3, 4, 5, 6, 7)),
    116: (HEXAHEDRON, (0, 2, 4, 6, 12, 14, 16, 18)),
    118: (TETRAHEDRON, (0, 2, 4, 9)),
}


def _read(path: Path) -> StoredMesh:
    positions: Positions = {}
    elements: Elements = []
    unit_m = None
    for data in read_data_sets(path, KINDS, advice=ADVICE):
        if data.kind == UNITS:
            unit_m = _read_unit(data)
        elif data.kind == TRACE_LINES:
            elements += _read_trace_line(data)
        elif data.kind in ELEMENTS:
            elements += _read_elements(data)
        else:
            positions |= _read_nodes(data)
    return StoredMesh(positions=positions, elements=elements, unit_m=unit_m)


FORMAT = MeshFormat(rank=0, fits=lambda path, head: is_universal(head), read=_read)  # noqa: ARG005


def holds_geometry(path: Path) -> bool:
    """Tell whether a file is a universal file with nodes and what lies between them.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    bool
        True where it is; what is damaged in it is said where it is read.
    """
    try:
        with open_input(path) as stream:
            is_known = is_universal(stream.read(HEAD_BYTES))
        kinds = {data.kind for data in read_data_sets(path, KINDS, advice=ADVICE)} if is_known else set()
    except FileFormatError:
        return False
    return bool(kinds & {SINGLE_NODES, *DOUBLE_NODES}) and bool(kinds & {TRACE_LINES, *ELEMENTS})


def _read_unit(data: DataSet) -> float:
    """Read the factor of length, by which the file's numbers are divided to be in m."""
    factor = data.numbers(data.first + 1, 25, 1, "the factor of length")[0]
    if factor <= 0.0:
        raise data.fault(f"the factor of length is {factor:g}; it is positive", data.first + 1)
    return 1.0 / factor


def _read_nodes(data: DataSet) -> Positions:
    positions: Positions = {}
    line = data.first
    while line < data.end:
        if data.kind == SINGLE_NODES:
            node, position = _read_node(data, line)
            line += 1
        else:
            node = data.integers(line, 10, 1, "the number of a node")[0]
            x, y, z = data.numbers(line + 1, 25, 3, f"the position of node {node}")[:3]
            position = x, y, z
            line += 2
        positions[node] = position
    return positions


def _read_node(data: DataSet, line: int) -> tuple[int, tuple[float, float, float]]:
    """Read four integers of ten columns and three numbers of 13, by the blanks between them where there are some."""
    text = data.lines[line]
    by_columns = [text[:10], *(text[at : at + 13] for at in (40, 53, 66))]
    tokens = text.split()
    for node, *place in ((tokens[0], *tokens[4:]) if len(tokens) == N_TOKENS else by_columns, by_columns):
        try:
            x, y, z = parse_numbers([part.strip() for part in place]).tolist()
        except NumberError:
            continue
        if node.strip().isdecimal():
            return int(node), (x, y, z)
    raise data.fault("a node should stand there: four integers, and its position as three numbers", line)


def _read_trace_line(data: DataSet) -> Elements:
    """Read the nodes that the pen goes to; 0 lifts it."""
    count = data.integers(data.first, 10, 2, "the number of nodes of a trace line")[1]
    nodes: list[int] = []
    line = data.first + 2
    while line < data.end and len(nodes) < count:
        n_nodes = min(PER_LINE, count - len(nodes))
        nodes += data.integers(line, 10, n_nodes, "the nodes of a trace line")
        line += 1
    return [(LINE, (a, b)) for a, b in pairwise(nodes) if a and b and a != b]


def _read_elements(data: DataSet) -> Elements:
    elements: Elements = []
    line, n_integers = data.first, ELEMENTS[data.kind]
    while line < data.end:
        head = data.integers(line, 10, n_integers, "the head of an element")
        descriptor, count = head[1], head[-1]
        line += 2 if descriptor in BEAMS else 1
        nodes: list[int] = []
        while len(nodes) < count:
            n_nodes = min(PER_LINE, count - len(nodes))
            nodes += data.integers(line, 10, n_nodes, f"the nodes of element {head[0]}")
            line += 1
        elements += _shape(descriptor, nodes)
    return elements


def _shape(descriptor: int, nodes: list[int]) -> Elements:
    """Give an element's shape and corners; lumped masses and the like have none."""
    if descriptor in LINES:
        return [(LINE, pair) for pair in pairwise(nodes)]
    plane = PLANE.get(descriptor % 10) if 40 < descriptor < 97 else None
    known = SOLID.get(descriptor, plane)
    if known is None or max(known[1]) >= len(nodes):
        return []
    return [(known[0], tuple(nodes[place] for place in known[1]))]
