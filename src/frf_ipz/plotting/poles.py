"""Poles and zeros: stabilisation diagram, map with error ellipses, pairs of measurement and model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.pairing.pairs import Pair, Pairs, PairVerdict
from frf_ipz.plotting.ellipses import error_ellipses, root_covariances, shown_zeros
from frf_ipz.plotting.picture import (
    Areas,
    Axis,
    Colour,
    Layer,
    Line,
    Panel,
    Picture,
    Points,
    Role,
    VerticalLines,
    frequency_axis,
    joined_segments,
)
from frf_ipz.plotting.wording import listed, number
from frf_ipz.rational import damping_ratio, natural_frequency_hz
from frf_ipz.updating.targets import root_name
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd

    from frf_ipz.frf import FrfLabel, FrfSet
    from frf_ipz.identification.modal_fit import ModalFit

# Of a pole, by how stable it is: name, colour, opacity, symbol, whether filled, size.
STABILITY: tuple[tuple[str, Colour, float, str, bool, float], ...] = (
    ("new", Role.MUTED, 0.55, "cross", False, 6),
    ("stable in frequency", 4, 1.0, "circle", False, 7),
    ("stable in frequency and damping", 0, 1.0, "diamond", True, 7),
    ("stable in shape too", 2, 1.0, "circle", True, 8),
)
VERDICTS: Mapping[PairVerdict, tuple[Colour, str, bool]] = {
    PairVerdict.PAIRED: (Role.GOOD, "circle", True),
    PairVerdict.MISSING_IN_MODEL: (Role.BAD, "cross", True),
    PairVerdict.MISSING_IN_MEASUREMENT: (Role.MUTED, "triangle-up", False),
    PairVerdict.AMBIGUOUS: (4, "diamond", False),
}
MOST_ELLIPSES = 400  # drawn; more would make a page large
MOST_LANES = 40  # FRFs drawn; more would be too low to tell apart
SHIFT = 0.16  # of a lane, from its middle to measured and computed roots


def describe_stabilization(fit: ModalFit, frfs: FrfSet | None = None) -> Picture:
    """Describe the stabilisation diagram: poles over model order, and the modes of the fit.

    Parameters
    ----------
    fit : ModalFit
        The fit.
    frfs : FrfSet, optional
        Measured FRFs, whose sum is drawn behind.

    Returns
    -------
    Picture
        One panel.
    """
    orders = fit.stabilization["order"].to_numpy(float)
    hertz = fit.model.natural_frequency_hz[: fit.n_modes]
    modes = listed([number(value, 5) for value in hertz], 20)
    tolerance = fit.stability
    lines = VerticalLines(name="modes of the fit", colour=Role.INK, x=hertz, dash="dot")
    return Picture(
        name="stabilisation",
        title="Stabilisation diagram",
        alt="Poles over frequency and model order, marked by how stable they are; vertical lines at the "
        f"{counted(fit.n_modes, 'mode')} of the fit: {modes} Hz.",
        panels=(
            Panel(
                y=Axis(title="Model order", limits=(orders.min() - 1.5, orders.max() + 1.5)),
                layers=(lines, *_diagram(fit.stabilization)),
                backdrop=None if frfs is None else _sum_of_frfs(frfs),
            ),
        ),
        x=frequency_axis(*fit.band_hz),
        note="Grey curve: sum of all FRFs' magnitudes. Vertical lines: the modes of the fit; squares: columns that "
        f"lead to them. Stable against the next lower order: {100 * tolerance.frequency:g} % in frequency, "
        f"{100 * tolerance.damping:g} % in damping, {100 * tolerance.vector:g} % in the vector (1 - MAC). Ringed: "
        "where the fit started.",
        height_px=480,
    )


def _diagram(poles: pd.DataFrame) -> list[Layer]:
    frequency, order = poles["frequency_hz"].to_numpy(float), poles["order"].to_numpy(float)
    damping, is_start = 100 * poles["damping_ratio"].to_numpy(float), poles["taken"].astype(bool).to_numpy()
    flags = [poles[name].astype(bool).to_numpy() for name in ("stable_frequency", "stable_damping", "stable_shape")]
    level = np.cumprod(np.stack(flags).astype(int), axis=0).sum(axis=0)
    styles = [(level == rank, *style) for rank, style in enumerate(STABILITY)]
    if "mode" in poles:
        leads = (poles["mode"].to_numpy() > 0) & (level > 0)
        styles.append((leads, "column of a mode of the fit", Role.INK, 0.9, "square", False, 11))
    styles.append((is_start, "taken", Role.BAD, 1.0, "circle", False, 14))
    return [
        Points(
            name=name,
            colour=colour,
            opacity=opacity,
            x=frequency[here],
            y=order[here],
            symbol=symbol,
            size=size,
            is_filled=is_filled,
            hover="{x:.6g} Hz, order {y:.0f}, damping {value:.4f} %",
            values=damping[here],
        )
        for here, name, colour, opacity, symbol, is_filled, size in styles
        if here.any()
    ]


def _sum_of_frfs(frfs: FrfSet) -> Line:
    return Line(
        name="sum of the FRFs",
        colour=Role.MUTED,
        opacity=0.7,
        x=frfs.frequency_hz,
        y=np.maximum(np.abs(frfs.values).sum(axis=1), np.finfo(float).tiny),
        width=1.2,
        hover="{x:.6g} Hz: {y:.4g} (SI)",
    )


def describe_pole_zero_map(fit: ModalFit) -> Picture:
    """Describe poles and zeros over frequency and damping ratio, with the ellipses that hold them with 95 %.

    Parameters
    ----------
    fit : ModalFit
        The fit.

    Returns
    -------
    Picture
        One panel.
    """
    poles, covariance = fit.model.poles[: fit.n_modes], root_covariances(fit)
    source = {
        "recordings": "the variance of the measured FRFs",
        "misfit": "the misfit of the fit",
        "stated": "the test",
    }
    names = [f"pole {mode}" for mode in range(1, len(poles) + 1)]
    layers = [*_ellipses(poles, covariance[: fit.n_modes], "poles", Role.INK)]
    layers.append(_roots(poles, "poles", names, Role.INK, frf=None))
    is_shown = shown_zeros(fit)
    for frf, label in enumerate(fit.labels):
        here = is_shown & (fit.zeros.frf == frf)
        values, name = fit.zeros.values[here], f"zeros {label}"
        if len(values):
            kinds = [f"zero of {label} ({fit.zeros.kind[row]})" for row in np.flatnonzero(here)]
            layers += _ellipses(values, covariance[fit.n_modes :][here], name, frf, frf=frf)
            layers.append(_roots(values, name, kinds, frf, frf=frf))
    return Picture(
        name="pole-zero-map",
        title="Poles and zeros, with the ellipses that hold the true ones with 95 % probability",
        alt=f"Map of {counted(len(poles), 'pole')} and {counted(int(is_shown.sum()), 'zero')} over frequency "
        "and damping ratio; ellipses show their uncertainty.",
        panels=(
            Panel(
                y=Axis(title="Damping ratio, %", limits=_damping_limits(fit), has_zero_line=True), layers=tuple(layers)
            ),
        ),
        x=frequency_axis(*fit.band_hz),
        note="Crosses: poles; circles: zeros of each FRF. The uncertainty comes from "
        f"{source.get(fit.noise_from, fit.noise_from)}. Zeros with a negative damping ratio lie in the right half "
        "plane: their FRF is not of minimum phase.",
        height_px=440,
    )


def _roots(roots: ComplexArray, name: str, texts: Sequence[str], colour: Colour, *, frf: int | None) -> Points:
    return Points(
        name=name,
        colour=colour,
        frf=frf,
        group=name,
        x=natural_frequency_hz(roots),
        y=100 * damping_ratio(roots),
        symbol="cross" if frf is None else "circle",
        size=9,
        is_filled=frf is None,
        hover="{x:.7g} Hz, damping {y:.5f} %\n{text}",
        texts=texts,
    )


def _damping_limits(fit: ModalFit) -> tuple[float, float]:
    """Choose what the map shows at first: all poles, and the zeros but for a few far ones, percent."""
    poles = 100 * damping_ratio(fit.model.poles[: fit.n_modes])
    zeros = 100 * damping_ratio(fit.zeros.values[shown_zeros(fit)])
    low, high = np.quantile(zeros, [0.1, 0.9]) if zeros.size else (0.0, 0.0)
    top = max(float(high), float(poles.max(initial=1e-3)))
    return min(1.2 * float(low), -0.06 * top), 1.2 * top


def _ellipses(
    roots: ComplexArray, covariance: FloatArray, name: str, colour: Colour, *, frf: int | None = None
) -> list[Layer]:
    rows = np.flatnonzero(np.isfinite(covariance).all(axis=(1, 2)))[:MOST_ELLIPSES]
    if not len(rows):
        return []
    hertz, ratio = error_ellipses(roots[rows], covariance[rows])
    return [Areas(name=name, colour=colour, opacity=0.12, frf=frf, group=name, in_legend=False, x=hertz, y=100 * ratio)]


def describe_pairs(pairs: Pairs, *, band_hz: tuple[float, float] | None = None) -> Picture:
    """Describe measured (upper) and computed (lower) poles and zeros, linked where they are paired.

    Parameters
    ----------
    pairs : Pairs
        Who belongs to whom.
    band_hz : pair of float, optional
        What is seen at first; from the lowest to the highest root where it is left out.

    Returns
    -------
    Picture
        One lane for the poles and one for the zeros of each FRF.
    """
    labels = pairs.labels
    lanes = sorted({row.frf for row in pairs.rows})[:MOST_LANES]
    names = ["poles" if frf < 0 else str(labels[frf]) for frf in lanes]
    heights = {frf: float(len(lanes) - lane) for lane, frf in enumerate(lanes)}
    rows = [row for row in pairs.rows if row.frf in heights]
    layers: list[Layer] = [_links([row for row in rows if row.verdict is PairVerdict.PAIRED], heights)]
    for verdict in VERDICTS:
        layers += _pair_ends([row for row in rows if row.verdict is verdict], verdict, heights, labels)
    hertz = np.array([_hertz(value) for row in rows for value in (row.measured_value, row.computed_value)])
    band = (float(np.nanmin(hertz)), float(np.nanmax(hertz))) if np.isfinite(hertz).any() else (0.0, 1.0)
    return Picture(
        name="pairs",
        title="Measured (upper) and computed (lower) poles and zeros, linked where they are paired",
        alt="One lane for the poles and one for the zeros of each FRF: measured roots above, those of the model below, "
        "joined by lines where they are paired.",
        panels=(
            Panel(
                y=Axis(limits=(0.4, len(lanes) + 0.75), ticks=tuple(heights.values()), tick_labels=tuple(names)),
                layers=tuple(layers),
            ),
        ),
        x=frequency_axis(*(band if band_hz is None else band_hz)),
        note="A slanted link is a frequency error of the model.",
        height_px=int(np.clip(120 + 48 * len(lanes), 220, 900)),
    )


def _links(rows: Sequence[Pair], heights: Mapping[int, float]) -> Line:
    starts = np.array([(_hertz(row.measured_value), heights[row.frf] + SHIFT) for row in rows]).reshape(-1, 2)
    ends = np.array([(_hertz(row.computed_value), heights[row.frf] - SHIFT) for row in rows]).reshape(-1, 2)
    x, y = joined_segments(starts, ends)
    return Line(name="paired", colour=Role.GOOD, in_legend=False, x=x, y=y)


def _pair_ends(
    rows: Sequence[Pair], verdict: PairVerdict, heights: Mapping[int, float], labels: Sequence[FrfLabel]
) -> list[Layer]:
    ends = [(row, "measured", row.measured_value, SHIFT) for row in rows if row.measured >= 0]
    ends += [(row, "model", row.computed_value, -SHIFT) for row in rows if row.computed >= 0]
    if not ends:
        return []
    colour, symbol, is_filled = VERDICTS[verdict]
    return [
        Points(
            name=verdict.value,
            colour=colour,
            x=np.array([_hertz(value) for _, _, value, _ in ends]),
            y=np.array([heights[row.frf] + shift for row, _, _, shift in ends]),
            symbol=symbol,
            is_filled=is_filled,
            hover="{x:.6g} Hz {text}",
            texts=[
                f"{side}: {pair_name(row, labels)}, damping {100 * float(damping_ratio(np.array(value))):.4g} %\n"
                f"{row.reason}"
                for row, side, value, _ in ends
            ],
        )
    ]


def pair_name(row: Pair, labels: Sequence[FrfLabel]) -> str:
    """Name the root of a pair for people.

    Parameters
    ----------
    row : Pair
        The pair.
    labels : sequence of FrfLabel
        What the measured FRFs connect.

    Returns
    -------
    str
        For example ``pole 2`` or ``zero of 101:+z / 89:+z``.
    """
    return root_name(row.kind, row.measured, str(labels[row.frf]) if 0 <= row.frf < len(labels) else "")


def _hertz(value: complex) -> float:
    return float(natural_frequency_hz(np.array(value)))
