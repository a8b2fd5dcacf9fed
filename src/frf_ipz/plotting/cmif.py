"""The complex mode indicator function: singular values of the FRF matrix over frequency, and the modes of the fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.curves import dash_of
from frf_ipz.plotting.picture import (
    Axis,
    Labels,
    Layer,
    Line,
    Panel,
    Picture,
    Role,
    VerticalLines,
    frequency_axis,
    in_hover,
)
from frf_ipz.plotting.structure import CHARACTER
from frf_ipz.plotting.wording import listed, number
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.runs.picture_data import ModeIndicator

MARGIN = 1.5  # factor above and below the singular values of the band
ROOM = 2.5  # factor above that, for the numbers of the modes
NAMES = ("largest", "second", "third")
MOST_CURVES = 6  # largest singular values that are drawn: more modes than that hardly share a peak
MOST_NUMBERS = 40  # modes whose numbers stand above their lines; more would cover each other


def describe_cmif(
    indicator: ModeIndicator, fit: ModalFit | None = None, *, band_hz: tuple[float, float] | None = None
) -> Picture:
    """Describe the complex mode indicator function.

    Parameters
    ----------
    indicator : ModeIndicator
        The singular values.
    fit : ModalFit, optional
        Its modes are marked.
    band_hz : pair of float, optional
        What is seen at first; the fit's band, or all lines, where it is left out.

    Returns
    -------
    Picture
        One panel.
    """
    x = indicator.frequency_hz
    band = band_hz or (fit.band_hz if fit is not None else (float(x[0]), float(x[-1])))
    axis = frequency_axis(*band)
    curves = indicator.values[:, :MOST_CURVES]
    limits = _limits(curves[(x >= band[0]) & (x <= band[1])], has_modes=fit is not None)
    layers: list[Layer] = [] if fit is None else _modes(fit, limits, axis)
    layers += [
        Line(
            name=f"{NAMES[row] if row < len(NAMES) else f'{row + 1}th'} singular value",
            colour=row,
            x=x,
            y=np.where(curves[:, row] > 0, curves[:, row], np.nan),
            dash=dash_of(row),
            hover="{x:.6g} Hz: {y:.4g} " + in_hover(indicator.title.rpartition(", ")[2]),
        )
        for row in range(curves.shape[1])
    ]
    n_outputs, n_inputs = len(indicator.outputs), len(indicator.inputs)
    matrix = f"{counted(n_outputs, 'output')} by {counted(n_inputs, 'input')}"
    marked = "" if fit is None else f" Vertical lines: {counted(fit.n_modes, 'mode')} of the fit."
    only = min(n_outputs, n_inputs) == 1
    meaning = (
        "With a single input or output there is one curve, and modes that share a peak do not show in it."
        if only
        else "Where two curves peak together, two modes share the peak."
    )
    return Picture(
        name="cmif",
        title="Complex mode indicator function, and the modes of the fit" if fit is not None else "CMIF",
        alt=f"Singular values of the FRF matrix over frequency, {matrix}."
        + ("" if fit is None else f" Modes of the fit: {listed(_frequencies(fit), 20)} Hz."),
        panels=(Panel(y=Axis(title=indicator.title, scale="log", limits=limits), layers=tuple(layers)),),
        x=axis,
        note=f"Singular values of the FRF matrix, {matrix}. {meaning}{marked}",
        height_px=400,
    )


def _limits(values: FloatArray, *, has_modes: bool) -> tuple[float, float]:
    known = values[np.isfinite(values) & (values > 0)]
    if not known.size:
        return (0.1, 10.0)
    return float(known.min()) / MARGIN, float(known.max()) * MARGIN * (ROOM if has_modes else 1.0)


def _frequencies(fit: ModalFit) -> list[str]:
    return [number(float(value), 5) for value in fit.model.natural_frequency_hz[: fit.n_modes]]


def _modes(fit: ModalFit, limits: tuple[float, float], axis: Axis) -> list[Layer]:
    hertz = fit.model.natural_frequency_hz[: fit.n_modes]
    texts = [f"mode {mode}, {text} Hz" for mode, text in enumerate(_frequencies(fit), start=1)]
    lines = VerticalLines(name="modes of the fit", colour=Role.INK, x=hertz, dash="dot", hover="{text}", texts=texts)
    if not 0 < len(hertz) <= MOST_NUMBERS:
        return [lines]
    numbers = Labels(
        name="modes of the fit",
        colour=Role.INK,
        group="modes of the fit",
        in_legend=False,
        x=hertz,
        y=np.full(len(hertz), limits[1]),
        texts=_numbers(hertz, axis),
        side="below right",
    )
    return [lines, numbers]


def _numbers(hertz: FloatArray, axis: Axis) -> list[str]:
    """Write the number of each mode; where numbers would cover each other, the first and the last of them."""
    places = np.log(hertz) if axis.scale == "log" else hertz
    low, high = np.log(axis.limits or (1.0, 2.0)) if axis.scale == "log" else axis.limits or (0.0, 1.0)
    texts: list[str] = []
    first = 0
    for mode, place in enumerate(places):
        joined = f"{first + 1}–{mode + 1}"
        if mode and place - places[first] < CHARACTER * (len(texts[first]) + 3) * (high - low):
            texts[first] = joined
            texts.append("")
        else:
            first = mode
            texts.append(str(mode + 1))
    return texts
