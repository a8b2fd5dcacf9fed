"""Recordings as universal files (UFF): time responses, functions of type 1 in data sets 58."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import FileFormatError
from frf_ipz.ingest.formats.recording import LARGEST, RawRecording, RecordingContents, SignalColumn
from frf_ipz.ingest.formats.universal_file import (
    TIME_RESPONSE,
    describe_functions,
    find_dof,
    read_functions,
)
from frf_ipz.ingest.units import is_stated
from frf_ipz.input_files import read_bytes
from frf_ipz.universal_sets import is_universal

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from frf_ipz.ingest.formats.recording import TableKeys
    from frf_ipz.ingest.formats.universal_file import UniversalFunction

QUANTITIES = {8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "force"}  # types of ordinates


class _UniversalRecordings:
    """Each time response is a column; it answers to its DOF, to the label of its ordinate and to its number."""

    rank = 0

    def fits(self, path: Path, head: bytes) -> bool:
        del path
        return is_universal(head)

    def open(self, path: Path, columns: Sequence[str], keys: TableKeys) -> RawRecording:
        if keys.time_column or keys.header_row is not None or keys.sample_rate_hz is not None:
            problem = "is a universal file, which states its time itself; leave out time_column, header_row and"
            raise FileFormatError(path, f"{problem} sample_rate_hz of [test]")
        responses = _read_responses(path)
        chosen = [_find(path, responses, column) for column in columns]
        first = chosen[0] if chosen else responses[0]
        for function in chosen:
            if not np.array_equal(function.x, first.x):
                problem = f"data sets {first.number} and {function.number} have different times; export them together"
                raise FileFormatError(path, problem, where=f"line {function.line}")
            is_finite = np.abs(function.values) < LARGEST
            if not is_finite.all():
                place = int(np.argmin(is_finite))
                problem = f"sample {place + 1} of data set {function.number} is not finite, or absurdly large"
                line = function.point_lines[place]
                raise FileFormatError(path, f"{problem}; correct the file", where=f"line {line}")
        table = np.column_stack([first.x, *(function.values.real for function in chosen)])
        return RawRecording(
            path=path,
            units=tuple(_unit(axis) for axis in (first.abscissa.unit, *(chosen.ordinate.unit for chosen in chosen))),
            blocks=iter([table]),
            line_of_row=lambda row: first.line + row,
        )

    def look(self, path: Path, keys: TableKeys) -> RecordingContents:
        del keys
        responses = _read_responses(path)
        names = [_dof(function) for function in responses]
        return RecordingContents(
            columns=tuple(
                SignalColumn(
                    name=name if names.count(name) == 1 and ":" in name else str(number),
                    unit=_unit(function.ordinate.unit),
                    dof=find_dof(*function.ends[:2]),
                    label=_quantity_of(function),
                )
                for number, (name, function) in enumerate(zip(names, responses, strict=True), start=1)
            ),
            has_time=True,
        )


FORMAT = _UniversalRecordings()


def _read_responses(path: Path) -> list[UniversalFunction]:
    functions = read_functions(path, read_bytes(path))
    responses = [function for function in functions if function.function_type == TIME_RESPONSE]
    if not responses:
        problem = f"holds no time response (data set 58 of type 1), but {describe_functions(functions)}"
        raise FileFormatError(path, f"{problem}; FRFs belong under [[frf]] of a test of kind 'frf'")
    return responses


def _quantity_of(function: UniversalFunction) -> str:
    """Name what is measured: by the type of the ordinate, else by its label."""
    return QUANTITIES.get(function.ordinate.data_type, function.ordinate.label)


def _find(path: Path, responses: Sequence[UniversalFunction], column: str) -> UniversalFunction:
    """Find a column by its DOF, by the label of its ordinate, or by its number among the time responses."""
    for name in (_dof, _label):
        found = [function for function in responses if name(function) == column.strip().lower()]
        if len(found) == 1:
            return found[0]
    if column.isdecimal() and 1 <= int(column[:9]) <= len(responses):
        return responses[int(column) - 1]
    known = ", ".join(
        f"{number} ('{_dof(function)}', '{function.ordinate.label}')"
        for number, function in enumerate(responses, start=1)
    )
    problem = f"has no column '{column}', or several; columns of a universal file are named by DOF, label or number"
    raise FileFormatError(path, f"{problem}: {known}; correct 'column' of the [[channel]]")


def _dof(function: UniversalFunction) -> str:
    node, direction, *_ = function.ends
    return str(find_dof(node, direction) or node)


def _label(function: UniversalFunction) -> str:
    return function.ordinate.label.lower()


def _unit(label: str) -> str:
    return label if is_stated(label) else ""
