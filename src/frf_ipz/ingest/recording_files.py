"""Recordings as calibrated numbers: SI, uniform in time, block by block or segment by segment.

Files are streamed; small ones are cached within a fixed budget of memory, since a test is read more than once. What a
survey has found in them is kept with them: FRFs, diagnosis and levels of a test work with the same one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from frf_ipz.errors import FileFormatError, QuantityError
from frf_ipz.ingest.formats.registry import open_recording
from frf_ipz.ingest.formats.time_stamps import decimal_resolution, resolution_of
from frf_ipz.ingest.signals.alignment import AGREES, Alignment, align, join
from frf_ipz.ingest.signals.windows import noise_decays
from frf_ipz.ingest.units import is_stated, sensitivity_factor, unit_factor, unit_ratio

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterator, Sequence
    from pathlib import Path

    from frf_ipz.arrays import FloatArray
    from frf_ipz.dofs import AnyDof
    from frf_ipz.ingest.campaign import Channel, SecondRecorder, TestSetup, VibrationTest
    from frf_ipz.ingest.formats.recording import RawRecording, TableKeys

Found = TypeVar("Found")

BUDGET = 64_000_000  # bytes of recordings that are cached
UNIFORM = 0.01  # of the median step: the contract's limit for a step that differs
ROUNDED = 0.75  # of the last digit: half of it by rounding, and what that does to a straight line through few times
FEWEST_SAMPLES = 16
NOTHING_LEFT = -math.log(np.finfo(np.float64).eps)  # time constants after which a window is less than a double's digit
WINDOWED_FORCE = "the applied window is taken back from the force too, as its noise decays with the window"


@dataclass(kw_only=True)
class RecordingFiles:
    """The recordings of a test.

    Parameters
    ----------
    test : VibrationTest
        Its columns, their units and its files.
    """

    test: VibrationTest
    _cache: dict[Path, FloatArray] = field(default_factory=dict)
    _cached_bytes: int = 0
    _notes: dict[str, dict[Path, None]] = field(default_factory=dict)
    _alignments: dict[Path, Alignment] = field(default_factory=dict)
    _found: dict[object, Any] = field(default_factory=dict, repr=False)

    @property
    def notes(self) -> tuple[str, ...]:
        """What had to be chosen in the files that were read so far, each once."""
        notes = [
            f"{next(iter(paths)).name}{f' and {len(paths) - 1} more' if len(paths) > 1 else ''}: {note}"
            for note, paths in self._notes.items()
        ]
        return (*notes, *self._alignment_notes())

    def _alignment_notes(self) -> list[str]:
        if not self._alignments:
            return []
        found = list(self._alignments.values())
        delays = sorted(1e3 * alignment.delay_s for alignment in found)
        span = f"{delays[0]:.4g} ms" if delays[0] == delays[-1] else f"{delays[0]:.4g} to {delays[-1]:.4g} ms"
        std = 1e3 * max(alignment.std_s for alignment in found)
        common = {setup.second_recorder.common for setup in self.test.setups if setup.second_recorder} - {None}
        how = "the cross-correlation of what both recorded" if common else "the trigger, at the times in their files"
        rates = [1e6 * alignment.drift for alignment in found if alignment.drift]
        drift = f", its clock off by up to {max(map(abs, rates)):.2g} ppm" if rates else ""
        return [f"second recorder: it began {span} after the first (+- {std:.2g} ms) by {how}{drift}"]

    def once(self, key: Hashable, find: Callable[[], Found]) -> Found:
        """Give what was found in the recordings before, or find it.

        Parameters
        ----------
        key : hashable
            What it depends on besides the recordings.
        find : callable
            Called for a new key.

        Returns
        -------
        object
            What it has found.
        """
        if key not in self._found:
            self._found[key] = find()
        found: Found = self._found[key]
        return found

    def blocks(self, setup: TestSetup, path: Path) -> Iterator[FloatArray]:
        """Give a recording block by block.

        Parameters
        ----------
        setup : TestSetup
            The set-up that the file belongs to.
        path : Path
            The file.

        Yields
        ------
        (n_rows, 1 + n_channels) array
            Time in s, force, responses; SI.

        Raises
        ------
        FileFormatError
            If a value is missing or no number, or the time is not uniform: names line and column.
        QuantityError
            If a unit is missing, or file and test contradict each other.
        """
        table = self._cache.get(path) if path not in self.test.signals else self.test.signals[path]
        if table is not None:
            yield table
            return
        blocks: list[FloatArray] = []
        for block in self._read(setup, path):
            if self._cached_bytes + sum(part.nbytes for part in blocks) + block.nbytes <= BUDGET:
                blocks.append(block)
            else:
                blocks = []
                self._cached_bytes = BUDGET
            yield block
        if blocks and self._cached_bytes < BUDGET:
            self._cache[path] = np.concatenate(blocks)
            self._cached_bytes += self._cache[path].nbytes

    def segments(self, setup: TestSetup, path: Path, bounds: Sequence[tuple[int, int]]) -> Iterator[FloatArray]:
        """Give segments of a recording.

        Parameters
        ----------
        setup : TestSetup
            The set-up that the file belongs to.
        path : Path
            The file.
        bounds : sequence of pairs of int
            First row and row after the last of each segment; ascending, they do not overlap.

        Yields
        ------
        (1 + n_channels, n_samples) array
            Time in s, force, responses; SI.
        """
        remaining = list(bounds)
        parts: list[FloatArray] = []
        n_rows = 0  # of the blocks so far
        for block in self.blocks(setup, path):
            while remaining and n_rows < remaining[0][1]:
                start, stop = remaining[0]
                parts.append(block[max(start - n_rows, 0) : max(stop - n_rows, 0)])
                if n_rows + len(block) < stop:
                    break
                yield np.ascontiguousarray(np.concatenate(parts).T)
                remaining.pop(0)
                parts = []
            n_rows += len(block)

    def _read(self, setup: TestSetup, path: Path) -> Iterator[FloatArray]:
        if setup.second_recorder is None:
            columns = setup.names_in_files([channel.column for channel in self.test.channels])
            blocks = self._read_file(setup, path, range(len(columns)), columns, setup.keys_for_files(self.test.table))
        else:
            blocks = iter([self._read_both(setup, setup.second_recorder, path)])
        start_s: float | None = None
        first = 2  # column that the window is on
        for block in blocks:
            if self.test.applied_window_s is not None and len(block):
                if start_s is None:
                    start_s = block[0, 0]
                    if noise_decays(block[:, 1], (block[:, 0] - start_s) / self.test.applied_window_s):
                        first = 1
                        self._notes.setdefault(WINDOWED_FORCE, {})[path] = None
                _take_back_window(path, block[:, first:], block[:, 0] - start_s, self.test.applied_window_s)
            yield block

    def _read_file(
        self, setup: TestSetup, path: Path, places: Sequence[int], columns: Sequence[str], keys: TableKeys
    ) -> Iterator[FloatArray]:
        """Give time and some channels of a file, SI: those at `places` among all, which it calls `columns`."""
        recording = open_recording(path, columns, keys)
        for note in recording.notes:
            self._notes.setdefault(note, {})[path] = None
        dofs = (*setup.input_dofs, *setup.output_dofs)
        factors = [_time_factor(recording)]
        factors += [
            _channel_factor(path, self.test.channels[place], dofs[place], file_unit)
            for place, file_unit in zip(places, recording.units[1:], strict=True)
        ]
        time_check = UniformTimeCheck(recording, factors[0])
        for block in recording.blocks:
            time_check.add(block[:, 0])
            block *= factors  # in place: the block is ours, and copies cost time
            yield block
        time_check.finish()

    def _read_both(self, setup: TestSetup, recorder: SecondRecorder, path: Path) -> FloatArray:
        """Put what a second recorder has beside what the first has, on the first's time."""
        names = [channel.column for channel in self.test.channels]
        own = dict(recorder.columns)
        first = [place for place, name in enumerate(names) if name not in own]
        second = [place for place, name in enumerate(names) if name in own]
        columns = setup.names_in_files([names[place] for place in first])
        keys = setup.keys_for_files(self.test.table)
        table = np.concatenate(list(self._read_file(setup, path, first, columns, keys)))
        other = recorder.files[setup.files.index(path)]
        places, columns_there = list(second), [own[names[place]] for place in second]
        if recorder.common is not None:
            places, columns_there = [*places, names.index(recorder.common[0])], [*columns_there, recorder.common[1]]
        there = replace(setup, variables=recorder.columns).keys_for_files(self.test.table)
        other_table = np.concatenate(list(self._read_file(setup, other, places, columns_there, there)))
        steps = [float(part[-1, 0] - part[0, 0]) / (len(part) - 1) for part in (table, other_table)]
        if abs(steps[1] / steps[0] - 1.0) > UNIFORM:
            problem = f"has a time step of {steps[1]:.6g} s, and {path.name} of the first recorder {steps[0]:.6g} s"
            raise FileFormatError(other, f"{problem}; record with one rate, or resample")
        if recorder.common is None:
            alignment = Alignment(delay_s=float(other_table[0, 0] - table[0, 0]), std_s=steps[0] / math.sqrt(6.0))
        else:
            column = 1 + first.index(places[-1])
            alignment = align(table[:, column], other_table[:, -1], *steps)
            other_table = other_table[:, :-1]
            if alignment.explained < AGREES:
                problem = (
                    f"its '{recorder.common[1]}' is not '{recorder.common[0]}' of {path.name}: shifted, they share"
                )
                way_out = "correct 'common' of second_recorder, or the order of its 'files'"
                raise FileFormatError(
                    other, f"{problem} {100 * max(alignment.explained, 0.0):.0f} % of the power; {way_out}"
                )
        joined = join(table, other_table, alignment)
        if len(joined) < FEWEST_SAMPLES:
            raise FileFormatError(other, f"was not recorded at the time of {path.name}; correct 'files'")
        self._alignments[other] = alignment
        order = np.argsort([*first, *second])
        return np.column_stack([joined[:, 0], joined[:, 1:][:, order]])


