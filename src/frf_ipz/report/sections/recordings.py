"""Records: the forces as recorded, and what is wrong with which."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.report.picture import Axis, Picture, Trace, colour_of, dash_of, line, panels
from frf_ipz.report.section import Section, Table
from frf_ipz.report.wording import counted, number, percent

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import pandas as pd

    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.ingest.frf_estimate import Trace as Recorded
    from frf_ipz.report.contents import RunContents

MOST_TRACES = 40  # drawn; more cover each other and make the page large
MOST_PANELS = 4  # channels with a panel each; more share one
LEGEND_NOTE = "Click a name in the legend to hide or show a record; dotted: left out. Drag to zoom."
SHOWN_AT_FIRST = 12  # records; the others are a click in the legend away


def build(run: RunContents) -> Section | None:
    """Give the section on records and their quality.

    Parameters
    ----------
    run : RunContents
        What the run holds.

    Returns
    -------
    Section or None
        None for FRFs that were estimated elsewhere.
    """
    estimate = run.estimate
    if estimate is None or not len(estimate.records):
        return None
    records = estimate.records
    used = int(records["used"].astype(bool).sum())
    lead = f"{counted(len(records), 'record')}, {used} used."
    return Section(
        anchor="recordings",
        title="Records",
        lead=lead,
        blocks=(*_pictures(estimate), _table(records)),
        notes=estimate.warnings,
        choices=estimate.choices,
    )


def _pictures(estimate: FrfEstimate) -> list[Picture]:
    traces = estimate.traces[:MOST_TRACES]
    if not traces:
        return []
    force = traces[0].channel
    pulses = [trace for trace in traces if trace.channel == force]
    responses = [trace for trace in traces if trace.channel != force]
    return [_pulses(pulses, estimate.records), *([_responses(responses, estimate.records)] if responses else [])]


def _pulses(traces: Sequence[Recorded], records: pd.DataFrame) -> Picture:
    triggers = dict(zip(records["record"], records["trigger_s"], strict=True)) if "trigger_s" in records else {}
    shifts = {name: float(time) for name, time in triggers.items() if np.isfinite(time)}
    aligned = all(shifts.get(trace.name, 0.0) > 0 for trace in traces)
    drawn = [
        _curve(trace, place, records, shift_s=shifts[trace.name] if aligned else 0.0, unit="ms")
        for place, trace in enumerate(traces)
    ]
    names = "; ".join(trace["name"] for trace in drawn[:SHOWN_AT_FIRST])
    return Picture(
        name="records",
        title="Forces as recorded" + (", aligned where they set in" if aligned else ""),
        alt=f"Force over time of {counted(len(traces), 'record')}: {names}.",
        traces=tuple(drawn),
        layout=panels({"title": {"text": "Time, ms"}}, Axis(title=f"{traces[0].channel}, {traces[0].unit}")),
        note=LEGEND_NOTE,
        height_px=330,
    )


def _responses(traces: Sequence[Recorded], records: pd.DataFrame) -> Picture:
    channels = list(dict.fromkeys(trace.channel for trace in traces))
    units = {trace.channel: trace.unit for trace in traces}
    names = list(dict.fromkeys(trace.name for trace in traces))
    stacked = len(channels) <= MOST_PANELS
    drawn = []
    for trace in traces:
        rank = channels.index(trace.channel) if stacked else 0
        curve = _curve(trace, names.index(trace.name), records, shift_s=0.0, unit="s")
        drawn.append({**curve, "yaxis": f"y{rank + 1}" if rank else "y", "showlegend": trace.channel == channels[0]})
    axes = [Axis(title=f"{channel}, {units[channel]}") for channel in channels]
    axes = axes if stacked else [Axis(title=f"responses, {' or '.join(dict.fromkeys(units.values()))}")]
    end = max(float(trace.time_s[-1]) for trace in traces if len(trace.time_s))
    x = {"title": {"text": "Time, s"}, "range": [0.0, end]}
    return Picture(
        name="responses",
        title="Responses as recorded",
        alt=f"Responses over time: {', '.join(channels)}; {counted(len(names), 'record')}.",
        traces=tuple(drawn),
        layout=panels(x, *axes),
        note=LEGEND_NOTE,
        height_px=int(np.clip(170 + 130 * len(axes), 300, 800)),
    )


def _curve(trace: Recorded, place: int, records: pd.DataFrame, *, shift_s: float, unit: str) -> Trace:
    used = dict(zip(records["record"], records["used"].astype(bool), strict=True))
    out = not used.get(trace.name, True)
    name = f"{trace.name} (left out)" if out else trace.name
    factor = 1e3 if unit == "ms" else 1.0
    visible = True if place < SHOWN_AT_FIRST else "legendonly"
    return line(
        factor * (np.asarray(trace.time_s) - shift_s),
        np.asarray(trace.values),
        name,
        colour_of(place),
        hover=f"%{{x:.5g}} {unit}: %{{y:.4g}} {trace.unit} ({trace.channel})",
        dash="dot" if out else dash_of(place),
        width=1.2,
        legendgroup=trace.name,
        visible=visible,
    )


def _table(records: pd.DataFrame) -> Table:
    columns: dict[str, tuple[str, Callable[[Any], str]]] = {
        "input_dof": ("input", str),
        "peak_force_N": ("peak force, N", number),
        "pulse_s": ("pulse, ms", lambda value: number(1e3 * value, 3)),
        "snr_db": ("signal to noise, dB", lambda value: number(value, 3)),
        "remaining_amplitude": ("remaining at the end", lambda value: percent(value, 2)),
        "weight": ("weight", lambda value: number(value, 3)),
        "used": ("used", lambda value: "yes" if value else "no"),
        "marks": ("what is wrong", lambda value: str(value or "")),
    }
    known = {name: entry for name, entry in columns.items() if name in records}
    rows = [
        [str(record), *[write(value) for (_, write), value in zip(known.values(), values, strict=True)]]
        for record, *values in records[["record", *known]].itertuples(index=False)
    ]
    used = records["used"].astype(bool).to_numpy()
    return Table(
        caption="Records and their quality",
        columns=("record", *[title for title, _ in known.values()]),
        rows=rows,
        marked=frozenset(np.flatnonzero(~used).tolist()),
        file="records.parquet",
    )
