"""The fit against the measurement: curves, misfit, noise, and how sure the fitted curve is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.curves import confidence_band, magnitude_title
from frf_ipz.report.picture import (
    Axis,
    Picture,
    Trace,
    band,
    colour_of,
    dash_of,
    frequency_axis,
    line,
    markers,
    panels,
)
from frf_ipz.report.section import Section, Table
from frf_ipz.report.thinning import bins_for, thin
from frf_ipz.report.wording import counted, number

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.arrays import ComplexArray
    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.report.contents import RunContents

DOTTED = ". Where the solid curve stays near the dotted one, the fit says all that the data say."
SHADED = " Shaded: where the fitted curve lies with 95 %; zoom in where it is thinner than the line."
NO_BAND = " How sure the fitted curve is cannot be said, so no band is drawn."
LARGE = 2.0  # misfit over noise from which a row of the table is marked


def build(run: RunContents) -> Section | None:
    """Give the section on the fit.

    Parameters
    ----------
    run : RunContents
        What the run holds.

    Returns
    -------
    Section or None
        None without a fit.
    """
    fit, frfs = run.fit, run.frfs
    if fit is None or frfs is None:
        return None
    used = frfs.select_lines(fit.used_lines)
    fitted = fit.model(used.s)
    misfit = np.linalg.norm(fitted - used.values) / max(float(np.linalg.norm(used.values)), np.finfo(float).tiny)
    lead = f"The fitted curves differ from the measured ones by {number(100 * float(misfit), 3)} % of their norm."
    blocks = [_picture(fit, used, fitted)]
    return Section(
        anchor="fit", title="Fit", lead=lead, blocks=(*blocks, *([_table(fit.misfit)] if len(fit.misfit) else []))
    )


def _picture(fit: ModalFit, used: FrfSet, fitted: ComplexArray) -> Picture:
    bins = bins_for(used.n_frfs)
    traces: list[Trace] = []
    for place in range(used.n_frfs):
        traces += _frf(fit, used, fitted, place, bins)
    title = magnitude_title(used.labels)
    axes = Axis(title=title, share=1.5, scale="log"), Axis(title="Misfit, " + title.partition(", ")[2], scale="log")
    return Picture(
        name="fit-picture",
        title="Measured (points) and fitted (lines); below: misfit against noise",
        alt=f"Magnitude of {counted(used.n_frfs, 'FRF')}, measured and fitted, with its 95 % band; below, the "
        "modulus of the misfit and the standard deviation of the measurement.",
        traces=tuple(traces),
        layout=panels(frequency_axis(*fit.band_hz), *axes),
        note="Below: solid, modulus of measurement minus fit; dotted, standard deviation of the measurement"
        + (DOTTED if np.isfinite(used.variance).any() else ", which is not known here.")
        + (SHADED if _has_band(fit) else NO_BAND),
        height_px=620,
        is_over_frequency=True,
    )


def _frf(fit: ModalFit, used: FrfSet, fitted: ComplexArray, place: int, bins: int) -> list[Trace]:
    tiny = np.finfo(float).tiny
    label, colour = used.labels[place], colour_of(place)
    measured, curve = np.abs(used.values[:, place]), np.maximum(np.abs(fitted[:, place]), tiny)
    lines = thin(used.frequency_hz, [np.log10(np.maximum(measured, tiny)), np.log10(curve)], bins // 2)
    x, std = used.frequency_hz[lines], fit.value_std[lines, place] / np.sqrt(2)
    group: Trace = {"meta": {"frf": place}, "legendgroup": str(label)}
    hover = f"%{{x:.6g}} Hz: %{{y:.4g}} {label.unit}"
    unlisted: Trace = {**group, "showlegend": False}
    traces: list[Trace] = []
    if _has_band(fit):
        traces += band(x, confidence_band(curve[lines], std), f"{label} 95 %", f"{colour}/0.3", **unlisted)
    points: Trace = {"size": 3.5, "opacity": 0.55, "hover": hover}
    traces.append(markers(x, measured[lines], f"{label} measured", colour, **points, **unlisted))
    traces.append(line(x, curve[lines], f"{label} fitted", colour, hover=hover, dash=dash_of(place), **group))
    return traces + _misfit(used, np.abs(fitted[:, place] - used.values[:, place]), place, bins)


def _has_band(fit: ModalFit) -> bool:
    return bool(np.isfinite(fit.value_std).all() and fit.value_std.any())


def _misfit(used: FrfSet, misfit: np.ndarray, place: int, bins: int) -> list[Trace]:
    tiny = np.finfo(float).tiny
    label, colour = used.labels[place], colour_of(place)
    style = {"meta": {"frf": place}, "legendgroup": str(label), "showlegend": False, "yaxis": "y2", "width": 1.1}
    lines = thin(used.frequency_hz, [np.log10(np.maximum(misfit, tiny))], bins // 2)
    hover = f"%{{x:.6g}} Hz: %{{y:.3g}} {label.unit}"
    x = used.frequency_hz[lines]
    traces = [line(x, np.maximum(misfit[lines], tiny), f"{label} misfit", colour, hover=hover, **style)]
    noise = np.sqrt(used.variance[lines, place])
    if np.isfinite(noise).any():
        traces.append(line(x, noise, f"{label} noise", f"{colour}/0.7", hover=hover, dash="dot", **style))
    return traces


def _table(misfit: pd.DataFrame) -> Table:
    rows = [
        [
            f"{row['output_dof']} / {row['input_dof']}",
            f"{number(row['band_low_hz'])} to {number(row['band_high_hz'])}",
            *[number(float(row[name]), 3) for name in ("misfit", "noise", "ratio")],
        ]
        for row in misfit.to_dict("records")
    ]
    large = frozenset(np.flatnonzero(misfit["ratio"].to_numpy(float) > LARGE).tolist())
    columns = ("FRF (output / input)", "band, Hz", "misfit, SI", "noise, SI", "misfit over noise")
    return Table(caption="Misfit against noise", columns=columns, rows=rows, marked=large, file="fit.parquet")