class UniformTimeCheck:
    """Refuses a time that is not uniform, block by block, and a recording that is too short.

    Parameters
    ----------
    recording : RawRecording
        What is read, for messages.
    factor : float
        From the unit of its times to s.
    """

    def __init__(self, recording: RawRecording, factor: float) -> None:
        self._factor = factor
        self._resolution = 0.0
        self._path = recording.path
        self._line_of_row = recording.line_of_row
        self._row_name = recording.row_name
        self._column = recording.time_column
        self._n_rows = 0
        self._last = np.empty(0)
        self._median = 0.0

    def add(self, time: FloatArray) -> None:
        """Check the next times.

        Parameters
        ----------
        time : (n_rows,) array
            As the file gives them.

        Raises
        ------
        FileFormatError
            If a step is not the median one: names the row.
        """
        steps = self._factor * (np.diff(time, prepend=self._last) if self._n_rows else np.diff(time))
        if self._n_rows == 0 and steps.size:
            self._median = float(np.median(steps))
            self._resolution = self._factor * resolution_of(time)
        can_tell = 2.0 * self._resolution < self._median  # a sample that is lost from rounding
        tolerance = UNIFORM * abs(self._median) + (self._resolution if can_tell else 0.0)
        wrong = ~(np.abs(steps - self._median) <= tolerance) | (steps <= 0.0)
        if wrong.any() and not self._is_rounded(time):
            if self._median == 0.0:
                raise self._stands_still(steps)
            is_coarse = self._median > 0.0 and not can_tell
            coarse = f"its times are rounded to {self._resolution:.2g} s, and " if is_coarse else ""
            position = int(np.argmax(wrong))
            row = self._n_rows + position + (self._n_rows == 0)
            raise FileFormatError(
                self._path,
                f"the time is not uniform: {coarse}a step is {steps[position]:.6g} s where the median is "
                f"{self._median:.6g} s; record with a constant rate, write the time with more digits, or resample; "
                "where only the digits of the time are too few, write sample_rate_hz = ... under [test]",
                where=f"{self._row_name} {self._line_of_row(row)}, column '{self._column}'",
            )
        self._n_rows += len(time)
        self._last = time[-1:]

    def _stands_still(self, steps: FloatArray) -> FileFormatError:
        row = self._n_rows + int(np.argmax(steps == 0.0)) + (self._n_rows == 0)
        share = 100.0 * float(np.mean(steps == 0.0))
        return FileFormatError(
            self._path,
            f"the time stands still in {share:.0f} % of the first rows: it is written with too few digits for its "
            "rate; write it with more digits, or write sample_rate_hz = ... under [test]",
            where=f"{self._row_name} {self._line_of_row(row)}, column '{self._column}'",
        )

    def _is_rounded(self, time: FloatArray) -> bool:
        """Tell whether times lie on a straight line but for the decimal digits that they are rounded to."""
        rows = np.concatenate([self._last, time])
        places = np.arange(len(rows)) - 0.5 * (len(rows) - 1)
        step = float(places @ rows / max(places @ places, 1.0))
        resolution = decimal_resolution(rows, 0.5 * step)
        is_same = self._n_rows == 0 or abs(self._factor * step - self._median) <= UNIFORM * self._median
        if not is_same or np.abs(rows - rows.mean() - step * places).max() > ROUNDED * resolution:
            return False
        self._median = self._factor * step
        return True

    def finish(self) -> None:
        """Check that there were enough of them.

        Raises
        ------
        FileFormatError
            If there are fewer than 16.
        """
        if self._n_rows < FEWEST_SAMPLES:
            problem = f"holds {self._n_rows} samples; a recording needs at least {FEWEST_SAMPLES}: is it cut off?"
            raise FileFormatError(self._path, problem)


