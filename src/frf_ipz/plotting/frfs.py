"""Measured FRFs, and the fit against them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.curves import PHASE_LIMITS, confidence_band, dash_of, magnitude_title, phase_degrees
from frf_ipz.plotting.picture import (
    Axis,
    Band,
    Layer,
    Line,
    Panel,
    Picture,
    Points,
    Role,
    Span,
    frequency_axis,
    in_hover,
)
from frf_ipz.plotting.wording import number
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.frf import FrfLabel, FrfSet
    from frf_ipz.identification.modal_fit import ModalFit

NO_VARIANCE = "The variance of these FRFs is not known, so no band is drawn. "
PHASE_HOVER = "{x:.6g} Hz: {y:.1f}°"
PHASE_AXIS = Axis(title="Phase, °", limits=PHASE_LIMITS, tick_step=90.0)
DOTTED = ". Where the solid curve stays near the dotted one, the fit says all that the data say."
SHADED = " Shaded: where the fitted curve lies with 95 %; zoom in where it is thinner than the line."
NO_BAND = " How sure the fitted curve is cannot be said, so no band is drawn."
MARGIN_DECADES = 0.2  # above and below the magnitudes of the band


def describe_frfs(
    frfs: FrfSet, *, band_hz: tuple[float, float] | None = None, fitted_hz: tuple[float, float] | None = None
) -> Picture:
    """Describe measured FRFs: magnitude with its band, phase, and coherence where it is known.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs.
    band_hz : pair of float, optional
        What is seen at first; all lines where it is left out.
    fitted_hz : pair of float, optional
        The band that is fitted, to be shaded.

    Returns
    -------
    Picture
        Two panels, or three.
    """
    low, high = float(frfs.frequency_hz[0]), float(frfs.frequency_hz[-1])
    band_hz = (low, high) if band_hz is None else band_hz
    has_coherence = bool(np.isfinite(frfs.coherence).any())
    has_band = bool(np.isfinite(frfs.variance).any())
    spans = (
        ()
        if fitted_hz is None
        else (
            Span(
                name="fitted", colour=Role.UPDATED, opacity=0.06, in_legend=False, low=fitted_hz[0], high=fitted_hz[1]
            ),
        )
    )
    magnitudes, phases, coherences = [], [], []
    for index in range(frfs.n_frfs):
        magnitudes += _magnitude(frfs, index)
        phases.append(_thin_line(frfs, index, phase_degrees(frfs.values[:, index]), PHASE_HOVER))
        coherences.append(_thin_line(frfs, index, frfs.coherence[:, index], "{x:.6g} Hz: {y:.5f}"))
    y = Axis(title=magnitude_title(frfs.labels), scale="log", limits=_magnitude_limits(frfs, band_hz))
    panels = [Panel(y=y, layers=(*spans, *magnitudes), share=2.2), Panel(y=PHASE_AXIS, layers=tuple(phases))]
    if has_coherence:
        panels.append(Panel(y=Axis(title="Coherence", limits=(-0.02, 1.05)), layers=tuple(coherences), share=0.8))
    return Picture(
        name="frf",
        title="Measured FRFs: magnitude"
        + (" with its 95 % band" if has_band else "")
        + (", phase and coherence" if has_coherence else " and phase"),
        alt=f"Magnitude, phase and coherence of {counted(frfs.n_frfs, 'measured FRF')} from {number(low)} to "
        f"{number(high)} Hz on logarithmic magnitude axes.",
        panels=tuple(panels),
        x=frequency_axis(*band_hz),
        note=(f"The band is ±1.96 standard deviations {_variance_source(frfs)}. " if has_band else NO_VARIANCE)
        + ("Shaded: the band that is fitted. " if spans else ""),
        height_px=620,
    )


def _variance_source(frfs: FrfSet) -> str:
    """Say where the variance comes from: one record has no scatter, and neither have FRFs from elsewhere."""
    sources = {
        "from the scatter between records": frfs.averages > 1,
        "from the noise within the one record there is, which does not show how the next would differ": frfs.averages
        == 1,
        "as stated with the FRFs": frfs.averages < 1,
    }
    return ", or ".join(source for source, frfs_of_it in sources.items() if frfs_of_it.any())


def _magnitude_limits(frfs: FrfSet, band_hz: tuple[float, float]) -> tuple[float, float] | None:
    """Give the range of the magnitudes in the band: lines near 0 Hz would take up half of the height."""
    sizes = np.abs(frfs.values[frfs.in_band(band_hz)])
    sizes = sizes[sizes > 0]
    margin = 10**MARGIN_DECADES
    return (float(sizes.min()) / margin, float(sizes.max()) * margin) if sizes.size else None


def _magnitude(frfs: FrfSet, index: int) -> list[Layer]:
    label, x = frfs.labels[index], frfs.frequency_hz
    magnitude = np.maximum(np.abs(frfs.values[:, index]), np.finfo(float).tiny)
    std = np.sqrt(frfs.variance[:, index] / 2)
    layers: list[Layer] = []
    if np.isfinite(std).any():
        low, high = confidence_band(magnitude, std)
        layers.append(_band(label, index, x, (low, high), opacity=0.25))
    curve = Line(
        name=str(label),
        colour=index,
        frf=index,
        group=str(label),
        x=x,
        y=magnitude,
        dash=dash_of(index),
        hover=magnitude_hover(label),
    )
    return [*layers, curve]


def _band(label: FrfLabel, index: int, x: FloatArray, limits: tuple[FloatArray, FloatArray], *, opacity: float) -> Band:
    return Band(
        name=f"{label} 95 %",
        colour=index,
        opacity=opacity,
        frf=index,
        group=str(label),
        in_legend=False,
        x=x,
        low=limits[0],
        high=limits[1],
    )


def _thin_line(frfs: FrfSet, index: int, values: FloatArray, hover: str) -> Line:
    label = str(frfs.labels[index])
    x = frfs.frequency_hz
    return Line(
        name=label, colour=index, frf=index, group=label, x=x, y=values, dash=dash_of(index), width=1.1, hover=hover
    )


def magnitude_hover(label: FrfLabel) -> str:
    """Say a magnitude with its unit.

    Parameters
    ----------
    label : FrfLabel
        Of the FRF.

    Returns
    -------
    str
        Hover pattern of a layer.
    """
    return f"{{x:.6g}} Hz: {{y:.4g}} {in_hover(label.unit)}"


def magnitude_and_phase(
    name: str,
    colour: Role,
    x: FloatArray,
    values: ComplexArray,
    hover: str,
    *,
    opacity: float = 1.0,
    dash: str = "solid",
    width: float,
) -> tuple[Line, Line]:
    """Draw an FRF as two curves.

    Parameters
    ----------
    name : str
        For the legend.
    colour : Role
        What it is.
    x : (n_lines,) array
        Hz.
    values : (n_lines,) complex array
        The FRF.
    hover : str
        Pattern of the magnitude, as `magnitude_hover` gives it.
    opacity : float
        1 hides what lies behind.
    dash : str
        As that of a `Line`.
    width : float
        Pixels.

    Returns
    -------
    magnitude, phase : Line
        Shown and hidden together.
    """
    magnitude = Line(
        name=name,
        colour=colour,
        opacity=opacity,
        group=name,
        x=x,
        y=np.abs(values),
        dash=dash,
        width=width,
        hover=hover,
    )
    phase = Line(
        name=name,
        colour=colour,
        opacity=opacity,
        group=name,
        x=x,
        y=phase_degrees(values),
        dash=dash,
        width=width,
        hover=PHASE_HOVER,
    )
    return magnitude, phase


def describe_fit(frfs: FrfSet, fit: ModalFit) -> Picture:
    """Describe measured FRFs as points, fitted ones as curves with their bands; below, misfit against noise.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs that were fitted, on all their lines.
    fit : ModalFit
        The fit.

    Returns
    -------
    Picture
        Two panels.
    """
    used = frfs.select_lines(fit.used_lines)
    fitted = fit.model(used.s)
    curves: list[Layer] = []
    misfits: list[Layer] = []
    for index in range(used.n_frfs):
        curves += _fitted(fit, used, fitted, index)
        misfits += _misfit(used, np.abs(fitted[:, index] - used.values[:, index]), index)
    title = magnitude_title(used.labels)
    return Picture(
        name="fit-picture",
        title="Measured (points) and fitted (lines); below: misfit against noise",
        alt=f"Magnitude of {counted(used.n_frfs, 'FRF')}, measured and fitted, with its 95 % band; below, the "
        "modulus of the misfit and the standard deviation of the measurement.",
        panels=(
            Panel(y=Axis(title=title, scale="log"), layers=tuple(curves), share=1.5),
            Panel(y=Axis(title="Misfit, " + title.partition(", ")[2], scale="log"), layers=tuple(misfits)),
        ),
        x=frequency_axis(*fit.band_hz),
        note="Below: solid, modulus of measurement minus fit; dotted, standard deviation of the measurement"
        + (DOTTED if np.isfinite(used.variance).any() else ", which is not known here.")
        + (SHADED if _has_band(fit) else NO_BAND),
        height_px=620,
    )


def _fitted(fit: ModalFit, used: FrfSet, fitted: ComplexArray, index: int) -> list[Layer]:
    label, x = used.labels[index], used.frequency_hz
    measured = np.abs(used.values[:, index])
    curve = np.maximum(np.abs(fitted[:, index]), np.finfo(float).tiny)
    hover = magnitude_hover(label)
    layers: list[Layer] = []
    if _has_band(fit):
        limits = confidence_band(curve, fit.value_std[:, index] / np.sqrt(2))
        layers.append(_band(label, index, x, limits, opacity=0.3))
    points = Points(
        name=f"{label} measured",
        colour=index,
        opacity=0.55,
        frf=index,
        group=str(label),
        in_legend=False,
        x=x,
        y=measured,
        size=3.5,
        hover=hover,
    )
    line = Line(
        name=f"{label} fitted",
        colour=index,
        frf=index,
        group=str(label),
        x=x,
        y=curve,
        dash=dash_of(index),
        hover=hover,
    )
    return [*layers, points, line]


def _has_band(fit: ModalFit) -> bool:
    return bool(np.isfinite(fit.value_std).all() and fit.value_std.any())


def _misfit(used: FrfSet, misfit: FloatArray, index: int) -> list[Layer]:
    label, x = used.labels[index], used.frequency_hz
    hover = f"{{x:.6g}} Hz: {{y:.3g}} {in_hover(label.unit)}"
    line = Line(
        name=f"{label} misfit",
        colour=index,
        frf=index,
        group=str(label),
        x=x,
        y=np.maximum(misfit, np.finfo(float).tiny),
        width=1.1,
        hover=hover,
    )
    noise = np.sqrt(used.variance[:, index])
    if not np.isfinite(noise).any():
        return [line]
    dotted = Line(
        name=f"{label} noise",
        colour=index,
        opacity=0.7,
        frf=index,
        group=str(label),
        in_legend=False,
        x=x,
        y=noise,
        width=1.1,
        dash="dot",
        hover=hover,
    )
    return [line, dotted]
