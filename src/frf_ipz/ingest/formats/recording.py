"""Recordings as their format reads them, and the protocol of a format for recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

from frf_ipz.arrays import FloatArray
from frf_ipz.dofs import Dof

LARGEST = 1e100  # a larger value is no measurement, and its square may overflow


@dataclass(frozen=True, slots=True, kw_only=True)
class TableKeys:
    """What a test says about the tables of its recordings; what it does not say is found.

    Parameters
    ----------
    time_column : str
        Name of the column that is the time.
    sample_rate_hz : float, optional
        Samples a second, for files without a column of time, Hz.
    header_row : int, optional
        Line of the names of the columns, from 1.
    rate_variable : str
        Name of the number in a file of arrays that is the rate, in samples a second.
    """

    time_column: str = ""
    sample_rate_hz: float | None = None
    header_row: int | None = None
    rate_variable: str = ""


@dataclass(frozen=True, slots=True)
class SignalColumn:
    """A column of a recording, besides its time.

    Parameters
    ----------
    name : str
        What a ``[[channel]]`` calls it.
    unit : str
        What the file says; may be empty.
    dof : Dof, optional
        Where it was measured, if the file says so.
    label : str
        What the file calls it, where that is not its name.
    """

    name: str
    unit: str = ""
    dof: Dof | None = None
    label: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingContents:
    """What a recording holds, for `init`, `check` and `read_recordings`.

    Parameters
    ----------
    columns : tuple of SignalColumn
        Its signals.
    has_time : bool
        The file says when its samples were taken.
    notes : tuple of str
        What had to be chosen.
    """

    columns: tuple[SignalColumn, ...]
    has_time: bool
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RawRecording:
    """A recording that is being read.

    Parameters
    ----------
    path : Path
        The file.
    units : tuple of str
        What the file says about the units of the time and of each column; empty where it says nothing.
    blocks : iterator of (n_rows, 1 + n_columns) array
        The time and the columns, finite, in the file's units, block after block.
    line_of_row : callable
        Line of the file of a row, for messages.
    time_column : str
        Name of the column of the time, for messages.
    row_name : str
        What a row is in the file, for messages.
    notes : tuple of str
        What the user has to know of how it was read.
    """

    path: Path
    units: tuple[str, ...]
    blocks: Iterator[FloatArray]
    line_of_row: Callable[[int], int]
    time_column: str = "time"
    row_name: str = "line"
    notes: tuple[str, ...] = ()


@runtime_checkable
class RecordingFormat(Protocol):
    """A format of recordings.

    Attributes
    ----------
    rank : int
        Formats are asked in ascending order whether a file is theirs.
    """

    rank: int

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

    def open(self, path: Path, columns: Sequence[str], keys: TableKeys) -> RawRecording:
        """Open a file for reading.

        Parameters
        ----------
        path : Path
            The file.
        columns : sequence of str
            Columns besides the time.
        keys : TableKeys
            What the test says about the table.

        Returns
        -------
        RawRecording
            To be read block by block.

        Raises
        ------
        FileFormatError
            If it is none, or lacks a column.
        """

    def look(self, path: Path, keys: TableKeys) -> RecordingContents:
        """Say what a file holds.

        Parameters
        ----------
        path : Path
            The file.
        keys : TableKeys
            What is known about the table.

        Returns
        -------
        RecordingContents
            Its signals, without the time.

        Raises
        ------
        FileFormatError
            If it is no recording.
        """
