"""A table of machines as people keep it: one row a machine."""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING

from frf_ipz.errors import FileFormatError, did_you_mean
from frf_ipz.input_files import read_text

if TYPE_CHECKING:
    from pathlib import Path

COLUMNS = ("id", "test", "serial_number", "date", "operator")
NEEDED = ("id", "test")
DELIMITERS = ",;\t"


def read_machine_list(path: Path) -> list[dict[str, str]]:
    """Read a table of machines.

    Parameters
    ----------
    path : Path
        CSV file with a header of `COLUMNS`; only ``id`` and ``test`` must be there. Commas, semicolons or tabs.

    Returns
    -------
    list of dict of str to str
        One a machine.

    Raises
    ------
    FileFormatError
        If a column is missing or unknown, a row has no id or no test, or there is no row.
    """
    lines = read_text(path).removeprefix("\ufeff").splitlines()
    delimiter = max(DELIMITERS, key=lines[0].count) if lines else ","
    rows = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=delimiter)]
    names = rows[0] if rows else []
    _require_columns(path, names)
    machines = []
    for number, row in enumerate(rows[1:], start=2):
        if not any(row):
            continue
        if len(row) != len(names):
            raise FileFormatError(path, f"has {len(row)} cells; {len(names)} are expected", where=f"line {number}")
        machine = dict(zip(names, row, strict=True))
        for name in NEEDED:
            if not machine[name]:
                raise FileFormatError(path, f"the cell of '{name}' is empty", where=f"line {number}")
        machines.append(machine)
    if not machines:
        raise FileFormatError(path, "names no machine: a row each, below the header")
    return machines


def _require_columns(path: Path, names: list[str]) -> None:
    for name in NEEDED:
        if name not in names:
            raise FileFormatError(path, f"has no column '{name}'; its columns are {','.join(COLUMNS)}", where="line 1")
    for name in names:
        if name not in COLUMNS:
            raise FileFormatError(path, f"unknown column '{name}'; {did_you_mean(name, COLUMNS)}", where="line 1")
        if names.count(name) > 1:
            raise FileFormatError(path, f"has two columns '{name}'", where="line 1")