def _take_back_window(path: Path, signals: FloatArray, time_s: FloatArray, time_constant_s: float) -> None:
    """Divide signals by the exponential window that an analyser has put on them, 1 at the first sample."""
    exponent = time_s / time_constant_s
    if exponent[-1] > NOTHING_LEFT:
        problem = (
            f"after {time_s[-1]:.4g} s an exponential window of {time_constant_s:g} s has left nothing; "
            "state the time constant that the analyser shows, in s, and cut recordings of several impacts apart"
        )
        raise FileFormatError(path, problem, where="[test] applied_exponential_window_s")
    signals *= np.exp(exponent)[:, None]


def _time_factor(recording: RawRecording) -> float:
    unit = recording.units[0]
    if not unit:
        return 1.0
    try:
        return unit_factor(unit, "time")
    except QuantityError as error:
        raise QuantityError(f"{recording.path}, column '{recording.time_column}': {error}") from None


def _way_out(file_unit: str) -> str:
    return f'where the file\'s is, say wrong_file_unit = "{file_unit}" in the [[channel]]'


def _channel_factor(path: Path, channel: Channel, dof: AnyDof, file_unit: str) -> float:
    """Return the factor to SI; the units of test and file must agree, and one of them must be stated."""
    rotational = dof.direction.startswith("r")
    file_unit = file_unit if is_stated(file_unit) and file_unit != channel.wrong_file_unit else ""
    test_unit = channel.column_unit
    where = f"{path}, column '{channel.column}'"
    if not test_unit and not file_unit:
        problem = "has no unit: give the [[channel]] a 'unit' or a 'sensitivity', or the file a row of units"
        raise QuantityError(f"{where}: {problem}")
    ratio = unit_ratio(file_unit, test_unit) if test_unit and file_unit else None
    if channel.sensitivity:
        if ratio is not None and math.isnan(ratio):
            problem = (
                f"is in '{file_unit}' by the file, and the sensitivity '{channel.sensitivity}' wants '{test_unit}'"
            )
            raise QuantityError(
                f"{where}: {problem}; where the file is in that unit already, leave the sensitivity out; "
                f"{_way_out(file_unit)}"
            )
        factor = sensitivity_factor(channel.sensitivity, channel.quantity, rotational=rotational)
        return factor if ratio is None else factor * ratio
    if ratio not in {None, 1.0}:
        problem = f"is in '{file_unit}' by the file and in '{test_unit}' by the test; correct the one that is wrong"
        problem += f"; {_way_out(file_unit)}"
        raise QuantityError(f"{where}: {problem}")
    try:
        return unit_factor(test_unit or file_unit, channel.quantity, rotational=rotational)
    except QuantityError as error:
        raise QuantityError(f"{where}: {error}") from None
