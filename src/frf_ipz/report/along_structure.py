"""Where along the structure an update has changed the model: a line for beams, coloured points for the rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import eigh

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.plotting.projection import project
from frf_ipz.report.picture import Axis, Picture, Trace, band, line, markers, panels
from frf_ipz.report.section import Table
from frf_ipz.report.wording import counted, number

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.report.contents import RunContents
    from frf_ipz.structure import ReducedModel
    from frf_ipz.updating.updated_model import UpdatedModel

LEAST_EIGENVALUE = 1e-9  # of the largest one: a rigid-body mode has no stiffness to change
MOST_POINTS = 400  # drawn along the structure
STIFF = 0.01  # of the largest flexibility: at points below, a ratio says nothing
BLUE_TO_ORANGE = [[0.0, "#0072b2"], [0.5, "#f2f2f2"], [1.0, "#d55e00"]]
HINT = "The smallest change that meets the targets: a hint where the model is off, no diagnosis of what is wrong there."


def picture_of_parts(parts: pd.DataFrame) -> Picture:
    """Draw how much stiffer or softer every part of the FE model has become.

    Parameters
    ----------
    parts : DataFrame
        From `updating.along_structure.change_along_structure`.

    Returns
    -------
    Picture
        With the 90 % band, where there is one.
    """
    names = parts["name"].astype(str).tolist()
    columns = ("stiffness_ratio", "stiffness_ratio_low", "stiffness_ratio_high")
    change, low, high = (100 * (parts[name].to_numpy(float) - 1) for name in columns)
    positions = project(parts[["x_m", "y_m", "z_m"]].to_numpy(float))
    is_line = not np.ptp(positions[:, 1]) and bool(np.ptp(positions[:, 0]))
    if is_line:
        traces, layout = _line_of_parts(positions[:, 0], (low, high), change, names)
    else:
        points, layout = coloured(positions, change, names)
        traces = [points]
    rows = [
        [name, *[f"{value:+.3g} %" for value in values]] for name, *values in zip(names, change, low, high, strict=True)
    ]
    return Picture(
        name="change",
        title="Change of stiffness along the structure" + (", with its 90 % band" if np.isfinite(low).any() else ""),
        alt=f"Change of the stiffness of {counted(len(parts), 'part')}: from {number(float(change.min()), 3)} % to "
        f"{number(float(change.max()), 3)} %.",
        traces=tuple(traces),
        layout=layout,
        note=HINT,
        table=Table(caption="Change of stiffness", columns=("part", "change", "low", "high"), rows=rows),
        height_px=320 if is_line else 430,
    )


def _line_of_parts(
    x: FloatArray, limits: tuple[FloatArray, FloatArray], change: FloatArray, names: list[str]
) -> tuple[list[Trace], dict[str, Any]]:
    order = np.argsort(x, kind="stable")
    texts = [names[row] for row in order]
    curve = line(x[order], change[order], "change", "@updated", hover="%{text}: %{y:+.3g} %", text=texts)
    traces = [{**curve, "mode": "lines+markers", "marker": {"size": 4}}]
    if np.isfinite(limits[0]).all():
        traces = band(x[order], (limits[0][order], limits[1][order]), "90 % band", "@updated/0.25") + traces
    y = Axis(title="Change of stiffness, %", options={"zeroline": True})
    return traces, panels({"title": {"text": "Position, m"}}, y)


def coloured(positions: FloatArray, change: FloatArray, names: list[str]) -> tuple[Trace, dict[str, Any]]:
    """Draw points coloured by a change.

    Parameters
    ----------
    positions : (n, 2) array
        On the drawing, m.
    change : (n,) array
        Percent.
    names : list of str
        Of the points.

    Returns
    -------
    trace, layout : dict
        For plotly.
    """
    largest = max(float(np.abs(change).max()), np.finfo(float).tiny)
    hover = "%{text}: %{customdata:+.3g} %"
    points = markers(positions[:, 0], positions[:, 1], "change", "@updated", text=names, customdata=change, hover=hover)
    scale = {"title": {"text": "change, %"}, "x": 0, "xanchor": "right", "thickness": 14}
    points["marker"] = {"color": change, "cmin": -largest, "cmax": largest, "colorscale": BLUE_TO_ORANGE, "size": 11}
    points["marker"] |= {"colorbar": scale, "line": {"width": 0.8, "color": "@muted"}}
    bare = {"showgrid": False, "zeroline": False, "showline": False, "ticks": "", "showticklabels": False}
    return points, {"xaxis": bare, "yaxis": {**bare, "scaleanchor": "x"}}


def pictures_of_flexibility(run: RunContents, updated: UpdatedModel) -> list[Picture]:
    """Draw how much further every point yields to a static force than the nominal model says.

    Parameters
    ----------
    run : RunContents
        What the run holds.
    updated : UpdatedModel
        The update.

    Returns
    -------
    list of Picture
        None where the model has no positions.
    """
    frfs, geometry = run.frfs, run.geometry
    if geometry is None or frfs is None:
        return []
    directions = {dof.direction for dof in (*frfs.output_dofs, *frfs.input_dofs)}
    place = {int(node): row for row, node in enumerate(geometry.nodes)}
    dofs = enumerate(updated.nominal.expanded_dofs)
    rows = np.array([row for row, dof in dofs if dof.direction in directions and dof.node in place], int)
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, MOST_POINTS).astype(int))] if len(rows) else rows
    before, after = (_flexibility(model, rows) for model in (updated.nominal, updated.model))
    moving = before > STIFF * before.max(initial=0.0)
    rows, change = rows[moving], 100 * (after[moving] / before[moving] - 1)
    if len(rows) < 2:
        return []
    names = [updated.nominal.expanded_dofs[row].name for row in rows]
    positions = project(geometry.coordinates_m)[[place[updated.nominal.expanded_dofs[row].node] for row in rows]]
    extremes = f"from {number(float(change.min()), 3)} to {number(float(change.max()), 3)} %"
    is_line = not np.ptp(positions[:, 1])
    traces, layout = _along(positions, change, names) if is_line else coloured(positions, change, names)
    return [
        Picture(
            name="flexibility",
            title="Change of the flexibility at each point of the structure",
            alt=f"Change of the static flexibility at {counted(len(rows), 'point')}: {extremes}.",
            traces=(traces,),
            layout=layout,
            note=f"Updated over nominal model, without motions as a rigid body. {HINT}",
            height_px=320 if is_line else 430,
        )
    ]


def _along(positions: FloatArray, change: FloatArray, names: list[str]) -> tuple[Trace, dict[str, Any]]:
    """Draw a structure that is a line: change over position."""
    points = markers(positions[:, 0], change, "change", "@updated", size=6, text=names, hover="%{text}: %{y:+.3g} %")
    return points, panels({"title": {"text": "Position, m"}}, Axis(title="Change of flexibility, %"))


def _flexibility(model: ReducedModel, rows: IntArray) -> FloatArray:
    """Give the static deflection under a unit force at the same point, (n_rows,), m/N."""
    values, shapes = eigh((model.stiffness + model.stiffness.T) / 2, model.mass)
    flexible = values > LEAST_EIGENVALUE * values[-1]
    return np.asarray(((model.expansion[rows] @ shapes[:, flexible]) ** 2 / values[flexible]).sum(axis=1))
