"""What changes with the level of the blows: FRFs of weak and of strong ones, frequency and damping over the level."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.curves import Q95, magnitude_title
from frf_ipz.report.picture import (
    Axis,
    Picture,
    Trace,
    colour_of,
    dash_of,
    frequency_axis,
    line,
    panels,
)
from frf_ipz.report.section import Block
from frf_ipz.report.table import Table
from frf_ipz.report.thinning import bins_for, thin
from frf_ipz.report.wording import counted, number, percent, with_error

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from frf_ipz.diagnosis.measured.levels import LevelDependence
    from frf_ipz.frf import FrfLabel

MOST_MODES = 6  # in the picture; the table has them all
SYMBOLS = ("circle", "square", "diamond", "cross", "triangle-up", "x", "star")


def level_pictures(
    levels: LevelDependence | None, measured: Sequence[FrfLabel], band_hz: tuple[float, float]
) -> list[Block]:
    """Draw what changes with the level of the blows.

    Parameters
    ----------
    levels : LevelDependence, optional
        Weak beside strong blows.
    measured : sequence of FrfLabel
        All FRFs of the run, by whose numbers the page shows and hides them.
    band_hz : pair of float
        What is shown at first.

    Returns
    -------
    list of Picture
        Empty where there is one level only.
    """
    if levels is None or not levels.labels:
        return []
    return [_frfs(levels, measured, band_hz), *([_modes(levels.modes)] if len(levels.modes) else [])]


def _frfs(levels: LevelDependence, measured: Sequence[FrfLabel], band_hz: tuple[float, float]) -> Picture:
    places = {(label.output_dof, label.input_dof, label.quantity): place for place, label in enumerate(measured)}
    traces: list[Trace] = []
    for row, label in enumerate(levels.labels):
        place = places.get((label.output_dof, label.input_dof, label.quantity), row)
        traces += _weak_and_strong(levels, row, place)
    difference = np.linalg.norm(levels.strong - levels.weak) / max(np.linalg.norm(levels.strong), np.finfo(float).tiny)
    low, high = float(levels.weak_N.min()), float(levels.strong_N.max())
    return Picture(
        name="levels",
        title="FRFs of weak blows (dashed) and of strong blows (solid)",
        alt=f"Magnitude of {counted(len(levels.labels), 'FRF')} from the weaker and from the stronger half of the "
        f"blows, {number(low, 3)} to {number(high, 3)} N on average; they differ by {percent(float(difference), 2)}.",
        traces=tuple(traces),
        layout=panels(frequency_axis(*band_hz), Axis(title=magnitude_title(levels.labels), scale="log")),
        note=f"Each half is averaged by itself; the two differ by {percent(float(difference), 2)} of their norm. Of a "
        "linear structure the curves fall onto each other, but for noise.",
        height_px=420,
        is_over_frequency=True,
    )


def _weak_and_strong(levels: LevelDependence, row: int, place: int) -> list[Trace]:
    label, colour = levels.labels[row], colour_of(place)
    tiny = np.finfo(float).tiny
    weak, strong = (np.maximum(values[:, row], tiny) for values in (levels.weak, levels.strong))
    kept = thin(levels.frequency_hz, [np.log10(weak), np.log10(strong)], bins_for(len(levels.labels)) // 2)
    x, group = levels.frequency_hz[kept], {"meta": {"frf": place}, "legendgroup": str(label)}
    hover = f"%{{x:.6g}} Hz: %{{y:.4g}} {label.unit}"
    named = (
        f"{label} strong, {number(float(levels.strong_N[row]), 3)} N",
        f"weak, {number(float(levels.weak_N[row]), 3)} N",
    )
    return [
        line(x, strong[kept], named[0], colour, hover=hover, **group),
        line(x, weak[kept], named[1], colour, hover=hover, dash="dash", width=1.2, **group),
    ]


def _modes(modes: pd.DataFrame) -> Picture:
    traces: list[Trace] = []
    groups = _clear_ones(modes)
    for place, rows in enumerate(groups):
        traces += _mode(rows, place)
    limits = [float(modes["level_N"].min()), float(modes["level_N"].max())]
    wide = [0.9 * limits[0], 1.1 * limits[1]]
    x = {"title": {"text": "Largest force of the blow, N"}, "type": "log", "range": np.log10(wide).tolist()}
    return Picture(
        name="level-modes",
        title="Frequency and damping of each mode against the level of the blow, with 95 % bars",
        alt=f"Change of frequency and damping ratio of {counted(len(groups), 'mode')} over the peak force of "
        f"single blows, {number(limits[0], 3)} to {number(limits[1], 3)} N.",
        traces=tuple(traces),
        layout=panels(x, Axis(title="Change of frequency, %"), Axis(title="Damping ratio, %", scale="log")),
        note="From the FRF of each single blow, in the sensor that shows the mode best; the change is that from the "
        "strongest blow. A line that leaves the level by more than its bars is a mode that is not linear. "
        "A mode that a single blow shows on a few lines only, or not by itself, is left out.",
        table=_table(modes),
        height_px=460,
    )


def _clear_ones(modes: pd.DataFrame) -> list[pd.DataFrame]:
    """Of each mode the FRF with the most blows, and of many modes those that are known best, by frequency."""
    best = []
    for _, of_mode in modes.groupby("mode"):
        groups = [rows.sort_values("level_N") for _, rows in of_mode.groupby("frf")]
        best.append(max(groups, key=lambda rows: (len(rows), -_unsure(rows))))
    best = [rows for rows in best if len(rows) > 1]
    best = sorted(best, key=lambda rows: (-len(rows), _unsure(rows)))[:MOST_MODES]
    return sorted(best, key=lambda rows: float(rows["frequency_hz"].iloc[-1]))


def _unsure(rows: pd.DataFrame) -> float:
    return float((rows["frequency_std_hz"] / rows["frequency_hz"]).max())


def _mode(rows: pd.DataFrame, place: int) -> list[Trace]:
    level, hertz = rows["level_N"].to_numpy(float), rows["frequency_hz"].to_numpy(float)
    deviation = Q95 * rows["frequency_std_hz"].to_numpy(float)
    name = f"mode {int(rows['mode'].iloc[0]) + 1}, {number(float(hertz[-1]), 4)} Hz, {rows['frf'].iloc[0]}"
    style: Trace = {
        "mode": "lines+markers",
        "marker": {"symbol": SYMBOLS[place % len(SYMBOLS)], "size": 8, "color": colour_of(place)},
        "legendgroup": name,
        "dash": dash_of(place),
        "width": 1.1,
    }
    change, damping = 100 * (hertz / hertz[-1] - 1), 100 * rows["damping_ratio"].to_numpy(float)
    bars = 100 * deviation / hertz, 100 * Q95 * rows["damping_ratio_std"].to_numpy(float)
    texts = [f"{record}: {value:.6g} Hz" for record, value in zip(rows["record"], hertz, strict=True)]
    hover = "%{text}, %{x:.4g} N: "
    more: Trace = {**style, "text": texts}
    return [
        line(level, change, name, colour_of(place), hover=hover + "%{y:.3g} %", error_y=_bars(bars[0]), **more),
        line(
            level,
            damping,
            name,
            colour_of(place),
            hover=hover + "damping %{y:.4g} %",
            error_y=_bars(bars[1]),
            yaxis="y2",
            showlegend=False,
            **more,
        ),
    ]


def _bars(size: np.ndarray) -> Trace:
    return {"type": "data", "array": size, "thickness": 1.2, "width": 3}


def _table(modes: pd.DataFrame) -> Table:
    rows = [
        [
            str(int(row["mode"]) + 1),
            row["frf"],
            row["record"],
            number(row["level_N"]),
            with_error(row["frequency_hz"], row["frequency_std_hz"]),
            with_error(100 * row["damping_ratio"], 100 * row["damping_ratio_std"]),
        ]
        for row in modes.sort_values(["mode", "frf", "level_N"]).to_dict("records")
    ]
    columns = ("mode", "FRF (sensor / excitation)", "record", "peak force, N", "frequency, Hz", "damping ratio, %")
    return Table(caption="Modes of single blows", columns=columns, rows=rows)
