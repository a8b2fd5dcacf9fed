"""Files that say what the rows of matrices are: ``dofs.csv``, and those of CalculiX, Ansys and Nastran."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from frf_ipz.dofs import DIRECTIONS, GENERALISED, Dof
from frf_ipz.errors import FileFormatError
from frf_ipz.fe.matrices.dof_table import DofTable, read_dof_table
from frf_ipz.fe.matrices.nastran_rows import read_uset
from frf_ipz.input_files import read_text

if TYPE_CHECKING:
    from pathlib import Path

CALCULIX = re.compile(r"^[ \t]*([0-9]{1,15})\.([1-6])[ \t]*$")
ANSYS = re.compile(r"^[ \t]*([0-9]{1,15})[ \t]+([0-9]{1,15})[ \t]+(U[XYZ]|ROT[XYZ]|[A-Z]{1,8})[ \t]*$")
ANSYS_DIRECTIONS = {"UX": "x", "UY": "y", "UZ": "z", "ROTX": "rx", "ROTY": "ry", "ROTZ": "rz"}
INTERNAL = 10**12  # above the numbers of all nodes


def read_rows(path: Path) -> DofTable:
    """Read what the rows are, whatever the format.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    DofTable
        Rows in their order, and positions where the file has them.

    Raises
    ------
    FileFormatError
        If it cannot be read.
    """
    if path.suffix.lower() == ".dof":
        return _read_calculix(path)
    if path.suffix.lower() in {".op2", ".asm"}:
        return read_uset(path)
    if path.suffix.lower() == ".mapping":
        return _read_ansys(path)
    return read_dof_table(path)


def _read_calculix(path: Path) -> DofTable:
    """Read lines such as ``12.3``: node and direction.

    A node of a shell or beam comes twice: with its translations, and with internal motions that have no name.
    """
    dofs: dict[Dof, None] = {}
    for number, line in enumerate(read_text(path).split("\n"), start=1):
        if not line.strip():
            continue
        match = CALCULIX.match(line)
        if match is None:
            raise FileFormatError(
                path, f"'{line.strip()[:40]}' is no node and direction, such as 12.3", where=f"line {number}"
            )
        dof = Dof(int(match[1]), DIRECTIONS[int(match[2]) - 1])
        dofs[dof if dof not in dofs else Dof(INTERNAL + number, GENERALISED)] = None
    return _table(dofs, path)


def _read_ansys(path: Path) -> DofTable:
    """Read the lines of HBMAT's mapping: equation, node, name of the DOF; a heading stands above."""
    found: dict[int, Dof] = {}
    for number, line in enumerate(read_text(path).split("\n"), start=1):
        match = ANSYS.match(line.upper())
        if match is None:
            if found and line.strip():
                raise FileFormatError(
                    path, f"'{line.strip()[:40]}' is no equation, node and DOF", where=f"line {number}"
                )
            continue
        direction = ANSYS_DIRECTIONS.get(match[3])
        row = int(match[1])
        found[row] = Dof(int(match[2]), direction) if direction else Dof(INTERNAL + row, GENERALISED)
    if sorted(found) != list(range(1, len(found) + 1)):
        raise FileFormatError(path, "the equations do not count through from 1; export it again")
    return _table(dict.fromkeys(found[row] for row in sorted(found)), path)


def _table(dofs: dict[Dof, None], path: Path) -> DofTable:
    if not dofs:
        raise FileFormatError(path, "names no DOF; one line a row of the matrices is needed")
    return DofTable(dofs=tuple(dofs), positions={}, axes={})
