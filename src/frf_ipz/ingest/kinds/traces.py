"""Stretches of recordings to draw: the pulse of every blow, the responses of a few."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.frf_estimate import Trace
from frf_ipz.ingest.signals.thinning import thin
from frf_ipz.ingest.units import si_unit
from frf_ipz.quantities import RESPONSES

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.records import Record
    from frf_ipz.ingest.survey.record_info import RecordInfo

N_POINTS = 2000
MARGIN = 0.5  # of the pulse's stretch that is drawn on each side
MOST_FORCES = 400
MOST_RESPONSES = 16


def record_traces(info: RecordInfo, record: Record, drawn: tuple[Trace, ...]) -> tuple[Trace, ...]:
    """Add what is drawn of one blow or record.

    Parameters
    ----------
    info : RecordInfo
        Where its pulse is.
    record : Record
        Its signals.
    drawn : tuple of Trace
        What is drawn of those before it.

    Returns
    -------
    tuple of Trace
        The same and the force of this one around its pulse; the responses too, where few have been drawn.
    """
    new: list[Trace] = []
    forces = sum(trace.unit.startswith("N") for trace in drawn)
    if forces < MOST_FORCES:
        start, stop = info.pulse
        margin = int(MARGIN * (stop - start))
        new.append(
            _trace(
                record, record.labels[0].input_channel, record.force, _force_unit(record), start - margin, stop + margin
            )
        )
    if record.used and len(drawn) - forces < MOST_RESPONSES:
        room = MOST_RESPONSES - (len(drawn) - forces)
        for label, response in list(zip(record.labels, record.responses, strict=True))[:room]:
            unit = si_unit(RESPONSES[label.quantity.power], rotational=label.output_dof.direction.startswith("r"))
            new.append(_trace(record, label.output_channel, response, unit, 0, record.n_samples))
    return (*drawn, *new)


def _force_unit(record: Record) -> str:
    return si_unit("force", rotational=record.labels[0].input_dof.direction.startswith("r"))


def _trace(record: Record, channel: str, values: FloatArray, unit: str, start: int, stop: int) -> Trace:
    start, stop = max(start, 0), min(stop, len(values))
    places, kept = thin(values[start:stop], N_POINTS)
    return Trace(
        name=record.name,
        channel=channel,
        unit=unit,
        time_s=np.asarray((places + start) * record.step_s),
        values=np.array(kept),
    )
