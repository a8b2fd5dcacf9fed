"""Records: forces and responses as recorded, and what is wrong with which."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.plotting.wording import number, percent
from frf_ipz.report.section import Section, Table, run_figures
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Callable

    import pandas as pd

    from frf_ipz.runs.results import Results

LEGEND_HINT = "Click a name in the legend to hide or show a record. Drag to zoom."


def build(run: Results) -> Section | None:
    """Give the section on records and their quality.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    Section or None
        None for FRFs that were estimated elsewhere, whose notes stand with them; notes alone for modes.
    """
    estimate = run.estimate
    if estimate is None:
        return None
    if not len(estimate.records):
        if run.frfs is not None or not estimate.warnings:
            return None
        lead = "Modes that were identified elsewhere."
        return Section(anchor="recordings", title="Test", lead=lead, notes=estimate.warnings, choices=estimate.choices)
    records = estimate.records
    used = int(records["used"].astype(bool).sum())
    return Section(
        anchor="recordings",
        title="Records",
        lead=f"{counted(len(records), 'record')}, {used} used.",
        blocks=(
            *run_figures(run, "records", "responses", hints=dict.fromkeys(("records", "responses"), LEGEND_HINT)),
            _table(records),
        ),
        notes=estimate.warnings,
        choices=estimate.choices,
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
