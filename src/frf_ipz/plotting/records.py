"""Records: forces and responses over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.curves import dash_of
from frf_ipz.plotting.picture import Axis, Line, Panel, Picture, in_hover
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from frf_ipz.ingest.frf_estimate import FrfEstimate, Trace

MOST_TRACES = 40  # drawn; more cover each other and make a page large
MOST_PANELS = 4  # channels with a panel each; more share one
SHOWN_AT_FIRST = 12  # records; a page shows the others after a click
LEFT_OUT = "Dotted: left out."


def describe_forces(estimate: FrfEstimate) -> Picture | None:
    """Describe the forces of all records, aligned where they set in.

    Parameters
    ----------
    estimate : FrfEstimate
        The result of ingest.

    Returns
    -------
    Picture or None
        None where no trace was kept.
    """
    forces, _ = _traces(estimate)
    if not forces:
        return None
    records = estimate.records
    triggers = dict(zip(records["record"], records["trigger_s"], strict=True)) if "trigger_s" in records else {}
    shifts = {name: float(time) for name, time in triggers.items() if np.isfinite(time)}
    aligned = all(shifts.get(trace.name, 0.0) > 0 for trace in forces)
    lines = tuple(
        _curve(trace, index, records, shift_s=shifts[trace.name] if aligned else 0.0, unit="ms")
        for index, trace in enumerate(forces)
    )
    names = "; ".join(line.name for line in lines[:SHOWN_AT_FIRST])
    return Picture(
        name="records",
        title="Forces as recorded" + (", aligned where they set in" if aligned else ""),
        alt=f"Force over time of {counted(len(forces), 'record')}: {names}.",
        panels=(Panel(y=Axis(title=f"{forces[0].channel}, {forces[0].unit}"), layers=lines),),
        x=Axis(title="Time, ms"),
        note=LEFT_OUT,
        height_px=330,
    )


def describe_responses(estimate: FrfEstimate) -> Picture | None:
    """Describe the responses of all records, a panel a channel where there are few.

    Parameters
    ----------
    estimate : FrfEstimate
        The result of ingest.

    Returns
    -------
    Picture or None
        None where no response was kept.
    """
    _, responses = _traces(estimate)
    if not responses:
        return None
    channels = list(dict.fromkeys(trace.channel for trace in responses))
    units = {trace.channel: trace.unit for trace in responses}
    names = list(dict.fromkeys(trace.name for trace in responses))
    is_stacked = len(channels) <= MOST_PANELS
    lines: list[list[Line]] = [[] for _ in (channels if is_stacked else channels[:1])]
    for trace in responses:
        curve = _curve(trace, names.index(trace.name), estimate.records, shift_s=0.0, unit="s")
        lines[channels.index(trace.channel) if is_stacked else 0].append(curve)
    titles = [f"{channel}, {units[channel]}" for channel in channels]
    titles = titles if is_stacked else [f"responses, {' or '.join(dict.fromkeys(units.values()))}"]
    end = max(float(trace.time_s[-1]) for trace in responses if len(trace.time_s))
    return Picture(
        name="responses",
        title="Responses as recorded",
        alt=f"Responses over time: {', '.join(channels)}; {counted(len(names), 'record')}.",
        panels=tuple(
            Panel(y=Axis(title=title), layers=tuple(curves)) for title, curves in zip(titles, lines, strict=True)
        ),
        x=Axis(title="Time, s", limits=(0.0, end)),
        note=LEFT_OUT,
        height_px=int(np.clip(170 + 130 * len(titles), 300, 800)),
    )


def _traces(estimate: FrfEstimate) -> tuple[Sequence[Trace], Sequence[Trace]]:
    """Tell forces from responses."""
    traces = estimate.traces[:MOST_TRACES]
    force = traces[0].channel if traces else ""
    return [trace for trace in traces if trace.channel == force], [trace for trace in traces if trace.channel != force]


def _curve(trace: Trace, index: int, records: pd.DataFrame, *, shift_s: float, unit: str) -> Line:
    used = dict(zip(records["record"], records["used"].astype(bool), strict=True))
    is_left_out = not used.get(trace.name, True)
    factor = 1e3 if unit == "ms" else 1.0
    return Line(
        name=f"{trace.name} (left out)" if is_left_out else trace.name,
        colour=index,
        group=trace.name,
        is_shown=index < SHOWN_AT_FIRST,
        x=factor * (np.asarray(trace.time_s) - shift_s),
        y=np.asarray(trace.values),
        dash="dot" if is_left_out else dash_of(index),
        width=1.2,
        hover=f"{{x:.5g}} {unit}: {{y:.4g}} {in_hover(trace.unit)} ({in_hover(trace.channel)})",
    )
