"""Recordings as WAV: channels by their numbers; integers as fractions of full scale, so that 1 is the input range."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.foreign_errors import errors_of_reader
from frf_ipz.ingest.formats.signal_table import Signal, SignalFormat, SignalTable, even_times
from frf_ipz.input_files import read_bytes
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from pathlib import Path

    from scipy.io import wavfile

    from frf_ipz.ingest.formats.recording import TableKeys
else:
    wavfile = import_late("scipy.io.wavfile")

KIND = "a WAV file"
LOSSES = ("Reached EOF",)  # of the messages of SciPy: samples that are not there


def _recognises(head: bytes) -> bool:
    return head[:4] in {b"RIFF", b"RIFX", b"RF64"} and head[8:12] == b"WAVE"


def _read(path: Path, keys: TableKeys) -> SignalTable:
    del keys
    with errors_of_reader(path, KIND, losses=LOSSES):
        rate_hz, samples = wavfile.read(io.BytesIO(read_bytes(path)))
        columns = np.atleast_2d(samples.T).astype(np.float64)
        note = "numbers as they stand"
        if samples.dtype.kind in "iu":
            bits = 8 * samples.dtype.itemsize
            zero = 2.0 ** (bits - 1)
            columns = (columns - (zero if samples.dtype.kind == "u" else 0.0)) / zero
            note = f"{bits}-bit numbers as fractions of full scale"
        time = even_times(columns.shape[1], float(rate_hz))
    signals = tuple(
        Signal(name=f"channel {number}", values=column, time=time) for number, column in enumerate(columns, start=1)
    )
    return SignalTable(path=path, signals=signals, notes=(f"WAV: {note}",))


FORMAT = SignalFormat(rank=10, recognises=_recognises, read=_read)
