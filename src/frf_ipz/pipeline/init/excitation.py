"""Impacts of a hammer, or a shaker's record: told by how long the force is large."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import InputError
from frf_ipz.ingest.formats.recording import TableKeys
from frf_ipz.ingest.formats.registry import open_recording

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from frf_ipz.pipeline.init.columns import Columns

MOST_FILES = 3  # that are looked into
LARGE = 0.1  # of the highest force
SHORT = 0.05  # of the record: pulses last a thousandth of it, noise and sines are large most of the time


def excitation(files: Sequence[Path], columns: Columns) -> str:
    """Tell which kind of test recordings are of.

    Parameters
    ----------
    files : sequence of Path
        Recordings.
    columns : Columns
        Their columns.

    Returns
    -------
    str
        ``hammer`` or ``random``.
    """
    return "random" if all(_is_lasting(path, columns) for path in files[:MOST_FILES]) else "hammer"


def _is_lasting(path: Path, columns: Columns) -> bool:
    keys = TableKeys() if columns.has_time else TableKeys(sample_rate_hz=1.0)
    try:
        force = np.concatenate([block[:, 1] for block in open_recording(path, [columns.force.name], keys).blocks])
    except InputError:  # check says what is wrong with it
        return False
    amplitude = np.abs(force - np.median(force)) if len(force) else np.zeros(1)
    return bool(np.mean(amplitude > LARGE * amplitude.max()) > SHORT)
