"""What the columns of a recording measure: by their units, else by their names."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from frf_ipz.dofs import Dof
from frf_ipz.errors import InputError
from frf_ipz.ingest.formats.registry import look_at_recording
from frf_ipz.ingest.formats.text_layout import name_and_unit
from frf_ipz.ingest.units import is_stated, unit_factor

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.ingest.formats.recording import RecordingContents

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
        Further forces.
    has_time : bool
        The files say when their samples were taken.
    dofs : dict of Path to dict of str to Dof
        Where each column of a file was measured, by the column's name; empty where the file does not say.
    """

    force: Column
    responses: tuple[Column, ...]
    other_forces: tuple[Column, ...]
    has_time: bool
    dofs: dict[Path, dict[str, Dof]]

    @property
    def names(self) -> tuple[str, ...]:
        """The columns of a test: the force first."""
        return (self.force.name, *(column.name for column in self.responses))


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
    contents = {path: look_at_recording(path) for path in files}
    names = _common_names(contents)
    first = contents[files[0]]
    columns = [
        _column(name, column.label, column.unit if is_stated(column.unit) else "")
        for name, column in zip(names, first.columns, strict=True)
    ]
    if len(columns) < 2:
        shown = ", ".join(names)
        raise InputError(f"{files[0]}: a force and a response are needed besides the time; its columns are {shown}")
    forces = [column for column in columns if column.quantity == "force"]
    if not forces:  # the first is it most often, unless its unit says that it is a motion
        by_name = [name for name, known in zip(names, first.columns, strict=True) if _named(known.label) == "force"]
        guess = next((column for column in columns if not column.unit_tells or column.name in by_name), None)
        if guess is None:
            units = ", ".join(f"'{name_and_unit(column.name)[0]}' in {column.file_unit}" for column in columns)
            raise InputError(f"{files[0]}: none of the columns is a force: {units}; FRFs need the force too")
        forces = [
            Column(name=guess.name, quantity="force", file_unit=guess.file_unit, unit_tells=False, name_tells=False)
        ]
        columns = [column for column in columns if column is not guess]
    responses = tuple(column for column in columns if column.quantity != "force")
    if not responses:
        shown = ", ".join(names)
        raise InputError(f"{files[0]}: a force and a response are needed besides the time; its columns are {shown}")
    return Columns(
        force=forces[0],
        responses=responses,
        other_forces=tuple(forces[1:]),
        has_time=all(content.has_time for content in contents.values()),
        dofs={
            path: {
                name: column.dof for name, column in zip(names, content.columns, strict=True) if column.dof is not None
            }
            for path, content in contents.items()
        },
    )


def _common_names(contents: Mapping[Path, RecordingContents]) -> list[str]:
    """Give names that serve in all files: their own, or numbers where each file calls its columns after its DOFs."""
    paths = list(contents)
    names = {path: [column.name for column in contents[path].columns] for path in paths}
    first = names[paths[0]]
    for path in paths[1:]:
        if names[path] == first:
            continue
        measured_somewhere = all(column.dof is not None for content in contents.values() for column in content.columns)
        if measured_somewhere and len({len(found) for found in names.values()}) == 1:
            return [str(number) for number in range(1, len(first) + 1)]
        raise InputError(
            f"{path}: has the columns {', '.join(names[path])}, and {paths[0]} has {', '.join(first)}; "
            "put files with different columns into folders of their own and run init on each"
        )
    return first


def _named(name: str) -> str | None:
    """Tell a quantity by the name of a column."""
    by_name = next((quantity for quantity, pattern in NAMES.items() if pattern.search(name)), None)
    letter = LETTER.match(name)
    return LETTERS[letter[1].lower()] if by_name is None and letter else by_name


def _column(written: str, name: str, unit: str) -> Column:
    by_name = _named(name)
    by_unit = quantity_of(unit)
    return Column(
        name=written,
        quantity=by_unit or by_name or "acceleration",
        file_unit=unit,
        unit_tells=by_unit is not None,
        name_tells=by_name is not None and by_unit is None,
    )


def quantity_of(unit: str) -> str | None:
    """Tell the quantity of a recording by its unit.

    Parameters
    ----------
    unit : str
        May be empty.

    Returns
    -------
    str or None
        None where it is one of none, such as V.
    """
    for quantity in UNITS if unit else ():
        try:
            unit_factor(unit, quantity)
        except InputError:
            continue
        return quantity
    return None
