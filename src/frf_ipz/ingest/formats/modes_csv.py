"""Modes as a long CSV: one row a mode and DOF, with the mode's frequency and damping ratio in each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.dofs import parse_dof
from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.ingest.formats.modes_file import ModesSource, make_modes
from frf_ipz.ingest.formats.text_layout import sniff
from frf_ipz.ingest.formats.text_table import column_index, line_of_row, read_blocks
from frf_ipz.late_imports import import_late
from frf_ipz.modes import DEVIATIONS
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from pathlib import Path

    import pyarrow as pa

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.dofs import Dof
    from frf_ipz.ingest.formats.text_layout import TextLayout
    from frf_ipz.modes import ModalParameters
else:
    pa = import_late("pyarrow")

OF_MODE = ("frequency_hz", "damping_ratio")
NEEDED = ("mode", *OF_MODE, "dof", "real")
COLUMNS = (*NEEDED, "imag", *DEVIATIONS)


class _ModesCsv:
    rank = 10

    def holds_modes(self, path: Path, head: bytes) -> bool:
        del path
        first = head.decode("latin-1").lower()
        return "mode" in first and "damping_ratio" in first and "dof" in first

    def read_modes(self, source: ModesSource) -> ModalParameters:
        layout = sniff(source.path)
        if not layout.header:
            raise FileFormatError(source.path, f"has no line that names its columns; expected are {','.join(NEEDED)}")
        names = layout.header[-1]
        columns = _read_columns(layout, names)
        modes, place_of_row = np.unique(columns["mode"], return_inverse=True)
        dofs = _read_dofs(layout, columns.pop("dof"))
        of_modes = {
            name: _one_a_mode(layout, name, columns[name], place_of_row)
            for name in (*OF_MODE, *DEVIATIONS)
            if name in columns
        }
        shapes = _shapes(layout, columns, (modes, place_of_row), dofs)
        known = {name: of_modes[name] for name in DEVIATIONS if name in of_modes}
        return make_modes(
            source,
            natural_frequency_hz=of_modes["frequency_hz"],
            damping_ratio=of_modes["damping_ratio"],
            shapes=shapes,
            dofs=tuple(dict.fromkeys(dofs)),
            **known,
        )


FORMAT = _ModesCsv()


def _read_columns(layout: TextLayout, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    if len(names) != layout.n_columns:
        problem = f"has {counted(layout.n_columns, 'value')} where the header has {counted(len(names), 'column')}"
        raise FileFormatError(layout.path, problem, where=f"line {layout.n_before + 1}")
    present = [*NEEDED, *(name for name in COLUMNS if name in names and name not in NEEDED)]
    indices = {column_index(layout, names, name): name for name in present}
    types = {index: pa.string() if name == "dof" else pa.float64() for index, name in indices.items()}
    table = pa.Table.from_batches(list(read_blocks(layout, names, types))).rename_columns(list(indices.values()))
    columns = {name: table[name].to_numpy(zero_copy_only=False) for name in present}
    for name in present:
        if name == "dof" or name in DEVIATIONS:
            continue
        is_bad = ~np.isfinite(columns[name])
        if is_bad.any():
            line = line_of_row(layout, int(np.argmax(is_bad)))
            raise FileFormatError(layout.path, f"column '{name}' holds no number there", where=f"line {line}")
    columns.setdefault("imag", np.zeros(len(columns["real"])))
    return columns


def _read_dofs(layout: TextLayout, texts: np.ndarray) -> list[Dof]:
    dofs = {}
    for row, text in enumerate(texts.tolist()):
        if text in dofs:
            continue
        try:
            dofs[text] = parse_dof(text)
        except InputError as error:
            raise FileFormatError(layout.path, str(error), where=f"line {line_of_row(layout, row)}") from None
    return [dofs[text] for text in texts.tolist()]


def _one_a_mode(layout: TextLayout, name: str, values: FloatArray, place_of_row: np.ndarray) -> FloatArray:
    """Take what all rows of a mode agree upon."""
    first = np.zeros(int(place_of_row.max()) + 1)
    first[place_of_row[::-1]] = values[::-1]
    differs = ~((values == first[place_of_row]) | (np.isnan(values) & np.isnan(first[place_of_row])))
    if differs.any():
        row = int(np.argmax(differs))
        problem = f"column '{name}' is {values[row]:g} there and {first[place_of_row[row]]:g} above, in the same mode"
        raise FileFormatError(layout.path, f"{problem}; a mode has one", where=f"line {line_of_row(layout, row)}")
    return first


def _shapes(
    layout: TextLayout, columns: dict[str, FloatArray], modes: tuple[FloatArray, np.ndarray], dofs: list[Dof]
) -> ComplexArray:
    """Arrange the rows as DOFs by modes; every mode needs every DOF."""
    numbers, place_of_row = modes
    places = {dof: place for place, dof in enumerate(dict.fromkeys(dofs))}
    shapes = np.full((len(places), len(numbers)), np.nan, complex)
    for row, (dof, mode) in enumerate(zip(dofs, place_of_row.tolist(), strict=True)):
        if not np.isnan(shapes[places[dof], mode]):
            where = f"line {line_of_row(layout, row)}"
            raise FileFormatError(layout.path, f"mode {numbers[mode]:g} has '{dof}' twice", where=where)
        shapes[places[dof], mode] = complex(columns["real"][row], columns["imag"][row])
    missing = np.argwhere(np.isnan(shapes))
    if len(missing):
        dof, mode = missing[0]
        problem = f"mode {numbers[mode]:g} has no row for '{list(places)[dof]}', which another mode has"
        raise FileFormatError(layout.path, f"{problem}; give each mode a row for each DOF, or leave the DOF out of all")
    return shapes
