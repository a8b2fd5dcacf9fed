"""Pairing: every measured pole and zero against its counterpart in the model, with the reason."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.pairing.pairs import Pair, PairVerdict
from frf_ipz.plotting.poles import pair_name
from frf_ipz.plotting.wording import NOTHING, number, percent
from frf_ipz.rational import natural_frequency_hz
from frf_ipz.report.section import Section, Table, run_figures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.runs.results import Results


def build(run: Results) -> Section | None:
    """Give the section on the pairing.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    Section or None
        None without a model.
    """
    if run.pairs is None:
        return None
    rows = run.pairs.rows
    counts = [run.pairs.count(kind) for kind in ("pole", "zero")]
    lead = ". ".join(count.text for count in counts if count.measured)
    lead = f"{lead}." if lead else "There is nothing to pair."
    return Section(
        anchor="pairing",
        title="Pairing",
        lead=lead,
        blocks=(*run_figures(run, "pairs"), _table(run, rows)) if rows else (),
        notes=run.pairs.warnings,
    )


def _table(run: Results, rows: Sequence[Pair]) -> Table:
    cells = []
    for row in rows:
        measured, computed = _hertz(row.measured_value), _hertz(row.computed_value)
        has_number = (
            row.kind == "pole" or row.measured < 0 or run.fit is None or bool(run.fit.zeros.identifiable[row.measured])
        )
        cells.append(
            [
                pair_name(row, run.labels),
                number(measured, 6) if has_number else NOTHING,
                number(computed, 6),
                percent(computed / measured - 1),
                number(row.distance, 3),
                row.verdict.value,
                row.reason,
            ]
        )
    columns = ("root", "measured, Hz", "model, Hz", "difference", "distance", "verdict", "why")
    marked = frozenset(np.flatnonzero([row.verdict is not PairVerdict.PAIRED for row in rows]).tolist())
    return Table(caption="Pairs", columns=columns, rows=cells, marked=marked, file="pairs.parquet")


def _hertz(value: complex) -> float:
    return float(natural_frequency_hz(np.array(value)))
