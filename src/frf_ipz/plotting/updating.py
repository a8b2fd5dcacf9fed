"""Updating and prediction: targets, convergence, points of interest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.curves import magnitude_title
from frf_ipz.plotting.frfs import FREQUENCY
from frf_ipz.plotting.style import MEASURED, NOMINAL, UPDATED, axes_or_new, colour, label_axes

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from matplotlib.axes import Axes

    from frf_ipz.arrays import ComplexArray
    from frf_ipz.plotting.targets import Target
    from frf_ipz.prediction.prediction import Prediction
    from frf_ipz.updating.updated_model import UpdatedModel

LEAST_PERCENT = 1e-6  # an error below has no place on a logarithmic axis


def plot_targets(targets: Sequence[Target], *, ax: Axes | None = None) -> Axes:
    """Draw the frequency errors of an update's targets, before and after.

    Parameters
    ----------
    targets : sequence of Target
        What `plotting.targets.target_rows` gives.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        With the picture.
    """
    ax = axes_or_new(ax)
    place = np.arange(1, len(targets) + 1)
    for name, mark, edge, errors in (
        ("before", "o", NOMINAL, [row.before for row in targets]),
        ("after", "s", UPDATED, [row.after for row in targets]),
    ):
        percent = np.maximum(100 * np.abs(np.array(errors)), LEAST_PERCENT)
        face = "none" if name == "before" else edge
        ax.semilogy(place, percent, mark, color=edge, markerfacecolor=face, markersize=5, label=name)
    names = [f"{row.kind} {row.measured_hz:.4g} Hz" for row in targets]
    ax.set_xticks(place, names, rotation=40, ha="right", rotation_mode="anchor")
    return label_axes(ax, "", "Error of the frequency, %")


def plot_convergence(updated: UpdatedModel, *, ax: Axes | None = None) -> Axes:
    """Draw the misfit of the targets over the iterations.

    Parameters
    ----------
    updated : UpdatedModel
        The update.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        With the picture.
    """
    ax = axes_or_new(ax)
    iteration = np.arange(1, len(updated.history) + 1)
    phases = updated.history["phase"].astype(str).to_numpy()
    misfit = updated.history["misfit"].to_numpy(float)
    for rank, phase in enumerate(dict.fromkeys(phases)):
        here = phases == phase
        ax.semilogy(iteration[here], misfit[here], "o-", color=colour(rank), markersize=3, linewidth=1, label=phase)
    return label_axes(ax, "Iteration", "Misfit of the targets")


def plot_stiffness_change(parts: pd.DataFrame, *, ax: Axes | None = None) -> Axes:
    """Draw how much stiffer or softer every part of the FE model has become, with its 90 % band.

    Parameters
    ----------
    parts : DataFrame
        ``UpdatedModel.parts``.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        Over the position along the longest extent of the structure.
    """
    ax = axes_or_new(ax)
    places = parts[["x_m", "y_m", "z_m"]].to_numpy(float)
    axis = int(np.argmax(np.ptp(places, axis=0)))
    rows = np.argsort(places[:, axis], kind="stable")
    columns = ("stiffness_ratio", "stiffness_ratio_low", "stiffness_ratio_high")
    change, low, high = (100 * (parts[name].to_numpy(float)[rows] - 1) for name in columns)
    x = places[rows, axis]
    if np.isfinite(low).all():
        ax.fill_between(x, low, high, color=UPDATED, alpha=0.25, linewidth=0, label="90 % band")
    ax.plot(x, change, ".-", color=UPDATED, linewidth=1, label="change")
    return label_axes(ax, f"Position {'xyz'[axis]}, m", "Change of stiffness, %")


def plot_prediction(
    prediction: Prediction, *, frf: int = 0, measured: ComplexArray | None = None, ax: Axes | None = None
) -> Axes:
    """Draw a predicted FRF with its 90 % band, beside the nominal one.

    Parameters
    ----------
    prediction : Prediction
        The prediction.
    frf : int
        Which of its FRFs.
    measured : (n_lines,) complex array, optional
        What was measured there, on the lines of the prediction, in SI units.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        With the picture.
    """
    ax = axes_or_new(ax)
    x, label = prediction.frequency_hz, prediction.labels[frf]
    low, high = prediction.magnitude_low[:, frf], prediction.magnitude_high[:, frf]
    if np.isfinite(low).any():
        ax.fill_between(x, low, high, color=UPDATED, alpha=0.25, linewidth=0, label="90 % band")
    if measured is not None:
        ax.semilogy(x, np.abs(measured), color=MEASURED, alpha=0.35, linewidth=3, label="measured")
    ax.semilogy(x, np.abs(prediction.nominal[:, frf]), "--", color=NOMINAL, linewidth=1, label="nominal model")
    ax.semilogy(x, np.abs(prediction.values[:, frf]), color=UPDATED, linewidth=1.2, label="updated model")
    ax.set_xlim(float(x[0]), float(x[-1]))
    return label_axes(ax, FREQUENCY, f"{magnitude_title([label])}\n{label}")
