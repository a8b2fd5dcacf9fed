"""Recordings as calibrated numbers: SI, uniform in time, block after block or stretch after stretch.

Files are streamed; small ones are kept within a fixed budget of memory, since a test is read more than once.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import FileFormatError, QuantityError
from frf_ipz.ingest.formats.registry import open_recording
from frf_ipz.ingest.units import same_unit, sensitivity_factor, unit_factor

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from frf_ipz.arrays import FloatArray
    from frf_ipz.dofs import Dof
    from frf_ipz.ingest.campaign import Channel, TestSetup, VibrationTest
    from frf_ipz.ingest.formats.recording import RawRecording

BUDGET = 64_000_000  # bytes of recordings that are kept
UNIFORM = 0.01  # of the median step: the contract's limit for a step that differs
FEWEST_SAMPLES = 16
GRAVITY = {"g": "g_0", "G": "g_0", "gn": "g_0"}  # how analysers write the acceleration of gravity


@dataclass(kw_only=True)
class RecordingFiles:
    """The recordings of a test.

    Parameters
    ----------
    test : VibrationTest
        Which columns are wanted, and their units.
    """

    test: VibrationTest
    _kept: dict[Path, FloatArray] = field(default_factory=dict)
    _bytes: int = 0

    def blocks(self, setup: TestSetup, path: Path) -> Iterator[FloatArray]:
        """Give a recording block by block.

        Parameters
        ----------
        setup : TestSetup
            The run that the file belongs to.
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
        if path in self._kept:
            yield self._kept[path]
            return
        kept: list[FloatArray] = []
        for block in self._read(setup, path):
            if self._bytes + sum(part.nbytes for part in kept) + block.nbytes <= BUDGET:
                kept.append(block)
            else:
                kept = []
                self._bytes = BUDGET
            yield block
        if kept and self._bytes < BUDGET:
            self._kept[path] = np.concatenate(kept)
            self._bytes += self._kept[path].nbytes

    def stretches(self, setup: TestSetup, path: Path, bounds: Sequence[tuple[int, int]]) -> Iterator[FloatArray]:
        """Give stretches of a recording.

        Parameters
        ----------
        setup : TestSetup
            The run that the file belongs to.
        path : Path
            The file.
        bounds : sequence of pairs of int
            First row and row after the last of each stretch; ascending, they do not overlap.

        Yields
        ------
        (1 + n_channels, n_samples) array
            Time in s, force, responses; SI.
        """
        wanted = list(bounds)
        parts: list[FloatArray] = []
        done = 0
        for block in self.blocks(setup, path):
            while wanted and done < wanted[0][1]:
                start, stop = wanted[0]
                parts.append(block[max(start - done, 0) : max(stop - done, 0)])
                if done + len(block) < stop:
                    break
                yield np.ascontiguousarray(np.concatenate(parts).T)
                wanted.pop(0)
                parts = []
            done += len(block)

    def _read(self, setup: TestSetup, path: Path) -> Iterator[FloatArray]:
        channels = self.test.channels
        recording = open_recording(path, [channel.column for channel in channels])
        dofs = (setup.input_dof, *setup.output_dofs)
        factors = [_time_factor(recording)]
        factors += [
            _factor(path, channel, dof, stated)
            for channel, dof, stated in zip(channels, dofs, recording.units[1:], strict=True)
        ]
        checked = _UniformTime(path, recording.line_of_row)
        for block in recording.blocks:
            block *= factors  # in place: the block is ours, and copies cost time
            checked.take(block[:, 0])
            yield block
        checked.finish()


class _UniformTime:
    """Checks the steps of the time while blocks come in."""

    def __init__(self, path: Path, line_of_row: Callable[[int], int]) -> None:
        self._path = path
        self._line_of_row = line_of_row
        self._n_rows = 0
        self._last = np.empty(0)
        self._median = 0.0

    def take(self, time: FloatArray) -> None:
        steps = np.diff(time, prepend=self._last) if self._n_rows else np.diff(time)
        if self._n_rows == 0 and steps.size:
            self._median = float(np.median(steps))
        wrong = ~(np.abs(steps - self._median) <= UNIFORM * abs(self._median)) | (steps <= 0.0)
        if wrong.any():
            place = int(np.argmax(wrong))
            row = self._n_rows + place + (self._n_rows == 0)
            raise FileFormatError(
                self._path,
                f"the time is not uniform: a step is {steps[place]:.6g} s where the median is {self._median:.6g} s; "
                "record with a constant rate, write the time with more digits, or resample",
                where=f"line {self._line_of_row(row)}, column 'time'",
            )
        self._n_rows += len(time)
        self._last = time[-1:]

    def finish(self) -> None:
        if self._n_rows < FEWEST_SAMPLES:
            problem = f"holds {self._n_rows} samples; a recording needs at least {FEWEST_SAMPLES}: is it cut off?"
            raise FileFormatError(self._path, problem)


def _time_factor(recording: RawRecording) -> float:
    stated = recording.units[0]
    if not stated:
        return 1.0
    try:
        return unit_factor(stated, "time")
    except QuantityError as error:
        raise QuantityError(f"{recording.path}, column 'time': {error}") from None


def _factor(path: Path, channel: Channel, dof: Dof, stated: str) -> float:
    """Return the factor to SI; what test and file say must agree, and one of them must say something."""
    rotational = dof.direction.startswith("r")
    if channel.quantity == "acceleration":
        stated = GRAVITY.get(stated, stated)
    told = channel.column_unit
    if not told and not stated:
        problem = "has no unit: give the [[channel]] a 'unit' or a 'sensitivity', or the file a row of units"
        raise QuantityError(f"{path}, column '{channel.column}': {problem}")
    if told and stated and same_unit(told, stated) is False:
        problem = f"is in '{stated}' by the file and in '{told}' by the test; correct the one that is wrong"
        raise QuantityError(f"{path}, column '{channel.column}': {problem}")
    if channel.sensitivity:
        return sensitivity_factor(channel.sensitivity, channel.quantity, rotational=rotational)
    try:
        return unit_factor(told or stated, channel.quantity, rotational=rotational)
    except QuantityError as error:
        raise QuantityError(f"{path}, column '{channel.column}': {error}") from None
