"""Recordings as calibrated numbers: SI, uniform in time, block by block or segment by segment.

Files are streamed; small ones are cached within a fixed budget of memory, since a test is read more than once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import FileFormatError, QuantityError
from frf_ipz.ingest.formats.registry import open_recording
from frf_ipz.ingest.units import is_stated, sensitivity_factor, unit_factor, unit_ratio

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from frf_ipz.arrays import FloatArray
    from frf_ipz.dofs import AnyDof
    from frf_ipz.ingest.campaign import Channel, TestSetup, VibrationTest
    from frf_ipz.ingest.formats.recording import RawRecording

BUDGET = 64_000_000  # bytes of recordings that are cached
UNIFORM = 0.01  # of the median step: the contract's limit for a step that differs
FEWEST_SAMPLES = 16
NOTHING_LEFT = -math.log(np.finfo(np.float64).eps)  # time constants after which a window is less than a double's digit


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

    @property
    def notes(self) -> tuple[str, ...]:
        """What had to be chosen in the files that were read so far, each once."""
        return tuple(
            f"{next(iter(paths)).name}{f' and {len(paths) - 1} more' if len(paths) > 1 else ''}: {note}"
            for note, paths in self._notes.items()
        )

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
        channels = self.test.channels
        columns = setup.names_in_files([channel.column for channel in channels])
        recording = open_recording(path, columns, setup.keys_for_files(self.test.table))
        for note in recording.notes:
            self._notes.setdefault(note, {})[path] = None
        dofs = (*setup.input_dofs, *setup.output_dofs)
        factors = [_time_factor(recording)]
        factors += [
            _channel_factor(path, channel, dof, file_unit)
            for channel, dof, file_unit in zip(channels, dofs, recording.units[1:], strict=True)
        ]
        time_check = UniformTimeCheck(recording)
        start_s: float | None = None
        for block in recording.blocks:
            block *= factors  # in place: the block is ours, and copies cost time
            time_check.add(block[:, 0])
            if self.test.applied_window_s is not None:
                start_s = block[0, 0] if start_s is None and len(block) else start_s
                _take_back_window(path, block, start_s or 0.0, self.test.applied_window_s)
            yield block
        time_check.finish()


class UniformTimeCheck:
    """Refuses a time that is not uniform, block by block, and a recording that is too short.

    Parameters
    ----------
    recording : RawRecording
        What is read, for messages.
    """

    def __init__(self, recording: RawRecording) -> None:
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
            s.

        Raises
        ------
        FileFormatError
            If a step is not the median one: names the row.
        """
        steps = np.diff(time, prepend=self._last) if self._n_rows else np.diff(time)
        if self._n_rows == 0 and steps.size:
            self._median = float(np.median(steps))
        wrong = ~(np.abs(steps - self._median) <= UNIFORM * abs(self._median)) | (steps <= 0.0)
        if wrong.any():
            position = int(np.argmax(wrong))
            row = self._n_rows + position + (self._n_rows == 0)
            raise FileFormatError(
                self._path,
                f"the time is not uniform: a step is {steps[position]:.6g} s where the median is {self._median:.6g} s; "
                "record with a constant rate, write the time with more digits, or resample; where only the digits of "
                "the time are too few, write sample_rate_hz = ... under [test]",
                where=f"{self._row_name} {self._line_of_row(row)}, column '{self._column}'",
            )
        self._n_rows += len(time)
        self._last = time[-1:]

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


def _take_back_window(path: Path, block: FloatArray, start_s: float, time_constant_s: float) -> None:
    """Divide the responses by the exponential window that an analyser has put on them, 1 at the first sample."""
    exponent = (block[:, 0] - start_s) / time_constant_s
    if len(exponent) and exponent[-1] > NOTHING_LEFT:
        problem = (
            f"after {block[-1, 0] - start_s:.4g} s an exponential window of {time_constant_s:g} s has left nothing; "
            "state the time constant that the analyser shows, in s, and cut recordings of several impacts apart"
        )
        raise FileFormatError(path, problem, where="[test] applied_exponential_window_s")
    block[:, 2:] *= np.exp(exponent)[:, None]


def _time_factor(recording: RawRecording) -> float:
    unit = recording.units[0]
    if not unit:
        return 1.0
    try:
        return unit_factor(unit, "time")
    except QuantityError as error:
        raise QuantityError(f"{recording.path}, column '{recording.time_column}': {error}") from None


def _channel_factor(path: Path, channel: Channel, dof: AnyDof, file_unit: str) -> float:
    """Return the factor to SI; the units of test and file must agree, and one of them must be stated."""
    rotational = dof.direction.startswith("r")
    file_unit = file_unit if is_stated(file_unit) else ""
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
                f"{where}: {problem}; where the file is in that unit already, leave the sensitivity out"
            )
        factor = sensitivity_factor(channel.sensitivity, channel.quantity, rotational=rotational)
        return factor if ratio is None else factor * ratio
    if ratio not in {None, 1.0}:
        problem = f"is in '{file_unit}' by the file and in '{test_unit}' by the test; correct the one that is wrong"
        raise QuantityError(f"{where}: {problem}")
    try:
        return unit_factor(test_unit or file_unit, channel.quantity, rotational=rotational)
    except QuantityError as error:
        raise QuantityError(f"{where}: {error}") from None
