"""Updating: targets before and after, convergence, and what changed where."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.wording import number, percent, small_percent
from frf_ipz.report.section import Section, Table, run_figures
from frf_ipz.runs.picture_data import changed_parts, update_targets
from frf_ipz.updating.along_structure import notable_changes
from frf_ipz.updating.targets import Target
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from frf_ipz.runs.results import Results
    from frf_ipz.updating.updated_model import UpdatedModel

SCALE = "std: "  # how columns of the history begin that say how wide a part of the prior is
MOST_PARTS = 5  # named one by one


def build(run: Results) -> Section | None:
    """Give the section on the update.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    Section or None
        None without an update.
    """
    updated = run.updated_model
    if updated is None:
        return None
    rows, parts = update_targets(run), changed_parts(run)
    tables = {"targets": _target_table(rows)} if rows else {}
    tables |= {"convergence": _iteration_table(updated)} if len(updated.history) else {}
    tables |= {"change": _part_table(parts)} if len(parts) else {}
    masses = (_mass_table(updated.masses),) if len(updated.masses) else ()
    change = "change" if len(parts) else "flexibility"
    figures = run_figures(run, "targets", "convergence", change, "modal-change", tables=tables)
    lead = f"Method {updated.method}: {updated.status.value}. {counted(len(updated.history), 'iteration')}."
    reduced = run.reduced_model
    return Section(
        anchor="updating",
        title="Updating",
        lead=lead,
        blocks=(*figures, *masses),
        notes=(*[f"Cannot be met: {text}" for text in updated.unmet], *_notable(parts), *updated.warnings),
        choices=(*(() if reduced is None else reduced.choices), *_regularisation(updated)),
    )


def _notable(parts: pd.DataFrame) -> list[str]:
    changes = notable_changes(parts) if len(parts) else ()
    n_unnamed = len(changes) - MOST_PARTS
    rest = [f"and {counted(n_unnamed, 'further part')} of the structure"] if n_unnamed > 0 else []
    return [*changes[:MOST_PARTS], *rest]


def _target_table(rows: Sequence[Target]) -> Table:
    cells = [
        [
            row.name,
            number(row.measured_hz, 6),
            number(row.before_hz, 6),
            number(row.after_hz, 6),
            percent(row.before),
            small_percent(row.after).replace(" ", "\u00a0"),
            *[number(100 * value, 3) for value in (row.measured_damping, row.before_damping, row.after_damping)],
        ]
        for row in rows
    ]
    damping = tuple(f"damping {name}, %" for name in ("measured", "before", "after"))
    columns = ("target", "measured, Hz", "before, Hz", "after, Hz", "error before", "error after", *damping)
    return Table(caption="Targets of the update", columns=columns, rows=cells, file="pairs.parquet")


def _iteration_table(updated: UpdatedModel) -> Table:
    rows = [
        [str(row["phase"]), number(row["iteration"]), number(row["misfit"]), number(row["step"])]
        for row in updated.history[["phase", "iteration", "misfit", "step"]].to_dict("records")
    ]
    columns = ("phase", "iteration", "misfit", "step")
    return Table(caption="Iterations", columns=columns, rows=rows, file="parameters.parquet")


def _part_table(parts: pd.DataFrame) -> Table:
    columns = ("stiffness_ratio", "stiffness_ratio_low", "stiffness_ratio_high")
    values = (100 * (parts[name].to_numpy(float) - 1) for name in columns)
    rows = [
        [name, *[f"{value:+.3g} %" for value in row]]
        for name, *row in zip(parts["name"].astype(str), *values, strict=True)
    ]
    return Table(caption="Change of stiffness", columns=("part", "change", "low", "high"), rows=rows)


def _mass_table(masses: pd.DataFrame) -> Table:
    rows = [
        [f"node {node}", *[f"{value:+.2g} kg" for value in kilograms]]
        for node, *kilograms in masses[["node", "mass_kg", "mass_kg_low", "mass_kg_high"]].itertuples(index=False)
    ]
    return Table(
        caption="Masses that the model lacks, or has too much of", columns=("at", "mass", "low", "high"), rows=rows
    )


def _regularisation(updated: UpdatedModel) -> list[str]:
    """How far each phase was free to go, as the data themselves ask for: one text a phase."""
    texts = []
    scales = [name for name in updated.history.columns if str(name).startswith(SCALE)]
    for phase, rows in updated.history.groupby("phase", sort=False) if scales else ():
        last = {str(name): float(rows[name].iloc[-1]) for name in scales}
        values = ", ".join(
            f"{name.removeprefix(SCALE)} {number(value)}" for name, value in last.items() if np.isfinite(value)
        )
        if values:
            texts.append(
                f"regularisation of the {phase} by likelihood and discrepancy principle, standard deviations: {values}"
            )
    return texts
