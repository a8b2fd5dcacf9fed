"""One FRF as columns of text, as analysers export it; ``columns`` of the test says what each column is."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, complex_array
from frf_ipz.errors import FileFormatError, did_you_mean
from frf_ipz.ingest.formats.frf_file import FrfContents, FrfSource, MeasuredFrf, note_at_rest, undefined_at_rest
from frf_ipz.ingest.formats.text_layout import COMMENT, NEWLINE, TextLayout, decode, name_and_unit, open_text, sniff
from frf_ipz.ingest.formats.text_table import not_a_number, read_blocks, require_once
from frf_ipz.ingest.units import frequency_factor, is_frequency_unit
from frf_ipz.late_imports import import_late
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    import pyarrow as pa
else:
    pa = import_late("pyarrow")

SKIP = "skip"
ANGULAR = re.compile(r"w|omega\w*|om|rad_?s|w_?(vec|axis)\w*", re.IGNORECASE)  # names of angular frequencies
STATED = "frequency"  # in the unit that the header states
FREQUENCIES = ("frequency_hz", "frequency_rad_s", STATED)
KNOWN = (
    *FREQUENCIES,
    "real",
    "imag",
    "magnitude",
    "magnitude_db",
    "phase_deg",
    "phase_rad",
    "coherence",
    "variance",
    SKIP,
)


class _TextColumns:
    rank = 10

    def holds(self, source: FrfSource, head: bytes) -> bool:
        del head
        return bool(source.columns)

    def read(self, source: FrfSource) -> tuple[MeasuredFrf, ...]:
        _check_columns(source)
        columns = _read_columns(source)
        if source.output_dof is None or source.input_dof is None:
            raise FileFormatError(source.path, "holds one FRF: its [[frf]] needs 'output_dof' and 'input_dof'")
        if (columns.get("magnitude", np.zeros(0)) < 0.0).any():
            problem = "holds negative magnitudes; where they are decibels, name the column magnitude_db in 'columns'"
            raise FileFormatError(source.path, problem)
        left_out = undefined_at_rest(columns)
        columns = {name: values[~left_out] for name, values in columns.items()}
        order = np.argsort(columns["frequency_hz"], kind="stable")
        columns = {name: values[order] for name, values in columns.items()}
        return (
            MeasuredFrf(
                source=source,
                output_dof=source.output_dof,
                input_dof=source.input_dof,
                frequency_hz=columns["frequency_hz"],
                values=_complex_values(columns),
                coherence=columns.get("coherence"),
                variance=columns.get("variance"),
                notes=note_at_rest(source, source.output_dof, source.input_dof, left_out),
            ),
        )

    def look(self, source: FrfSource) -> FrfContents:
        _check_columns(source)
        return FrfContents(n_outputs=1, n_inputs=1)


FORMAT = _TextColumns()


def _check_columns(source: FrfSource) -> None:
    for name in source.columns:
        if name not in KNOWN:
            raise FileFormatError(source.path, f"'columns' names '{name}'; {did_you_mean(name, KNOWN)}")
    columns = set(source.columns)
    is_complete = {"real", "imag"} <= columns or (
        len(columns & {"magnitude", "magnitude_db"}) == 1 and len(columns & {"phase_deg", "phase_rad"}) == 1
    )
    if len(columns & set(FREQUENCIES)) != 1 or not is_complete:
        raise FileFormatError(
            source.path,
            f"'columns' are {', '.join(source.columns)}; needed are frequency_hz (or frequency_rad_s) and either "
            "real and imag, or one of magnitude, magnitude_db and one of phase_deg, phase_rad",
        )


def _read_columns(source: FrfSource) -> dict[str, FloatArray]:
    layout = sniff(source.path, skip_rows=source.skip_rows)
    if layout.n_columns < len(source.columns):
        problem = f"has {counted(layout.n_columns, 'column')}, but 'columns' of its [[frf]] names {len(source.columns)}"
        raise FileFormatError(source.path, problem, where=f"line {layout.n_before + 1}")
    names = [*source.columns, *[SKIP] * (layout.n_columns - len(source.columns))]
    indices = [index for index, name in enumerate(names) if name != SKIP]
    table = pa.Table.from_batches(read_blocks(layout, names, dict.fromkeys(indices, pa.float64())))
    numbers = np.column_stack([table.column(position).to_numpy() for position in range(len(indices))])
    columns = {names[index]: numbers[:, position] for position, index in enumerate(indices)}
    name = next(name for name in FREQUENCIES if name in columns)
    frequency = columns.pop(name)
    is_bad = ~np.isfinite(numbers).all(axis=1) & (frequency != 0.0)
    if is_bad.any():
        raise not_a_number(layout, names, indices, int(np.argmax(is_bad)))
    require_once(layout, name, frequency, np.arange(len(frequency)), "its FRF")
    return {"frequency_hz": frequency * _frequency_factor(layout, name, names.index(name)), **columns}


def _frequency_factor(layout: TextLayout, name: str, index: int) -> float:
    """Give the factor to Hz; what `columns` says must not contradict the header."""
    unit = stated_frequency_unit(layout, index)
    if name == STATED:
        return frequency_factor(unit)
    factor = frequency_factor("rad/s" if name == "frequency_rad_s" else "Hz")
    if unit and frequency_factor(unit) != factor:
        problem = f"its header gives frequencies in '{unit}', where 'columns' of its [[frf]] says {name}"
        raise FileFormatError(layout.path, f"{problem}; write {name_of_frequency(unit)} there, or correct the header")
    return factor


def _head_rows(layout: TextLayout) -> list[list[str]]:
    """Give the lines before the numbers, those too that `skip_rows` leaves out."""
    with open_text(layout.path) as stream:
        lines = NEWLINE.split(stream.read(layout.start))
    return [layout.split(COMMENT.sub("", decode(line))) for line in lines if line.strip()]


def name_of_frequency(unit: str) -> str:
    """Give what `columns` says of frequencies in a unit.

    Parameters
    ----------
    unit : str
        Empty where none is stated.

    Returns
    -------
    str
        One of `FREQUENCIES`.
    """
    factors = {frequency_factor("Hz"): "frequency_hz", frequency_factor("rad/s"): "frequency_rad_s"}
    return factors.get(frequency_factor(unit), STATED)


def stated_frequency_unit(layout: TextLayout, index: int) -> str:
    """Find the unit of frequency that the header states for a column.

    Parameters
    ----------
    layout : TextLayout
        Of the file.
    index : int
        The column.

    Returns
    -------
    str
        Such as ``rad/s``; empty where the header states none.
    """
    for fields in _head_rows(layout):
        if len(fields) == layout.n_columns:
            name, unit = name_and_unit(fields[index])
            for text in (unit, name):
                if is_frequency_unit(text):
                    return text
            if ANGULAR.fullmatch(name):
                return "rad/s"
    return ""


def _complex_values(columns: dict[str, FloatArray]) -> ComplexArray:
    if "real" in columns:
        return complex_array(columns["real"], columns["imag"])
    phase = columns["phase_rad"] if "phase_rad" in columns else np.radians(columns["phase_deg"])
    magnitude = columns["magnitude"] if "magnitude" in columns else 10.0 ** (columns["magnitude_db"] / 20.0)
    return np.asarray(magnitude * np.exp(1j * phase))
