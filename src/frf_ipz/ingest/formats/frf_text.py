"""One FRF as columns of text, as analysers export it; ``columns`` of the test says what each column is."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, complex_array
from frf_ipz.errors import FileFormatError, QuantityError, did_you_mean
from frf_ipz.ingest.formats.column_words import ANGULAR, FREQUENCY, LEVEL, NO_SCALE, OTHER_ANGLE, frf_role, stated_phase
from frf_ipz.ingest.formats.decibels import DECIBELS, EMPTY_BRACKETS, is_level, join_polar, reference_of
from frf_ipz.ingest.formats.frf_file import FrfContents, FrfSource, MeasuredFrf, note_at_rest, undefined_at_rest
from frf_ipz.ingest.formats.text_layout import (
    COMMENT,
    NEWLINE,
    TextLayout,
    decode,
    is_number,
    name_and_unit,
    open_text,
    sniff,
)
from frf_ipz.ingest.formats.text_table import not_a_number, read_blocks, require_once
from frf_ipz.ingest.units import frequency_factor, frf_factor, is_frequency_unit, is_stated, is_unit
from frf_ipz.late_imports import import_late
from frf_ipz.quantities import FrfQuantity
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import pyarrow as pa
else:
    pa = import_late("pyarrow")

SKIP = "skip"
STATED = FREQUENCY  # in the unit that the header states
FREQUENCIES = ("frequency_hz", "frequency_rad_s", STATED)
KNOWN = (
    *FREQUENCIES,
    "real",
    "imag",
    "magnitude",
    DECIBELS,
    "phase_deg",
    "phase_rad",
    "coherence",
    "variance",
    SKIP,
)
PHASES = ("phase_deg", "phase_rad")
OF_VALUES = {"real", "imag", "magnitude", DECIBELS}  # columns in the unit of the FRF, or relative to it
RATIO = re.compile(r"\(([^()]+)\)\s*\(([^()]+)\)")  # SignalCalc writes (m/s²)(N) for a ratio
NO_UNIT = re.compile(r"h\d*(\(.*\))?|frf|lin(ear)?|point[ :]*\d*", re.IGNORECASE)  # what brackets hold beside units
BRACKETS = re.compile(r"\[([^\[\]]*)\]")


@dataclass(frozen=True, slots=True, kw_only=True)
class HeaderUnit:
    """Unit that a header states for values.

    Parameters
    ----------
    text : str
        As the header writes it; empty where it states none.
    quantity : FrfQuantity, optional
        What has that unit, or its reciprocal; None for a unit of neither, such as ``V/V``.
    is_reciprocal : bool
        It is a unit of force over response.
    """

    text: str = ""
    quantity: FrfQuantity | None = None
    is_reciprocal: bool = False


class _TextColumns:
    rank = 10

    def holds(self, source: FrfSource, head: bytes) -> bool:
        del head
        return bool(source.columns)

    def read(self, source: FrfSource) -> tuple[MeasuredFrf, ...]:
        _check_columns(source)
        columns, header_unit = _read_columns(source)
        unit = _unit_as_meant(source, header_unit)
        if source.output_dof is None or source.input_dof is None:
            raise FileFormatError(source.path, "holds one FRF: its [[frf]] needs 'output_dof' and 'input_dof'")
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
                values=_complex_values(source.path, columns),
                coherence=columns.get("coherence"),
                variance=columns.get("variance"),
                unit=unit,
                is_level=DECIBELS in columns,
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
        len(columns & {"magnitude", DECIBELS}) == 1 and len(columns & {"phase_deg", "phase_rad"}) == 1
    )
    if len(columns & set(FREQUENCIES)) != 1 or not is_complete:
        raise FileFormatError(
            source.path,
            f"'columns' are {', '.join(source.columns)}; needed are frequency_hz (or frequency_rad_s) and either "
            "real and imag, or one of magnitude, magnitude_db and one of phase_deg, phase_rad",
        )


def _read_columns(source: FrfSource) -> tuple[dict[str, FloatArray], HeaderUnit]:
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
    frequency_hz = frequency * _frequency_factor(layout, name, names.index(name))
    _check_phase(layout, names)
    return {"frequency_hz": frequency_hz, **columns}, unit_of_values(_head_rows(layout), names)


def _unit_as_meant(source: FrfSource, stated: HeaderUnit) -> str:
    """Give the unit of the values as their header states it; it must be one of what they are said to be."""
    if DECIBELS not in source.columns and is_level(stated.text):
        return stated.text
    if not stated.text or source.unit:
        return stated.text
    if stated.quantity is None:
        problem = f"its header gives values in '{stated.text}', which is no unit of {source.quantity.value}"
        raise FileFormatError(source.path, f"{problem}; write what they are in as 'unit' of its [[frf]]")
    if (stated.quantity, stated.is_reciprocal) != (source.quantity, source.is_reciprocal):
        what = "force over response" if stated.is_reciprocal else stated.quantity.value
        problem = f"its header gives values in '{stated.text}', which is {what}; correct the 'quantity' of its [[frf]]"
        raise FileFormatError(source.path, f"{problem}, or write their right 'unit' there")
    return stated.text


def unit_of_values(rows: Sequence[Sequence[str]], names: Sequence[str]) -> HeaderUnit:
    """Find the unit of the values in a header.

    Parameters
    ----------
    rows : sequence of sequence of str
        Fields of its lines.
    names : sequence of str
        What the columns are, as `columns` says it.

    Returns
    -------
    HeaderUnit
        What stands beside the names of real parts, imaginary parts or magnitudes, also where it is no unit; else a unit
        of FRFs or of their reciprocals wherever one stands; else what stands below those names.

    Examples
    --------
    >>> names = ["frequency_hz", "magnitude_db", "phase_deg"]
    >>> unit_of_values([["f [Hz]", "Magnitude [dB re 1 g/N]", "Phase [deg]"]], names).text
    '1 g/N'
    """
    of_values = [_of_values(row, names) for row in rows if len(row) == len(names)]
    beside = [_unit_beside(field, name) for row in of_values for field, name in row]
    for text in filter(None, beside):
        return _known_unit(text) or HeaderUnit(text=text)
    fields = [field for row in rows for field in row]
    cut = [" ".join(row) for row in rows if len(row) != len(names)]  # at the blanks within brackets too
    whole = [_unit_beside(inner, DECIBELS) or inner for text in cut for inner in BRACKETS.findall(text)]
    for text in (*(name_and_unit(field)[1] for field in fields), *whole, *fields):
        unit = _known_unit(text)
        if unit is not None:
            return unit
    claimed = (
        _claimed_unit(field, name, is_alone=len({field for field, _ in row}) == 1)
        for row in of_values
        for field, name in row
    )
    return HeaderUnit(text=next(filter(None, claimed), ""))


def _of_values(row: Sequence[str], names: Sequence[str]) -> list[tuple[str, str]]:
    return [(field, name) for field, name in zip(row, names, strict=True) if name in OF_VALUES and field]


def _known_unit(text: str) -> HeaderUnit | None:
    """Read a unit of FRFs or of their reciprocals; None where a text is neither."""
    ratio = RATIO.fullmatch(text.strip())
    for unit in (text, f"({ratio[1]})/({ratio[2]})") if ratio else (text,):
        for quantity, is_reciprocal in product(FrfQuantity if unit.strip() else (), (False, True)):
            try:
                frf_factor(f"1/({unit})" if is_reciprocal else unit, quantity, "z", "z")
            except QuantityError:
                continue
            return HeaderUnit(text=unit, quantity=quantity, is_reciprocal=is_reciprocal)
    return None


def _unit_beside(field: str, name: str) -> str:
    """Give what stands in the place of a unit beside the name of a column; empty where nothing does.

    Decibels are relative to it, whatever the order: ``dB re 1 g/N``, ``g/N (dB)``.
    """
    level = LEVEL.search(field) if name == DECIBELS else None
    if level is None and not frf_role(field):
        return ""
    if level is not None:
        if level["reference"]:
            return reference_of(field)
        field = EMPTY_BRACKETS.sub("", field[: level.start()] + field[level.end() :]).strip()
    ratio = RATIO.search(field)
    if ratio:
        return ratio[0]
    text = name_and_unit(field)[1]
    if text:
        return text if _is_claimed(text, name, is_square=field.endswith("]")) else ""
    return _ratio_behind(field)


def _is_claimed(text: str, name: str, *, is_square: bool) -> bool:
    """Tell whether brackets beside a name claim to hold a unit.

    Square ones do, but for what is known to be none; round ones where it is one, or what stands in its place where
    values have no scale. Else they hold a remark.
    """
    if not is_stated(text) or is_number(text) or NO_UNIT.fullmatch(text):
        return False
    if "/" in text or is_unit(text):
        return True
    if frf_role(text) == name:
        return False
    return is_square or bool(LEVEL.search(text) or NO_SCALE.fullmatch(text)) or sum(map(is_unit, text.split())) > 1


def _ratio_behind(field: str) -> str:
    """Give a ratio of units, with its number and all that follows; empty where there is none."""
    words = field.split()
    place = next((place for place, word in enumerate(words) if _is_ratio(word)), None)
    if place is None:
        return ""
    return " ".join(words[place - 1 if place and is_number(words[place - 1]) else place :])


def _is_ratio(word: str) -> bool:
    parts = word.split("/")
    return len(parts) > 1 and all(is_unit(part.strip("()")) for part in parts)


def _claimed_unit(field: str, name: str, *, is_alone: bool) -> str:
    """Give what a field that names no column claims to be a unit, in brackets or alone; empty where it is none.

    Alone stands a unit that all parts of a value share, and none has another: 'Re' and 'Im' are names. So may be a
    letter above decibels.
    """
    if frf_role(field):
        return ""
    unit = name_and_unit(field)[1]
    if is_stated(unit) and ("/" in unit or is_unit(unit)):
        return unit
    if not is_alone or (name == DECIBELS and "/" not in field):
        return ""
    parts = [part.strip() for part in field.replace("/", " ").split()]
    is_claimed = any(map(is_unit, parts)) or bool(parts and all(map(NO_SCALE.fullmatch, parts)))
    return field if is_claimed else ""


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


def _check_phase(layout: TextLayout, names: Sequence[str]) -> None:
    """Refuse phases that the header states to be in another unit than `columns` says."""
    name = next((name for name in names if name in PHASES), None)
    for fields in _head_rows(layout) if name else ():
        stated = stated_phase(fields[names.index(name)], fields) if len(fields) == layout.n_columns else ""
        if stated in ("", name):
            continue
        text = fields[names.index(name)]
        if stated == OTHER_ANGLE:
            problem = f"its column '{text}' is neither in degrees nor in radians; export one of them"
        else:
            problem = f"its header gives phases in '{text}', where 'columns' of its [[frf]] says {name}; write {stated}"
            problem += " there, or correct the header"
        raise FileFormatError(layout.path, problem)


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


def _complex_values(path: Path, columns: dict[str, FloatArray]) -> ComplexArray:
    if "real" in columns:
        return complex_array(columns["real"], columns["imag"])
    return join_polar(path, columns, key="columns")
