"""Recordings as TDMS (National Instruments): channels by name, with their units and wave form properties."""

from __future__ import annotations

import io
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.foreign_errors import errors_of_reader, import_reader
from frf_ipz.ingest.formats.file_arrays import MOST_EXPANDED
from frf_ipz.ingest.formats.signal_table import Signal, SignalFormat, SignalTable, even_times
from frf_ipz.input_files import read_bytes, require_expanded

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.formats.recording import TableKeys

KIND = "a TDMS file"
STEP, OFFSET = "wf_increment", "wf_start_offset"
LOSSES = (  # of the messages of nptdms: samples that are not there, or are not scaled
    "less data than expected",
    "metadata is incomplete",
    "not a multiple",
    "Cropping data",
    "Unsupported scale type",
)
UNITS = ("unit_string", "NI_UnitDescription", "Unit", "unit")


def _recognises(head: bytes) -> bool:
    return head.startswith(b"TDSm")


def _read(path: Path, keys: TableKeys) -> SignalTable:
    del keys
    nptdms = import_reader(path, "nptdms", kind=KIND, extra="tdms")
    data = read_bytes(path)
    with errors_of_reader(path, KIND, losses=LOSSES) as said:
        heads = nptdms.TdmsFile.read_metadata(io.BytesIO(data))
        channels = [channel for group in heads.groups() for channel in group.channels()]
        require_expanded(
            path, sum(8 * len(channel) for channel in channels), file_bytes=len(data), most_bytes=MOST_EXPANDED
        )
        content = nptdms.TdmsFile.read(io.BytesIO(data))
        names = Counter(channel.name for channel in channels)
        signals = []
        for group in content.groups():
            for channel in group.channels():
                values = np.asarray(channel[:])
                if values.dtype.kind in "biuf" and len(values):
                    name = channel.name if names[channel.name] == 1 else f"{group.name}/{channel.name}"
                    signals.append(_make_signal(name, values, channel.properties))
    return SignalTable(path=path, signals=tuple(signals), notes=tuple(f"TDMS: {text}" for text in said))


FORMAT = SignalFormat(rank=10, recognises=_recognises, read=_read)


def _make_signal(name: str, values: Any, properties: Any) -> Signal:  # noqa: ANN401 - as nptdms has them
    step_s = float(properties.get(STEP, 0.0) or 0.0)
    start_s = float(properties.get(OFFSET, 0.0) or 0.0)
    time: FloatArray | None = even_times(len(values), 1.0 / step_s, start_s) if step_s > 0.0 else None
    unit = next((str(properties[key]).strip() for key in UNITS if str(properties.get(key, "")).strip()), "")
    return Signal(name=name, values=values.astype(np.float64), unit=unit, time=time)
