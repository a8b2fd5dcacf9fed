"""A picture as plain data: what it shows, for whoever draws it.

Each picture of a run is described once. `plotting.figures` draws a description on paper with Matplotlib, the report on
its page with Plotly. A description names the meaning of a colour, not the colour; it holds all points, of which a page
draws those that a screen can show; and it says in words what can be seen.

A picture has panels, each panel two axes and layers. Layers are drawn in their order, the first one at the back.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from frf_ipz.arrays import FloatArray

if TYPE_CHECKING:
    from collections.abc import Sequence

WIDE = 30.0  # ratio of the ends from which a frequency axis is logarithmic
FREQUENCY = "Frequency, Hz"
PLAIN_NUMBERS = (1e-4, 1e5)  # between them a logarithmic axis can do without powers of ten
HEIGHT_PX = 420  # of a picture with one panel


class Role(StrEnum):
    """What a colour means."""

    MEASURED = "measured"
    NOMINAL = "nominal"
    UPDATED = "updated"
    REFERENCE = "reference"
    GOOD = "good"
    BAD = "bad"
    INK = "ink"
    MUTED = "muted"


Colour: TypeAlias = "Role | int"
"""A meaning, or the number of a curve among others, from 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One axis of a panel.

    Parameters
    ----------
    title : str
        Quantity and unit.
    scale : str
        ``linear``, ``log`` or ``category``: then positions are names.
    limits : pair of float, optional
        What is seen at first, in the axis' own quantity; all layers where it is left out.
    ticks : tuple of float, optional
        Where they are; chosen by whoever draws where they are left out.
    tick_labels : tuple of str
        Their texts; the numbers where it is empty.
    tick_step : float, optional
        From one tick to the next, on a logarithmic axis in decades.
    tick_angle : float
        By which their texts are turned, degrees.
    is_reversed : bool
        It grows downwards, or to the left.
    is_bare : bool
        Nothing of it is drawn but its title.
    is_fixed : bool
        Zooming leaves it alone.
    has_zero_line : bool
        The line at 0 is drawn.
    is_frequency : bool
        It is one of the frequency axes of a page that zoom together.
    """

    title: str = ""
    scale: str = "linear"
    limits: tuple[float, float] | None = None
    ticks: tuple[float, ...] | None = None
    tick_labels: tuple[str, ...] = ()
    tick_step: float | None = None
    tick_angle: float = 0.0
    is_reversed: bool = False
    is_bare: bool = False
    is_fixed: bool = False
    has_zero_line: bool = False
    is_frequency: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layer:
    """What all layers have.

    Parameters
    ----------
    name : str
        In the legend, and in what is said of a point.
    colour : Role or int
        Its meaning, or its number.
    opacity : float
        1 hides what lies behind.
    frf : int, optional
        Number of the measured FRF that it belongs to: a page shows and hides it with that FRF.
    group : str
        Layers of one group are shown and hidden together; empty for none.
    in_legend : bool
        The legend names it.
    is_shown : bool
        False for what a page shows only after a click on its name.
    """

    name: str
    colour: Colour
    opacity: float = 1.0
    frf: int | None = None
    group: str = ""
    in_legend: bool = True
    is_shown: bool = True


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Line(Layer):
    """A curve.

    Parameters
    ----------
    x, y : (n,) array
        Its points; a gap where one is NaN.
    dash : str
        ``solid``, ``dash``, ``dot``, ``dashdot``, ``longdash`` or ``longdashdot``.
    width : float
        Of the line, in pixels of a page.
    symbol : str
        Drawn at each point; nothing where it is empty.
    size : float
        Of the symbols, in pixels of a page.
    deviation : (n,) array, optional
        Half lengths of error bars.
    hover : str
        What is said of a point: a pattern of `str.format` with ``x``, ``y``, ``text`` and ``value``; nothing where it
        is empty. Text of others goes in by `in_hover`.
    texts : sequence of str
        ``text`` of each point.
    """

    x: FloatArray
    y: FloatArray
    dash: str = "solid"
    width: float = 1.6
    symbol: str = ""
    size: float = 6.0
    deviation: FloatArray | None = None
    hover: str = ""
    texts: Sequence[str] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Band(Layer):
    """The space between two curves.

    Parameters
    ----------
    x, low, high : (n,) array
        The curves.
    """

    x: FloatArray
    low: FloatArray
    high: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Points(Layer):
    """Single points.

    Parameters
    ----------
    x : (n,) array or sequence of str
        Positions; names on an axis of categories.
    y : (n,) array or sequence of str
        As `x`.
    symbol : str
        ``circle``, ``square``, ``square-x``, ``diamond``, ``cross``, ``triangle-up``, ``triangle-down``, ``star`` or
        ``tick``, a short line upwards.
    size : float
        In pixels of a page.
    is_filled : bool
        False for the outline of the symbol.
    hover : str
        As that of a `Line`.
    texts : sequence of str
        ``text`` of each point.
    values : (n,) array, optional
        ``value`` of each point.
    scale_title : str
        Where it is given, points are coloured by `values`, from blue below zero to orange above.
    labels : str
        Side on which the texts are written beside the points, as ``above`` or ``below right``; nowhere where it is
        empty.
    """

    x: FloatArray | Sequence[str]
    y: FloatArray | Sequence[str]
    symbol: str = "circle"
    size: float = 8.0
    is_filled: bool = True
    hover: str = ""
    texts: Sequence[str] = ()
    values: FloatArray | None = None
    scale_title: str = ""
    labels: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Labels(Layer):
    """Words beside places.

    Parameters
    ----------
    x, y : (n,) array
        The places.
    texts : sequence of str
        The words.
    side : str
        Where they stand, as ``above`` or ``below right``.
    """

    x: FloatArray
    y: FloatArray
    texts: Sequence[str]
    side: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Areas(Layer):
    """Closed outlines, filled faintly.

    Parameters
    ----------
    x, y : (n_areas, n_corners) array
        Their corners.
    """

    x: FloatArray
    y: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VerticalLines(Layer):
    """Lines over the whole height of a panel, whose vertical axis states its limits.

    Parameters
    ----------
    x : (n,) array
        Where they stand.
    dash : str
        As that of a `Line`.
    width : float
        In pixels of a page.
    hover : str
        As that of a `Line`.
    texts : sequence of str
        ``text`` of each line.
    """

    x: FloatArray
    dash: str = "solid"
    width: float = 1.0
    hover: str = ""
    texts: Sequence[str] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Span(Layer):
    """A range of the horizontal axis, shaded over the whole height of the picture.

    Parameters
    ----------
    low, high : float
        From, to.
    """

    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bars(Layer):
    """Bars, one a category; several layers of them stand side by side.

    Parameters
    ----------
    labels : sequence of str
        The categories.
    sizes : (n,) array
        Lengths.
    colours : sequence of Role or int
        Of each bar, where they differ.
    is_horizontal : bool
        They lie.
    is_hatched : bool
        They are hatched.
    texts : sequence of str
        Written on each bar.
    values : (n,) array, optional
        ``value`` of each bar.
    hover : str
        As that of a `Line`.
    """

    labels: Sequence[str]
    sizes: FloatArray
    colours: Sequence[Colour] = ()
    is_horizontal: bool = False
    is_hatched: bool = False
    texts: Sequence[str] = ()
    values: FloatArray | None = None
    hover: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeatMap(Layer):
    """A matrix of numbers as shades: of their logarithm from 1, or of the numbers from 0.

    Parameters
    ----------
    columns, rows : sequence of str
        Names.
    values : (n_rows, n_columns) array
        The numbers, positive or NaN.
    texts : sequence of sequence of str
        The numbers as people read them, row by row.
    highest : float
        Number of the last shade.
    is_linear : bool
        Shades are of the numbers; else of their logarithm.
    scale_title : str
        What the numbers are.
    hover : str
        As that of a `Line`; ``x`` and ``y`` are the names.
    """

    columns: Sequence[str]
    rows: Sequence[str]
    values: FloatArray
    texts: Sequence[Sequence[str]]
    highest: float
    scale_title: str
    is_linear: bool = False
    hover: str = ""

    @property
    def shades(self) -> FloatArray:
        """What is shaded, from 0."""
        return self.values if self.is_linear else np.log10(np.maximum(self.values, 1e-3))

    @property
    def highest_shade(self) -> float:
        """Where the shades end."""
        return self.highest if self.is_linear else float(np.log10(self.highest))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Panel:
    """One pair of axes.

    Parameters
    ----------
    y : Axis
        The vertical one.
    layers : tuple of Layer
        From the back to the front.
    x : Axis, optional
        The horizontal one, where panels stand beside each other; else they share that of the picture.
    share : float
        Of the height or width, relative to the other panels.
    backdrop : Line, optional
        A curve behind all layers, on a logarithmic axis of its own that is not drawn.
    is_to_scale : bool
        A metre is as long upwards as it is sideways.
    """

    y: Axis
    layers: tuple[Layer, ...]
    x: Axis | None = None
    share: float = 1.0
    backdrop: Line | None = None
    is_to_scale: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Picture:
    """One picture.

    Parameters
    ----------
    name : str
        Unique in a run; letters, digits and hyphens.
    title : str
        What it shows.
    alt : str
        What can be seen in it, in words, for those who cannot.
    panels : tuple of Panel
        From the top down; from the left to the right where they have horizontal axes of their own.
    x : Axis
        The horizontal axis that all panels share.
    note : str
        How to read it.
    height_px : int
        On a page.
    has_legend : bool
        False where the axes say it all.
    """

    name: str
    title: str
    alt: str
    panels: tuple[Panel, ...]
    x: Axis = Axis()
    note: str = ""
    height_px: int = HEIGHT_PX
    has_legend: bool = True

    @property
    def is_over_frequency(self) -> bool:
        """Its horizontal axis is a frequency."""
        return self.x.is_frequency

    @property
    def layers(self) -> tuple[Layer, ...]:
        """All layers of all panels, without what lies behind them."""
        return tuple(layer for panel in self.panels for layer in panel.layers)


def frequency_axis(low_hz: float, high_hz: float) -> Axis:
    """Make a horizontal axis in Hz, logarithmic where the band is wide.

    Parameters
    ----------
    low_hz, high_hz : float
        What is seen at first.

    Returns
    -------
    Axis
        One that zooms together with the others of a page.

    Examples
    --------
    >>> [frequency_axis(low, 1000.0).scale for low in (0.0, 10.0, 100.0)]
    ['linear', 'log', 'linear']
    """
    scale = "log" if low_hz > 0 and high_hz > WIDE * low_hz else "linear"
    return Axis(title=FREQUENCY, scale=scale, limits=(float(low_hz), float(high_hz)), is_frequency=True)


def select_panel(picture: Picture, index: int) -> Picture:
    """Leave all panels of a picture out but one.

    Parameters
    ----------
    picture : Picture
        The picture.
    index : int
        Which panel.

    Returns
    -------
    Picture
        With that panel.
    """
    return replace(picture, panels=(picture.panels[index],), height_px=min(picture.height_px, HEIGHT_PX))


def legend_layers(picture: Picture) -> list[Layer]:
    """Give the layers that the legend of a picture names: what a panel above has named is not named again.

    Parameters
    ----------
    picture : Picture
        The picture.

    Returns
    -------
    list of Layer
        In the order in which they are drawn.
    """
    layers: list[Layer] = []
    for panel in picture.panels:
        above = {layer.group or layer.name for layer in layers}
        drawn = panel.layers if panel.backdrop is None else (panel.backdrop, *panel.layers)
        layers += [layer for layer in drawn if layer.in_legend and (layer.group or layer.name) not in above]
    return layers


def with_layers(picture: Picture, *layers: Layer, panel: int = 0) -> Picture:
    """Draw further layers over a panel of a picture.

    Parameters
    ----------
    picture : Picture
        The picture.
    *layers : Layer
        What to draw.
    panel : int
        Where.

    Returns
    -------
    Picture
        With them in front.
    """
    panels = list(picture.panels)
    panels[panel] = replace(panels[panel], layers=(*panels[panel].layers, *layers))
    return replace(picture, panels=tuple(panels))


def in_hover(text: str) -> str:
    """Make any text a part of a hover pattern that stands for itself.

    Parameters
    ----------
    text : str
        A unit, the name of a channel.

    Returns
    -------
    str
        Its braces doubled.

    Examples
    --------
    >>> ("{x:.1f} " + in_hover("{m}/s")).format(x=1.0)
    '1.0 {m}/s'
    """
    return text.replace("{", "{{").replace("}", "}}")


def joined_segments(starts: FloatArray, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Join straight pieces into one curve with gaps.

    Parameters
    ----------
    starts, ends : (n, 2) array
        Ends of each piece.

    Returns
    -------
    x, y : (3 n,) array
        NaN between the pieces.

    Examples
    --------
    >>> x, y = joined_segments(np.zeros((1, 2)), np.ones((1, 2)))
    >>> x.tolist(), y.tolist()
    ([0.0, 1.0, nan], [0.0, 1.0, nan])
    """
    points = np.full((len(starts), 3, 2), np.nan)
    points[:, 0], points[:, 1] = starts, ends
    x, y = points.reshape(-1, 2).T
    return x, y
