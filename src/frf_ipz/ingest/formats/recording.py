"""Recordings as their format reads them, and the protocol of a format for recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

from frf_ipz.arrays import FloatArray


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
    """

    time_column: str = ""
    sample_rate_hz: float | None = None
    header_row: int | None = None


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
    """

    path: Path
    units: tuple[str, ...]
    blocks: Iterator[FloatArray]
    line_of_row: Callable[[int], int]
    time_column: str = "time"


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
