"""Pictures on paper: a description drawn by Matplotlib, with colours that colour-blind people can tell apart."""

from __future__ import annotations

from functools import singledispatch
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from matplotlib import rc_context
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.ticker import (
    FuncFormatter,
    LogFormatterMathtext,
    LogLocator,
    MaxNLocator,
    MultipleLocator,
    NullLocator,
)

from frf_ipz.arguments import as_path
from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.output_files import replacing
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
    legend_layers,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.axis import XAxis, YAxis
    from matplotlib.container import BarContainer

FORMATS = ("svg", "pdf", "png")
WIDTH_IN = 6.3  # a text column of most journals; lengths in inches, as Matplotlib takes them
INCHES_PER_PX = 3.2 / 420  # of the height of a picture: what is 420 pixels high on a page suits a column so
POINTS_PER_PX = 0.62  # of widths and symbols: a page is wider than a column, and seen from further away
TITLE_IN = 0.25  # above each of several pictures
MOST_NAMES = 18  # in a legend; with more it is left out, as it would hide the picture
MOST_COLUMNS = 3  # of a legend
ROW_IN = 0.17  # of a legend
LONGEST_NAME, LONGEST_TICK = 90, 40  # characters that there is room for: in a row, and upright or beside the axes
LEGEND_SYMBOL = 7.0  # at most, points
CHARACTERS = 96  # of the legend's font in the width of a figure
SYMBOL_CHARACTERS = 7  # as wide as a symbol before a name
ALL_LABELLED = 0.5  # decades of a logarithmic axis of which all ticks are labelled
FEW_DECADES = 2.0  # seen of a logarithmic axis whose ticks are plain numbers
SHADE_TICKS = tuple(np.log10([1, 2, 5]).tolist())  # of each decade
MOST_CELLS = 240  # of a map in which the numbers are written
MANY_POINTS = 20_000  # from which a vector file holds a raster of them
COLOURS = (
    "#0072b2",
    "#d55e00",
    "#009e73",
    "#cc79a7",
    "#8a6a00",
    "#56b4e9",
    "#4d4d4d",
)  # Okabe and Ito, yellow left out
ROLES: dict[Role, str] = {
    Role.MEASURED: "#1b1f24",
    Role.NOMINAL: "#b45f00",
    Role.UPDATED: "#0072b2",
    Role.REFERENCE: "#1b1f24",
    Role.GOOD: "#009e73",
    Role.BAD: "#d55e00",
    Role.INK: "#1b1f24",
    Role.MUTED: "#8c959f",
}
GRID = "#e4e8ec"
BLUE_TO_ORANGE = LinearSegmentedColormap.from_list("change", ["#0072b2", "#f2f2f2", "#d55e00"])
DASHES: dict[str, Any] = {
    "solid": "-",
    "dash": "--",
    "dot": ":",
    "dashdot": "-.",
    "longdash": (0, (8, 3)),
    "longdashdot": (0, (8, 3, 1, 3)),
}
SYMBOLS = {
    "circle": "o",
    "square": "s",
    "square-x": "X",
    "diamond": "D",
    "cross": "x",
    "triangle-up": "^",
    "triangle-down": "v",
    "star": "*",
    "tick": "|",
}
LEAST_WIDTH = 0.9  # of a vertical line, points
BESIDE_POINTS = 4.0  # from a point to its label
BAR_WIDTH = 0.8  # of the room that a category has

Handles = dict[int, "Artist"]


def draw_pictures(pictures: Sequence[Picture]) -> Figure:
    """Draw pictures below each other.

    Parameters
    ----------
    pictures : sequence of Picture
        One or more; of several, each has its title.

    Returns
    -------
    Figure
        It belongs to no window.
    """
    title = TITLE_IN if len(pictures) > 1 else 0.0
    heights = [INCHES_PER_PX * picture.height_px + title + _legend_height_in(picture) for picture in pictures]
    figure = Figure(figsize=(WIDTH_IN, sum(heights)), layout="constrained")
    parts = figure.subfigures(len(pictures), 1, height_ratios=heights, squeeze=False)[:, 0]
    for part, picture in zip(parts, pictures, strict=True):
        _draw_panels(part, picture)
        if title:
            part.suptitle(_plain(picture.title), fontsize=9)
    return figure


