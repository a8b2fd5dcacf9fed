"""Records and the structure that they were made on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.projection import project
from frf_ipz.plotting.style import CYCLE, FAINT, MEASURED, axes_or_new, colour, dash, label_axes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from frf_ipz.dofs import Dof
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.structure import Geometry

MARKS = {"sensor": ("s", CYCLE[0]), "input": ("v", CYCLE[1]), "point of interest": ("*", CYCLE[2])}


def plot_records(estimate: FrfEstimate, *, ax: Axes | None = None) -> Axes:
    """Draw the forces of all records; those left out are dotted.

    Parameters
    ----------
    estimate : FrfEstimate
        The result of ingest.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        With the picture.
    """
    ax = axes_or_new(ax)
    used = dict(zip(estimate.records["record"], estimate.records["used"].astype(bool), strict=True))
    channel = estimate.traces[0].channel if estimate.traces else ""
    forces = [trace for trace in estimate.traces if trace.channel == channel]
    for place, trace in enumerate(forces):
        style = dash(place) if used.get(trace.name, True) else ":"
        ax.plot(trace.time_s, trace.values, style, color=colour(place), linewidth=0.9, label=trace.name)
    unit = forces[0].unit if forces else "N"
    return label_axes(ax, "Time, s", f"{channel}, {unit}", legend=len(forces) <= 12)


def plot_structure(
    geometry: Geometry,
    *,
    sensors: Sequence[Dof] = (),
    inputs: Sequence[Dof] = (),
    points: Sequence[Dof] = (),
    ax: Axes | None = None,
) -> Axes:
    """Draw a structure with sensors, inputs and points of interest.

    Parameters
    ----------
    geometry : Geometry
        Of the FE model.
    sensors, inputs, points : sequence of Dof
        What to mark.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        With the picture.
    """
    ax = axes_or_new(ax, height_in=2.0)
    positions = project(geometry.coordinates_m)
    place = {int(node): row for row, node in enumerate(geometry.nodes)}
    for first, second in geometry.lines:
        rows = [place[int(first)], place[int(second)]]
        ax.plot(positions[rows, 0], positions[rows, 1], color=FAINT, linewidth=2, zorder=1)
    ax.plot(positions[:, 0], positions[:, 1], ".", color=MEASURED, markersize=1.5, zorder=2)
    held = [place[node] for node in geometry.supports if node in place]
    ax.plot(
        positions[held, 0], positions[held, 1], "X", color=MEASURED, markersize=8, label="support" if held else None
    )
    for (name, (mark, edge)), dofs in zip(MARKS.items(), (sensors, inputs, points), strict=True):
        rows = [place[dof.node] for dof in dofs if dof.node in place]
        if rows:
            ax.plot(positions[rows, 0], positions[rows, 1], mark, color=edge, markersize=8, label=name, zorder=3)
    ax.grid(visible=False)
    ax.set_yticks([])
    if np.ptp(positions[:, 1]):
        ax.set_aspect("equal")
    return label_axes(ax, "Position, m", "")
