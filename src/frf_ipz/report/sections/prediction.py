"""Predicted FRFs at the points of interest: nominal, updated with its band, and measured where it was."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.wording import listed, number
from frf_ipz.prediction.agreement import compare_frfs
from frf_ipz.prediction.reference import measured_at
from frf_ipz.report.section import Block, Choice, Section, Table, run_figures
from frf_ipz.runs.figures import deviation_of
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray
    from frf_ipz.prediction.prediction import Prediction
    from frf_ipz.runs.results import Results


def build(run: Results) -> Section | None:
    """Give the section on the points of interest.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    Section or None
        None where nothing is predicted.
    """
    prediction = run.prediction
    if prediction is None or not prediction.labels:
        return None
    known = measured_at(prediction, run.reference) or measured_at(prediction, run.frfs)
    points = listed([str(dof) for dof in run.points])
    quantity = "quantity that was measured" if run.frfs is not None else "quantity that the test names"
    lead = f"{counted(len(prediction.labels), 'FRF')} predicted at {points}, in the {quantity}."
    if not known:
        lead += " Nothing was measured there."
    lead += f" {'The first' if len(prediction.labels) > 1 else 'It'} is drawn on the first screen."
    with_causes = run.with_causes if _counts(run) else None
    return Section(
        anchor="prediction",
        title="Points of interest",
        lead=lead,
        blocks=(*_others(run), _table(prediction, known, with_causes)),
        notes=prediction.warnings,
    )


def _others(run: Results) -> list[Block]:
    """Show the FRFs that are not on the first screen: the only one, or any by choice."""
    others = run_figures(run, "prediction")[1:]
    if len(others) < 2:
        return [*others]
    names = [str(label) for label in run.prediction.labels[1:]] if run.prediction is not None else []
    pictures = {name: figure.picture for name, figure in zip(names, others, strict=False)}
    return [Choice(name="other-predictions", label="FRF", pictures=pictures)]


def _counts(run: Results) -> bool:
    """Tell whether the last run has looked at what the causes do: those of an older one may still be kept."""
    deviation = deviation_of(run)
    return deviation is not None and bool(np.isfinite(deviation.with_causes_db))


def _table(prediction: Prediction, known: dict[int, ComplexArray], with_causes: Prediction | None) -> Table:
    rows = []
    moved = compare_frfs(prediction.nominal, prediction.values)
    low, high = prediction.magnitude_low, prediction.magnitude_high
    for frf, label in enumerate(prediction.labels):
        good = (low[:, frf] > 0) & np.isfinite(high[:, frf])
        width = 10 * np.log10(high[good, frf] / low[good, frf]) if good.any() else np.array([np.nan])
        cells = [str(label), number(float(prediction.half_width_db[frf]), 3), number(float(width.max()), 3)]
        cells.append(number(float(moved.median_db[frf]), 3))
        rows.append(cells + _errors(prediction, frf, known.get(frf), with_causes))
    columns = ["FRF (output / input)", "band ± dB, median", "band ± dB, largest", "moved by the update, dB (median)"]
    columns += (
        ["error before, dB", "error after, dB", "correlation of shape, after", "of amplitude, after"] if known else []
    )
    columns += ["error with the causes, dB"] if known and with_causes is not None else []
    return Table(
        caption=f"Predicted FRFs, {prediction.band_text}; errors are medians",
        columns=tuple(columns),
        rows=_trimmed(rows, len(columns)),
        file="poi_frf.parquet",
    )


def _errors(
    prediction: Prediction, frf: int, measured: ComplexArray | None, with_causes: Prediction | None
) -> list[str]:
    if measured is None:
        return ["–"] * 5
    good = np.isfinite(measured)
    truth = measured[good, None]
    before, after = (
        compare_frfs(truth, values[good, frf : frf + 1]) for values in (prediction.nominal, prediction.values)
    )
    decibels = [number(float(figure), 3) for figure in (before.median_db[0], after.median_db[0])]
    best = None if with_causes is None else compare_frfs(truth, with_causes.values[good, frf : frf + 1])
    last = [] if best is None else [number(float(best.median_db[0]), 3)]
    return [*decibels, f"{after.shape[0]:.4f}", f"{after.amplitude[0]:.4f}", *last]


def _trimmed(rows: list[list[str]], count: int) -> list[list[str]]:
    return [row[:count] for row in rows]
