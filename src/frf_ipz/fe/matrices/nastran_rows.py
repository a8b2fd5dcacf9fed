"""Rows of Nastran's matrices: the USET of a NAS2CAM ``.op2``, and the ``.asm`` of an external super-element, by pyyeti.

pyyeti's table has six rows a grid point: the point, its displacement coordinate system (number, kind), its origin, and
the three rows of the matrix that turns that system to the basic one. A scalar point has one row.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.dofs import DIRECTIONS, GENERALISED, Dof
from frf_ipz.errors import FileFormatError
from frf_ipz.fe.matrices.dof_table import DofTable
from frf_ipz.fe.matrices.fortran_records import check_records
from frf_ipz.fe.matrices.stored import MOST_BYTES
from frf_ipz.foreign_errors import errors_of_reader, import_reader
from frf_ipz.input_files import read_bytes
from frf_ipz.output_files import write_bytes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import FloatArray

KIND, EXTRA = "a file of Nastran", "nastran"
SETS = ("a", "l", "f", "n", "g")  # the usual ones of matrices first
POINT_ROWS = len(DIRECTIONS)
FIRST_OF_NAS2CAM = ("SUPERID", "SLIST")  # data blocks
BLOCKS_SHOWN = 4
RECTANGULAR, CYLINDRICAL, SPHERICAL = 1, 2, 3


def read_uset(path: Path) -> DofTable:
    """Read the rows that a USET names.

    Parameters
    ----------
    path : Path
        ``.op2`` written by NAS2CAM, or the ``.asm`` of EXTSEOUT, with the ``.pch`` of the same name beside it.

    Returns
    -------
    DofTable
        All DOFs of the residual structure, with the sets that matrices may have.

    Raises
    ------
    FileFormatError
        If it cannot be read, or pyyeti is not installed.
    """
    is_binary = path.suffix.lower() == ".op2"
    n2p = import_reader(path, "pyyeti.nastran.n2p", kind=KIND, extra=EXTRA)
    reader = import_reader(path, "pyyeti.nastran." + ("op2" if is_binary else "bulk"), kind=KIND, extra=EXTRA)
    with TemporaryDirectory() as folder, errors_of_reader(path, KIND):  # pyyeti takes paths
        copy, content = Path(folder) / path.name, read_bytes(path, most_bytes=MOST_BYTES)
        write_bytes(copy, content)
        if is_binary:
            check_records(path, content)
        else:
            return _table_of_super_element(copy, path, reader)
        with reader.OP2(str(copy)) as file:
            _require_rows(path, list(file.dbnames))
            usets = file.rdn2cop2()["uset"]
        tables = [_table(usets[number], n2p) for number in sorted(usets)]
        first = tables[0]
        return DofTable(
            dofs=first.dofs,
            positions=first.positions,
            axes=first.axes,
            choices=tuple(choice for table in tables for choice in table.choices),
        )


def _require_rows(path: Path, blocks: list[str]) -> None:
    """Refuse an OP2 of results: only NAS2CAM writes one that begins with the super-elements of its USET."""
    if blocks and blocks[0] not in FIRST_OF_NAS2CAM:
        shown = ", ".join(blocks[:BLOCKS_SHOWN]) + (", ..." if len(blocks) > BLOCKS_SHOWN else "")
        problem = f"holds the data blocks {shown} and does not name the rows of matrices; an OP2 that does is written"
        raise FileFormatError(path, f"{problem} by NAS2CAM, with the matrices in the OP4 beside it")


def _table_of_super_element(copy: Path, path: Path, reader: Any) -> DofTable:  # noqa: ANN401 - a module
    punch = path.with_suffix(".pch")
    if punch.is_file():
        write_bytes(copy.with_suffix(".pch"), read_bytes(punch, most_bytes=MOST_BYTES))
    uset, _, *rows = reader.asm2uset(str(copy), try_rdextrn="pv_only", follow_includes=False)
    labels = _labels(uset)
    wanted = np.arange(len(labels))
    if rows and rows[-1] is not None:
        kept = np.asarray(rows[-1])
        wanted = np.flatnonzero(kept) if kept.dtype == bool else kept.astype(int)
    positions, axes = _places(uset, labels)
    return DofTable(dofs=tuple(labels[row] for row in wanted.tolist()), positions=positions, axes=axes)


def _table(uset: Any, n2p: Any) -> DofTable:  # noqa: ANN401 - a table of pandas, a module
    labels = _labels(uset)
    positions, axes = _places(uset, labels)
    choices = []
    for name in SETS:
        rows = np.flatnonzero(n2p.mksetpv(uset, "g", name))
        dofs = tuple(labels[row] for row in rows.tolist())
        choices.append(DofTable(dofs=dofs, positions=positions, axes=axes))
    return DofTable(dofs=tuple(labels), positions=positions, axes=axes, choices=tuple(choices))


def _labels(uset: Any) -> list[Dof]:  # noqa: ANN401
    return [
        Dof(int(node), DIRECTIONS[int(number) - 1]) if 1 <= number <= POINT_ROWS else Dof(int(node), GENERALISED)
        for node, number in uset.index.tolist()
    ]


def _places(uset: Any, labels: Sequence[Dof]) -> tuple[dict[int, tuple[float, ...]], dict[int, FloatArray]]:  # noqa: ANN401
    """Positions of grid points along the basic axes, and the axes of those that have others."""
    values = uset.loc[:, "x":"z"].to_numpy(float)
    positions: dict[int, tuple[float, ...]] = {}
    axes: dict[int, FloatArray] = {}
    for row, dof in enumerate(labels):
        if dof.direction != DIRECTIONS[0]:
            continue
        positions[dof.node] = tuple(values[row].tolist())
        system = values[row + 1 : row + POINT_ROWS]
        if len(system) == POINT_ROWS - 1 and system[0, 0] != 0:
            axes[dof.node] = _axes(values[row], int(system[0, 1]), system[1], system[2:])
    return positions, axes


def _axes(point: FloatArray, kind: int, origin: FloatArray, turn: FloatArray) -> FloatArray:
    """Axes of a displacement coordinate system at a point, as rows."""
    if kind == RECTANGULAR:
        return np.asarray(turn.T)
    x, y, z = turn.T @ (point - origin)
    around = np.arctan2(y, x) if np.hypot(x, y) > 0 else 0.0
    outward = np.array([np.cos(around), np.sin(around), 0.0])
    along = np.array([-np.sin(around), np.cos(around), 0.0])
    axis = np.array([0.0, 0.0, 1.0])
    if kind == CYLINDRICAL:
        return np.array([outward, along, axis]) @ turn.T
    down = np.arctan2(np.hypot(x, y), z)
    radial = np.sin(down) * outward + np.cos(down) * axis
    return np.array([radial, np.cos(down) * outward - np.sin(down) * axis, along]) @ turn.T
