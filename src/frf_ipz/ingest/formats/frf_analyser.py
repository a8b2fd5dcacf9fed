"""One FRF as text of an analyser (SignalCalc, OROS, CutPro, LMS and others) whose header says what the columns are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import FileFormatError
from frf_ipz.ingest.formats import frf_text
from frf_ipz.ingest.formats.column_words import OTHER_ANGLE, frf_role, stated_phase
from frf_ipz.ingest.formats.decibels import DECIBELS
from frf_ipz.ingest.formats.frf_file import FrfContents, FrfSource, MeasuredFrf
from frf_ipz.ingest.formats.text_layout import is_number, name_and_unit, sniff

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from frf_ipz.arrays import ComplexArray
    from frf_ipz.ingest.formats.text_layout import TextLayout

MAGNITUDES = {"magnitude", DECIBELS}
PHASES = {"real", "imag", "phase_deg", "phase_rad"}
LABELS = ("output_dof", "input_dof")
LEAST_SPAN = 2.0 * np.pi  # degrees: within it phases without a unit may be radians
MOST_HEAD = 1 << 12  # bytes in which a binary file shows itself


@dataclass(frozen=True, slots=True, kw_only=True)
class AnalyserColumns:
    """What the columns of an analyser's text are.

    Parameters
    ----------
    columns : tuple of str
        As `columns` of ``[[frf]]`` says it.
    unit : HeaderUnit
        Of the values.
    phase : str
        The name of the column of phases where it states neither degrees nor radians.
    """

    columns: tuple[str, ...]
    unit: frf_text.HeaderUnit
    phase: str = ""


class _AnalyserText:
    rank = 50

    def holds(self, source: FrfSource, head: bytes) -> bool:
        if source.columns or b"\0" in head[:MOST_HEAD] or source.skip_rows:
            return False
        return find_frf_columns(source) is not None or _holds_magnitudes_only(source.path)

    def read(self, source: FrfSource) -> tuple[MeasuredFrf, ...]:
        found = find_frf_columns(source)
        if found is None:
            require_phase(source.path)
            raise FileFormatError(
                source.path, "does not say what its columns are; write columns = [...] in its [[frf]]"
            )
        frfs = frf_text.FORMAT.read(replace(source, columns=found.columns))
        if found.phase:
            _require_degrees(source.path, found, frfs[0].values)
        about = f"{source.path.name}: its columns are {', '.join(found.columns)}"
        unit = found.unit.text
        if unit and source.unit and unit != source.unit:
            about += f"; in '{source.unit}', as its [[frf]] says, where its header says '{unit}'"
        return tuple(replace(frf, source=source, notes=(*frf.notes, about)) for frf in frfs)

    def look(self, source: FrfSource) -> FrfContents:
        found = find_frf_columns(source)
        if found is None:
            require_phase(source.path)
            raise FileFormatError(
                source.path, "does not say what its columns are; write columns = [...] in its [[frf]]"
            )
        about = f"columns {', '.join(found.columns)}"
        quantity = None if found.unit.is_reciprocal else found.unit.quantity
        unit = "" if found.unit.quantity is None else found.unit.text
        return FrfContents(n_outputs=1, n_inputs=1, quantity=quantity, unit=unit, about=about)


FORMAT = _AnalyserText()


def find_frf_columns(source: FrfSource) -> AnalyserColumns | None:
    """Find out from its header what the columns of a text file are.

    Parameters
    ----------
    source : FrfSource
        The file.

    Returns
    -------
    AnalyserColumns or None
        None where the header does not speak of an FRF.
    """
    try:
        layout = sniff(source.path)
    except FileFormatError:
        return None
    if any(label in fields for fields in layout.header for label in LABELS):  # a long table of many FRFs
        return None
    for words, roles in _possible_headers(layout):
        known = set(roles)
        is_complete = {"real", "imag"} <= known or (
            bool(known & {"magnitude", DECIBELS}) and bool(known & {"phase_deg", "phase_rad"})
        )
        named = [role for role in roles if role != frf_text.SKIP]
        if (
            len(roles) == layout.n_columns
            and is_complete
            and roles[0] == frf_text.STATED
            and len(set(named)) == len(named)
        ):
            phase = next((word for word in words if _is_open_phase(word, words)), "")
            if phase and any(stated_phase(field, words) == "phase_deg" for row in layout.header for field in row):
                phase = ""  # a row of units says it
            frequency = frf_text.name_of_frequency(frf_text.stated_frequency_unit(layout, 0))
            unit = frf_text.unit_of_values(layout.header, roles)
            return AnalyserColumns(columns=(frequency, *roles[1:]), unit=unit, phase=phase)
    return None


def _possible_headers(layout: TextLayout) -> Iterator[tuple[list[str], list[str]]]:
    """Give the words of each line of text, with those of a row of units below it, and what such columns are."""
    for fields, below in pairwise([*layout.header, ()]):
        words = [field for field in fields if field and not is_number(field)]
        if len(words) == len(below) == layout.n_columns:
            words = [f"{word} [{unit}]" if unit else word for word, unit in zip(words, below, strict=True)]
        roles = [frf_role(word) or frf_text.SKIP for word in words]
        if len(words) != layout.n_columns:  # units stand between the names
            roles = list(dict.fromkeys(role for role in roles if role != frf_text.SKIP))
        yield words, roles


def require_phase(path: Path) -> None:
    """Refuse text whose header names frequencies and magnitudes only.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    FileFormatError
        If there is no phase.
    """
    if _holds_magnitudes_only(path):
        problem = "its header names frequencies and magnitudes, without a phase, and poles and zeros need both"
        raise FileFormatError(path, f"{problem}; export real and imaginary part, or magnitude and phase")


def _holds_magnitudes_only(path: Path) -> bool:
    try:
        layout = sniff(path)
    except FileFormatError:
        return False
    headers = [roles for _, roles in _possible_headers(layout) if len(roles) == layout.n_columns]
    return any(roles[0] == frf_text.STATED and MAGNITUDES & set(roles) and not PHASES & set(roles) for roles in headers)


def _is_open_phase(word: str, words: Sequence[str]) -> bool:
    """Tell whether a name is that of phases that are stated to be neither in degrees nor in radians."""
    return frf_role(word).startswith("phase") and stated_phase(word, words) in ("", OTHER_ANGLE)


def _require_degrees(path: Path, found: AnalyserColumns, values: ComplexArray) -> None:
    """Refuse phases in a unit that is none of them, and such without a unit that look like radians."""
    if name_and_unit(found.phase)[1] or stated_phase(found.phase, ()) == OTHER_ANGLE:
        problem = f"its column '{found.phase}' is neither in degrees nor in radians; export one of them"
        raise FileFormatError(path, problem)
    phase_deg = np.degrees(np.angle(values))
    if np.abs(phase_deg).max(initial=0.0) <= LEAST_SPAN and phase_deg.any():
        columns = ", ".join(f'"{name}"' for name in found.columns)
        problem = (
            f"the phases of its column '{found.phase}' lie between {phase_deg.min():.3g} and {phase_deg.max():.3g}"
        )
        way_out = f"write columns = [{columns}] in its [[frf]], or phase_rad there"
        raise FileFormatError(path, f"{problem}, and nothing says whether these are degrees or radians; {way_out}")
