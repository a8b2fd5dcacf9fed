"""Recordings to draw, with few enough points: the pulse of every impact, the responses of a few."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.ingest.frf_estimate import Trace
from frf_ipz.ingest.units import si_unit
from frf_ipz.quantities import RESPONSES

if TYPE_CHECKING:
    from frf_ipz.ingest.records import Record
    from frf_ipz.ingest.survey.record_info import RecordInfo

N_POINTS = 2000
MARGIN = 0.5  # of the pulse's length, drawn on each side of it
MOST_FORCES = 400
MOST_RESPONSES = 16


def add_traces(traces: tuple[Trace, ...], info: RecordInfo, record: Record) -> tuple[Trace, ...]:
    """Add what is drawn of one record.

    Parameters
    ----------
    traces : tuple of Trace
        What is drawn of the records before it.
    info : RecordInfo
        Where its pulse is.
    record : Record
        Its signals.

    Returns
    -------
    tuple of Trace
        The same and the force of this one around its pulse; the responses too, where few are drawn yet.
    """
    new_traces: list[Trace] = []
    n_forces = sum(trace.unit.startswith("N") for trace in traces)
    if n_forces < MOST_FORCES:
        start, stop = info.pulse_interval
        margin = int(MARGIN * (stop - start))
        channel = record.labels[0].input_channel
        new_traces.append(
            _make_trace(record, channel, record.force, _force_unit(record), start - margin, stop + margin)
        )
    if record.used and len(traces) - n_forces < MOST_RESPONSES:
        room = MOST_RESPONSES - (len(traces) - n_forces)
        for label, response in list(zip(record.labels, record.responses, strict=True))[:room]:
            unit = si_unit(RESPONSES[label.quantity.power], rotational=label.output_dof.direction.startswith("r"))
            new_traces.append(_make_trace(record, label.output_channel, response, unit, 0, record.n_samples))
    return (*traces, *new_traces)


def thin(values: FloatArray, n_points: int) -> tuple[np.ndarray, FloatArray]:
    """Keep the lowest and the highest sample of each of many short intervals of a signal.

    Parameters
    ----------
    values : (n,) array
        The signal.
    n_points : int
        Points to keep at most.

    Returns
    -------
    positions : (m,) int array
        Which samples, ascending; m is at most `n_points`.
    values : (m,) array
        Their values.

    Examples
    --------
    >>> positions, extremes = thin(np.sin(np.arange(10_000.0)), 100)
    >>> len(positions) <= 100, bool(extremes.max() > 0.999)
    (True, True)
    """
    if len(values) <= n_points:
        return np.arange(len(values)), values
    size = -(-len(values) // max(n_points // 2, 1))
    cells = np.pad(values, (0, -len(values) % size), mode="edge").reshape(-1, size)
    starts = np.arange(len(cells)) * size
    positions = np.unique(np.concatenate([starts + cells.argmin(axis=1), starts + cells.argmax(axis=1)]))
    return positions, values[positions]


def _force_unit(record: Record) -> str:
    return si_unit("force", rotational=record.labels[0].input_dof.direction.startswith("r"))


def _make_trace(record: Record, channel: str, values: FloatArray, unit: str, start: int, stop: int) -> Trace:
    start, stop = max(start, 0), min(stop, len(values))
    positions, extremes = thin(values[start:stop], N_POINTS)
    return Trace(
        name=record.name,
        channel=channel,
        unit=unit,
        time_s=np.asarray((positions + start) * record.step_s),
        values=np.array(extremes),
    )
