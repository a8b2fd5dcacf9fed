"""Updating: targets before and after, convergence, and what changed where."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import eigh

from frf_ipz.plotting.projection import project
from frf_ipz.plotting.targets import Target
from frf_ipz.report.picture import Axis, Picture, Trace, line, markers, panels
from frf_ipz.report.section import Section
from frf_ipz.report.table import Table
from frf_ipz.report.wording import counted, number, percent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import FloatArray, IntArray
    from frf_ipz.report.contents import RunContents
    from frf_ipz.structure import Geometry, ReducedModel
    from frf_ipz.updating.updated_model import UpdatedModel

PART = re.compile(r"stiffness of (?:element|spring|group) (\S+)(?: to (\S+))?")
MOST_MODES = 30
BLUE_TO_ORANGE = [[0.0, "#0072b2"], [0.5, "#f2f2f2"], [1.0, "#d55e00"]]
FEW_STEPS = 20  # iterations that are each named on the axis
MOST_NAMES = 30  # of targets written under the axis
MOST_PLACES = 400  # drawn along the structure
STIFF = 0.01  # of the largest flexibility: at places below, a ratio says nothing
LEAST_EIGENVALUE = 1e-9  # of the largest one: a rigid-body mode has no stiffness to change


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
    pictures += [*_of_parts(updated, run.geometry), *_of_flexibility(run, updated), _of_modes(updated)]
    lead = f"Method {updated.method}: {updated.status.value}. {counted(len(updated.history), 'iteration')}."
    reduced = run.reduced
    return Section(
        anchor="updating",
        title="Updating",
        lead=lead,
        blocks=tuple(pictures),
        notes=(*[f"Cannot be met: {text}" for text in updated.unmet], *updated.warnings),
        choices=() if reduced is None else reduced.choices,
    )


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
            percent(row.after),
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


def _of_parts(updated: UpdatedModel, geometry: Geometry | None) -> list[Picture]:
    """Draw the factors on the stiffness of named parts, where the method has such parameters."""
    columns = [(name, match) for name in updated.history.columns if (match := PART.fullmatch(str(name)))]
    values = updated.history[[name for name, _ in columns]].to_numpy(float) if columns else np.zeros((0, 0))
    known = values[np.isfinite(values).all(axis=1)] if values.size else values
    if not len(known):
        return []
    change = 100 * np.expm1(known[-1])
    names = [str(name).removeprefix("stiffness of ") for name, _ in columns]
    x, title = _positions([match for _, match in columns], geometry)
    rows = [[name, f"{value:+.3g} %"] for name, value in zip(names, change, strict=True)]
    picture = Picture(
        name="change",
        title="Change of stiffness along the structure",
        alt=f"Change of the stiffness of {counted(len(change), 'part')}: from {number(float(change.min()), 3)} % to "
        f"{number(float(change.max()), 3)} %.",
        traces=(
            {
                **line(x, change, "change", "@updated", hover="%{text}: %{y:+.3g} %", text=names),
                "mode": "lines+markers",
            },
        ),
        layout=panels({"title": {"text": title}}, Axis(title="Change of stiffness, %", options={"zeroline": True})),
        note="The smallest change that meets the targets, spread as the prior allows: a hint where the model is off, "
        "no diagnosis of what is wrong there.",
        table=Table(caption="Change of stiffness", columns=("part", "change"), rows=rows, file="parameters.parquet"),
        height_px=320,
    )
    return [picture]


def _positions(matches: Sequence[re.Match[str]], geometry: Geometry | None) -> tuple[FloatArray, str]:
    """Middle of each part along the longest extent where parts are the elements of a line, else their number."""
    count = np.arange(1.0, len(matches) + 1)
    if geometry is None or not all(match[1].isdigit() for match in matches):
        return count, "Part"
    place = {int(node): row for row, node in enumerate(geometry.nodes)}
    ends = np.array([(int(match[1]), int(match[2] or match[1]) + 1) for match in matches])
    axis = int(np.argmax(np.ptp(geometry.coordinates_m, axis=0)))
    if not {int(node) for node in ends.ravel()} <= set(place):
        return count, "Part"
    rows = np.vectorize(place.__getitem__)(ends)
    return geometry.coordinates_m[rows, axis].mean(axis=1), "Position, m"


def _of_flexibility(run: RunContents, updated: UpdatedModel) -> list[Picture]:
    """Draw how much further every place gives way to a force at rest than the nominal model says."""
    frfs, geometry = run.frfs, run.geometry
    if geometry is None or frfs is None:
        return []
    directions = {dof.direction for dof in (*frfs.output_dofs, *frfs.input_dofs)}
    place = {int(node): row for row, node in enumerate(geometry.nodes)}
    dofs = enumerate(updated.nominal.expanded_dofs)
    rows = np.array([row for row, dof in dofs if dof.direction in directions and dof.node in place], int)
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, MOST_PLACES).astype(int))] if len(rows) else rows
    before, after = (_flexibility(model, rows) for model in (updated.nominal, updated.model))
    moving = before > STIFF * before.max(initial=0.0)
    rows, change = rows[moving], 100 * (after[moving] / before[moving] - 1)
    if len(rows) < 2:
        return []
    names = [updated.nominal.expanded_dofs[row].name for row in rows]
    positions = project(geometry.coordinates_m)[[place[updated.nominal.expanded_dofs[row].node] for row in rows]]
    extremes = f"from {number(float(change.min()), 3)} to {number(float(change.max()), 3)} %"
    is_line = not np.ptp(positions[:, 1])
    traces, layout = _along(positions, change, names) if is_line else _over(positions, change, names)
    return [
        Picture(
            name="flexibility",
            title="Change along the structure: how much further each place gives way to a force on it",
            alt=f"Change of the static flexibility at {counted(len(rows), 'place')}: {extremes}.",
            traces=(traces,),
            layout=layout,
            note="Updated over nominal model, without motions as a rigid body. The smallest change that meets the "
            "targets: a hint where the model is off, no diagnosis of what is wrong there.",
            height_px=320 if is_line else 430,
        )
    ]


def _along(positions: FloatArray, change: FloatArray, names: list[str]) -> tuple[Trace, dict[str, Any]]:
    """Draw a structure that is a line: change over position."""
    points = markers(positions[:, 0], change, "change", "@updated", size=6, text=names, hover="%{text}: %{y:+.3g} %")
    return points, panels({"title": {"text": "Position, m"}}, Axis(title="Change of flexibility, %"))


def _over(positions: FloatArray, change: FloatArray, names: list[str]) -> tuple[Trace, dict[str, Any]]:
    """Draw any other structure: places coloured by the change."""
    largest = max(float(np.abs(change).max()), np.finfo(float).tiny)
    hover = "%{text}: %{customdata:+.3g} %"
    points = markers(positions[:, 0], positions[:, 1], "change", "@updated", text=names, customdata=change, hover=hover)
    scale = {"title": {"text": "change, %"}, "x": 0, "xanchor": "right", "thickness": 14}
    points["marker"] = {"color": change, "cmin": -largest, "cmax": largest, "colorscale": BLUE_TO_ORANGE, "size": 11}
    points["marker"] |= {"colorbar": scale, "line": {"width": 0.8, "color": "@muted"}}
    bare = {"showgrid": False, "zeroline": False, "showline": False, "ticks": "", "showticklabels": False}
    return points, {"xaxis": bare, "yaxis": {**bare, "scaleanchor": "x"}}


def _flexibility(model: ReducedModel, rows: IntArray) -> FloatArray:
    """Give the static deflection under a unit force on the same place, (n_rows,), m/N."""
    values, shapes = eigh((model.stiffness + model.stiffness.T) / 2, model.mass)
    flexible = values > LEAST_EIGENVALUE * values[-1]
    return np.asarray(((model.expansion[rows] @ shapes[:, flexible]) ** 2 / values[flexible]).sum(axis=1))


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
