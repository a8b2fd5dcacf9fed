"""Positions of nodes from a deck: CSV, Abaqus and CalculiX (``.inp``), Nastran (``.bdf``, ``.dat``, ``.nas``)."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.fe.matrices.dof_table import LARGEST
from frf_ipz.input_files import read_text
from frf_ipz.text_numbers import parse_number

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

SEPARATOR = re.compile(r"[,;\t]")
NASTRAN = {".bdf", ".dat", ".nas", ".bulk", ".blk", ".pch"}
FIELD, LARGE_FIELD = 8, 16


def read_positions(path: Path) -> dict[int, tuple[float, float, float]]:
    """Read where nodes are.

    Parameters
    ----------
    path : Path
        The deck, or a CSV ``node,x,y,z``.

    Returns
    -------
    mapping of int to (3,) tuple
        In the unit of the file.

    Raises
    ------
    FileFormatError
        If it names no node, a position cannot be read, or is given along axes of its own.
    """
    lines = read_text(path).split("\n")
    suffix = path.suffix.lower()
    rows = _deck(lines) if suffix == ".inp" else _grids(lines, path) if suffix in NASTRAN else _table(lines)
    positions: dict[int, tuple[float, float, float]] = {}
    for number, (node, cells) in rows:
        where = f"line {number}"
        if not (node.isascii() and node.isdecimal() and len(node) <= 18):
            raise FileFormatError(path, f"'{node[:40]}' is no node number", where=where)
        try:
            x, y, z = (parse_number(cell) if cell.strip() else 0.0 for cell in (*cells, "", "", "")[:3])
        except InputError as error:
            raise FileFormatError(path, str(error), where=where) from None
        if max(abs(x), abs(y), abs(z)) > LARGEST:
            raise FileFormatError(path, "a node is farther than any structure reaches", where=where)
        positions[int(node)] = (x, y, z)
    if not positions:
        raise FileFormatError(path, "names no node; expected is CSV (node,x,y,z), an .inp deck, or a Nastran deck")
    return positions


def _table(lines: list[str]) -> Iterator[tuple[int, tuple[str, list[str]]]]:
    for number, line in enumerate(lines, start=1):
        cells = [cell.strip() for cell in SEPARATOR.split(line)]
        if cells[0] and (number > 1 or cells[0].isdecimal()):
            yield number, (cells[0], cells[1:])


def _deck(lines: list[str]) -> Iterator[tuple[int, tuple[str, list[str]]]]:
    is_node = False
    for number, line in enumerate(lines, start=1):
        if line.startswith("**") or not line.strip():
            continue
        if line.startswith("*"):
            words = line[1:].split(",")
            is_node = words[0].strip().upper() == "NODE"
            continue
        if is_node:
            cells = [cell.strip() for cell in line.split(",")]
            yield number, (cells[0], cells[1:])


def _grids(lines: list[str], path: Path) -> Iterator[tuple[int, tuple[str, list[str]]]]:
    for number, line in enumerate(lines, start=1):
        upper = line.upper()
        if not upper.startswith("GRID"):
            continue
        if "," in line:
            cells = [cell.strip() for cell in line.split(",")][1:]
        elif upper.startswith("GRID*"):
            further = lines[number] if number < len(lines) else ""
            cells = [
                part[8 + LARGE_FIELD * k : 24 + LARGE_FIELD * k].strip() for part in (line, further) for k in range(4)
            ]
        else:
            cells = [line[8 + FIELD * k : 16 + FIELD * k].strip() for k in range(7)]
        cells += [""] * 5
        if cells[1] not in {"", "0"}:
            raise FileFormatError(
                path,
                "a node's position is along axes of its own; give positions as CSV: node,x,y,z",
                where=f"line {number}",
            )
        yield number, (cells[0], cells[2:5])
