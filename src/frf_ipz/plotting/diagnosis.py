"""Diagnosis: where model and measurement disagree, and what explains it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.plotting.curves import Q95
from frf_ipz.plotting.style import FAINT, MEASURED, UPDATED, axes_or_new, colour, dash, label_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from frf_ipz.diagnosis.measured.levels import LevelDependence
    from frf_ipz.diagnosis.result import Diagnosis, LawInTime

MOST_RANKED = 12


def plot_mismatch(diagnosis: Diagnosis, *, column: str = "before", ax: Axes | None = None) -> Axes:
    """Draw the misfit over what noise and tolerances explain, by FRF and band.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    column : str
        ``before`` or ``after``: of the model as it is, or with the findings.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        A map; 1 is as good as the measurement.
    """
    table = diagnosis.mismatch
    names = list(dict.fromkeys(table["frf"].astype(str)))
    bands = sorted({(float(low), float(high)) for low, high in zip(table["low_hz"], table["high_hz"], strict=True)})
    ax = axes_or_new(ax, height_in=1.4 + 0.3 * len(names))
    values = np.full((len(names), len(bands)), np.nan)
    for row in table.to_dict("records"):
        place = names.index(str(row["frf"])), bands.index((float(row["low_hz"]), float(row["high_hz"])))
        values[place] = row[column]
    image = ax.imshow(np.log10(np.maximum(values, 0.1)), cmap="cividis", aspect="auto", vmin=0)
    colours = ax.figure.colorbar(image, ax=ax)
    colours.set_label("log10 of misfit over noise", fontsize=8)
    ax.set_xticks(range(len(bands)), [f"{low:.4g}-{high:.4g}" for low, high in bands], rotation=40, ha="right")
    ax.set_yticks(range(len(names)), names)
    ax.grid(visible=False)
    return label_axes(ax, "Band, Hz", "")


def plot_ranking(diagnosis: Diagnosis, *, ax: Axes | None = None) -> Axes:
    """Draw findings and alternatives by their evidence.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        Bars; the findings stand out.
    """
    ranked = [*diagnosis.findings, *diagnosis.alternatives][:MOST_RANKED]
    ax = axes_or_new(ax, height_in=1.0 + 0.28 * len(ranked))
    n_findings = len(diagnosis.findings)
    shades = [UPDATED if place < n_findings else FAINT for place in range(len(ranked))]
    ax.barh(range(len(ranked)), [finding.log_evidence_gain for finding in ranked], color=shades)
    ax.set_yticks(range(len(ranked)), [finding.effect.replace("_", " ") for finding in ranked])
    ax.invert_yaxis()
    return label_axes(ax, "Log Bayes factor", "", legend=False)


def plot_proof(diagnosis: Diagnosis, *, ax: Axes | None = None) -> Axes:
    """Draw the error of the FRFs before and after, on what was fitted and on what was held out.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        Bars.
    """
    ax = axes_or_new(ax)
    steps = {"as it is": diagnosis.before, "within tolerances": diagnosis.updated, "with the findings": diagnosis.after}
    place = np.arange(len(steps))
    for rank, (name, values) in enumerate(
        (
            ("fitted", [misfit.training for misfit in steps.values()]),
            (f"held out ({diagnosis.held_out_kind})", [misfit.held_out for misfit in steps.values()]),
        )
    ):
        hatch = "//" if rank else ""
        ax.bar(place + 0.4 * (rank - 0.5), 100 * np.array(values), 0.38, color=colour(rank), hatch=hatch, label=name)
    ax.set_yscale("log")
    ax.set_xticks(place, list(steps))
    return label_axes(ax, "", "Normalised FRF error, %")


def plot_law(law: LawInTime, *, ax: Axes | None = None) -> Axes:
    """Draw a record as measured, with a force law and without it; the law's force, where none was simulated.

    Parameters
    ----------
    law : LawInTime
        Of a diagnosis.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        Responses over time, or the force over the motion at its location.
    """
    ax = axes_or_new(ax)
    if not law.record:
        ax.plot(law.motion_m, law.force_N, color=UPDATED, linewidth=0.8)
        return label_axes(ax, "Motion, m", "Force of the law, N", legend=False)
    ax.plot(law.time_s, law.measured, color=MEASURED, linewidth=2.2, label=f"{law.channel} in {law.record}")
    ax.plot(law.time_s, law.without, color=FAINT, linestyle="--", linewidth=0.8, label="without the law")
    ax.plot(law.time_s, law.simulated, color=UPDATED, linewidth=0.8, label="with the law")
    return label_axes(ax, "Time, s", f"{law.response.capitalize()}, {law.unit}")


def plot_levels(levels: LevelDependence, *, ax: Axes | None = None) -> Axes:
    """Draw the change of each mode's frequency over the level of excitation, with 95 % bars.

    Parameters
    ----------
    levels : LevelDependence
        Weak beside strong records.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        A line of a linear structure stays at zero.
    """
    ax = axes_or_new(ax)
    for place, (_, rows) in enumerate(levels.modes.groupby(["mode", "frf"])):
        ordered = rows.sort_values("level_N")
        hertz = ordered["frequency_hz"].to_numpy(float)
        bars = 100 * Q95 * ordered["frequency_std_hz"].to_numpy(float) / hertz
        name = f"mode {int(ordered['mode'].iloc[0]) + 1}, {ordered['frf'].iloc[0]}"
        style: dict[str, Any] = {"color": colour(place), "linestyle": dash(place), "marker": "o", "markersize": 3}
        ax.errorbar(ordered["level_N"], 100 * (hertz / hertz[-1] - 1), bars, label=name, capsize=2, **style)
    ax.set_xscale("log")
    return label_axes(ax, "Peak force, N", "Change of frequency, %")