def draw_panel(picture: Picture, ax: Axes | None = None, *, panel: int = 0) -> Axes:
    """Draw one panel of a picture.

    Parameters
    ----------
    picture : Picture
        The picture.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.
    panel : int
        Which panel.

    Returns
    -------
    Axes
        With the panel.
    """
    content = picture.panels[panel]
    x = content.x or picture.x
    if ax is None:
        height = max(picture.height_px / len(picture.panels), 0.6 * picture.height_px)
        ax = Figure(figsize=(WIDTH_IN, INCHES_PER_PX * height), layout="constrained").subplots()
    handles = _draw(ax, content, x, [layer for layer in picture.layers if isinstance(layer, Span)])
    _title(ax, x, content.y)
    if picture.has_legend:
        _legend(ax, [layer for layer in _all_layers(content) if layer.in_legend], handles)
    return ax


def save_figure(figure: Figure, path: str | Path | BinaryIO, *, file_format: str) -> None:
    """Write a figure to a file, with text as text.

    Parameters
    ----------
    figure : Figure
        The figure.
    path : str, Path or binary stream
        File to write.
    file_format : str
        ``svg``, ``pdf`` or ``png``.

    Raises
    ------
    InputError
        If there is no such format, or the file cannot be written.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> from tempfile import TemporaryDirectory
    >>> ax = frf_ipz.plotting.plot_frfs(frfs)
    >>> with TemporaryDirectory() as folder:
    ...     frf_ipz.plotting.save_figure(ax.figure, f"{folder}/frfs.svg", file_format="svg")
    """
    target = as_path(path) if isinstance(path, str | Path) else path
    if file_format not in FORMATS:
        raise InputError(f"'{file_format}' is no format of pictures; {did_you_mean(str(file_format), FORMATS)}")
    with rc_context({"svg.fonttype": "none", "pdf.fonttype": 42, "savefig.dpi": 200}):  # text stays text
        try:
            if isinstance(target, Path):
                with replacing(target) as beside:
                    figure.savefig(beside, format=file_format)
            else:
                figure.canvas.print_figure(target, format=file_format)
        except OSError as error:
            raise InputError(f"{target}: cannot be written: {error.strerror}") from None


def _draw_panels(part: SubFigure, picture: Picture) -> None:
    shares = [panel.share for panel in picture.panels]
    is_beside = picture.panels[0].x is not None
    if is_beside:
        axes = part.subplots(1, len(shares), sharey=True, width_ratios=shares, squeeze=False)[0]
    else:
        axes = part.subplots(len(shares), 1, sharex=True, height_ratios=shares, squeeze=False)[:, 0]
    spans = [layer for layer in picture.layers if isinstance(layer, Span)]
    handles: Handles = {}
    for ax, panel in zip(axes, picture.panels, strict=True):
        x = panel.x or picture.x
        handles |= _draw(ax, panel, x, spans)
        is_outer = is_beside or ax is axes[-1]
        _title(ax, x if is_outer else Axis(), Axis() if is_beside and ax is not axes[0] else panel.y)
    if picture.has_legend:
        _legend(axes[0], legend_layers(picture), handles)


def _all_layers(panel: Panel) -> tuple[Layer, ...]:
    return panel.layers if panel.backdrop is None else (panel.backdrop, *panel.layers)


