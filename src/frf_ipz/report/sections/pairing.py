"""Pairing: every measured pole and zero against its counterpart in the model, with the reason."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.pairing.pairs import Pair, Verdict
from frf_ipz.plotting.targets import root_name
from frf_ipz.rational import damping_ratio, natural_frequency_hz
from frf_ipz.report.picture import Axis, Picture, Trace, frequency_axis, line, markers, panels
from frf_ipz.report.section import Section, Table
from frf_ipz.report.wording import number, percent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.report.contents import RunContents

STYLES = {
    Verdict.PAIRED: ("@good", "circle"),
    Verdict.MISSING_IN_MODEL: ("@bad", "x"),
    Verdict.MISSING_IN_MEASUREMENT: ("@muted", "triangle-up-open"),
    Verdict.AMBIGUOUS: ("@c4", "diamond-open"),
}
MOST_LANES = 40  # FRFs drawn; more would be too low to tell apart


def build(run: RunContents) -> Section | None:
    """Give the section on the pairing.

    Parameters
    ----------
    run : RunContents
        What the run holds.

    Returns
    -------
    Section or None
        None without a model.
    """
    if run.pairs is None:
        return None
    rows = run.pairs.rows
    counts = {verdict: sum(row.verdict is verdict for row in rows) for verdict in Verdict}
    text = ", ".join(f"{count} {verdict.value}" for verdict, count in counts.items() if count)
    lead = f"Poles and zeros of measurement and model: {text}." if text else "There is nothing to pair."
    return Section(
        anchor="pairing",
        title="Pairing",
        lead=lead,
        blocks=(_picture(run, rows), _table(run, rows)) if rows else (),
        notes=run.pairs.warnings,
    )


def _picture(run: RunContents, rows: Sequence[Pair]) -> Picture:
    lanes = sorted({row.frf for row in rows})[:MOST_LANES]
    names = ["poles" if frf < 0 else str(run.labels[frf]) for frf in lanes]
    height = {frf: float(len(lanes) - place) for place, frf in enumerate(lanes)}
    drawn = [row for row in rows if row.frf in height]
    traces = [_links(drawn, height)]
    for verdict, (colour, symbol) in STYLES.items():
        traces += _points(run, [row for row in drawn if row.verdict is verdict], verdict, height, (colour, symbol))
    y = Axis(
        title="",
        options={
            "tickvals": list(height.values()),
            "ticktext": names,
            "range": [0.4, len(lanes) + 0.75],
            "zeroline": False,
        },
    )
    return Picture(
        name="pairs",
        title="Measured (upper) and computed (lower) poles and zeros, linked where they are paired",
        alt="One lane for the poles and one for the zeros of each FRF: measured roots above, those of the model below, "
        "joined by lines where they are paired.",
        traces=tuple(traces),
        layout=panels(frequency_axis(*run.band_hz), y),
        note="A slanted link is a frequency error of the model.",
        height_px=int(np.clip(120 + 48 * len(lanes), 220, 900)),
        is_over_frequency=True,
    )


SHIFT = 0.16  # of a lane, from its middle to measured and computed roots


def _links(rows: Sequence[Pair], height: dict[int, float]) -> Trace:
    pairs = [row for row in rows if row.verdict is Verdict.PAIRED]
    x, y = np.full((len(pairs), 3), np.nan), np.full((len(pairs), 3), np.nan)
    for place, row in enumerate(pairs):
        x[place, :2] = _hertz(row.measured_value), _hertz(row.computed_value)
        y[place, :2] = height[row.frf] + SHIFT, height[row.frf] - SHIFT
    return line(x.ravel(), y.ravel(), "paired", "@good", showlegend=False)


def _points(
    run: RunContents, rows: Sequence[Pair], verdict: Verdict, height: dict[int, float], style: tuple[str, str]
) -> list[Trace]:
    ends = [(row, "measured", row.measured_value, SHIFT) for row in rows if row.measured >= 0]
    ends += [(row, "model", row.computed_value, -SHIFT) for row in rows if row.computed >= 0]
    if not ends:
        return []
    texts = [
        f"{where}: {_name(run, row)}, damping {100 * float(damping_ratio(np.array(value))):.4g} %<br>{row.reason}"
        for row, where, value, _ in ends
    ]
    x = np.array([_hertz(value) for _, _, value, _ in ends])
    y = np.array([height[row.frf] + shift for row, _, _, shift in ends])
    colour, symbol = style
    return [markers(x, y, verdict.value, colour, symbol=symbol, text=texts, hover="%{x:.6g} Hz %{text}")]


def _table(run: RunContents, rows: Sequence[Pair]) -> Table:
    cells = []
    for row in rows:
        measured, computed = _hertz(row.measured_value), _hertz(row.computed_value)
        cells.append(
            [
                _name(run, row),
                number(measured, 6),
                number(computed, 6),
                percent(computed / measured - 1),
                number(row.distance, 3),
                row.verdict.value,
                row.reason,
            ]
        )
    columns = ("root", "measured, Hz", "model, Hz", "difference", "distance", "verdict", "why")
    marked = frozenset(np.flatnonzero([row.verdict is not Verdict.PAIRED for row in rows]).tolist())
    return Table(caption="Pairs", columns=columns, rows=cells, marked=marked, file="pairs.parquet")


def _name(run: RunContents, row: Pair) -> str:
    return root_name(row.kind, row.measured, str(run.labels[row.frf]) if 0 <= row.frf < len(run.labels) else "")


def _hertz(value: complex) -> float:
    return float(natural_frequency_hz(np.array(value)))
