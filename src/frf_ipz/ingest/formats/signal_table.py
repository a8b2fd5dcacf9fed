"""Recordings of files that hold signals with names, units and times: one `SignalFormat` for each kind of file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.dofs import Dof
from frf_ipz.errors import FileFormatError, did_you_mean, errors_of_file
from frf_ipz.ingest.formats.recording import LARGEST, RawRecording, RecordingContents, SignalColumn, TableKeys
from frf_ipz.ingest.formats.time_stamps import unit_of_stamps
from frf_ipz.ingest.units import unit_factor

SAME_RATE = 0.01  # the contract's limit for a step that differs
SAME_CLOCK = 1e-4  # relative, of the rates of two clocks: that of a quartz is far nearer


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Signal:
    """One signal of a file.

    Parameters
    ----------
    name : str
        What the file calls it.
    values : (n_samples,) array
        In its unit.
    unit : str
        What the file says; may be empty.
    time : (n_samples,) array, optional
        When the samples were taken; None where the file does not say.
    time_unit : str
        Of the time.
    dof : Dof, optional
        Where it was measured, if the file says so.
    """

    name: str
    values: FloatArray
    unit: str = ""
    time: FloatArray | None = None
    time_unit: str = "s"
    dof: Dof | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SignalTable:
    """The signals of a file.

    Parameters
    ----------
    path : Path
        The file.
    signals : tuple of Signal
        In their order.
    notes : tuple of str
        What had to be chosen.
    unread : mapping of str to str
        Signals that cannot be read, and why; asking for one is an error.
    """

    path: Path
    signals: tuple[Signal, ...]
    notes: tuple[str, ...] = ()
    unread: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalFormat:
    """A format of recordings whose files are tables of signals.

    Parameters
    ----------
    rank : int
        Formats are asked in ascending order whether a file is theirs.
    recognises : callable
        Tells by the first bytes whether a file is of this format.
    read : callable
        Reads all signals of a file; of the test's keys it needs none but those that name variables.
    """

    rank: int
    recognises: Callable[[bytes], bool]
    read: Callable[[Path, TableKeys], SignalTable]

    def fits(self, path: Path, head: bytes) -> bool:
        """Tell whether a file is of this format.

        Parameters
        ----------
        path : Path
            The file.
        head : bytes
            Its first bytes.

        Returns
        -------
        bool
            True if it is.
        """
        del path
        return self.recognises(head)

    def open(self, path: Path, columns: Sequence[str], keys: TableKeys) -> RawRecording:
        """Open a file for reading.

        Parameters
        ----------
        path : Path
            The file.
        columns : sequence of str
            Signals by their names, DOFs or numbers.
        keys : TableKeys
            What the test says about the table.

        Returns
        -------
        RawRecording
            In one block.

        Raises
        ------
        FileFormatError
            If it cannot be read, lacks a signal, or does not say when its samples were taken.
        """
        return open_signals(self.read(path, keys), columns, keys)

    def look(self, path: Path, keys: TableKeys) -> RecordingContents:
        """Say what a file holds.

        Parameters
        ----------
        path : Path
            The file.
        keys : TableKeys
            What the test says about the table.

        Returns
        -------
        RecordingContents
            Its signals.

        Raises
        ------
        FileFormatError
            If it cannot be read.
        """
        return describe_signals(self.read(path, keys))


def describe_signals(table: SignalTable) -> RecordingContents:
    """Say what a table of signals holds.

    Parameters
    ----------
    table : SignalTable
        All signals of the file.

    Returns
    -------
    RecordingContents
        Those that have the length of most; a name that stands there twice is replaced by its number.
    """
    signals = _usual_signals(table)
    counts = Counter(signal.name for signal in table.signals)
    numbers = {id(signal): str(number) for number, signal in enumerate(table.signals, start=1)}
    return RecordingContents(
        columns=tuple(
            SignalColumn(
                name=signal.name if signal.name and counts[signal.name] == 1 else numbers[id(signal)],
                unit=signal.unit,
                dof=signal.dof,
                label=signal.name,
            )
            for signal in signals
        ),
        has_time=all(signal.time is not None for signal in signals),
        notes=table.notes,
    )


def open_signals(table: SignalTable, columns: Sequence[str], keys: TableKeys) -> RawRecording:
    """Make a recording of some signals.

    Parameters
    ----------
    table : SignalTable
        All signals of the file.
    columns : sequence of str
        Those that are wanted, by their names, DOFs or numbers.
    keys : TableKeys
        What the test says about the table.

    Returns
    -------
    RawRecording
        In one block.

    Raises
    ------
    FileFormatError
        If a signal is missing or not finite, their times differ, or there is no time.
    """
    if keys.header_row is not None:
        raise FileFormatError(table.path, "is no text file, so [test] header_row does not fit it; leave the key out")
    chosen = [find_signal(table, column) for column in columns] or list(_usual_signals(table))[:1]
    for signal in chosen:
        _require_same_length(table, chosen[0], signal)
        wrong = ~(np.abs(signal.values) < LARGEST)
        if wrong.any():
            sample, count = int(np.argmax(wrong)) + 1, int(wrong.sum())
            problem = f"sample {sample} of '{signal.name}' is no number, or absurdly large ({count} are)"
            raise FileFormatError(table.path, f"{problem}; correct the file, or leave it out of the test")
    time, time_unit, time_name = _find_time(table, chosen, keys)
    return RawRecording(
        path=table.path,
        units=(time_unit, *(signal.unit for signal in chosen)),
        blocks=iter([np.column_stack([time, *(signal.values for signal in chosen)]).astype(np.float64, copy=False)]),
        line_of_row=lambda row: row + 1,
        time_column=time_name,
        row_name="sample",
        notes=table.notes,
    )


def find_signal(table: SignalTable, column: str, *, key: str = "column") -> Signal:
    """Find a signal by its name, its DOF, or its number.

    Parameters
    ----------
    table : SignalTable
        All signals of the file.
    column : str
        What is wanted.
    key : str
        Of the test that names it.

    Returns
    -------
    Signal
        The one.

    Raises
    ------
    FileFormatError
        If there is none, or there are several.
    """
    for given in (column, column.strip().lower()):
        named = [signal for signal in table.signals if given in {signal.name, signal.name.strip().lower()}]
        named = named or [signal for signal in table.signals if str(signal.dof) == given]
        if len(named) == 1:
            return named[0]
        if named:
            numbers = [str(n) for n, signal in enumerate(table.signals, start=1) if signal in named]
            problem = f"has {len(named)} signals '{column}', the numbers {', '.join(numbers)}"
            raise FileFormatError(table.path, f"{problem}; write the number, as in {key} = {numbers[0]}")
    if column.isascii() and column.isdigit() and 1 <= int(column[:9]) <= len(table.signals):
        return table.signals[int(column) - 1]
    if column in table.unread:
        raise FileFormatError(table.path, table.unread[column])
    names = [signal.name for signal in table.signals]
    problem = f"has no signal '{column}'; {did_you_mean(column, names)}"
    place = "'column' of the [[channel]]" if key == "column" else f"'{key}'"
    raise FileFormatError(table.path, f"{problem}; correct {place}, or name it under 'variables'")


def even_times(n_samples: int, rate_hz: float, start_s: float = 0.0) -> FloatArray:
    """Give the times of samples that were taken at a constant rate.

    Parameters
    ----------
    n_samples : int
        How many.
    rate_hz : float
        Samples a second, Hz.
    start_s : float
        Time of the first, s.

    Returns
    -------
    (n_samples,) array
        s.
    """
    return np.asarray(start_s + np.arange(n_samples) / rate_hz)


def _usual_signals(table: SignalTable) -> tuple[Signal, ...]:
    """Leave out what is no signal beside the others: all that has another length than most samples are in."""
    if not table.signals:
        for problem in table.unread.values():
            raise FileFormatError(table.path, problem)
        raise FileFormatError(table.path, "holds no signals; measure or export it again")
    weights: Counter[int] = Counter()
    for signal in table.signals:
        weights[len(signal.values)] += len(signal.values)
    ((usual, _),) = weights.most_common(1)
    return tuple(signal for signal in table.signals if len(signal.values) == usual)


def _require_same_length(table: SignalTable, first: Signal, signal: Signal) -> None:
    n_first, n_samples = len(first.values), len(signal.values)
    if n_samples == n_first:
        return
    problem = f"'{first.name}' has {n_first} samples and '{signal.name}' has {n_samples}"
    raise FileFormatError(table.path, f"{problem}; the channels of a recording have one rate and one length: resample")


def _find_time(table: SignalTable, chosen: Sequence[Signal], keys: TableKeys) -> tuple[FloatArray, str, str]:
    """Give times, their unit, and what they are called."""
    first, n_samples = chosen[0], len(chosen[0].values)
    if keys.time_column:
        time = find_signal(table, keys.time_column, key="time_column")
        _require_same_length(table, first, time)
        times, unit, name = time.values, time.unit, time.name
    elif first.time is not None:
        times, unit, name = first.time, first.time_unit, "time"
        for signal in chosen:
            if signal.time is None or not _are_same_times(first.time, signal.time):
                problem = f"'{first.name}' and '{signal.name}' were not sampled at the same times"
                raise FileFormatError(table.path, f"{problem}; export them with one time, or resample")
    elif keys.sample_rate_hz is not None:
        return even_times(n_samples, keys.sample_rate_hz), "s", "time"
    else:
        problem = "does not say when its samples were taken: write sample_rate_hz = ... under [test]"
        raise FileFormatError(table.path, f"{problem}, or name the time by time_column or variables = {{ time = ... }}")
    with errors_of_file(table.path, where=f"'{name}'"):
        unit = unit or unit_of_stamps(times, keys.sample_rate_hz)
    if keys.sample_rate_hz is None:
        return times, unit, name
    step_s = float(times[-1] - times[0]) / max(n_samples - 1, 1) * (unit_factor(unit, "time") if unit else 1.0)
    if step_s > 0.0 and abs(step_s * keys.sample_rate_hz - 1.0) > SAME_CLOCK:
        problem = f"[test] sample_rate_hz = {keys.sample_rate_hz:g}, but the file's own time has a mean step of"
        way_out = "correct sample_rate_hz, or leave it out"
        raise FileFormatError(table.path, f"{problem} {step_s:.6g} s, which is {1.0 / step_s:.6g} Hz; {way_out}")
    return even_times(n_samples, keys.sample_rate_hz), "s", name


def _are_same_times(first: FloatArray, other: FloatArray) -> bool:
    """Compare times to within a hundredth of a step: those of one clock, printed or computed in two ways."""
    if first is other or len(first) < 2:
        return True
    step = abs(first[-1] - first[0]) / (len(first) - 1)
    return bool(np.abs(first - other).max() <= SAME_RATE * step)
