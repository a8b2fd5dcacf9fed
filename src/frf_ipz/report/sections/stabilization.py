"""Stabilisation diagram: poles over model orders, what was taken, and why."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.report.picture import Axis, Picture, Trace, frequency_axis, line, markers, panels
from frf_ipz.report.section import Block, Section, Table
from frf_ipz.report.thinning import bins_for, thin
from frf_ipz.report.wording import counted, listed, number, percent

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.report.contents import RunContents

KINDS = (
    ("new", "@muted/0.55", "x-thin", 6),
    ("stable in frequency", "@c4", "circle-open", 7),
    ("stable in frequency and damping", "@c0", "diamond", 7),
    ("stable in frequency, damping and shape", "@c2", "circle", 8),
)


def build(run: RunContents) -> Section | None:
    """Give the section on the stabilisation diagram.

    Parameters
    ----------
    run : RunContents
        What the run holds.

    Returns
    -------
    Section or None
        None where the fit kept no diagram.
    """
    fit = run.fit
    if fit is None or not len(fit.stabilization):
        return None
    n_taken = int(fit.stabilization["taken"].astype(bool).sum())
    orders = fit.stabilization["order"].nunique()
    lead = (
        f"{counted(len(fit.stabilization), 'pole')} of {counted(orders, 'model order')}; {n_taken} of them were where "
        f"the fit started, and {counted(fit.n_modes, 'mode')} remained."
    )
    blocks: list[Block] = [_picture(fit, run.frfs)]
    blocks += [_decisions(fit.decisions)] if len(fit.decisions) else []
    return Section(anchor="stabilization", title="Stabilisation", lead=lead, blocks=tuple(blocks))


def _picture(fit: ModalFit, frfs: FrfSet | None) -> Picture:
    poles = fit.stabilization
    orders = poles["order"].to_numpy(float)
    span = [orders.min() - 1.5, orders.max() + 1.5]
    traces = [*_sum_of_frfs(frfs), *_modes(fit, span), *_poles(poles)]
    modes = listed([number(hertz, 5) for hertz in fit.model.natural_frequency_hz[: fit.n_modes]], 20)
    order_axis = {"range": span}
    indicator = {"overlaying": "y", "side": "right", "type": "log", "showgrid": False, "showticklabels": False}
    indicator["ticks"] = ""
    layout = panels(frequency_axis(*fit.band_hz), Axis(title="Model order", options=order_axis), yaxis2=indicator)
    return Picture(
        name="stabilisation",
        title="Stabilisation diagram",
        alt="Poles over frequency and model order, marked by how stable they are; vertical lines at the "
        f"{counted(fit.n_modes, 'mode')} of the fit: {modes} Hz.",
        traces=tuple(traces),
        layout=layout,
        note="Grey curve: sum of all FRFs' magnitudes. Vertical lines: the modes of the fit. Ringed: taken as a start.",
        height_px=480,
        is_over_frequency=True,
    )


def _poles(poles: pd.DataFrame) -> list[Trace]:
    frequency, damping = poles["frequency_hz"].to_numpy(float), poles["damping_ratio"].to_numpy(float)
    order, is_start = poles["order"].to_numpy(float), poles["taken"].astype(bool).to_numpy()
    flags = [poles[name].astype(bool).to_numpy() for name in ("stable_frequency", "stable_damping", "stable_shape")]
    level = np.cumprod(np.stack(flags).astype(int), axis=0).sum(axis=0)
    hover = "%{x:.6g} Hz, order %{y}, damping %{customdata:.4f} %"
    traces = []
    for number_of, (name, colour, symbol, size) in enumerate(KINDS):
        here = level == number_of
        style: Trace = {"symbol": symbol, "size": size, "hover": hover, "customdata": 100 * damping[here]}
        traces.append(markers(frequency[here], order[here], name, colour, **style))
    ring: Trace = {"symbol": "circle-open", "size": 14, "hover": hover, "customdata": 100 * damping[is_start]}
    return [*traces, markers(frequency[is_start], order[is_start], "taken", "@bad", **ring)]


def _modes(fit: ModalFit, span: list[float]) -> list[Trace]:
    hertz = fit.model.natural_frequency_hz[: fit.n_modes]
    x, y = np.full((3, fit.n_modes), np.nan), np.full((3, fit.n_modes), np.nan)
    x[:2], y[0], y[1] = hertz, span[0], span[1]
    return [line(x.T.ravel(), y.T.ravel(), "modes of the fit", "@ink", width=1, dash="dot")]


def _sum_of_frfs(frfs: FrfSet | None) -> list[Trace]:
    if frfs is None:
        return []
    total = np.maximum(np.abs(frfs.values).sum(axis=1), np.finfo(float).tiny)
    lines = thin(frfs.frequency_hz, [np.log10(total)], bins_for(1))
    style: Trace = {"yaxis": "y2", "width": 1.2, "hover": "%{x:.6g} Hz: %{y:.4g} (SI)"}
    return [line(frfs.frequency_hz[lines], total[lines], "sum of the FRFs", "@muted/0.7", **style)]


def _decisions(decisions: pd.DataFrame) -> Table:
    rows = [
        [number(row["frequency_hz"], 6), percent(row["damping_ratio"]), str(row["action"]), str(row["reason"])]
        for row in decisions.to_dict("records")
    ]
    columns = ("frequency, Hz", "damping", "what was done", "why")
    return Table(caption="Decisions on the way from start to fit", columns=columns, rows=rows)