def _draw(ax: Axes, panel: Panel, x: Axis, spans: Iterable[Span]) -> Handles:
    """Draw a panel without titles; gives what stands for each layer in a legend, by the layer's identity."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(visible=True, color=GRID, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.tick_params(which="both", labelsize=8)
    for side, axis in (("x", x), ("y", panel.y)):
        if axis.scale == "log":
            getattr(ax, f"set_{side}scale")("log")
    handles = {} if panel.backdrop is None else {id(panel.backdrop): _draw_behind(ax, panel.backdrop)}
    bars = [layer for layer in panel.layers if isinstance(layer, Bars)]
    handles |= {id(layer): _draw_bars(layer, ax, rank, len(bars)) for rank, layer in enumerate(bars)}
    layers = [*spans, *[layer for layer in panel.layers if not isinstance(layer, Bars | Span)]]
    handles |= {id(layer): _draw_layer(layer, ax) for layer in layers if not _covers_all(layer, x)}
    _set_axis(ax, "x", x)
    _set_axis(ax, "y", panel.y)
    if panel.is_to_scale:
        ax.set_aspect("equal")
    if x.is_bare or panel.y.is_bare or any(isinstance(layer, HeatMap) for layer in panel.layers):
        ax.grid(visible=False)
    return handles


def _draw_behind(ax: Axes, line: Line) -> Artist:
    behind = ax.twinx()
    behind.set_yscale("log")
    handle = _draw_layer(line, behind)
    behind.set_axis_off()
    ax.set_zorder(behind.get_zorder() + 1)
    ax.patch.set_visible(False)
    return handle


def _covers_all(layer: Layer, x: Axis) -> bool:
    """Tell whether a layer shades all that is seen."""
    return isinstance(layer, Span) and x.limits is not None and layer.low <= x.limits[0] and x.limits[1] <= layer.high


def _set_axis(ax: Axes, side: str, axis: Axis) -> None:
    ticks = ax.xaxis if side == "x" else ax.yaxis
    if axis.limits is not None:
        getattr(ax, f"set_{side}lim")(*axis.limits)
    if axis.is_bare:
        ticks.set_major_locator(NullLocator())
        ticks.set_minor_locator(NullLocator())
        ax.spines["bottom" if side == "x" else "left"].set_visible(False)
    else:
        _set_ticks(ticks, axis)
    if axis.tick_angle:
        ax.tick_params(axis="x", labelrotation=-axis.tick_angle)
        for label in ax.get_xticklabels():
            label.set(ha="right", rotation_mode="anchor")
    if axis.has_zero_line:
        (ax.axvline if side == "x" else ax.axhline)(0, color=ROLES[Role.MUTED], linewidth=0.6, zorder=0.9)
    if axis.is_reversed:
        ticks.set_inverted(True)


def _set_ticks(ticks: XAxis | YAxis, axis: Axis) -> None:
    if axis.ticks is not None:
        ticks.set_ticks(list(axis.ticks), [_plain(text, LONGEST_TICK) for text in axis.tick_labels] or None)
    elif axis.scale == "linear" and axis.tick_step is not None:
        ticks.set_major_locator(MultipleLocator(axis.tick_step))
    elif axis.scale == "linear":
        ticks.set_major_locator(MaxNLocator(nbins="auto", steps=[1, 2, 5, 10]))
    elif axis.is_frequency:
        ticks.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ticks.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
        ticks.set_minor_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    elif axis.scale == "log":
        powers = LogFormatterMathtext()
        ticks.set_major_formatter(FuncFormatter(lambda value, _: _label(value, ticks) or powers(value)))
        ticks.set_minor_formatter(FuncFormatter(lambda value, _: _label(value, ticks)))


def _label(value: float, ticks: XAxis | YAxis) -> str:
    """Write a tick as a plain number where few powers of ten are seen."""
    low, high = sorted(ticks.get_view_interval())
    decades = float(np.log10(high / low)) if low > 0 else np.inf
    is_plain = PLAIN_NUMBERS[0] < low and high < PLAIN_NUMBERS[1] and decades <= FEW_DECADES
    return f"{value:.4g}" if is_plain and (decades <= ALL_LABELLED or f"{value:e}"[0] in "1235") else ""


def _title(ax: Axes, x: Axis, y: Axis) -> None:
    ax.set_xlabel(_plain(x.title), fontsize=9)
    ax.set_ylabel(_plain(y.title, LONGEST_TICK), fontsize=9)


def _legend_height_in(picture: Picture) -> float:
    """Give the room that the rows of a legend need beyond the first."""
    names = list(dict.fromkeys(layer.name for layer in legend_layers(picture))) if picture.has_legend else []
    if not 0 < len(names) <= MOST_NAMES:
        return 0.0
    return ROW_IN * (-(-len(names) // _legend_columns(names)) - 1)


def _legend_columns(names: Iterable[str]) -> int:
    return int(np.clip(CHARACTERS // (max(map(len, names)) + SYMBOL_CHARACTERS), 1, MOST_COLUMNS))


def _legend_handle(artist: Artist) -> Artist:
    """Give what stands for a layer in a legend: large symbols would cover each other there."""
    if not isinstance(artist, Line2D) or artist.get_markersize() <= LEGEND_SYMBOL:
        return artist
    small = Line2D([], [])
    small.update_from(artist)
    small.set_markersize(LEGEND_SYMBOL)
    return small


def _legend(ax: Axes, layers: Sequence[Layer], handles: Handles) -> None:
    """Name layers above the axes."""
    named = {layer.name: handles[id(layer)] for layer in layers if id(layer) in handles}
    if not 0 < len(named) <= MOST_NAMES:
        return
    ax.legend(
        [_legend_handle(handle) for handle in named.values()],
        [_plain(name) for name in named],
        loc="lower left",
        bbox_to_anchor=(0, 1),
        ncols=_legend_columns(named),
        frameon=False,
        fontsize=8,
        borderaxespad=0.2,
    )


def _plain(text: str, longest: int = LONGEST_NAME) -> str:
    """Text that Matplotlib sets as it stands: no formula, no name that a legend leaves out; cut where it is long."""
    short = text if len(text) <= longest else f"{text[: longest - 1]}…"
    escaped = short.replace("$", "\\$")
    return f" {escaped}" if escaped.startswith("_") else escaped


def _label_of(layer: Layer) -> str:
    return _plain(layer.name) if layer.in_legend else "_nolegend_"


def _colour(colour: Colour) -> str:
    return ROLES[colour] if isinstance(colour, Role) else COLOURS[colour % len(COLOURS)]


@singledispatch
def _draw_layer(layer: Layer, ax: Axes) -> Artist:
    """Draw a layer; gives what stands for it in a legend."""
    raise TypeError(f"{type(layer).__name__} cannot be drawn on {ax}")


@_draw_layer.register(Line)
def _(layer: Line, ax: Axes) -> Artist:
    colour = _colour(layer.colour)
    style: dict[str, Any] = {
        "label": _label_of(layer),
        "color": colour,
        "alpha": layer.opacity,
        "linestyle": DASHES[layer.dash],
        "linewidth": POINTS_PER_PX * layer.width,
        "marker": SYMBOLS.get(layer.symbol, ""),
        "markersize": POINTS_PER_PX * layer.size,
    }
    if layer.deviation is not None:
        ax.errorbar(layer.x, layer.y, layer.deviation, capsize=2, fmt="none", ecolor=colour)
    return ax.plot(layer.x, layer.y, **style)[0]


@_draw_layer.register(Band)
def _(layer: Band, ax: Axes) -> Artist:
    colour = _colour(layer.colour)
    style: dict[str, Any] = {"label": _label_of(layer), "color": colour, "alpha": layer.opacity, "linewidth": 0}
    return ax.fill_between(layer.x, layer.low, layer.high, **style)


@_draw_layer.register(Points)
def _(layer: Points, ax: Axes) -> Artist:
    size, colour = POINTS_PER_PX * layer.size, _colour(layer.colour)
    is_filled = layer.is_filled or layer.symbol == "square-x"  # whose outline alone is no symbol here
    if layer.scale_title and layer.values is not None:
        largest = max(float(np.abs(layer.values).max(initial=0.0)), np.finfo(float).tiny)
        colours: dict[str, Any] = {"c": layer.values, "cmap": BLUE_TO_ORANGE, "vmin": -largest, "vmax": largest}
        points = ax.scatter(layer.x, layer.y, s=size**2, edgecolors=ROLES[Role.MUTED], linewidths=0.4, **colours)
        bar = ax.figure.colorbar(points, ax=ax, fraction=0.05)
        bar.set_label(_plain(layer.scale_title), fontsize=8)
        bar.ax.tick_params(labelsize=8)
        return points
    if layer.labels:
        _write_beside(ax, layer.x, layer.y, layer.texts, layer.labels, colour)
    return ax.plot(
        _names(layer.x),
        _names(layer.y),
        label=_label_of(layer),
        linestyle="none",
        marker=SYMBOLS[layer.symbol],
        color=colour,
        alpha=layer.opacity,
        markersize=size,
        markerfacecolor=colour if is_filled else "none",
        markeredgewidth=0 if is_filled and layer.symbol not in {"cross", "tick"} else 1.0,
        rasterized=len(layer.x) > MANY_POINTS,
    )[0]


def _names(values: Any) -> Any:  # noqa: ANN401  an array, or names
    return [_plain(value, LONGEST_TICK) if isinstance(value, str) else value for value in values]


@_draw_layer.register(Labels)
def _(layer: Labels, ax: Axes) -> Artist:
    _write_beside(ax, layer.x, layer.y, layer.texts, layer.side, _colour(layer.colour))
    return ax.patch


def _write_beside(ax: Axes, x: Any, y: Any, texts: Sequence[str], side: str, colour: str) -> None:  # noqa: ANN401
    across = -1 if "left" in side else 1 if "right" in side else 0
    up = 1 if "above" in side else -1 if "below" in side else 0
    for position in zip(x, y, texts, strict=True):
        ax.annotate(
            _plain(position[2]),
            position[:2],
            xytext=(BESIDE_POINTS * across, BESIDE_POINTS * up),
            textcoords="offset points",
            ha={-1: "right", 0: "center", 1: "left"}[across],
            va={-1: "top", 0: "center", 1: "bottom"}[up],
            fontsize=8,
            color=colour,
        )


@_draw_layer.register(Areas)
def _(layer: Areas, ax: Axes) -> Artist:
    colour = _colour(layer.colour)
    return ax.fill(
        layer.x.T, layer.y.T, facecolor=(colour, layer.opacity), edgecolor=(colour, 2 * layer.opacity), linewidth=0.6
    )[0]


@_draw_layer.register(VerticalLines)
def _(layer: VerticalLines, ax: Axes) -> Artist:
    return ax.vlines(
        layer.x,
        0,
        1,
        transform=ax.get_xaxis_transform(),
        color=_colour(layer.colour),
        alpha=layer.opacity,
        linestyle=DASHES[layer.dash],
        linewidth=max(POINTS_PER_PX * layer.width, LEAST_WIDTH),
    )


@_draw_layer.register(Span)
def _(layer: Span, ax: Axes) -> Artist:
    return ax.axvspan(layer.low, layer.high, color=_colour(layer.colour), alpha=layer.opacity, linewidth=0)


@_draw_layer.register(HeatMap)
def _(layer: HeatMap, ax: Axes) -> Artist:
    top = layer.highest_shade
    image = ax.imshow(layer.shades, cmap="cividis", aspect="auto", vmin=0, vmax=top)
    ax.set_xticks(range(len(layer.columns)), _names(layer.columns))
    ax.set_yticks(range(len(layer.rows)), _names(layer.rows))
    ticks = [decade + step for decade in range(int(top) + 1) for step in SHADE_TICKS if decade + step <= top]
    powers = FuncFormatter(lambda value, _: f"{10**value:.3g}")
    bar = ax.figure.colorbar(
        image, ax=ax, ticks=None if layer.is_linear else ticks, format=None if layer.is_linear else powers
    )
    bar.set_label(_plain(layer.scale_title), fontsize=8)
    bar.ax.tick_params(labelsize=8)
    if layer.values.size <= MOST_CELLS:
        for (row, column), value in np.ndenumerate(layer.shades):
            colour = "white" if value < top / 2 else "black"
            ax.text(column, row, layer.texts[row][column], ha="center", va="center", fontsize=7, color=colour)
    return image


def _draw_bars(layer: Bars, ax: Axes, rank: int, count: int) -> Artist:
    """Draw the bars of one layer beside those of the others."""
    width = BAR_WIDTH / count
    positions = np.arange(len(layer.labels)) + width * (rank - (count - 1) / 2)
    colours = [_colour(colour) for colour in layer.colours or [layer.colour] * len(layer.labels)]
    hatch = "//" if layer.is_hatched else ""
    draw = ax.barh if layer.is_horizontal else ax.bar
    bars: BarContainer = draw(positions, layer.sizes, 0.95 * width, color=colours, alpha=layer.opacity, hatch=hatch)
    ticks = ax.yaxis if layer.is_horizontal else ax.xaxis
    ticks.set_ticks(np.arange(len(layer.labels)), _names(layer.labels))
    ax.grid(visible=False, axis="y" if layer.is_horizontal else "x")
    if layer.texts:
        ax.bar_label(bars, _names(layer.texts), padding=3, fontsize=7)
        ax.margins(x=0.16)
    return bars.patches[0]
