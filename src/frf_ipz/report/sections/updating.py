"""Updating: targets before and after, convergence, and what changed where."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import eigh

from frf_ipz.plotting.targets import Target
from frf_ipz.report.along_structure import LEAST_EIGENVALUE, picture_of_parts, pictures_of_flexibility
from frf_ipz.report.picture import Axis, Picture, Trace, line, markers, panels
from frf_ipz.report.section import Section, Table
from frf_ipz.report.wording import counted, number, percent, small_percent
from frf_ipz.updating.along_structure import notable_changes

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from frf_ipz.report.contents import RunContents
    from frf_ipz.updating.updated_model import UpdatedModel

SCALE = "std: "  # how columns of the history begin that say how wide a part of the prior is
MOST_MODES = 30
MOST_PARTS = 5  # named one by one
FEW_STEPS = 20  # iterations that are each named on the axis
MOST_NAMES = 30  # of targets written under the axis


def build(run: RunContents) -> Section | None:
    """Give the section on the update.

    Parameters
    ----------
    run : RunContents
        What the run holds.

    Returns
    -------
    Section or None
        None without an update.
    """
    updated = run.updated
    if updated is None:
        return None
    rows = run.targets()
    pictures = [_targets(rows)] if rows else []
    pictures += [_convergence(updated)] if len(updated.history) > 1 else []
    parts = run.parts
    pictures += [picture_of_parts(parts)] if len(parts) else pictures_of_flexibility(run, updated)
    pictures.append(_of_modes(updated))
    lead = f"Method {updated.method}: {updated.status.value}. {counted(len(updated.history), 'iteration')}."
    reduced = run.reduced
    return Section(
        anchor="updating",
        title="Updating",
        lead=lead,
        blocks=tuple(pictures),
        notes=(*[f"Cannot be met: {text}" for text in updated.unmet], *_notable(parts), *updated.warnings),
        choices=(*(() if reduced is None else reduced.choices), *_regularisation(updated)),
    )


def _notable(parts: pd.DataFrame) -> list[str]:
    changes = notable_changes(parts) if len(parts) else ()
    n_unnamed = len(changes) - MOST_PARTS
    rest = [f"and {counted(n_unnamed, 'further part')} of the structure"] if n_unnamed > 0 else []
    return [*changes[:MOST_PARTS], *rest]


def _targets(rows: Sequence[Target]) -> Picture:
    x = np.arange(1, len(rows) + 1)
    traces: list[Trace] = []
    texts = [f"{row.name} at {number(row.measured_hz, 6)} Hz" for row in rows]
    for name, colour, symbol, values in (
        ("before", "@nominal", "circle-open", [row.before for row in rows]),
        ("after", "@updated", "circle", [row.after for row in rows]),
    ):
        errors = 100 * np.abs(np.array(values))
        hover = "%{text}: %{y:.4g} % off"
        traces.append(markers(x, np.maximum(errors, 1e-6), name, colour, symbol=symbol, text=texts, hover=hover))
    step = -(-len(rows) // MOST_NAMES)
    axis = {
        "title": {"text": "Target"},
        "tickvals": x[::step].tolist(),
        "ticktext": [_short(row) for row in rows[::step]],
    }
    axis["tickangle"] = -40
    return Picture(
        name="targets",
        title="Frequency errors of the targets, before and after",
        alt=f"Relative frequency errors of {counted(len(rows), 'target')} on a logarithmic axis: largest before "
        f"{percent(max(abs(row.before) for row in rows), 2)}, after {percent(max(abs(row.after) for row in rows), 2)}.",
        traces=tuple(traces),
        layout=panels(axis, Axis(title="Error of the frequency, %", scale="log")),
        table=_target_table(rows),
        height_px=400,
    )


def _short(row: Target) -> str:
    return f"{row.kind} {number(row.measured_hz)} Hz"


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


def _convergence(updated: UpdatedModel) -> Picture:
    history = updated.history
    place = np.arange(1, len(history) + 1)
    misfit = history["misfit"].to_numpy(float)
    phases = history["phase"].astype(str).to_numpy()
    traces = []
    for rank, phase in enumerate(dict.fromkeys(phases)):
        here = phases == phase
        style: dict[str, Any] = {"hover": "iteration %{x}: %{y:.4g}", "mode": "lines+markers"}
        style["marker"] = {"symbol": ["circle", "square", "diamond"][rank % 3], "size": 6}
        traces.append(line(place[here], misfit[here], phase, f"@c{rank}", **style))
    scale = "log" if np.all(misfit > 0) else "linear"
    steps = {"dtick": 1} if len(history) <= FEW_STEPS else {}
    return Picture(
        name="convergence",
        title="Convergence",
        alt=f"Misfit over {counted(len(history), 'iteration')}: from {number(misfit[0])} to {number(misfit[-1])}.",
        traces=tuple(traces),
        layout=panels({"title": {"text": "Iteration"}, **steps}, Axis(title="Misfit of the targets", scale=scale)),
        table=Table(
            caption="Iterations",
            columns=("phase", "iteration", "misfit", "step"),
            rows=[
                [str(row["phase"]), number(row["iteration"]), number(row["misfit"]), number(row["step"])]
                for row in history[["phase", "iteration", "misfit", "step"]].to_dict("records")
            ],
            file="parameters.parquet",
        ),
        height_px=320,
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


def _of_modes(updated: UpdatedModel) -> Picture:
    values, shapes = eigh(updated.nominal.stiffness, updated.nominal.mass)
    flexible = values > LEAST_EIGENVALUE * values[-1]
    values, shapes = values[flexible][:MOST_MODES], shapes[:, flexible][:, :MOST_MODES]
    change = np.einsum("ik,ij,jk->k", shapes, updated.model.stiffness - updated.nominal.stiffness, shapes) / values
    hertz = np.sqrt(values) / (2 * np.pi)
    names = [f"{number(value)} Hz" for value in hertz]
    bars: Trace = {
        "type": "bar",
        "x": names,
        "y": 100 * change,
        "name": "change",
        "marker": {"color": "@updated"},
        "hovertemplate": "mode at %{x}: %{y:+.3g} %<extra></extra>",
    }
    return Picture(
        name="modal-change",
        title="Change of the stiffness that each nominal mode sees",
        alt="Bars: " + ", ".join(f"{name} {100 * value:+.2g} %" for name, value in zip(names, change, strict=True)),
        traces=(bars,),
        layout=panels({"title": {"text": "Nominal mode"}, "type": "category"}, Axis(title="Change of stiffness, %")),
        height_px=300,
    )
