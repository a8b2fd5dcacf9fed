"""Poles and zeros in the s-plane with their error ellipses; tables of modes and zeros."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.plotting.ellipses import error_ellipses, root_covariances, root_deviations, shown_zeros
from frf_ipz.rational import damping_ratio, natural_frequency_hz
from frf_ipz.report.picture import Axis, Picture, Trace, colour_of, frequency_axis, line, markers, panels
from frf_ipz.report.section import Block, Section, Table
from frf_ipz.report.wording import counted, number, with_error

if TYPE_CHECKING:
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.report.contents import RunContents

MOST_ELLIPSES = 400  # drawn; more would make the page large


def build(run: RunContents) -> Section | None:
    """Give the section on poles and zeros.

    Parameters
    ----------
    run : RunContents
        What the run holds.

    Returns
    -------
    Section or None
        None without a fit.
    """
    fit = run.fit
    if fit is None:
        return None
    known = int(np.count_nonzero(fit.zeros.identifiable))
    lead = (
        f"{counted(fit.n_modes, 'pole')} shared by all FRFs, and {counted(known, 'zero')} of single FRFs with a number"
        + (
            f"; {len(fit.zeros.values) - known} more that the data do not support."
            if known < len(fit.zeros.values)
            else "."
        )
    )
    where = {"recordings": "the scatter between records", "misfit": "the misfit of the fit"}.get(
        fit.noise_from, fit.noise_from
    )
    blocks: list[Block] = [_picture(fit, where), _mode_table(fit)]
    blocks += [_zero_table(fit)] if len(fit.zeros.values) else []
    return Section(anchor="poles", title="Poles and zeros", lead=lead, blocks=tuple(blocks), notes=fit.warnings)


def _picture(fit: ModalFit, noise_from: str) -> Picture:
    poles = fit.model.poles[: fit.n_modes]
    traces = [*_ellipses(poles, root_covariances(fit)[: fit.n_modes], "poles", "@ink")]
    hover = "%{x:.7g} Hz, damping %{y:.5f} %<br>%{text}"
    names = [f"pole {place + 1}" for place in range(len(poles))]
    style: Trace = {"symbol": "x", "size": 9, "text": names, "hover": hover}
    traces.append(markers(natural_frequency_hz(poles), 100 * damping_ratio(poles), "poles", "@ink", **style))
    for frf, label in enumerate(fit.labels):
        traces += _zeros_of(fit, frf, str(label), hover)
    y = Axis(title="Damping ratio, %", options={"range": _damping_range(fit), "zeroline": True})
    return Picture(
        name="pole-zero-map",
        title="Poles and zeros, with the ellipses that hold the true ones with 95 % probability",
        alt=f"Map of {counted(len(poles), 'pole')} and {counted(int(shown_zeros(fit).sum()), 'zero')} over frequency "
        "and damping ratio; ellipses show their uncertainty.",
        traces=tuple(traces),
        layout=panels(frequency_axis(*fit.band_hz), y),
        note=f"Crosses: poles; circles: zeros of each FRF. The uncertainty comes from {noise_from}; zoom in to see "
        "small ellipses. Zeros with a negative damping ratio lie in the right half plane: their FRF is not of minimum "
        "phase.",
        height_px=440,
        is_over_frequency=True,
    )


def _damping_range(fit: ModalFit) -> list[float]:
    """Choose what the map shows at first: all poles, and the zeros but for a few far ones, percent."""
    poles = 100 * damping_ratio(fit.model.poles[: fit.n_modes])
    zeros = 100 * damping_ratio(fit.zeros.values[shown_zeros(fit)])
    low, high = np.quantile(zeros, [0.1, 0.9]) if zeros.size else (0.0, 0.0)
    top = max(float(high), float(poles.max(initial=1e-3)))
    return [min(1.2 * float(low), -0.06 * top), 1.2 * top]


def _zeros_of(fit: ModalFit, frf: int, label: str, hover: str) -> list[Trace]:
    here = shown_zeros(fit) & (fit.zeros.frf == frf)
    values = fit.zeros.values[here]
    if not len(values):
        return []
    kinds = [f"zero of {label} ({fit.zeros.kind[place]})" for place in np.flatnonzero(here)]
    colour = colour_of(frf)
    meta: Trace = {"meta": {"frf": frf}}
    style: Trace = {"symbol": "circle-open", "size": 9, "text": kinds, "hover": hover, **meta}
    dots = markers(natural_frequency_hz(values), 100 * damping_ratio(values), f"zeros {label}", colour, **style)
    return [*_ellipses(values, root_covariances(fit)[fit.n_modes :][here], f"zeros {label}", colour, **meta), dots]


def _ellipses(
    roots: ComplexArray,
    covariance: FloatArray,
    name: str,
    colour: str,
    **options: Any,  # noqa: ANN401  any property of a trace
) -> list[Trace]:
    rows = np.flatnonzero(np.isfinite(covariance).all(axis=(1, 2)))[:MOST_ELLIPSES]
    if not len(rows):
        return []
    outlines = error_ellipses(roots[rows], covariance[rows])
    hertz, ratio = (np.pad(part, ((0, 0), (0, 1)), constant_values=np.nan) for part in outlines)
    style: Trace = {"width": 1, "showlegend": False, "fill": "toself", "fillcolor": f"{colour}/0.12"}
    return [line(hertz.ravel(), 100 * ratio.ravel(), name, colour, **style, **options)]


def _mode_table(fit: ModalFit) -> Table:
    poles = fit.model.poles[: fit.n_modes]
    hertz_std, ratio_std = root_deviations(poles, root_covariances(fit)[: fit.n_modes])
    extra = [name for name in ("mpc", "quality") if name in fit.modes and len(fit.modes) == len(poles)]
    rows = []
    for place, pole in enumerate(poles):
        hertz, ratio = float(natural_frequency_hz(pole)), float(damping_ratio(pole))
        quality = [_cell(fit.modes[name].iloc[place]) for name in extra]
        cells = [with_error(hertz, hertz_std[place], 7), with_error(100 * ratio, 100 * ratio_std[place], 5)]
        rows.append([str(place + 1), *cells, *quality])
    columns = (
        "pole",
        "frequency, Hz",
        "damping ratio, %",
        *[name.upper() if name == "mpc" else name for name in extra],
    )
    return Table(caption="Modes of the band", columns=columns, rows=rows, file="poles.parquet, modes.parquet")


def _cell(value: object) -> str:
    return number(float(value), 3) if isinstance(value, float | int | np.number) else str(value)


def _zero_table(fit: ModalFit) -> Table:
    zeros = fit.zeros
    hertz_std, ratio_std = root_deviations(zeros.values, root_covariances(fit)[fit.n_modes :])
    order: IntArray = np.lexsort((np.abs(zeros.values), zeros.frf))
    rows = []
    for place in order:
        root, known = zeros.values[place], bool(zeros.identifiable[place])
        numbers = ["–", "–"]
        if known:
            hertz, ratio = float(natural_frequency_hz(root)), float(damping_ratio(root))
            damping = with_error(100 * ratio, 100 * ratio_std[place], 5)
            if zeros.kind[place] == "real":
                damping = f"{'left' if root.real < 0 else 'right'} half plane"
            numbers = [with_error(hertz, hertz_std[place], 7), damping]
        rows.append([str(fit.labels[zeros.frf[place]]), zeros.kind[place], *numbers, zeros.reason[place]])
    columns = ("FRF (output / input)", "kind", "frequency, Hz", "damping ratio, %", "why without a number")
    marked = frozenset(np.flatnonzero(~zeros.identifiable[order]).tolist())
    return Table(caption="Zeros", columns=columns, rows=rows, marked=marked, file="zeros.parquet")
