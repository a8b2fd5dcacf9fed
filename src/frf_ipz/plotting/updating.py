"""Updating: targets before and after, convergence, and what changed where along the structure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigh

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.dofs import Dof
from frf_ipz.plotting.picture import Axis, Band, Bars, Layer, Line, Panel, Picture, Points, Role
from frf_ipz.plotting.projection import project
from frf_ipz.plotting.wording import number, percent
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from frf_ipz.frf import FrfLabel
    from frf_ipz.structure import Geometry, ReducedModel
    from frf_ipz.updating.targets import Target
    from frf_ipz.updating.updated_model import UpdatedModel

MOST_MODES = 30
MOST_NAMES = 30  # of targets written under the axis
MOST_POINTS = 400  # drawn along the structure
FEW_STEPS = 20  # iterations that are each named on the axis
LEAST_PERCENT = 1e-6  # an error below has no place on a logarithmic axis
LEAST_EIGENVALUE = 1e-9  # of the largest one: a rigid-body mode has no stiffness to change
STIFF = 0.01  # of the largest flexibility: at points below, a ratio says nothing
HINT = "The smallest change that meets the targets: a hint where the model is off, no diagnosis of what is wrong there."
SYMBOLS = ("circle", "square", "diamond")


def describe_targets(targets: Sequence[Target]) -> Picture | None:
    """Describe the frequency errors of an update's targets, before and after.

    Parameters
    ----------
    targets : sequence of Target
        What `updating.targets.target_rows` gives.

    Returns
    -------
    Picture or None
        None without targets.
    """
    if not targets:
        return None
    x = np.arange(1.0, len(targets) + 1)
    texts = [f"{row.name} at {number(row.measured_hz, 6)} Hz" for row in targets]
    layers = tuple(
        Points(
            name=name,
            colour=colour,
            x=x,
            y=np.maximum(100 * np.abs(np.array(errors)), LEAST_PERCENT),
            is_filled=is_filled,
            hover="{text}: {y:.4g} % off",
            texts=texts,
        )
        for name, colour, is_filled, errors in (
            ("before", Role.NOMINAL, False, [row.before for row in targets]),
            ("after", Role.UPDATED, True, [row.after for row in targets]),
        )
    )
    step = -(-len(targets) // MOST_NAMES)
    names = [f"{row.kind} {number(row.measured_hz)} Hz" for row in targets[::step]]
    return Picture(
        name="targets",
        title="Frequency errors of the targets, before and after",
        alt=f"Relative frequency errors of {counted(len(targets), 'target')} on a logarithmic axis: largest before "
        f"{percent(max(abs(row.before) for row in targets), 2)}, after "
        f"{percent(max(abs(row.after) for row in targets), 2)}.",
        panels=(Panel(y=Axis(title="Error of the frequency, %", scale="log"), layers=layers),),
        x=Axis(title="Target", ticks=tuple(x[::step].tolist()), tick_labels=tuple(names), tick_angle=-40),
        height_px=400,
    )


def describe_convergence(updated: UpdatedModel) -> Picture | None:
    """Describe the misfit of the targets over the iterations.

    Parameters
    ----------
    updated : UpdatedModel
        The update.

    Returns
    -------
    Picture or None
        None where there was one step at most.
    """
    history = updated.history
    if len(history) <= 1:
        return None
    iteration, misfit = np.arange(1.0, len(history) + 1), history["misfit"].to_numpy(float)
    phases = history["phase"].astype(str).to_numpy()
    lines = tuple(
        Line(
            name=str(phase),
            colour=rank,
            x=iteration[phases == phase],
            y=misfit[phases == phase],
            symbol=SYMBOLS[rank % len(SYMBOLS)],
            hover="iteration {x:.0f}: {y:.4g}",
        )
        for rank, phase in enumerate(dict.fromkeys(phases))
    )
    scale = "log" if np.all(misfit > 0) else "linear"
    return Picture(
        name="convergence",
        title="Convergence",
        alt=f"Misfit over {counted(len(history), 'iteration')}: from {number(misfit[0])} to {number(misfit[-1])}.",
        panels=(Panel(y=Axis(title="Misfit of the targets", scale=scale), layers=lines),),
        x=Axis(title="Iteration", tick_step=1.0 if len(history) <= FEW_STEPS else None),
        height_px=320,
    )


def describe_stiffness_change(parts: pd.DataFrame) -> Picture | None:
    """Describe how much stiffer or softer every part of the FE model has become, with its 90 % band.

    Parameters
    ----------
    parts : DataFrame
        ``UpdatedModel.parts``.

    Returns
    -------
    Picture or None
        Over the position for a structure that is a line, else coloured points; None without parts.
    """
    if not len(parts):
        return None
    names = parts["name"].astype(str).tolist()
    columns = ("stiffness_ratio", "stiffness_ratio_low", "stiffness_ratio_high")
    change, low, high = (100 * (parts[name].to_numpy(float) - 1) for name in columns)
    positions = project(parts[["x_m", "y_m", "z_m"]].to_numpy(float))
    is_line = not np.ptp(positions[:, 1]) and bool(np.ptp(positions[:, 0]))
    if is_line:
        order = np.argsort(positions[:, 0], kind="stable")
        panel, x = _change_over_position(
            positions[order, 0], (low[order], change[order], high[order]), [names[row] for row in order]
        )
    else:
        panel, x = _coloured_points(positions, change, names), Axis(is_bare=True)
    return Picture(
        name="change",
        title="Change of stiffness along the structure" + (", with its 90 % band" if np.isfinite(low).any() else ""),
        alt=f"Change of the stiffness of {counted(len(parts), 'part')}: from {number(float(change.min()), 3)} % to "
        f"{number(float(change.max()), 3)} %.",
        panels=(panel,),
        x=x,
        note=HINT,
        height_px=320 if is_line else 430,
    )


def _change_over_position(
    x: FloatArray, curves: tuple[FloatArray, FloatArray, FloatArray], names: list[str]
) -> tuple[Panel, Axis]:
    low, change, high = curves
    layers: list[Layer] = []
    if np.isfinite(low).all():
        layers.append(Band(name="90 % band", colour=Role.UPDATED, opacity=0.25, x=x, low=low, high=high))
    layers.append(
        Line(
            name="change",
            colour=Role.UPDATED,
            x=x,
            y=change,
            symbol="circle",
            size=4,
            hover="{text}: {y:+.3g} %",
            texts=names,
        )
    )
    y = Axis(title="Change of stiffness, %", has_zero_line=True)
    return Panel(y=y, layers=tuple(layers)), Axis(title="Position, m")


def _coloured_points(positions: FloatArray, change: FloatArray, names: list[str]) -> Panel:
    points = Points(
        name="change",
        colour=Role.UPDATED,
        in_legend=False,
        x=positions[:, 0],
        y=positions[:, 1],
        size=11,
        hover="{text}: {value:+.3g} %",
        texts=names,
        values=change,
        scale_title="change, %",
    )
    return Panel(y=Axis(is_bare=True), layers=(points,), is_to_scale=True)


def describe_flexibility_change(
    updated: UpdatedModel, geometry: Geometry | None, labels: Sequence[FrfLabel]
) -> Picture | None:
    """Describe how much further every point yields to a static force than the nominal model says.

    Parameters
    ----------
    updated : UpdatedModel
        The update.
    geometry : Geometry, optional
        Where the nodes are.
    labels : sequence of FrfLabel
        What was measured: points are those in the same directions.

    Returns
    -------
    Picture or None
        None where the model has no positions.
    """
    if geometry is None or not labels:
        return None
    dofs = updated.nominal.expanded_dofs
    directions = {dof.direction for label in labels for dof in (label.output_dof, label.input_dof)}
    node_rows = {int(node): row for row, node in enumerate(geometry.nodes)}
    node_of_row = {
        row: dof.node for row, dof in enumerate(dofs) if isinstance(dof, Dof) and dof.direction in directions
    }
    rows = np.array([row for row, node in node_of_row.items() if node in node_rows], np.int64)
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, MOST_POINTS).astype(int))] if len(rows) else rows
    before, after = (_flexibility(model, rows) for model in (updated.nominal, updated.model))
    is_moving = before > STIFF * before.max(initial=0.0)
    rows, change = rows[is_moving], 100 * (after[is_moving] / before[is_moving] - 1)
    if len(rows) < 2:
        return None
    names = [dofs[row].name for row in rows]
    positions = project(geometry.coordinates_m)[[node_rows[node_of_row[row]] for row in rows.tolist()]]
    is_line = not np.ptp(positions[:, 1])
    extremes = f"from {number(float(change.min()), 3)} to {number(float(change.max()), 3)} %"
    return Picture(
        name="flexibility",
        title="Change of the flexibility at each point of the structure",
        alt=f"Change of the static flexibility at {counted(len(rows), 'point')}: {extremes}.",
        panels=(
            _flexibility_over_position(positions, change, names)
            if is_line
            else _coloured_points(positions, change, names),
        ),
        x=Axis(title="Position, m") if is_line else Axis(is_bare=True),
        note=f"Updated over nominal model, without motions as a rigid body. {HINT}",
        height_px=320 if is_line else 430,
    )


def _flexibility_over_position(positions: FloatArray, change: FloatArray, names: list[str]) -> Panel:
    points = Points(
        name="change",
        colour=Role.UPDATED,
        in_legend=False,
        x=positions[:, 0],
        y=change,
        size=6,
        hover="{text}: {y:+.3g} %",
        texts=names,
    )
    return Panel(y=Axis(title="Change of flexibility, %"), layers=(points,))


def _flexibility(model: ReducedModel, rows: IntArray) -> FloatArray:
    """Give the static deflection under a unit force at the same point, (n_rows,), m/N."""
    values, shapes = eigh((model.stiffness + model.stiffness.T) / 2, model.mass)
    flexible = values > LEAST_EIGENVALUE * values[-1]
    return np.asarray(((model.expansion[rows] @ shapes[:, flexible]) ** 2 / values[flexible]).sum(axis=1))


def describe_modal_change(updated: UpdatedModel) -> Picture | None:
    """Describe the change of the stiffness that each nominal mode sees.

    Parameters
    ----------
    updated : UpdatedModel
        The update.

    Returns
    -------
    Picture or None
        Bars; None where measured shapes were expanded, which are no change of the stiffness.
    """
    if updated.expansion is not None:
        return None
    values, shapes = eigh(updated.nominal.stiffness, updated.nominal.mass)
    flexible = values > LEAST_EIGENVALUE * values[-1]
    values, shapes = values[flexible][:MOST_MODES], shapes[:, flexible][:, :MOST_MODES]
    change = np.einsum("ik,ij,jk->k", shapes, updated.model.stiffness - updated.nominal.stiffness, shapes) / values
    names = [f"{number(value)} Hz" for value in np.sqrt(values) / (2 * np.pi)]
    bars = Bars(
        name="change",
        colour=Role.UPDATED,
        in_legend=False,
        labels=names,
        sizes=100 * change,
        hover="mode at {x}: {y:+.3g} %",
    )
    return Picture(
        name="modal-change",
        title="Change of the stiffness that each nominal mode sees",
        alt="Bars: " + ", ".join(f"{name} {100 * value:+.2g} %" for name, value in zip(names, change, strict=True)),
        panels=(Panel(y=Axis(title="Change of stiffness, %", has_zero_line=True), layers=(bars,)),),
        x=Axis(title="Nominal mode", scale="category"),
        height_px=300,
    )
