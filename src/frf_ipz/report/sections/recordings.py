"""Blows or records: the forces as recorded, and what is wrong with which."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.report.picture import Axis, Picture, Trace, colour_of, dash_of, line, panels
from frf_ipz.report.section import Section
from frf_ipz.report.table import Table
from frf_ipz.report.wording import counted, number, percent

if TYPE_CHECKING:
    from collections.abc import Callable

    import pandas as pd

    from frf_ipz.ingest.recordings import Recordings
    from frf_ipz.ingest.recordings import Trace as Recorded
    from frf_ipz.report.contents import RunContents

MOST_TRACES = 60  # drawn; more cover each other and make the page large
SHOWN_AT_FIRST = 12  # blows; the others are a click in the legend away


def build(run: RunContents) -> Section | None:
    """Give the section on blows and their quality.

    Parameters
    ----------
    run : RunContents
        What the run holds.

    Returns
    -------
    Section or None
        None for FRFs that were estimated elsewhere.
    """
    recordings = run.recordings
    if recordings is None or not len(recordings.blows):
        return None
    blows = recordings.blows
    used = int(blows["used"].astype(bool).sum())
    lead = f"{counted(len(blows), 'blow or record', 'blows or records')}, {used} used."
    picture = _traces(recordings)
    return Section(
        anchor="recordings",
        title="Blows",
        lead=lead,
        blocks=(*([picture] if picture else []), _table(blows)),
        notes=recordings.warnings,
        choices=recordings.choices,
    )


def _traces(recordings: Recordings) -> Picture | None:
    traces = recordings.traces[:MOST_TRACES]
    if not traces:
        return None
    names = list(dict.fromkeys(trace.name for trace in traces))
    force = traces[0].channel
    responses = list(dict.fromkeys(trace.channel for trace in traces if trace.channel != force))
    units = {trace.channel: trace.unit for trace in traces}
    left_out = set(recordings.blows.loc[~recordings.blows["used"].astype(bool), "blow"])
    drawn = [
        _curve(trace, names.index(trace.name), first=trace.channel == force, left_out=left_out) for trace in traces
    ]
    ends = [float(trace.time_s[-1]) for trace in traces if len(trace.time_s)]
    x = {"title": {"text": "Time, s"}, "range": [0.0, max(ends)]}
    axes = [Axis(title=f"{force}, {units[force]}")]
    if responses:
        unit = " or ".join(dict.fromkeys(units[name] for name in responses))
        axes.append(Axis(title=f"{'response' if len(responses) > 1 else responses[0]}, {unit}"))
    return Picture(
        name="blows",
        title="Recordings as they were used: force above, responses below",
        alt=f"Force and responses over time of {counted(len(names), 'blow or record', 'blows or records')}; "
        f"those left out are dotted: {', '.join(sorted(left_out)) or 'none'}.",
        traces=tuple(drawn),
        layout=panels(x, *axes),
        note="Click a name in the legend to hide or show a blow; dotted: left out. Drag to zoom into a pulse.",
        height_px=460,
    )


def _curve(trace: Recorded, place: int, *, first: bool, left_out: set[str]) -> Trace:
    out = trace.name in left_out
    name = f"{trace.name} (left out)" if out else trace.name
    hover = f"%{{x:.5g}} s: %{{y:.4g}} {trace.unit} ({trace.channel})"
    more = {"yaxis": "y" if first else "y2", "legendgroup": trace.name, "showlegend": first}
    more["visible"] = True if place < SHOWN_AT_FIRST else "legendonly"
    dash = "dot" if out else dash_of(place)
    return line(
        np.asarray(trace.time_s),
        np.asarray(trace.values),
        name,
        colour_of(place),
        hover=hover,
        dash=dash,
        width=1.2,
        **more,
    )


def _table(blows: pd.DataFrame) -> Table:
    columns: dict[str, tuple[str, Callable[[Any], str]]] = {
        "input_dof": ("struck at", str),
        "peak_force_N": ("peak force, N", number),
        "pulse_s": ("pulse, ms", lambda value: number(1e3 * value, 3)),
        "snr_db": ("signal to noise, dB", lambda value: number(value, 3)),
        "left_at_end": ("left at the end", lambda value: percent(value, 2)),
        "weight": ("weight", lambda value: number(value, 3)),
        "used": ("used", lambda value: "yes" if value else "no"),
        "marks": ("what is wrong", lambda value: str(value or "")),
    }
    known = {name: entry for name, entry in columns.items() if name in blows}
    rows = [
        [str(blow), *[write(value) for (_, write), value in zip(known.values(), values, strict=True)]]
        for blow, *values in blows[["blow", *known]].itertuples(index=False)
    ]
    used = blows["used"].astype(bool).to_numpy()
    return Table(
        caption="Blows and their quality",
        columns=("blow", *[title for title, _ in known.values()]),
        rows=rows,
        marked=frozenset(np.flatnonzero(~used).tolist()),
        file="blows.parquet",
    )
