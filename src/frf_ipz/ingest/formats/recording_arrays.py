"""Recordings in files of arrays: which arrays are signals and which the time follows from their shapes and names."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import FileFormatError, errors_of_file
from frf_ipz.ingest.formats.column_words import TIME
from frf_ipz.ingest.formats.file_arrays import ArrayFormat, FileArrays, describe, last_part
from frf_ipz.ingest.formats.registry import find_array_format
from frf_ipz.ingest.formats.signal_table import Signal, SignalTable, describe_signals, even_times, open_signals
from frf_ipz.ingest.formats.testlab_arrays import TestlabBlock, points_of, testlab_blocks
from frf_ipz.ingest.formats.text_columns import TIME_UNIT
from frf_ipz.ingest.formats.text_layout import read_head
from frf_ipz.ingest.formats.time_stamps import resolution_of, unit_of_stamps
from frf_ipz.ingest.units import unit_factor

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.formats.file_arrays import NumericArray
    from frf_ipz.ingest.formats.recording import RawRecording, RecordingContents, TableKeys

FEWEST_SAMPLES = 16  # of a recording
MOST_COLUMNS = 1024  # of a matrix whose columns are signals
EVEN = 0.01  # the contract's limit for a step that differs
RATE = re.compile(
    r"(f_?s|sf|sr|srate|fsamp\w*|sampl\w*[_ ]?(rate|freq\w*)([_ ]?hz)?|rate(_hz)?|abtastrate)", re.IGNORECASE
)
FREQUENCY = re.compile(r"freq\w*", re.IGNORECASE)  # a rate where nothing else is one
STEP = re.compile(
    r"(dt|delta_?t|ts|t_?s|time_?step|step_?s|t_?sample|sampl\w*_?(time|period|interval)|wf_increment)", re.I
)
UNIT = re.compile(r"(y_?)?(units?(_str)?|einheit\w*|eu)", re.IGNORECASE)
NAMES = re.compile(r"((channel|signal|column|sensor)_?)?(names?|labels?|channels|columns|headers?)", re.IGNORECASE)
TIME_SHORT = re.compile(r"t|tt|t_?vec\w*|time\w*|zeit\w*", re.IGNORECASE)


class _ArrayRecordings:
    """Signals by the names of their arrays; columns of a matrix as ``data(:,2)`` or ``data[:,1]``."""

    rank = 4

    def fits(self, path: Path, head: bytes) -> bool:
        del path
        return find_array_format(head) is not None

    def open(self, path: Path, columns: Sequence[str], keys: TableKeys) -> RawRecording:
        arrays = _read(path)
        given = [column for column in (*columns, keys.time_column) if column]
        table = find_signals(arrays, keys, given)
        named = {signal.name for signal in table.signals}
        extra = [signal for column in given if column not in named for signal in _named_signal(arrays, column, table)]
        return open_signals(replace(table, signals=(*table.signals, *extra)), columns, keys)

    def look(self, path: Path, keys: TableKeys) -> RecordingContents:
        return describe_signals(find_signals(_read(path), keys, ()))


FORMAT = _ArrayRecordings()


def _read(path: Path) -> FileArrays:
    array_format: ArrayFormat | None = find_array_format(read_head(path))
    if array_format is None:
        raise FileFormatError(path, "is no file of arrays")
    return array_format.read(path)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Candidate:
    """An array whose rows, after `columns` has turned it, may be samples."""

    name: str
    values: NumericArray
    axis: int

    @property
    def n_samples(self) -> int:
        return int(self.values.shape[self.axis])


def find_signals(arrays: FileArrays, keys: TableKeys, columns: Sequence[str]) -> SignalTable:
    """Find the signals of a recording among the arrays of a file, and when they were sampled.

    Parameters
    ----------
    arrays : FileArrays
        All that the file holds.
    keys : TableKeys
        What the test says: the time, or the rate.
    columns : sequence of str
        Arrays that are asked for; their length is that of the recording.

    Returns
    -------
    SignalTable
        All arrays that have as many samples, with a note on what was chosen.

    Raises
    ------
    FileFormatError
        If no array can be a signal.
    """
    blocks = [block for block in testlab_blocks(arrays) if not np.iscomplexobj(block.values)]
    if blocks:
        return _testlab_table(arrays, blocks)
    shapes = {name: array for name, array in arrays.arrays.items() if _may_be_signals(array)}
    lengths = _lengths(arrays, shapes, columns)
    if not lengths:
        complex_ones = [name for name, array in arrays.arrays.items() if np.iscomplexobj(array) and array.size > 1]
        way_out = "FRFs belong under [[frf]] of a test of kind 'frf'"
        hint = f"; '{complex_ones[0]}' is complex: {way_out}" if complex_ones else ""
        problem = f"holds no array of {FEWEST_SAMPLES} samples or more{hint}. It holds {arrays.listing()}"
        raise FileFormatError(arrays.path, problem)
    n_samples = lengths.most_common(1)[0][0]
    candidates = [
        _Candidate(name=name, values=array, axis=array.shape.index(n_samples))
        for name, array in shapes.items()
        if n_samples in array.shape and array.size <= n_samples * MOST_COLUMNS
    ]
    signals = [signal for candidate in candidates for signal in _columns(arrays, candidate, keys.sample_rate_hz)]
    time, note = (None, "") if keys.time_column else _find_time(arrays, signals, keys, columns)
    has_own = {signal.name for signal in signals if signal.time is not None}
    others = [
        signal
        for signal in signals
        if signal is not time and not (time is None and has_own and signal.time is None and _grows(signal.values))
    ]
    unit = ""
    if time is not None:
        with errors_of_file(arrays.path, where=f"'{time.name}'"):
            unit = time.unit or unit_of_stamps(time.values, keys.sample_rate_hz)
            unit_factor(unit or "s", "time")
    left_out = [f"'{name}' ({describe(shapes[name])})" for name in shapes if n_samples not in shapes[name].shape]
    names = ", ".join(f"'{signal.name}'" for signal in others)
    chosen = f"taken by their shape: {names}, {n_samples} samples each; {note}"
    chosen += f"; left out: {', '.join(left_out)}" if left_out else ""
    timed = tuple(
        signal if time is None else replace(signal, time=time.values, time_unit=unit or "s") for signal in others
    )
    return SignalTable(path=arrays.path, signals=timed, notes=(chosen,))


def _may_be_signals(array: NumericArray) -> bool:
    return array.dtype.kind in "iuf" and 1 <= array.ndim <= 3 and array.size > 0 and max(array.shape) >= FEWEST_SAMPLES


def _lengths(arrays: FileArrays, shapes: dict[str, NumericArray], columns: Sequence[str]) -> Counter[int]:
    """Count how many numbers speak for each number of samples: those of the arrays that are asked for, else of all."""
    weights: Counter[int] = Counter()
    for column in columns:
        name = arrays.find(column) or arrays.find(re.split(r"\s*[(\[]", column)[0])
        if name in shapes:
            weights[max(shapes[name].shape)] += shapes[name].size
    if not weights:
        for array in shapes.values():
            weights[max(array.shape)] += array.size
    return weights


def _columns(arrays: FileArrays, candidate: _Candidate, sample_rate_hz: float | None) -> Iterator[Signal]:
    """Give the columns of an array, with the names and units that stand beside it."""
    rows = np.moveaxis(candidate.values, candidate.axis, 0)
    columns = rows.reshape(candidate.n_samples, -1)
    n_columns = columns.shape[1]
    first = columns[:, 0].astype(np.float64) if n_columns > 1 else np.empty(0)
    own_time = first if n_columns > 1 and _grows(first) and not _counts(first) else None
    with errors_of_file(arrays.path, where=f"'{candidate.name}'"):
        own_unit = "" if own_time is None else unit_of_stamps(own_time, sample_rate_hz)
    units = _texts_beside(arrays, candidate.name, UNIT, n_columns)
    labels = _texts_beside(arrays, candidate.name, NAMES, n_columns) if n_columns > 1 else ()
    for number in range(n_columns):
        name = candidate.name
        if n_columns > 1:
            place: list[int | None] = [int(part) for part in np.unravel_index(number, rows.shape[1:])]
            place.insert(candidate.axis, None)
            name = arrays.column_name(candidate.name, tuple(place))
        label = labels[number].strip() if labels else ""
        dofs = points_of(label or name)
        yield Signal(
            name=label if label and list(labels).count(labels[number]) == 1 else name,
            values=columns[:, number].astype(np.float64),
            unit=units[number].strip() if units else _unit_of_time(name),
            time=own_time if number else None,
            time_unit=own_unit or "s",
            dof=dofs[0] if len(dofs) == 1 else None,
        )


def _texts_beside(arrays: FileArrays, name: str, wanted: re.Pattern[str], count: int) -> tuple[str, ...]:
    """Find as many texts as an array has columns: attributes, fields beside it, or a list in the same place."""
    way = name[: -len(last_part(name))]
    for key, texts in arrays.texts.items():
        if len(texts) != count or not wanted.fullmatch(last_part(key)):
            continue
        place = key[: -len(last_part(key))]
        is_own = place in {f"{name}@", f"{name}."}
        is_beside = place == way and (way or count > 1) and (count > 1 or _is_alone(arrays, way))
        if is_own or is_beside:
            return texts
    suffixed = [key for key in arrays.texts if key.lower() in {f"{name}_unit".lower(), f"{name}_units".lower()}]
    return arrays.texts[suffixed[0]] * count if wanted is UNIT and suffixed else ()


def _is_alone(arrays: FileArrays, way: str) -> bool:
    """Tell whether a structure or group holds one long array only, to which its unit belongs."""
    inside = [key for key, array in arrays.arrays.items() if key.startswith(way) and array.size >= FEWEST_SAMPLES]
    return len([key for key in inside if not TIME_SHORT.fullmatch(last_part(key))]) == 1


def _unit_of_time(name: str) -> str:
    match, last = TIME_UNIT.search(name), last_part(name)
    is_time = bool(TIME.match(last) or TIME_SHORT.match(last))
    return match[1] if match and match.start() and is_time else ""


def _find_time(
    arrays: FileArrays, signals: Sequence[Signal], keys: TableKeys, columns: Sequence[str]
) -> tuple[Signal | None, str]:
    """Find the time among the columns, else a rate among the single numbers; say which."""
    free = [signal for signal in signals if signal.name not in columns]
    for signal in free:
        bare = last_part(signal.name)
        if (TIME.match(bare) or TIME_SHORT.fullmatch(bare)) and _grows(signal.values):
            return signal, f"the time is '{signal.name}'"
    if any(signal.time is not None for signal in signals):  # the first column of each matrix is the time of the others
        return None, "the time is the first column of each"
    rate_hz, source = (None, "") if keys.sample_rate_hz is not None else _find_rate(arrays, keys.rate_variable)
    if rate_hz is None and len(free) > 1:
        even = [signal for signal in free if _grows(signal.values) and not _counts(signal.values)]
        if len(even) == 1:
            return even[0], f"the time is '{even[0].name}', which grows by equal steps"
    if rate_hz is not None:
        times = even_times(len(signals[0].values), rate_hz)
        return Signal(name="time", values=times, unit="s"), f"{rate_hz:g} samples a second by '{source}'"
    return None, "no time and no rate among the arrays"


def _find_rate(arrays: FileArrays, rate_variable: str) -> tuple[float | None, str]:
    """Find the rate among single numbers, or what makes it: the step of the time."""
    if rate_variable:
        value = arrays.select(rate_variable)
        if value.size != 1 or not 0 < float(np.real(value.ravel()[0])) < np.inf:
            problem = (
                f"'{rate_variable}' is {describe(value)}; sample_rate_hz under 'variables' names one positive number"
            )
            raise FileFormatError(arrays.path, problem)
        return float(np.real(value.ravel()[0])), rate_variable
    singles = {
        name: float(array.ravel()[0])
        for name, array in arrays.arrays.items()
        if array.size == 1 and array.dtype.kind in "iuf" and 0.0 < float(array.ravel()[0]) < np.inf
    }
    for name, number in singles.items():
        if RATE.fullmatch(last_part(name)) and number > 1.0:
            return number, name
    for name, number in singles.items():
        if STEP.fullmatch(last_part(name)) and number < 1.0:
            return 1.0 / number, name
    for name, number in singles.items():
        if FREQUENCY.fullmatch(last_part(name)) and number > 1.0:
            return number, name
    return None, ""


def _grows(values: FloatArray) -> bool:
    steps = np.diff(values)
    median = float(np.median(steps)) if steps.size else 0.0
    resolution = resolution_of(values)
    tolerance = EVEN * median + (resolution if resolution < 0.5 * median else 0.0)
    return median > 0.0 and bool((np.abs(steps - median) <= tolerance).all())


def _counts(values: FloatArray) -> bool:
    return bool((np.diff(values) == 1.0).all() and float(values[0]).is_integer())


def _named_signal(arrays: FileArrays, column: str, table: SignalTable) -> Iterator[Signal]:
    """Give an array that is asked for and that its shape did not make a signal."""
    known = {signal.name.lower() for signal in table.signals} | {str(signal.dof) for signal in table.signals}
    if column.lower() in known or (column.isdigit() and 1 <= int(column[:9]) <= len(table.signals)):
        return
    values = np.squeeze(arrays.select(column))
    if values.ndim != 1 or np.iscomplexobj(values):
        example = arrays.column_name(column, (None, 0))
        problem = f"'{column}' is {describe(values)}; a channel is one column of real numbers, as in '{example}'"
        raise FileFormatError(arrays.path, f"{problem}; write it as 'column', or under 'variables'")
    alike = (signal for signal in table.signals if len(signal.values) == len(values))
    time, unit = next(((signal.time, signal.time_unit) for signal in alike), (None, "s"))
    yield Signal(name=column, values=values.astype(np.float64), unit=_unit_of_time(column), time=time, time_unit=unit)


def _testlab_table(arrays: FileArrays, blocks: Sequence[TestlabBlock]) -> SignalTable:
    signals = []
    for block in blocks:
        for number in range(block.values.shape[1]):
            name = block.names[number] if block.names else arrays.column_name(block.name, (None, number))
            dofs = points_of(name)
            signals.append(
                Signal(
                    name=name,
                    values=block.values[:, number].astype(np.float64),
                    unit=block.units[number] if block.units else "",
                    time=block.x,
                    dof=dofs[0] if len(dofs) == 1 else None,
                )
            )
    note = f"{len(blocks)} structure(s) of Testlab with {len(signals)} signals"
    return SignalTable(path=arrays.path, signals=tuple(signals), notes=(note,))
