"""Measured FRFs: magnitude with its band, phase, coherence."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.wording import number, percent
from frf_ipz.report.section import Section, Table, run_figures
from frf_ipz.runs.figures import median_coherence
from frf_ipz.runs.picture_data import fitted_lines
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from frf_ipz.arrays import IntArray
    from frf_ipz.frf import FrfSet
    from frf_ipz.runs.results import Results

ZOOM_HINT = "All pictures over frequency zoom together; 'FRFs' at the top chooses what they show."


def build(run: Results) -> Section | None:
    """Give the section on the measured FRFs.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    Section or None
        None where nothing was measured.
    """
    frfs = run.frfs
    if frfs is None:
        return None
    low, high = float(frfs.frequency_hz[0]), float(frfs.frequency_hz[-1])
    step = float(np.median(np.diff(frfs.frequency_hz))) if frfs.n_lines > 1 else 0.0
    text = f"{counted(frfs.n_frfs, 'FRF')} on {frfs.n_lines} lines from {number(low)} to {number(high)} Hz"
    window = ""
    if frfs.window_decay_1_s:
        window = (
            " Force and response share an exponential window: peaks look wider here than they are; the fit takes "
            "that back exactly."
        )
    lead = f"{text}, {number(step, 3)} Hz apart.{window}"
    table = _table(frfs, fitted_lines(run))
    estimate = run.estimate
    has_records = estimate is not None and len(estimate.records) > 0  # notes stand with them then
    return Section(
        anchor="frfs",
        title="FRFs",
        lead=lead,
        blocks=tuple(run_figures(run, "frfs", hints={"frf": ZOOM_HINT}, tables={"frf": table})),
        notes=() if estimate is None or has_records else estimate.warnings,
        choices=() if estimate is None or has_records else estimate.choices,
    )


def _table(frfs: FrfSet, lines: IntArray) -> Table:
    rows = []
    for frf, label in enumerate(frfs.labels):
        coherence, variance = frfs.coherence[lines, frf], frfs.variance[lines, frf]
        power = np.mean(np.abs(frfs.values[lines, frf]) ** 2)
        known = np.isfinite(variance)
        noise = np.sqrt(np.mean(variance[known]) / power) if known.any() and power > 0 else np.nan
        averages = str(int(frfs.averages[frf])) if frfs.averages[frf] else "–"
        rows.append(
            [
                str(label.output_dof),
                str(label.input_dof),
                label.quantity.value,
                label.unit,
                averages,
                median_coherence(coherence) or "–",
                percent(float(noise), 2),
            ]
        )
    columns = ("output", "input", "quantity", "unit", "averages", "median coherence", "noise, of the RMS value")
    low, high = (number(float(frfs.frequency_hz[line])) for line in (lines[0], lines[-1])) if len(lines) else ("–", "–")
    return Table(caption=f"Measured FRFs, {low} to {high} Hz", columns=columns, rows=rows, file="frf.parquet")
