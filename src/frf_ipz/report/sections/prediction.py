"""Predicted FRFs at the points of interest: nominal, updated with its band, and measured where it was."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.curves import LEAST, magnitude_title, phase_degrees
from frf_ipz.prediction.agreement import compare_frfs
from frf_ipz.report.picture import Axis, Picture, Trace, band, frequency_axis, line, panels
from frf_ipz.report.reference import measured_at
from frf_ipz.report.section import Section, Table
from frf_ipz.report.sections.frfs import PHASE_AXIS
from frf_ipz.report.thinning import bins_for, thin
from frf_ipz.report.wording import counted, listed, number

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
    from frf_ipz.prediction.prediction import Prediction
    from frf_ipz.report.contents import RunContents

MOST_PICTURES = 8  # predicted FRFs drawn; all stand in the file


def build(run: RunContents) -> Section | None:
    """Give the section on the points of interest.

    Parameters
    ----------
    run : RunContents
        What the run holds.

    Returns
    -------
    Section or None
        None where nothing is predicted.
    """
    prediction = run.prediction
    if prediction is None or not prediction.labels:
        return None
    known = {**measured_at(prediction, run.frfs), **measured_at(prediction, run.reference)}
    points = listed([str(dof) for dof in run.points])
    lead = f"{counted(len(prediction.labels), 'FRF')} predicted at {points}, in the quantity that was measured."
    if not known:
        lead += " Nothing was measured there."
    pictures = [
        _picture(prediction, place, known.get(place)) for place in range(len(prediction.labels))[:MOST_PICTURES]
    ]
    return Section(
        anchor="prediction",
        title="Points of interest",
        lead=lead,
        blocks=(*pictures, _table(prediction, known)),
        notes=prediction.warnings,
    )


def _picture(prediction: Prediction, place: int, measured: ComplexArray | None) -> Picture:
    label, frequency = prediction.labels[place], prediction.frequency_hz
    values, nominal = prediction.values[:, place], prediction.nominal[:, place]
    lines = thin(frequency, [_log(values), _log(nominal)], bins_for(4 * len(prediction.labels)))
    x = frequency[lines]
    traces = _band(prediction, place, lines)
    hover = f"%{{x:.6g}} Hz: %{{y:.4g}} {label.unit}"
    if measured is not None:
        traces += _measured(frequency, measured, hover)
    styles: tuple[tuple[str, ComplexArray, Trace], ...] = (
        ("nominal model", nominal, {"colour": "@nominal", "dash": "dash", "width": 1.4}),
        ("updated model", values, {"colour": "@updated", "dash": "solid", "width": 2}),
    )
    for name, curve, style in styles:
        traces.append(line(x, np.abs(curve[lines]), name, hover=hover, **style))
        below = {**style, "showlegend": False, "legendgroup": name, "yaxis": "y2"}
        traces.append(line(x, phase_degrees(curve[lines]), name, hover="%{x:.6g} Hz: %{y:.1f}°", **below))
    axes = Axis(title=magnitude_title([label]), share=2.2, scale="log"), Axis(title="Phase, °", options=PHASE_AXIS)
    return Picture(
        name=f"prediction-{place}",
        title=f"{label}: response at {label.output_dof} to a force at {label.input_dof}",
        alt=f"Magnitude and phase of the predicted FRF {label}: nominal model dashed, updated model solid with its "
        "90 % band" + (", measurement as a broad grey line." if measured is not None else "."),
        traces=tuple(traces),
        layout=panels(frequency_axis(float(frequency[0]), float(frequency[-1])), *axes),
        note="The band is what the targets and the prior leave open (90 %).",
        height_px=500,
        is_over_frequency=True,
    )


def _band(prediction: Prediction, place: int, lines: IntArray) -> list[Trace]:
    low, high = prediction.magnitude_low[lines, place], prediction.magnitude_high[lines, place]
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        return []
    floor = LEAST * np.abs(prediction.values[lines, place])
    return band(prediction.frequency_hz[lines], (np.maximum(low, floor), high), "90 % band", "@updated/0.28")


def _measured(frequency: FloatArray, measured: ComplexArray, hover: str) -> list[Trace]:
    good = np.isfinite(measured)
    lines = np.flatnonzero(good)[thin(frequency[good], [_log(measured[good])], bins_for(4) // 2)]
    x, values, style = frequency[lines], measured[lines], {"width": 5, "legendgroup": "measured"}
    below: Trace = {"yaxis": "y2", "showlegend": False, "hover": "%{x:.6g} Hz: %{y:.1f}°", **style}
    return [
        line(x, np.abs(values), "measured", "@reference/0.35", hover=hover, **style),
        line(x, phase_degrees(values), "measured", "@reference/0.35", **below),
    ]


def _table(prediction: Prediction, known: dict[int, ComplexArray]) -> Table:
    rows = []
    moved = compare_frfs(prediction.nominal, prediction.values)
    low, high = prediction.magnitude_low, prediction.magnitude_high
    for place, label in enumerate(prediction.labels):
        good = (low[:, place] > 0) & np.isfinite(high[:, place])
        width = 10 * np.log10(high[good, place] / low[good, place]) if good.any() else np.array([np.nan])
        cells = [str(label), number(float(np.median(width)), 3), number(float(width.max()), 3)]
        cells.append(number(float(moved.median_db[place]), 3))
        rows.append(cells + _errors(prediction, place, known.get(place)))
    columns = ["FRF (output / input)", "band ± dB, median", "band ± dB, largest", "moved by the update, dB (median)"]
    columns += (
        ["error before, dB", "error after, dB", "correlation of shape, after", "of amplitude, after"] if known else []
    )
    return Table(
        caption="Predicted FRFs", columns=tuple(columns), rows=_trimmed(rows, len(columns)), file="poi_frf.parquet"
    )


def _errors(prediction: Prediction, place: int, measured: ComplexArray | None) -> list[str]:
    if measured is None:
        return ["–"] * 4
    good = np.isfinite(measured)
    truth = measured[good, None]
    before, after = (
        compare_frfs(truth, values[good, place : place + 1]) for values in (prediction.nominal, prediction.values)
    )
    decibels = [number(float(figure), 3) for figure in (before.median_db[0], after.median_db[0])]
    return [*decibels, f"{after.shape[0]:.4f}", f"{after.amplitude[0]:.4f}"]


def _trimmed(rows: list[list[str]], count: int) -> list[list[str]]:
    return [row[:count] for row in rows]


def _log(values: ComplexArray) -> FloatArray:
    return np.log10(np.maximum(np.abs(values), np.finfo(float).tiny))
