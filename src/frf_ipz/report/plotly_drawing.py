"""Pictures on the page: a description as traces and a layout for plotly.js.

Colours are names (``@measured``, ``@updated/0.2`` with an opacity) that the page turns into colours of the light or the
dark theme. Of long curves the page gets what a screen can show: peaks and notches stay.
"""

from __future__ import annotations

from dataclasses import replace
from functools import singledispatch
from string import Formatter
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.plotting.curves import N_COLOURS
from frf_ipz.plotting.picture import (
    PLAIN_NUMBERS,
    Areas,
    Axis,
    Band,
    Bars,
    Colour,
    HeatMap,
    Labels,
    Layer,
    Line,
    Panel,
    Picture,
    Points,
    Role,
    Span,
    VerticalLines,
    joined_segments,
    legend_layers,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

Trace: TypeAlias = "dict[str, Any]"

GAP = 0.06  # of the height, between panels
GAP_BESIDE = 0.08  # of the width
POINTS = 30_000  # of one kind of curve on the whole page: keeps one of 9 FRFs of 50 000 lines at 2 MB, of 900 below 10
BINS = (40, 1000)  # of one curve: the fewest that still have its peaks and notches, and as many as a page has columns
DOTS = 340  # bins of single points: as many as stand beside each other in the columns of a screen
ROWS = 1200  # of a screen: a curve that stays within half a row of the line drawn instead looks the same
FEWEST = 100  # lines that a curve is drawn with: a pointer finds a point near it
LOGARITHMIC = 0.35  # of the bins are spread evenly over the logarithm of the frequency, the others over the frequency
MOST_CELLS = 240  # of a map in which the numbers are written
BESIDE_NAMES_PX = {"x": 30, "y": 10}  # from names of categories to the title of their axis
BLUE_TO_ORANGE = [[0.0, "#0072b2"], [0.5, "#f2f2f2"], [1.0, "#d55e00"]]
SYMBOLS = {"cross": "x", "tick": "line-ns"}
THIN_SYMBOLS = {"cross": "x-thin"}
SIDES = {"above": "top", "below": "bottom"}
FIELDS = {"x": "x", "y": "y", "text": "text", "value": "customdata"}
WHOLE = {"cliponaxis": False}  # words at the rim of a picture are not cut
PLAIN_TICKS = {"tickformat": ".10~g"}  # 20, 50, 100, 200
DECADES_A_TICK = 0.31  # plotly labels 1, 2 and 5 of each decade for 0.3 to 0.7 decades a tick
FEWEST_TICKS = 3
POWERS = {"exponentformat": "power", "minorloglabels": "complete"}  # else plotly writes 2 x 10^-7 as 2
ALWAYS_CLEAR = {"marker": {"opacity": 1.0}}  # points outside a range that is chosen stay as clear as they were


def draw_picture(picture: Picture, *, n_alike: int = 1) -> dict[str, Any]:
    """Draw a picture for plotly.js.

    Parameters
    ----------
    picture : Picture
        The description.
    n_alike : int
        How many pictures of its kind the page holds: they share what one would have in points.

    Returns
    -------
    dict
        ``data``, the traces, with NumPy arrays; ``layout``, without what the theme of the page adds; and ``drawn``, how
        many points of the curves there are, where some are left out.
    """
    named = {id(layer) for layer in legend_layers(picture)} if picture.has_legend else set()
    traces: list[Trace] = []
    counts: list[tuple[int, int]] = []
    for index, panel in enumerate(picture.panels):
        chosen = _thinned_points(panel, POINTS // n_alike)
        counts += [
            (len(chosen[id(layer)]), len(layer.x))
            for layer in panel.layers
            if isinstance(layer, Line | Points | Band) and id(layer) in chosen
        ]
        is_beside = panel.x is not None
        drawn = [(layer, _number("y", 0 if is_beside else index)) for layer in panel.layers]
        if panel.backdrop is not None:
            drawn.insert(0, (panel.backdrop, _number("y", len(picture.panels) + index)))
        for layer, y in drawn:
            for trace in _draw(_thinned(layer, chosen.get(id(layer))), panel):
                axes = {"xaxis": _number("x", index if is_beside else 0), "yaxis": y}
                traces.append(_with_common(trace, layer, named, axes))
    said = _count_of_points(counts, "lines" if picture.is_over_frequency else "points")
    return {"data": traces, "layout": _layout(picture, has_legend=bool(named)), **said}


def _count_of_points(counts: Sequence[tuple[int, int]], noun: str) -> dict[str, str]:
    """Say how many points are drawn of how many: what lies between them shows no more by zooming in."""
    left_out = [(drawn, there) for drawn, there in counts if drawn < there]
    if not left_out:
        return {}
    low, high = (end(drawn for drawn, _ in left_out) for end in (min, max))
    drawn = f"{low}" if low == high else f"{low} to {high}"
    text = f"A curve is drawn through {drawn} of {max(there for _, there in left_out)} {noun}: peaks and notches, and"
    return {"drawn": f"{text} what a screen shows of the rest."}


def thin(x: FloatArray, curves: Sequence[FloatArray], n_bins: int) -> IntArray:
    """Choose the points to draw: of every bin those with the smallest and the largest value of each curve.

    Bins are narrow at low frequencies too, so that the choice serves linear and logarithmic axes equally well.

    Parameters
    ----------
    x : (n_points,) array
        Ascending: frequencies, times.
    curves : sequence of (n_points,) array
        What is drawn, as it is drawn: the logarithm of a magnitude on a logarithmic axis. NaN counts as no value.
    n_bins : int
        About twice as many points are kept of each curve.

    Returns
    -------
    (n_thinned,) int array
        Points to draw, ascending; all of them where there are few.

    Examples
    --------
    >>> f = np.arange(10_000.0)
    >>> peak = np.where(f == 7_777, 1.0, 0.0)
    >>> lines = thin(f, [peak], 100)
    >>> 7_777 in lines, len(lines) <= 202
    (True, True)
    """
    if len(x) <= 2 * n_bins:
        return np.arange(len(x))
    starts = _bin_starts(x, n_bins)
    points = [np.zeros(1, int)]  # the last point is a bin of its own
    for curve in curves:
        points += [_largest_of_bins(curve, starts), _largest_of_bins(-curve, starts)]
    return np.unique(np.concatenate(points))


def straighten(x: FloatArray, curves: Sequence[FloatArray]) -> IntArray:
    """Leave out points of curves that straight lines between the others show as well, to within half a row of a screen.

    Lines are straight on a linear and on a logarithmic axis of x alike. They stand for 2, 4, 8 and so on points, from
    the first one on, so that few steps do for long curves: resonances keep their points, and what is smooth between
    them does with few.

    Parameters
    ----------
    x : (n_points,) array
        Ascending: frequencies, times.
    curves : sequence of (n_points,) array
        What is drawn, as it is drawn. Beside a value that is not known all points stay.

    Returns
    -------
    (n_kept,) int array
        Points to draw, ascending, both ends among them.

    Examples
    --------
    >>> x = np.arange(1.0, 514.0)
    >>> straighten(x, [np.zeros(513), np.where(x == 40, 1.0, 0.0)])[:12].tolist()
    [0, 4, 8, 12, 16, 20, 24, 28, 32, 36, 38, 39]
    """
    places, is_kept = np.arange(len(x)), np.ones(len(x), bool)
    axes = (x, np.log(np.maximum(x, x[x > 0][0])))
    rows = [(curve, _row(curve)) for curve in curves if np.isfinite(curve).any()]
    step = 2 ** int(np.log2(max(len(x) / FEWEST, 2)))
    while step > 1:
        first = places - places % step
        last = np.minimum(first + step, len(x) - 1)
        is_straight = np.ones(-(-len(x) // step), bool)
        for curve, row in rows:
            for axis in axes:
                with np.errstate(invalid="ignore", divide="ignore"):  # NaN counts as not straight
                    part = (axis - axis[first]) / np.where(last > first, axis[last] - axis[first], 1.0)
                    off = np.abs(curve[first] + part * (curve[last] - curve[first]) - curve)
                is_straight &= np.maximum.reduceat(np.where(np.isfinite(off), off, np.inf), places[::step]) <= row / 2
        is_kept &= ~is_straight[places // step] | (places == first) | (places == places[-1])
        step //= 2
    return np.flatnonzero(is_kept)


def _row(curve: FloatArray) -> float:
    """Give what a curve changes by from one row of a screen to the next where it takes up all of them."""
    return float(np.nanmax(curve) - np.nanmin(curve)) / ROWS


def _bin_starts(x: FloatArray, n_bins: int) -> IntArray:
    low, high = x[x > 0][0], x[-1]
    logarithmic = int(n_bins * LOGARITHMIC)
    edges = np.concatenate([np.geomspace(low, high, logarithmic), np.linspace(x[0], high, n_bins - logarithmic)])
    starts = np.unique(np.searchsorted(x, np.sort(edges)))
    return np.unique(np.concatenate([[0], starts[starts < len(x)]]))


def _largest_of_bins(curve: FloatArray, starts: IntArray) -> IntArray:
    values = np.where(np.isfinite(curve), curve, -np.inf)
    largest = np.maximum.reduceat(values, starts)
    widths = np.diff(np.append(starts, len(curve)))
    hits = np.flatnonzero(values == np.repeat(largest, widths))
    bins = np.searchsorted(starts, hits, side="right") - 1
    return hits[np.unique(bins, return_index=True)[1]]


def _thinned_points(panel: Panel, n_points: int) -> dict[int, IntArray]:
    """Choose the points of each long curve of a panel; curves of one FRF that share their x are thinned together."""
    groups: dict[tuple[int, int | None], list[Line | Points | Band]] = {}
    for layer in (*panel.layers, *([] if panel.backdrop is None else [panel.backdrop])):
        if isinstance(layer, Line | Points | Band) and isinstance(layer.x, np.ndarray):
            groups.setdefault((id(layer.x), layer.frf), []).append(layer)
    groups = {key: layers for key, layers in groups.items() if _is_a_curve(layers)}
    chosen: dict[int, IntArray] = {}
    for layers in groups.values():
        is_logarithmic = panel.y.scale == "log" or layers == [panel.backdrop]
        lines = [layer for layer in layers if not isinstance(layer, Points)]
        n_curves = len(_curves_of(lines, is_logarithmic=is_logarithmic))
        n_bins = int(np.clip(n_points // (2 * len(groups) * n_curves), *BINS))
        x, points = np.asarray(layers[0].x, float), np.zeros(0, int)
        roughness = [_roughness(layer, is_logarithmic=is_logarithmic) > n_bins for layer in lines]
        for is_rough in set(roughness):  # noise does not take the resonances of a smooth curve beside it
            alike = [layer for layer, rough in zip(lines, roughness, strict=True) if rough == is_rough]
            curves = _curves_of(alike, is_logarithmic=is_logarithmic)
            sides = _sides_of(alike, is_logarithmic=is_logarithmic)
            points = _points_of(x, curves, sides, n_bins, is_rough=is_rough)
            chosen |= {id(layer): points for layer in alike}
        dots = [layer for layer in layers if isinstance(layer, Points)]
        if dots:
            beside = thin(x, _curves_of(dots, is_logarithmic=is_logarithmic), min(n_bins, DOTS))
            chosen |= {id(layer): np.union1d(points, beside) for layer in dots}
    return chosen


def _points_of(
    x: FloatArray, curves: Sequence[FloatArray], sides: Sequence[FloatArray], n_bins: int, *, is_rough: bool
) -> IntArray:
    """Choose the points of curves: smooth ones keep whole resonances, of noise the peaks and notches are left."""
    drawn = [*curves, *sides]
    if not is_rough:
        points = straighten(x, drawn)
        if len(points) <= n_bins:
            return points
    points = thin(x, curves, n_bins)
    return points[straighten(x[points], [curve[points] for curve in drawn])]


def _roughness(layer: Layer, *, is_logarithmic: bool) -> int:
    """Count the points of a curve that the line between their neighbours does not show."""
    counts = []
    for curve in (curve for curve in _curves_of([layer], is_logarithmic=is_logarithmic) if np.isfinite(curve).any()):
        off = np.abs(curve[1:-1] - (curve[:-2] + curve[2:]) / 2)
        counts.append(int(np.count_nonzero(off > _row(curve) / 2)))
    return max(counts, default=0)


def _is_a_curve(layers: Sequence[Layer]) -> bool:
    """Tell whether some layers hold a curve, all over one ascending x of which some is positive."""
    curves = [layer for layer in layers if isinstance(layer, Line | Band)]
    return any(len(curve.x) > 2 * BINS[0] and (np.diff(curve.x) > 0).all() and curve.x[-1] > 0 for curve in curves)


def _curves_of(layers: Sequence[Layer], *, is_logarithmic: bool) -> list[FloatArray]:
    values = [np.asarray(layer.y, float) for layer in layers if isinstance(layer, Line | Points)]
    return _as_drawn(values, is_logarithmic=is_logarithmic) or _sides_of(layers, is_logarithmic=is_logarithmic)


def _sides_of(layers: Sequence[Layer], *, is_logarithmic: bool) -> list[FloatArray]:
    sides = [side for layer in layers if isinstance(layer, Band) for side in (layer.low, layer.high)]
    return _as_drawn(sides, is_logarithmic=is_logarithmic)


def _as_drawn(curves: Sequence[FloatArray], *, is_logarithmic: bool) -> list[FloatArray]:
    if not is_logarithmic:
        return list(curves)
    return [np.log10(np.maximum(curve, np.finfo(float).tiny)) for curve in curves]


def _thinned(layer: Layer, points: IntArray | None) -> Layer:
    if points is None or len(points) == len(getattr(layer, "x", points)):
        return layer
    names = ("x", "y", "low", "high", "deviation", "values", "texts")
    parts = {name: getattr(layer, name, None) for name in names}
    full = {name: part for name, part in parts.items() if part is not None and len(part)}
    return replace(layer, **{name: _at(part, points) for name, part in full.items()})


def _at(part: Any, points: IntArray) -> Any:  # noqa: ANN401  an array, or a list of names
    return part[points] if isinstance(part, np.ndarray) else [part[point] for point in points]


def _with_common(trace: Trace, layer: Layer, named: set[int], axes: dict[str, str]) -> Trace:
    """Add what all traces have."""
    common: Trace = {"name": _text(layer.name), **{key: name for key, name in axes.items() if name not in {"x", "y"}}}
    if id(layer) not in named:
        common["showlegend"] = False
    if layer.frf is not None:
        common["meta"] = {"frf": layer.frf}
    group = layer.group or (layer.name if isinstance(layer, Band) else "")
    if group:
        common["legendgroup"] = group
    if not layer.is_shown:
        common["visible"] = "legendonly"
    return {**trace, **common}


def _number(name: str, index: int) -> str:
    return name if index == 0 else f"{name}{index + 1}"


def _text(text: str) -> str:
    """Text that plotly shows as it stands: it takes some tags and entities in it for markup."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace("\n", "<br>")


def _texts(texts: Sequence[str]) -> list[str]:
    return [_text(text) for text in texts]


def _colour(colour: Colour, opacity: float = 1.0) -> str:
    name = str(colour) if isinstance(colour, Role) else f"c{colour % N_COLOURS}"
    return f"@{name}" if opacity == 1.0 else f"@{name}/{opacity:g}"


def colour_name(number: int) -> str:
    """Name the colour of the n-th curve.

    Parameters
    ----------
    number : int
        From 0.

    Returns
    -------
    str
        As the page's script takes it.
    """
    return _colour(number)


def _hover(pattern: str, *, with_name: bool = True) -> Trace:
    """Turn a hover pattern into plotly's."""
    if not pattern:
        return {"hoverinfo": "skip"}
    parts = []
    for literal, name, spec, _ in Formatter().parse(pattern):
        parts.append(_text(literal).replace("%{", "%&#123;"))
        if name is not None:
            parts.append(f"%{{{FIELDS[name]}{':' if spec else ''}{spec}}}")
    extra = "%{fullData.name}" if with_name else ""
    return {"hovertemplate": f"{''.join(parts)}<extra>{extra}</extra>"}


def _symbol(symbol: str, *, is_filled: bool) -> str:
    if symbol == "tick":
        return "line-ns-open"
    if is_filled:
        return SYMBOLS.get(symbol, symbol)
    return THIN_SYMBOLS.get(symbol, f"{symbol}-open")


def _side(side: str) -> str:
    """Turn ``above left`` into ``top left``."""
    height, _, across = side.partition(" ")
    return f"{SIDES[height]} {across or 'center'}"


@singledispatch
def _draw(layer: Layer, panel: Panel) -> list[Trace]:
    """Draw a layer."""
    raise TypeError(f"{type(layer).__name__} cannot be drawn on the panel '{panel.y.title}'")


@_draw.register(Line)
def _(layer: Line, panel: Panel) -> list[Trace]:
    del panel
    colour = _colour(layer.colour, layer.opacity)
    trace: Trace = {
        "type": "scatter",
        "mode": "lines+markers" if layer.symbol else "lines",
        "x": layer.x,
        "y": layer.y,
        "line": {"color": colour, "width": layer.width, "dash": layer.dash},
        **_hover(layer.hover),
    }
    if layer.symbol:
        trace["marker"] = {"symbol": _symbol(layer.symbol, is_filled=True), "size": layer.size, "color": colour}
    if len(layer.texts):
        trace["text"] = _texts(layer.texts)
    if layer.deviation is not None:
        trace["error_y"] = {"type": "data", "array": layer.deviation, "thickness": 1.2, "width": 3}
    return [trace]


@_draw.register(Band)
def _(layer: Band, panel: Panel) -> list[Trace]:
    del panel
    colour = _colour(layer.colour, layer.opacity)
    known = np.isfinite(layer.low) & np.isfinite(layer.high)
    stretches = np.split(np.arange(len(known)), np.flatnonzero(np.diff(known)) + 1)
    # each stretch there and back; plotly takes what a gap separates for outlines of their own
    outline = [np.concatenate([rows, rows[::-1]]) for rows in stretches if known[rows].all()]
    x = [layer.x[rows] for rows in outline]
    y = [np.where(np.arange(len(rows)) < len(rows) // 2, layer.low[rows], layer.high[rows]) for rows in outline]
    return [
        {
            "type": "scatter",
            "mode": "lines",
            "x": _joined(x),
            "y": _joined(y),
            "line": {"width": 0, "color": colour},
            "fill": "toself",
            "fillcolor": colour,
            "hoverinfo": "skip",
        }
    ]


def _joined(parts: Sequence[FloatArray]) -> FloatArray:
    return np.concatenate([np.append(part, np.nan) for part in parts])[:-1] if parts else np.zeros(0)


@_draw.register(Points)
def _(layer: Points, panel: Panel) -> list[Trace]:
    del panel
    colour, symbol = _colour(layer.colour), _symbol(layer.symbol, is_filled=layer.is_filled)
    marker: Trace = {"color": colour, "size": layer.size, "symbol": symbol}
    if not layer.is_filled or layer.symbol == "tick":
        marker["line"] = {"width": 1.8, "color": colour}
    trace: Trace = {
        "type": "scatter",
        "mode": "markers+text" if layer.labels else "markers",
        "x": _positions(layer.x),
        "y": _positions(layer.y),
        "marker": marker,
        **({} if layer.opacity == 1.0 else {"opacity": layer.opacity}),
        "unselected": ALWAYS_CLEAR,
        **_hover(layer.hover),
    }
    if len(layer.texts):
        trace["text"] = _texts(layer.texts)
    if layer.labels:
        trace |= {"textposition": _side(layer.labels), "textfont": {"color": colour, "size": 12.5}, **WHOLE}
    if layer.values is not None:
        trace["customdata"] = layer.values
        trace["marker"] = _shades(layer.values, layer) if layer.scale_title else marker
    return [trace]


def _positions(values: FloatArray | Sequence[str]) -> Any:  # noqa: ANN401  an array, or names
    return values if isinstance(values, np.ndarray) else _texts([str(value) for value in values])


def _shades(values: FloatArray, layer: Points) -> Trace:
    largest = max(float(np.abs(values).max(initial=0.0)), np.finfo(float).tiny)
    return {
        "color": values,
        "cmin": -largest,
        "cmax": largest,
        "colorscale": BLUE_TO_ORANGE,
        "size": layer.size,
        "colorbar": {"title": {"text": _text(layer.scale_title)}, "x": 0, "xanchor": "right", "thickness": 14},
        "line": {"width": 0.8, "color": _colour(Role.MUTED)},
    }


@_draw.register(Labels)
def _(layer: Labels, panel: Panel) -> list[Trace]:
    del panel
    font = {"color": _colour(layer.colour), "size": 12.5}
    words = {"text": _texts(layer.texts), "textposition": _side(layer.side), "textfont": font}
    return [{"type": "scatter", "mode": "text", "x": layer.x, "y": layer.y, "hoverinfo": "skip", **words, **WHOLE}]


@_draw.register(Areas)
def _(layer: Areas, panel: Panel) -> list[Trace]:
    del panel
    x, y = (np.pad(part, ((0, 0), (0, 1)), constant_values=np.nan).ravel() for part in (layer.x, layer.y))
    fill = {"fill": "toself", "fillcolor": _colour(layer.colour, layer.opacity)}
    line = {"width": 1, "color": _colour(layer.colour)}
    return [{"type": "scatter", "mode": "lines", "x": x, "y": y, "line": line, "hoverinfo": "skip", **fill}]


@_draw.register(VerticalLines)
def _(layer: VerticalLines, panel: Panel) -> list[Trace]:
    low, high = panel.y.limits or (0.0, 1.0)
    x, y = joined_segments(*(np.stack([layer.x, np.full(len(layer.x), end)], 1) for end in (low, high)))
    line = {"width": layer.width, "dash": layer.dash, "color": _colour(layer.colour, layer.opacity)}
    trace: Trace = {"type": "scatter", "mode": "lines", "x": x, "y": y, "line": line, **_hover(layer.hover)}
    if len(layer.texts):
        trace["text"] = [_text(text) for text in layer.texts for _ in range(3)]  # of both ends, and of the gap
    return [trace]


@_draw.register(Span)
def _(layer: Span, panel: Panel) -> list[Trace]:
    del layer, panel
    return []  # a shape of the layout


@_draw.register(Bars)
def _(layer: Bars, panel: Panel) -> list[Trace]:
    del panel
    names, sizes = _texts(layer.labels), layer.sizes
    colours = [_colour(colour, 0.7 if colour is Role.MUTED else 1.0) for colour in layer.colours]
    trace: Trace = {
        "type": "bar",
        "orientation": "h" if layer.is_horizontal else "v",
        "x": sizes if layer.is_horizontal else names,
        "y": names if layer.is_horizontal else sizes,
        "marker": {
            "color": colours or _colour(layer.colour, layer.opacity),
            "pattern": {"shape": "/" if layer.is_hatched else ""},
        },
        **_hover(layer.hover, with_name=layer.in_legend),
    }
    if len(layer.texts):
        trace |= {"text": _texts(layer.texts), "textposition": "auto", "insidetextfont": {"color": "@paper"}}
    if layer.values is not None:
        trace["customdata"] = layer.values
    return [trace]


@_draw.register(HeatMap)
def _(layer: HeatMap, panel: Panel) -> list[Trace]:
    del panel
    ticks = np.linspace(0.0, layer.highest, 5) if layer.is_linear else np.arange(0.0, int(layer.highest_shade) + 1)
    is_written = layer.values.size <= MOST_CELLS
    return [
        {
            "type": "heatmap",
            "x": _texts(layer.columns),
            "y": _texts(layer.rows),
            "z": layer.shades,
            "text": [_texts(row) for row in layer.texts],
            "texttemplate": "%{text}" if is_written else "",
            "zmin": 0,
            "zmax": layer.highest_shade,
            "colorscale": "Cividis",
            "showscale": not is_written,
            "colorbar": {
                "title": {"text": _text(layer.scale_title)},
                "tickvals": ticks,
                "ticktext": [f"{tick if layer.is_linear else 10**tick:g}" for tick in ticks],
                "thickness": 14,
            },
            **_hover(layer.hover, with_name=False),
        }
    ]


def _layout(picture: Picture, *, has_legend: bool) -> dict[str, Any]:
    layout: dict[str, Any] = {"showlegend": has_legend}
    is_beside = picture.panels[0].x is not None
    domains = _domains([panel.share for panel in picture.panels], GAP_BESIDE if is_beside else GAP)
    for index, (panel, (start, end)) in enumerate(zip(picture.panels, domains, strict=True)):
        y = _number("yaxis", index)
        if panel.x is not None:
            anchor = {"anchor": "y", "domain": [start, end]}
            layout[_number("xaxis", index)] = {**_axis(panel.x, "x", panel), **anchor}
            layout["yaxis"] = _axis(panel.y, "y", panel)
        else:
            layout[y] = {**_axis(panel.y, "y", panel), "domain": [1 - end, 1 - start]}
        if panel.backdrop is not None:
            layout[_number("yaxis", len(picture.panels) + index)] = {
                "overlaying": _number("y", index),
                "side": "right",
                "type": "log",
                "showgrid": False,
                "showticklabels": False,
                "ticks": "",
            }
    if not is_beside:
        layout["xaxis"] = {
            **_axis(picture.x, "x", picture.panels[0]),
            "anchor": _number("y", len(picture.panels) - 1),
        }
    shapes = [_shade(layer) for layer in picture.layers if isinstance(layer, Span)]
    return {**layout, "shapes": shapes} if shapes else layout


def _domains(shares: Sequence[float], gap: float) -> list[tuple[float, float]]:
    """Give the ends of each panel, 0 to 1, in the order of the panels."""
    free = 1 - gap * (len(shares) - 1)
    sizes = free * np.array(shares) / sum(shares)
    starts = np.concatenate([[0.0], np.cumsum(sizes + gap)[:-1]])
    return [(float(start), float(min(start + size, 1.0))) for start, size in zip(starts, sizes, strict=True)]


def _axis(axis: Axis, side: str, panel: Panel) -> dict[str, Any]:
    drawn: dict[str, Any] = {"title": {"text": _text(axis.title)}}
    if not axis.is_frequency:  # the page switches those between linear and logarithmic
        drawn["type"] = axis.scale
    is_logarithm = axis.scale == "log" and not axis.is_frequency
    if axis.limits is not None:
        drawn["range"] = [float(np.log10(end)) if is_logarithm else float(end) for end in axis.limits]
    if is_logarithm:
        low, high = axis.limits or _extent(side, panel)
        is_plain = axis.tick_step is None and PLAIN_NUMBERS[0] < low and high < PLAIN_NUMBERS[1]
        drawn |= {**PLAIN_TICKS, "nticks": _most_ticks(low, high)} if is_plain else POWERS
    if axis.ticks is not None:
        drawn |= {"tickvals": list(axis.ticks), "ticktext": _texts(axis.tick_labels)}
    if axis.tick_step is not None:
        drawn |= {"dtick": axis.tick_step, "tick0": 0}
    if axis.tick_angle:
        drawn["tickangle"] = axis.tick_angle
    if axis.is_reversed:
        drawn["autorange"] = "reversed"
    return drawn | _frame(axis, side, panel)


def _extent(side: str, panel: Panel) -> tuple[float, float]:
    """Give the smallest and the largest positive number of what a logarithmic axis shows."""
    names = ("x",) if side == "x" else ("y", "low", "high", "sizes")
    parts = [getattr(layer, name, None) for layer in panel.layers for name in names]
    shown = np.concatenate([np.ravel(part) for part in parts if isinstance(part, np.ndarray)] or [np.ones(1)])
    shown = shown[np.isfinite(shown) & (shown > 0)]
    return (float(shown.min()), float(shown.max())) if shown.size else (1.0, 1.0)


def _most_ticks(low: float, high: float) -> int:
    """Give as many ticks as make 20, 50, 100, 200: with more, plotly labels 30, 40 and 60 to 90 too."""
    return max(int(np.log10(high / low) / DECADES_A_TICK), FEWEST_TICKS)


def _frame(axis: Axis, side: str, panel: Panel) -> dict[str, Any]:
    """Lines of an axis."""
    frame: dict[str, Any] = {"fixedrange": True} if axis.is_fixed else {}
    if axis.is_bare:
        frame |= {"showgrid": False, "zeroline": False, "showline": False, "ticks": "", "showticklabels": False}
    elif side == "x" and panel.y.is_bare:
        frame |= {"showgrid": False, "zeroline": False}
    elif axis.has_zero_line:
        frame["zeroline"] = True
    if side == "y" and panel.is_to_scale:
        frame["scaleanchor"] = "x"
    if any(isinstance(layer, HeatMap) for layer in panel.layers):
        frame |= {"title": {"text": _text(axis.title), "standoff": BESIDE_NAMES_PX[side]}, "ticklabelstandoff": 4}
    return frame


def _shade(span: Span) -> dict[str, Any]:
    return {
        "type": "rect",
        "xref": "x",
        "yref": "paper",
        "x0": span.low,
        "x1": span.high,
        "y0": 0,
        "y1": 1,
        "fillcolor": _colour(span.colour, span.opacity),
        "line": {"width": 0},
        "layer": "below",
    }
