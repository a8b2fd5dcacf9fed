"""What the columns of a recording measure: by their units, else by their names."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from frf_ipz.errors import InputError
from frf_ipz.ingest.formats.recording import TableKeys
from frf_ipz.ingest.formats.text_columns import TIME, find_columns
from frf_ipz.ingest.formats.text_layout import is_number, name_and_unit, sniff
from frf_ipz.ingest.units import is_stated, unit_factor

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from frf_ipz.ingest.formats.text_columns import TextColumns

UNITS = {"force": "N", "velocity": "m/s", "displacement": "m", "acceleration": "m/s^2"}  # where the files state none
# What columns are called, in English and German: words first, then the letters that stand at the beginning.
NAMES = {
    "force": re.compile(r"force|hammer|impact|load|kraft", re.IGNORECASE),
    "acceleration": re.compile(r"acc|beschl", re.IGNORECASE),
    "velocity": re.compile(r"vel|speed|ldv|vibrometer|geschw|schnelle", re.IGNORECASE),
    "displacement": re.compile(r"disp|gap|pos|lvdt|weg|auslenk", re.IGNORECASE),
}
LETTER = re.compile(r"([favxu])\d*(_|$)", re.IGNORECASE)
LETTERS = {"f": "force", "a": "acceleration", "v": "velocity", "x": "displacement", "u": "displacement"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of the recordings.

    Parameters
    ----------
    name : str
        As `test.toml` calls it.
    quantity : str
        ``force``, ``acceleration``, ``velocity`` or ``displacement``.
    file_unit : str
        What the file says; may be empty.
    unit_tells : bool
        The quantity follows from the file's unit.
    name_tells : bool
        It follows from the column's name.
    """

    name: str
    quantity: str
    file_unit: str
    unit_tells: bool
    name_tells: bool

    @property
    def is_known(self) -> bool:
        """The quantity is no guess."""
        return self.unit_tells or self.name_tells


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """The columns that all recordings have in common.

    Parameters
    ----------
    force : Column
        The input.
    responses : tuple of Column
        The outputs.
    other_forces : tuple of Column
        Further forces; a test has one.
    has_time : bool
        There is a column of time.
    """

    force: Column
    responses: tuple[Column, ...]
    other_forces: tuple[Column, ...]
    has_time: bool


def read_columns(files: Sequence[Path]) -> Columns:
    """Find the force and the responses.

    Parameters
    ----------
    files : sequence of Path
        Recordings.

    Returns
    -------
    Columns
        With at least one response.

    Raises
    ------
    InputError
        If files have different columns, or no force or no response can be among them.
    """
    found = _common_columns(files)
    columns = _signals(files[0], found)
    forces = [column for column in columns if column.quantity == "force"]
    if not forces:  # the first is it most often, unless its unit says that it is a motion
        guess = next((column for column in columns if not column.unit_tells), None)
        if guess is None:
            units = ", ".join(f"'{name_and_unit(column.name)[0]}' in {column.file_unit}" for column in columns)
            raise InputError(f"{files[0]}: none of the columns is a force: {units}; FRFs need the force too")
        forces = [
            Column(name=guess.name, quantity="force", file_unit=guess.file_unit, unit_tells=False, name_tells=False)
        ]
        columns = [column for column in columns if column is not guess]
    responses = tuple(column for column in columns if column.quantity != "force")
    if not responses:
        names = ", ".join(found.names)
        raise InputError(f"{files[0]}: a force and a response are needed besides the time; its columns are {names}")
    return Columns(
        force=forces[0],
        responses=responses,
        other_forces=tuple(forces[1:]),
        has_time=found.time is not None,
    )


def _common_columns(files: Sequence[Path]) -> TextColumns:
    first = find_columns(sniff(files[0]), TableKeys())
    for path in files[1:]:
        other = find_columns(sniff(path), TableKeys())
        if other.names != first.names:
            raise InputError(
                f"{path}: has the columns {', '.join(other.names)}, and {files[0]} has {', '.join(first.names)}; "
                "put files with different columns into folders of their own and run init on each"
            )
    return first


def _signals(path: Path, found: TextColumns) -> list[Column]:
    """Give the columns of signals: those that hold numbers, and are neither a time nor a count."""
    rows = sniff(path).rows
    columns = []
    for index, (name, unit) in enumerate(zip(found.names, found.units, strict=True)):
        is_time = index == found.time or TIME.match(name) or (index == 0 and found.counts_samples)
        if is_time or not any(is_number(fields[index]) for fields in rows if index < len(fields)):
            continue
        written = name if name and found.names.count(name) == 1 else str(index + 1)
        columns.append(_column(written, name_and_unit(name)[0], unit if is_stated(unit) else ""))
    if len(columns) < 2:
        names = ", ".join(found.names)
        raise InputError(f"{path}: a force and a response are needed besides the time; its columns are {names}")
    return columns


def _column(written: str, name: str, unit: str) -> Column:
    by_name = next((quantity for quantity, pattern in NAMES.items() if pattern.search(name)), None)
    letter = LETTER.match(name)
    by_name = LETTERS[letter[1].lower()] if by_name is None and letter else by_name
    by_unit = _quantity_of(unit)
    return Column(
        name=written,
        quantity=by_unit or by_name or "acceleration",
        file_unit=unit,
        unit_tells=by_unit is not None,
        name_tells=by_name is not None and by_unit is None,
    )


def _quantity_of(unit: str) -> str | None:
    """Tell a quantity by a unit; None where it is one of none, such as V."""
    for quantity in UNITS if unit else ():
        try:
            unit_factor(unit, quantity)
        except InputError:
            continue
        return quantity
    return None
