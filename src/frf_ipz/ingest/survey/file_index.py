"""A file's length, time step and impacts, found in one pass that keeps an envelope of the force only."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import FileFormatError
from frf_ipz.ingest.campaign import TestSetup

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.recording_files import RecordingFiles

CELL = 64  # samples of the envelope's cells
BURST = 0.02  # of the highest force of the file: what may be an impact of its own
QUIET = 5.0  # times the median cell, which is noise or hum: what may be an impact
NO_IMPACT = 3.0  # times the median cell: a highest force below this is no impact at all
BOUNCE_S = 0.1  # pulses closer than this are one impact that hit twice
CROWDED = 0.5  # of the longest distance between pulses: closer ones are one impact that hit twice


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FileIndex:
    """Length, time step and pulses of a file.

    Parameters
    ----------
    setup : TestSetup
        The set-up that the file belongs to.
    path : Path
        The file.
    n_rows : int
        Samples.
    step_s : float
        Mean time step, s.
    onsets : tuple of int
        Row, to within a cell, at which each pulse of the force begins.
    """

    setup: TestSetup
    path: Path
    n_rows: int
    step_s: float
    onsets: tuple[int, ...] = ()

    @property
    def longest(self) -> int:
        """Rows from a pulse to the next or to the end, at most."""
        return int(np.diff([*self.onsets, self.n_rows]).max(initial=0)) if self.onsets else self.n_rows


@dataclass(slots=True)
class _Envelope:
    """Highest and lowest force of each cell."""

    highest: list[FloatArray] = field(default_factory=list)
    lowest: list[FloatArray] = field(default_factory=list)
    remainder: FloatArray = field(default_factory=lambda: np.empty(0))

    def add(self, force: FloatArray) -> None:
        force = np.concatenate([self.remainder, force])
        n_cells = len(force) // CELL
        cells = force[: n_cells * CELL].reshape(n_cells, CELL)
        self.highest.append(cells.max(axis=1))
        self.lowest.append(cells.min(axis=1))
        self.remainder = force[n_cells * CELL :].copy()

    def amplitude(self) -> FloatArray:
        """Give the largest distance from the base in each cell; the last one may be shorter."""
        last_cell = [self.remainder] if self.remainder.size else []
        highest = np.concatenate([*self.highest, *[cell.max(keepdims=True) for cell in last_cell]])
        lowest = np.concatenate([*self.lowest, *[cell.min(keepdims=True) for cell in last_cell]])
        base = float(np.median(0.5 * (highest + lowest)))
        return np.asarray(np.maximum(highest - base, base - lowest))


def index_file(files: RecordingFiles, setup: TestSetup, path: Path, *, find_impacts: bool) -> FileIndex:
    """Read through a file.

    Parameters
    ----------
    files : RecordingFiles
        The recordings.
    setup : TestSetup
        The set-up that the file belongs to.
    path : Path
        The file.
    find_impacts : bool
        Look for pulses of the force.

    Returns
    -------
    FileIndex
        Length, step and pulses.

    Raises
    ------
    FileFormatError
        If the file cannot be read, or no impact is found.
    """
    envelope = _Envelope()
    n_rows, first, last = 0, 0.0, 0.0
    for block in files.blocks(setup, path):
        if n_rows == 0:
            first = float(block[0, 0])
        last = float(block[-1, 0])
        n_rows += len(block)
        envelope.add(block[:, 1])
    onsets = _find_onsets(path, files.test.input_channel.column, envelope.amplitude()) if find_impacts else ()
    return FileIndex(setup=setup, path=path, n_rows=n_rows, step_s=(last - first) / (n_rows - 1), onsets=onsets)


def split_impacts(index: FileIndex, usual_length: int) -> tuple[tuple[int, int], ...]:
    """Split a file at its impacts.

    Parameters
    ----------
    index : FileIndex
        The file.
    usual_length : int
        Rows from a pulse to the next in this test.

    Returns
    -------
    tuple of pairs of int
        First row and row after the last of each impact. An impact begins a little before its pulse; a file with one
        impact is not split. A pulse that follows too soon to be a new impact belongs to the impact before.
    """
    distance = max(CROWDED * usual_length, BOUNCE_S / index.step_s)
    starts = [index.onsets[0]]
    for onset in index.onsets[1:]:
        if onset - starts[-1] >= distance:
            starts.append(onset)
    if len(starts) == 1:
        return ((0, index.n_rows),)
    lead = max(CELL, usual_length // 50)
    bounds = [max(start - lead, 0) for start in starts] + [index.n_rows]
    return tuple(pairwise(bounds))


def _find_onsets(path: Path, column: str, amplitude: FloatArray) -> tuple[int, ...]:
    highest, level = float(amplitude.max()), float(np.median(amplitude))
    if highest == 0.0 or (highest < NO_IMPACT * level and len(amplitude) > 3):
        problem = (
            f"no impact found: the column '{column}' rises to {highest:.3g} N at most over a level of {level:.3g} N; "
            "is it the force, or is the file to be left out by [ingest] drop?"
        )
        raise FileFormatError(path, problem)
    loud = amplitude >= min(max(BURST * highest, QUIET * level), highest)
    begins = np.flatnonzero(np.diff(loud.astype(np.int8), prepend=0) > 0)
    return tuple(int(cell) * CELL for cell in begins)
