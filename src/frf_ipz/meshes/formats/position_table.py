"""Positions of nodes as CSV: ``node,x,y,z``, or ``node,x_mm,y_mm,z_mm``."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from frf_ipz.input_files import read_text
from frf_ipz.meshes.coordinate_names import coordinate_unit
from frf_ipz.meshes.mesh_file import MeshFormat, StoredMesh
from frf_ipz.meshes.text_decks import read_node, read_position

if TYPE_CHECKING:
    from pathlib import Path

SEPARATOR = re.compile(r"[,;\t]")


def _read(path: Path) -> StoredMesh:
    positions, unit_m = {}, None
    for number, line in enumerate(read_text(path).split("\n"), start=1):
        cells = [cell.strip() for cell in SEPARATOR.split(line)]
        if number == 1:
            _, unit_m = coordinate_unit(path, cells)
        if cells[0] and (number > 1 or cells[0].isdecimal()):
            positions[read_node(path, number, cells[0])] = read_position(path, number, cells[1:])
    return StoredMesh(positions=positions, unit_m=unit_m)


FORMAT = MeshFormat(rank=100, fits=lambda path, head: True, read=_read)  # noqa: ARG005 - what nothing else is
