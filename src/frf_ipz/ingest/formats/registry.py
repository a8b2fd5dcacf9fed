"""Finds the formats: every module of this folder with a ``FORMAT``. Adding a format is adding a file."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import TYPE_CHECKING, Any

from frf_ipz.errors import FileFormatError
from frf_ipz.ingest import formats
from frf_ipz.ingest.formats.frf_file import FrfFormat
from frf_ipz.ingest.formats.recording import RecordingFormat
from frf_ipz.ingest.formats.text_layout import HEAD

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from frf_ipz.ingest.formats.frf_file import FrfSource, MeasuredFrf
    from frf_ipz.ingest.formats.recording import RawRecording


def open_recording(path: Path, columns: Sequence[str]) -> RawRecording:
    """Open a recording of any format.

    Parameters
    ----------
    path : Path
        The file.
    columns : sequence of str
        Columns wanted besides the time.

    Returns
    -------
    RawRecording
        To be read block by block.

    Raises
    ------
    FileFormatError
        If it cannot be read, or lacks a column.
    """
    head = _head(path)
    for candidate in _formats(RecordingFormat):
        if candidate.fits(path, head):
            recording: RawRecording = candidate.open(path, columns)
            return recording
    raise FileFormatError(path, "is of no known format for recordings; export it as CSV")


def read_frfs(source: FrfSource) -> tuple[MeasuredFrf, ...]:
    """Read the FRFs of a file of any format.

    Parameters
    ----------
    source : FrfSource
        The file and what is said about it.

    Returns
    -------
    tuple of MeasuredFrf
        At least one.

    Raises
    ------
    FileFormatError
        If it cannot be read.
    """
    head = _head(source.path)
    for candidate in _formats(FrfFormat):
        if candidate.holds(source, head):
            frfs: tuple[MeasuredFrf, ...] = candidate.read(source)
            return frfs
    raise FileFormatError(
        source.path, "is of no known format for FRFs; export it as CSV, as text with 'columns', or as UFF 58"
    )


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as stream:
            head = stream.read(HEAD)
    except FileNotFoundError:
        raise FileFormatError(path, "there is no such file") from None
    except OSError as error:
        raise FileFormatError(path, f"cannot be read: {error.strerror}") from None
    if not head.strip():
        raise FileFormatError(path, "is empty; measure or export it again")
    return head


@cache
def _formats(protocol: type) -> tuple[Any, ...]:
    modules = [importlib.import_module(found.name) for found in pkgutil.iter_modules(formats.__path__, _prefix())]
    candidates = [module.FORMAT for module in modules if isinstance(getattr(module, "FORMAT", None), protocol)]
    return tuple(sorted(candidates, key=lambda candidate: candidate.rank))


def _prefix() -> str:
    return formats.__name__ + "."
