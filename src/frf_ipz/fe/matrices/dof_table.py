"""``dofs.csv``: node and direction of each row of the matrices, and the coordinates of the node."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.dofs import DIRECTIONS, GENERALISED, Dof
from frf_ipz.errors import FileFormatError, did_you_mean, errors_of_file
from frf_ipz.input_files import read_text
from frf_ipz.meshes.coordinate_names import coordinate_unit
from frf_ipz.text_numbers import parse_number

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

COLUMNS = ("node", "direction", "x_m", "y_m", "z_m")
SAME_POSITION = 1e-9  # coordinates of one node are copies of one number
LARGEST_NODE = 2**53  # beyond, neighbours are one number to a spreadsheet
LARGEST = 1e9  # m or mm, beyond any structure: a coordinate that was meant otherwise
AXES = ("e1x", "e1y", "e1z", "e2x", "e2y", "e2z")  # first and second axis of a node, where they are its own
SAME_AXES = 1e-3  # axes are printed with few digits; they are made orthonormal
NOWHERE = (0.0, 0.0, 0.0)  # where a generalised DOF is
GENERALISED_DIRECTIONS = (GENERALISED, "0")
PLAIN = {"x": "x_m", "y": "y_m", "z": "z_m"}  # where lengths are in another unit
SEPARATORS = (",", ";", "\t")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DofTable:
    """Rows of the matrices.

    Parameters
    ----------
    dofs : tuple of Dof
        One a row.
    positions : mapping of int to (3,) sequence
        Where nodes are, as far as the file says it, in the unit of the model's length.
    axes : mapping of int to (3, 3) array
        Nodes with axes of their own, which are the rows of the array.
    choices : tuple of DofTable
        Selections of the rows, where matrices may have one of several.
    without_unit : bool
        Positions stand under x, y, z, which say no unit.
    unit_m : float, optional
        Unit of the positions where their columns state another one than the model's, as ``x_mm`` does.
    """

    dofs: tuple[Dof, ...]
    positions: Mapping[int, Sequence[float]]
    axes: Mapping[int, FloatArray]
    choices: tuple[DofTable, ...] = ()
    without_unit: bool = False
    unit_m: float | None = None

    def of_order(self, order: int) -> DofTable:
        """Choose the selection of rows that a matrix has.

        Parameters
        ----------
        order : int
            Its number of rows.

        Returns
        -------
        DofTable
            The first choice of that order; this one where there is none.
        """
        return next((choice for choice in self.choices if len(choice.dofs) == order), self)


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
    lines_of_text = read_text(path).replace("\r", "\n").split("\n")
    separator = max(SEPARATORS, key=lines_of_text[0].count)
    rows = _csv_rows(lines_of_text, separator, path)
    _, header = next(rows, (1, []))
    header, unit_m = coordinate_unit(path, header)
    columns = _columns(header, path)
    axes: dict[int, FloatArray] = {}
    lines: dict[Dof, int] = {}
    positions: dict[int, tuple[float, float, float]] = {}
    for number, row in rows:
        if not any(cell.strip() for cell in row):
            continue
        where = f"line {number}"
        if any(cell.strip() for cell in row[len(header) :]):
            raise FileFormatError(
                path,
                f"has {len(row)} cells, but the first line names {len(header)} columns; numbers have decimal points",
                where=where,
            )
        dof, position = _read_row(row, columns, path, where)
        if dof in lines:
            raise FileFormatError(path, f"the DOF {dof.name} is in line {lines[dof]} already", where=where)
        lines[dof] = number
        own = _read_axes(row, columns, path, where)
        if own is not None and np.abs(axes.setdefault(dof.node, own) - own).max() > SAME_AXES:
            raise FileFormatError(path, f"node {dof.node} has other axes in an earlier line", where=where)
        if dof.direction == GENERALISED:
            continue
        first = positions.setdefault(dof.node, position)
        if max(abs(old - new) for old, new in zip(first, position, strict=True)) > SAME_POSITION:
            raise FileFormatError(path, f"node {dof.node} has other coordinates in an earlier line", where=where)
    if not lines:
        raise FileFormatError(path, "names no DOF; one row a row of the matrices is needed")
    without_unit = unit_m is None and bool(PLAIN.keys() & set(header))
    return DofTable(dofs=tuple(lines), positions=positions, axes=axes, without_unit=without_unit, unit_m=unit_m)


def _csv_rows(lines: list[str], separator: str, path: Path) -> Iterator[tuple[int, list[str]]]:
    """Give the number of each line with its cells."""
    rows = csv.reader(lines, delimiter=separator, skipinitialspace=True)
    try:
        for row in rows:
            yield rows.line_num, row
    except csv.Error as error:
        raise FileFormatError(path, f"is no table: {error}", where=f"line {rows.line_num}") from None


def _columns(header: list[str], path: Path) -> Mapping[str, int]:
    names = [PLAIN.get(name, name) for name in header]
    columns = {name: index for index, name in enumerate(names)}
    for name in COLUMNS:
        if names.count(name) > 1:
            raise FileFormatError(path, f"names the column '{name}' twice; rename one", where="line 1")
        if name not in columns:
            raise FileFormatError(
                path,
                f"has no column '{name}'; expected is the header {','.join(COLUMNS)}, or x_mm, y_mm, z_mm",
                where="line 1",
            )
    return columns


def _read_row(
    row: list[str], columns: Mapping[str, int], path: Path, where: str
) -> tuple[Dof, tuple[float, float, float]]:
    if len(row) <= max(columns[name] for name in COLUMNS):
        raise FileFormatError(path, f"has {len(row)} cells; {', '.join(COLUMNS)} are needed", where=where)
    node, direction, *coordinates = (row[columns[name]].strip() for name in COLUMNS)
    number = int(node[:20]) if node.isascii() and node.isdecimal() else 0
    if not 1 <= number <= LARGEST_NODE:
        raise FileFormatError(path, f"'{node}' is no node number; expected is 1 or more", where=where)
    if direction.lower() in GENERALISED_DIRECTIONS:
        return Dof(number, GENERALISED), NOWHERE
    if direction.lower() not in DIRECTIONS:
        known = (*DIRECTIONS, GENERALISED)
        raise FileFormatError(
            path, f"'{direction}' is no direction; {did_you_mean(direction.lower(), known)}", where=where
        )
    position: list[float] = []
    for name, text in zip(COLUMNS[2:], coordinates, strict=True):
        with errors_of_file(path, where=f"{where}, column '{name}'"):
            position.append(parse_number(text))
        if abs(position[-1]) > LARGEST:
            raise FileFormatError(path, f"{text} is farther than any structure reaches; check its export", where=where)
    x, y, z = position
    return Dof(number, direction.lower()), (x, y, z)


def _read_axes(row: list[str], columns: Mapping[str, int], path: Path, where: str) -> FloatArray | None:
    """Read a node's own axes; None where they are not given."""
    present = [name for name in AXES if name in columns]
    cells = [row[columns[name]].strip() if columns[name] < len(row) else "" for name in present]
    if not any(cells):
        return None
    if len(present) < len(AXES) or not all(cells):
        raise FileFormatError(path, f"a node's own axes need all of {', '.join(AXES)}", where=where)
    with errors_of_file(path, where=where):
        first, second = np.array([parse_number(cell) for cell in cells]).reshape(2, 3)
    is_orthonormal = (
        abs(first @ first - 1) <= SAME_AXES
        and abs(second @ second - 1) <= SAME_AXES
        and abs(first @ second) <= SAME_AXES
    )
    if not is_orthonormal:
        raise FileFormatError(path, "axes e1 and e2 are needed of length 1 and at right angles", where=where)
    first = first / np.linalg.norm(first)
    second = second - (second @ first) * first
    second = second / np.linalg.norm(second)
    return np.array([first, second, np.cross(first, second)])
