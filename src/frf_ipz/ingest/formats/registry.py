"""Finds the formats: every module of this folder with a ``FORMAT``. Adding a format is adding a file."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.dofs import as_dofs
from frf_ipz.errors import FileFormatError, errors_of_file
from frf_ipz.ingest import formats
from frf_ipz.ingest.formats.file_arrays import ArrayFormat
from frf_ipz.ingest.formats.frf_file import FrfFormat
from frf_ipz.ingest.formats.modes_file import ModesFormat
from frf_ipz.ingest.formats.recording import LARGEST, RecordingFormat, TableKeys
from frf_ipz.ingest.formats.text_layout import read_head, sniff
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from frf_ipz.ingest.formats import column_words
    from frf_ipz.ingest.formats.frf_file import FrfContents, FrfSource, MeasuredFrf
    from frf_ipz.ingest.formats.modes_file import ModesSource
    from frf_ipz.ingest.formats.recording import RawRecording, RecordingContents
    from frf_ipz.modes import ModalParameters
else:
    column_words = import_late("frf_ipz.ingest.formats.column_words")

FEWEST_COLUMNS = 3  # frequency and two parts of a value
TWO_PARTS = "an FRF needs real and imaginary part, or magnitude and phase, in one file"
LETTERS_SHOWN, NAMES_SHOWN = 40, 5  # of names of columns, in a message


def open_recording(path: Path, columns: Sequence[str], keys: TableKeys | None = None) -> RawRecording:
    """Open a recording of any format.

    Parameters
    ----------
    path : Path
        The file.
    columns : sequence of str
        Columns besides the time.
    keys : TableKeys, optional
        What the test says about the table.

    Returns
    -------
    RawRecording
        To be read block by block.

    Raises
    ------
    FileFormatError
        If it cannot be read, or lacks a column.
    """
    head = read_head(path)
    for candidate in _formats(RecordingFormat):
        if candidate.fits(path, head):
            recording: RawRecording = candidate.open(path, columns, keys or TableKeys())
            return recording
    raise FileFormatError(path, "is of no known format for recordings; export it as CSV")


def read_frf_file(source: FrfSource) -> tuple[MeasuredFrf, ...]:
    """Read the FRFs of a file of any format.

    Parameters
    ----------
    source : FrfSource
        The file as the test describes it.

    Returns
    -------
    tuple of MeasuredFrf
        At least one.

    Raises
    ------
    FileFormatError
        If it cannot be read.
    """
    head = read_head(source.path)
    for candidate in _formats(FrfFormat):
        if candidate.holds(source, head):
            frfs: tuple[MeasuredFrf, ...] = candidate.read(source)
            for frf in frfs:
                with errors_of_file(source.path):
                    as_dofs((frf.output_dof, frf.input_dof))
                _require_sizes(frf)
            return frfs
    problem = "is of no known format for FRFs; export it as CSV, as text with 'columns', or as UFF 58"
    raise FileFormatError(source.path, problem + _columns_unknown(source.path))


def _columns_unknown(path: Path) -> str:
    """Give the names of columns, which do not tell what they are, where a file is a table of numbers."""
    try:
        layout = sniff(path)
    except FileFormatError:
        return ""
    names = next((row for row in reversed(layout.header) if len(row) == layout.n_columns), ())
    roles = [column_words.frf_role(name) for name in names]
    if names and all(roles) and column_words.FREQUENCY not in roles:
        shown = ", ".join(f"'{name[:LETTERS_SHOWN]}'" for name in names[:NAMES_SHOWN])
        return f"; it has no column of frequencies beside {shown}: export them too"
    if names and layout.n_columns == FEWEST_COLUMNS - 1:
        return f"; it has '{names[-1][:LETTERS_SHOWN]}' alone beside '{names[0][:LETTERS_SHOWN]}': {TWO_PARTS}"
    if not names or layout.n_columns < FEWEST_COLUMNS:
        return ""
    shown = ", ".join(f"'{name[:LETTERS_SHOWN]}'" for name in names[:NAMES_SHOWN])
    return (
        f"; it is a table whose columns {shown} do not all say what they are: write it, as in "
        'columns = ["frequency_hz", "real", "imag"], in its [[frf]]'
    )


def look_at_recording(path: Path, keys: TableKeys | None = None) -> RecordingContents:
    """Say what a recording of any format holds.

    Parameters
    ----------
    path : Path
        The file.
    keys : TableKeys, optional
        What is known about its table.

    Returns
    -------
    RecordingContents
        Its signals.

    Raises
    ------
    FileFormatError
        If it is no recording.
    """
    head = read_head(path)
    found: RecordingContents = next(
        candidate for candidate in _formats(RecordingFormat) if candidate.fits(path, head)
    ).look(path, keys or TableKeys())
    return found


def is_known_recording(path: Path) -> bool:
    """Tell whether a format of recordings knows a file by its content; text that is none of these may be a table too.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    bool
        True if one does.

    Raises
    ------
    FileFormatError
        If it cannot be read, or is empty.
    """
    head = read_head(path)
    return any(candidate.fits(path, head) for candidate in _formats(RecordingFormat)[:-1])


def look_at_frfs(source: FrfSource) -> FrfContents | None:
    """Say what a file of FRFs of any format holds.

    Parameters
    ----------
    source : FrfSource
        The file; nothing needs to be known of it.

    Returns
    -------
    FrfContents or None
        None where no format of FRFs takes the file for its own.

    Raises
    ------
    FileFormatError
        If it is a file that may hold FRFs, and holds none.
    """
    head = read_head(source.path)
    for candidate in _formats(FrfFormat):
        if candidate.holds(source, head):
            contents: FrfContents = candidate.look(source)
            return contents
    return None


def find_array_format(head: bytes) -> ArrayFormat | None:
    """Find the format of a file of named arrays.

    Parameters
    ----------
    head : bytes
        Its first bytes.

    Returns
    -------
    ArrayFormat or None
        None where it is no such file.
    """
    return next((candidate for candidate in _formats(ArrayFormat) if candidate.recognises(head)), None)


def read_modes_file(source: ModesSource) -> ModalParameters:
    """Read the modes of a file of any format.

    Parameters
    ----------
    source : ModesSource
        The file as the test describes it.

    Returns
    -------
    ModalParameters
        At least one mode.

    Raises
    ------
    FileFormatError
        If it cannot be read.
    """
    head = read_head(source.path)
    for candidate in _formats(ModesFormat):
        if candidate.holds_modes(source.path, head):
            with errors_of_file(source.path):
                modes: ModalParameters = candidate.read_modes(source)
            return modes
    raise FileFormatError(
        source.path,
        "is of no known format for modes; expected is a universal file with data sets 55 or 2414, or a CSV with the "
        "columns mode,frequency_hz,damping_ratio,dof,real,imag",
    )


def _require_sizes(frf: MeasuredFrf) -> None:
    """Refuse numbers whose squares overflow; none of them is a measurement."""
    for name in ("frequency_hz", "values", "variance", "coherence"):
        numbers = getattr(frf, name)
        if numbers is not None and np.max(np.abs(numbers), initial=0.0) > LARGEST:
            place = int(np.argmax(np.abs(numbers)))
            problem = f"of {frf.output_dof} / {frf.input_dof} holds {numbers[place]:.4g}, which no measurement gives"
            raise FileFormatError(frf.source.path, f"{name} {problem}; correct the file")


@cache
def _formats(protocol: type) -> tuple[Any, ...]:
    prefix = f"{formats.__name__}."
    modules = [importlib.import_module(module.name) for module in pkgutil.iter_modules(formats.__path__, prefix)]
    candidates = [module.FORMAT for module in modules if isinstance(getattr(module, "FORMAT", None), protocol)]
    return tuple(sorted(candidates, key=lambda candidate: candidate.rank))
