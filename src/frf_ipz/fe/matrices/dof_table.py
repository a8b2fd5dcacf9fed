"""``dofs.csv``: node and direction of each row of the matrices, and the coordinates of the node."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.dofs import DIRECTIONS, Dof
from frf_ipz.errors import FileFormatError, did_you_mean
from frf_ipz.input_files import read_text

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

COLUMNS = ("node", "direction", "x_m", "y_m", "z_m")
SAME_POSITION_M = 1e-9  # coordinates of one node are copies of one number


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DofTable:
    """Rows of the matrices.

    Parameters
    ----------
    dofs : tuple of Dof
        One a row.
    nodes : (n_nodes,) int array
        Node numbers, ascending.
    coordinates_m : (n_nodes, 3) array
        Their positions.
    """

    dofs: tuple[Dof, ...]
    nodes: IntArray
    coordinates_m: FloatArray


def read_dof_table(path: Path) -> DofTable:
    """Read ``dofs.csv``.

    Parameters
    ----------
    path : Path
        The file: a header row, then one row a DOF.

    Returns
    -------
    DofTable
        The DOFs in the order of the file.

    Raises
    ------
    FileFormatError
        If a column is missing, a row cannot be read, a DOF comes twice, or a node has two positions.
    """
    rows = csv.reader(read_text(path).splitlines(), skipinitialspace=True)
    columns = _columns(next(rows, []), path)
    lines: dict[Dof, int] = {}
    positions: dict[int, tuple[float, float, float]] = {}
    for row in rows:
        if not any(cell.strip() for cell in row):
            continue
        where = f"line {rows.line_num}"
        dof, position = _read_row(row, columns, path, where)
        if dof in lines:
            raise FileFormatError(path, f"the DOF {dof.name} is in line {lines[dof]} already", where=where)
        lines[dof] = rows.line_num
        first = positions.setdefault(dof.node, position)
        if max(abs(old - new) for old, new in zip(first, position, strict=True)) > SAME_POSITION_M:
            raise FileFormatError(path, f"node {dof.node} has other coordinates in an earlier line", where=where)
    if not lines:
        raise FileFormatError(path, "names no DOF; one row a row of the matrices is needed")
    nodes = sorted(positions)
    return DofTable(
        dofs=tuple(lines),
        nodes=np.array(nodes),
        coordinates_m=np.array([positions[node] for node in nodes], dtype=float),
    )


def _columns(header: list[str], path: Path) -> Mapping[str, int]:
    columns = {name.strip().lower(): index for index, name in enumerate(header)}
    for name in COLUMNS:
        if name not in columns:
            raise FileFormatError(
                path, f"has no column '{name}'; expected is the header {','.join(COLUMNS)}", where="line 1"
            )
    return columns


def _read_row(
    row: list[str], columns: Mapping[str, int], path: Path, where: str
) -> tuple[Dof, tuple[float, float, float]]:
    if len(row) <= max(columns[name] for name in COLUMNS):
        raise FileFormatError(path, f"has {len(row)} cells; {', '.join(COLUMNS)} are needed", where=where)
    node, direction, *coordinates = (row[columns[name]].strip() for name in COLUMNS)
    if not node.isdecimal() or int(node) < 1:
        raise FileFormatError(path, f"'{node}' is no node number; expected is 1 or more", where=where)
    if direction.lower() not in DIRECTIONS:
        raise FileFormatError(
            path, f"'{direction}' is no direction; {did_you_mean(direction.lower(), DIRECTIONS)}", where=where
        )
    try:
        x, y, z = (float(text) for text in coordinates)
    except ValueError:
        raise FileFormatError(path, f"{', '.join(coordinates)} are no three coordinates in m", where=where) from None
    if not np.isfinite((x, y, z)).all():
        raise FileFormatError(path, f"{', '.join(coordinates)} are not finite", where=where)
    return Dof(int(node), direction.lower()), (x, y, z)
