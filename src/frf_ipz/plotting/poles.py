"""Poles and zeros: stabilisation diagram, map with error ellipses, pairs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.pairing.pairs import Pair, Pairs, Verdict
from frf_ipz.plotting.ellipses import error_ellipses, root_covariances, shown_zeros
from frf_ipz.plotting.style import BAD, FAINT, GOOD, MEASURED, NOMINAL, axes_or_new, colour, label_axes
from frf_ipz.rational import damping_ratio, natural_frequency_hz

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from frf_ipz.frf import FrfLabel, FrfSet
    from frf_ipz.identification.modal_fit import ModalFit

LEVELS = (
    ("new", {"marker": "x", "color": FAINT}),
    ("stable in frequency", {"marker": "o", "color": "#8a6a00", "markerfacecolor": "none"}),
    ("and damping", {"marker": "D", "color": "#0072b2", "markerfacecolor": "none"}),
    ("and shape", {"marker": "o", "color": GOOD}),
)
VERDICTS = {
    Verdict.PAIRED: {"marker": "o", "color": GOOD},
    Verdict.MISSING_IN_MODEL: {"marker": "x", "color": BAD},
    Verdict.MISSING_IN_MEASUREMENT: {"marker": "^", "color": FAINT, "markerfacecolor": "none"},
    Verdict.AMBIGUOUS: {"marker": "D", "color": NOMINAL, "markerfacecolor": "none"},
}
SHIFT = 0.16  # of a lane, from its middle to measured and computed roots


def plot_stabilization(fit: ModalFit, frfs: FrfSet | None = None, *, ax: Axes | None = None) -> Axes:
    """Draw the stabilisation diagram: poles over model order, and the modes of the fit.

    Parameters
    ----------
    fit : ModalFit
        The fit.
    frfs : FrfSet, optional
        Measured FRFs, whose sum is drawn behind.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        With the picture.
    """
    ax = axes_or_new(ax)
    poles = fit.stabilization
    if frfs is not None:
        behind = ax.twinx()
        behind.semilogy(frfs.frequency_hz, np.abs(frfs.values).sum(axis=1), color=FAINT, linewidth=0.8, alpha=0.7)
        behind.set_axis_off()
    for hertz in fit.model.natural_frequency_hz[: fit.n_modes]:
        ax.axvline(hertz, color=MEASURED, linestyle=":", linewidth=0.8)
    flags = poles[["stable_frequency", "stable_damping", "stable_shape"]].to_numpy(bool)
    level = np.cumprod(flags, axis=1).sum(axis=1)
    for rank, (name, style) in enumerate(LEVELS):
        here = poles[level == rank]
        _points(ax, here["frequency_hz"], here["order"], label=name, markersize=4, **style)
    starts = poles[poles["taken"].to_numpy(bool)]
    ring = {"marker": "o", "color": BAD, "markerfacecolor": "none", "markersize": 9}
    _points(ax, starts["frequency_hz"], starts["order"], label="taken", **ring)
    ax.set_xlim(*fit.band_hz)
    return label_axes(ax, "Frequency, Hz", "Model order")


def plot_pole_zero_map(fit: ModalFit, *, ax: Axes | None = None) -> Axes:
    """Draw poles and zeros over frequency and damping ratio, with the ellipses that hold them with 95 %.

    Parameters
    ----------
    fit : ModalFit
        The fit.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        With the picture.
    """
    ax = axes_or_new(ax)
    covariance = root_covariances(fit)
    poles, zeros = fit.model.poles[: fit.n_modes], fit.zeros
    _ellipses(ax, poles, covariance[: fit.n_modes], MEASURED)
    _points(ax, natural_frequency_hz(poles), 100 * damping_ratio(poles), label="poles", marker="x", color=MEASURED)
    for frf, label in enumerate(fit.labels):
        here = shown_zeros(fit) & (zeros.frf == frf)
        values, style = zeros.values[here], {"marker": "o", "color": colour(frf), "markerfacecolor": "none"}
        _ellipses(ax, values, covariance[fit.n_modes :][here], colour(frf))
        name = f"zeros {label}"
        _points(ax, natural_frequency_hz(values), 100 * damping_ratio(values), label=name, markersize=5, **style)
    ax.set_xlim(*fit.band_hz)
    return label_axes(ax, "Frequency, Hz", "Damping ratio, %")


def plot_pairs(pairs: Pairs, labels: Sequence[FrfLabel], *, ax: Axes | None = None) -> Axes:
    """Draw measured (upper) and computed (lower) poles and zeros, linked where they are paired.

    Parameters
    ----------
    pairs : Pairs
        Who belongs to whom.
    labels : sequence of FrfLabel
        What the measured FRFs connect.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        One lane for the poles and one for the zeros of each FRF.
    """
    lanes = sorted({row.frf for row in pairs.rows})
    ax = axes_or_new(ax, height_in=1.2 + 0.35 * len(lanes))
    height = {frf: len(lanes) - place for place, frf in enumerate(lanes)}
    for row in pairs.targets:
        ends = [_hertz(row.measured_value), _hertz(row.computed_value)]
        ax.plot(ends, [height[row.frf] + SHIFT, height[row.frf] - SHIFT], color=GOOD, linewidth=0.8)
    for verdict, style in VERDICTS.items():
        here = [row for row in pairs.rows if row.verdict is verdict]
        points = _ends(here, height)
        if points:
            _points(ax, *zip(*points, strict=True), label=verdict.value, markersize=4, **style)
    ax.set_yticks(list(height.values()), ["poles" if frf < 0 else str(labels[frf]) for frf in lanes])
    return label_axes(ax, "Frequency, Hz", "")


def _ends(rows: Sequence[Pair], height: dict[int, int]) -> list[tuple[float, float]]:
    measured = [(_hertz(row.measured_value), height[row.frf] + SHIFT) for row in rows if row.measured >= 0]
    return measured + [(_hertz(row.computed_value), height[row.frf] - SHIFT) for row in rows if row.computed >= 0]


def _ellipses(ax: Axes, roots: np.ndarray, covariance: np.ndarray, edge: str) -> None:
    hertz, ratio = error_ellipses(roots, covariance)
    ax.fill(hertz.T, 100 * ratio.T, facecolor=edge, edgecolor=edge, alpha=0.2, linewidth=0.6)


def _points(ax: Axes, x: Any, y: Any, **style: Any) -> None:  # noqa: ANN401  whatever Matplotlib takes
    ax.plot(x, y, linestyle="none", **style)


def _hertz(value: complex) -> float:
    return float(natural_frequency_hz(np.array(value)))
