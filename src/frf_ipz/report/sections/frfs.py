"""Measured FRFs: magnitude with its band, phase, coherence."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.curves import PHASE_LIMITS, confidence_band, magnitude_title, phase_degrees
from frf_ipz.report.picture import (
    Axis,
    Picture,
    Trace,
    band,
    colour_of,
    dash_of,
    frequency_axis,
    line,
    panels,
    shaded_span,
)
from frf_ipz.report.section import Section, Table
from frf_ipz.report.thinning import bins_for, thin
from frf_ipz.report.wording import counted, number

if TYPE_CHECKING:
    from frf_ipz.frf import FrfSet
    from frf_ipz.report.contents import RunContents

NO_VARIANCE = "The variance of these FRFs is not known, so no band is drawn. "
PHASE_AXIS = {"dtick": 90, "tick0": 0, "range": list(PHASE_LIMITS)}


def build(run: RunContents) -> Section | None:
    """Give the section on the measured FRFs.

    Parameters
    ----------
    run : RunContents
        What the run holds.

    Returns
    -------
    Section or None
        None where nothing was measured.
    """
    frfs = run.frfs
    if frfs is None:
        return None
    low, high = float(frfs.frequency_hz[0]), float(frfs.frequency_hz[-1])
    step = float(np.median(np.diff(frfs.frequency_hz))) if frfs.n_lines > 1 else 0.0
    text = f"{counted(frfs.n_frfs, 'FRF')} on {frfs.n_lines} lines from {number(low)} to {number(high)} Hz"
    window = ""
    if frfs.window_decay_1_s:
        window = (
            " Force and response share an exponential window: peaks look wider here than they are; the fit takes "
            "that back exactly."
        )
    lead = f"{text}, {number(step, 3)} Hz apart.{window}"
    return Section(anchor="frfs", title="FRFs", lead=lead, blocks=(_picture(run, frfs),))


def _picture(run: RunContents, frfs: FrfSet) -> Picture:
    bins = bins_for(frfs.n_frfs)
    traces: list[Trace] = []
    has_coherence = bool(np.isfinite(frfs.coherence).any())
    has_band = bool(np.isfinite(frfs.variance).any())
    for number_of in range(frfs.n_frfs):
        traces += _frf(frfs, number_of, bins, has_coherence=has_coherence)
    axes = [
        Axis(title=magnitude_title(frfs.labels), share=2.2, scale="log", options=_shown(frfs, run.band_hz)),
        Axis(title="Phase, °", options=PHASE_AXIS),
    ]
    axes += [Axis(title="Coherence", share=0.8, options={"range": [-0.02, 1.05]})] if has_coherence else []
    low, high = float(frfs.frequency_hz[0]), float(frfs.frequency_hz[-1])
    shapes = [] if run.fit is None else [shaded_span(run.fit.band_hz, 0, 1, "@updated/0.06")]
    return Picture(
        name="frf",
        title="Measured FRFs: magnitude"
        + (" with its 95 % band" if has_band else "")
        + (", phase and coherence" if has_coherence else " and phase"),
        alt=f"Magnitude, phase and coherence of {counted(frfs.n_frfs, 'measured FRF')} from {number(low)} to "
        f"{number(high)} Hz on logarithmic magnitude axes.",
        traces=tuple(traces),
        layout=panels(frequency_axis(*run.band_hz), *axes, shapes=shapes),
        note=("The band is ±1.96 standard deviations from the scatter between records. " if has_band else NO_VARIANCE)
        + ("Shaded: the band that is fitted. " if shapes else "")
        + "All pictures over frequency zoom together; 'FRFs' at the top chooses what they show.",
        table=_table(frfs),
        height_px=620,
        is_over_frequency=True,
    )


def _shown(frfs: FrfSet, band_hz: tuple[float, float]) -> dict[str, list[float]]:
    """Give the range of the magnitudes in the band: lines near 0 Hz would take up half of the height."""
    sizes = np.abs(frfs.values[frfs.in_band(band_hz)])
    sizes = sizes[sizes > 0]
    return {"range": [float(np.log10(sizes.min())) - 0.2, float(np.log10(sizes.max())) + 0.2]} if sizes.size else {}


def _frf(frfs: FrfSet, place: int, bins: int, *, has_coherence: bool) -> list[Trace]:
    magnitude = np.maximum(np.abs(frfs.values[:, place]), np.finfo(float).tiny)
    lines = thin(frfs.frequency_hz, [np.log10(magnitude)], bins)
    x, label = frfs.frequency_hz[lines], frfs.labels[place]
    style = {"meta": {"frf": place}, "legendgroup": str(label), "dash": dash_of(place)}
    colour = colour_of(place)
    std = np.sqrt(frfs.variance[lines, place] / 2)
    traces: list[Trace] = []
    if np.isfinite(std).any():
        shade = {"meta": {"frf": place}, "legendgroup": str(label), "showlegend": False}
        traces += band(x, confidence_band(magnitude[lines], std), f"{label} 95 %", f"{colour}/0.25", **shade)
    hover = f"%{{x:.6g}} Hz: %{{y:.4g}} {label.unit}"
    traces.append(line(x, magnitude[lines], str(label), colour, hover=hover, **style))
    phase = phase_degrees(frfs.values[lines, place])
    below = {**style, "showlegend": False, "width": 1.1}
    traces.append(line(x, phase, str(label), colour, hover="%{x:.6g} Hz: %{y:.1f}°", yaxis="y2", **below))
    if has_coherence:
        sampled = thin(frfs.frequency_hz, [frfs.coherence[:, place]], bins)
        points = frfs.frequency_hz[sampled], frfs.coherence[sampled, place]
        traces.append(line(*points, str(label), colour, hover="%{x:.6g} Hz: %{y:.5f}", yaxis="y3", **below))
    return traces


def _table(frfs: FrfSet) -> Table:
    rows = []
    for place, label in enumerate(frfs.labels):
        coherence, variance = frfs.coherence[:, place], frfs.variance[:, place]
        power = np.mean(np.abs(frfs.values[:, place]) ** 2)
        known = np.isfinite(variance)
        noise = np.sqrt(np.mean(variance[known]) / power) if known.any() and power > 0 else np.nan
        median = np.median(coherence[np.isfinite(coherence)]) if np.isfinite(coherence).any() else np.nan
        averages = str(int(frfs.averages[place])) if frfs.averages[place] else "–"
        rows.append(
            [
                str(label.output_dof),
                str(label.input_dof),
                label.quantity.value,
                label.unit,
                averages,
                number(float(median), 5),
                f"{number(100 * float(noise), 2)} %",
            ]
        )
    columns = ("output", "input", "quantity", "unit", "averages", "median coherence", "noise, of the RMS value")
    return Table(caption="Measured FRFs", columns=columns, rows=rows, file="frf.parquet")
