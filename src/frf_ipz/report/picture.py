"""A picture as plain data for plotly.js: traces, axes, and what it says to those who cannot see it.

Colours are names (``@measured``, ``@updated/0.2`` with an opacity) that the page turns into colours of the light or
the dark theme; arrays are packed once for the whole page by `report.packing`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.report.section import Table

Trace: TypeAlias = "dict[str, Any]"

DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")
COLOURS = 7  # numbered colours @c0 .. @c6 of the page's themes
GAP = 0.06  # of the height, between panels


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """A vertical axis of one panel.

    Parameters
    ----------
    title : str
        Quantity and unit.
    share : float
        Of the height, relative to the other panels.
    scale : str
        ``linear`` or ``log``.
    options : dict
        Further properties of a plotly axis.
    """

    title: str
    share: float = 1.0
    scale: str = "linear"
    options: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Picture:
    """One picture with its caption.

    Parameters
    ----------
    name : str
        Unique on the page; letters, digits and hyphens.
    title : str
        What it shows.
    alt : str
        What can be seen in it, in words, for those who cannot.
    traces : tuple of dict
        plotly traces; arrays are NumPy arrays.
    layout : dict
        plotly layout without colours of the theme.
    note : str
        How to read it.
    table : Table, optional
        The numbers behind it.
    height_px : int
        On the page.
    is_over_frequency : bool
        Its horizontal axis is a frequency, linked with the others.
    """

    kind: ClassVar[str] = "picture"

    name: str
    title: str
    alt: str
    traces: tuple[Trace, ...]
    layout: dict[str, Any]
    note: str = ""
    table: Table | None = None
    height_px: int = 420
    is_over_frequency: bool = False


def frequency_axis(low_hz: float, high_hz: float) -> dict[str, Any]:
    """Horizontal axis in Hz.

    Parameters
    ----------
    low_hz, high_hz : float
        What is shown at first.

    Returns
    -------
    dict
        A plotly axis.
    """
    return {"title": {"text": "Frequency, Hz"}, "range": [float(low_hz), float(high_hz)]}


def panels(x: dict[str, Any], *axes: Axis, **options: Any) -> dict[str, Any]:  # noqa: ANN401  any property of a layout
    """Lay out panels above each other that share the horizontal axis.

    Parameters
    ----------
    x : dict
        The horizontal axis.
    *axes : Axis
        Vertical axes from the top down; the k-th is ``y``, ``y2``, ... of the traces.
    **options : object
        Further properties of the layout.

    Returns
    -------
    dict
        A plotly layout.
    """
    shares = np.array([axis.share for axis in axes]) / sum(axis.share for axis in axes)
    free = 1 - GAP * (len(axes) - 1)
    layout: dict[str, Any] = {**options}
    top = 1.0
    for number, (axis, share) in enumerate(zip(axes, shares, strict=True)):
        bottom = max(top - share * free, 0.0)
        layout[f"yaxis{'' if number == 0 else number + 1}"] = {
            "title": {"text": axis.title},
            "type": axis.scale,
            "domain": [bottom, top],
            **({"exponentformat": "power"} if axis.scale == "log" else {}),
            **axis.options,
        }
        top = bottom - GAP
    layout["xaxis"] = {"anchor": "y" if len(axes) == 1 else f"y{len(axes)}", **x}
    return layout


def line(x: Any, y: Any, name: str, colour: str, *, hover: str = "", **options: Any) -> Trace:  # noqa: ANN401  arrays or lists
    """Draw a curve.

    Parameters
    ----------
    x, y : array
        Points.
    name : str
        In the legend and in hover texts.
    colour : str
        A name of the themes.
    hover : str
        A plotly hover template without the name; where it is empty, nothing is said.
    **options : object
        Further properties; ``width`` and ``dash`` of the line among them.

    Returns
    -------
    dict
        A plotly trace.
    """
    style = {"color": colour, "width": options.pop("width", 1.6), "dash": options.pop("dash", "solid")}
    return {"type": "scatter", "mode": "lines", "x": x, "y": y, "name": name, "line": style, **_hover(hover), **options}


def markers(x: Any, y: Any, name: str, colour: str, *, hover: str = "", **options: Any) -> Trace:  # noqa: ANN401  as above
    """Draw points.

    Parameters
    ----------
    x, y : array
        Points.
    name : str
        In the legend and in hover texts.
    colour : str
        A name of the themes.
    hover : str
        A plotly hover template without the name; where it is empty, nothing is said.
    **options : object
        Further properties; ``symbol`` and ``size`` of the markers among them.

    Returns
    -------
    dict
        A plotly trace.
    """
    symbol = options.pop("symbol", "circle")
    style: dict[str, Any] = {"color": colour, "size": options.pop("size", 8), "symbol": symbol}
    if str(symbol).endswith("-open") or symbol in {"x-thin", "cross-thin"}:
        style["line"] = {"width": 1.8, "color": colour}
    return (
        {"type": "scatter", "mode": "markers", "x": x, "y": y, "name": name, "marker": style} | _hover(hover) | options
    )


def band(
    x: Any,  # noqa: ANN401  arrays or lists
    limits: tuple[Any, Any],
    name: str,
    colour: str,
    **options: Any,  # noqa: ANN401  any property of a trace
) -> list[Trace]:
    """Fill the space between two curves.

    Parameters
    ----------
    x : array
        Horizontal.
    limits : pair of arrays
        Lower and upper curve.
    name : str
        In the legend.
    colour : str
        A name of the themes with an opacity.
    **options : object
        Further properties of both traces.

    Returns
    -------
    list of dict
        Two plotly traces.
    """
    bare = {"line": {"width": 0, "color": colour}, "hoverinfo": "skip", "mode": "lines", "type": "scatter"}
    group = options.pop("legendgroup", name)
    low = {**bare, "x": x, "y": limits[0], "showlegend": False, "legendgroup": group, "name": name, **options}
    high = {**bare, "x": x, "y": limits[1], "fill": "tonexty", "fillcolor": colour, "legendgroup": group, "name": name}
    return [low, {**high, **options}]


def colour_of(number: int) -> str:
    """Colour of the n-th curve.

    Parameters
    ----------
    number : int
        From 0.

    Returns
    -------
    str
        A name of the themes.
    """
    return f"@c{number % COLOURS}"


def dash_of(number: int) -> str:
    """Dash of the n-th curve: curves that share a colour differ in it.

    Parameters
    ----------
    number : int
        From 0.

    Returns
    -------
    str
        A plotly dash.
    """
    return DASHES[(number // COLOURS) % len(DASHES)]


def shaded_span(x: Sequence[float], low: float, high: float, colour: str, **options: Any) -> dict[str, Any]:  # noqa: ANN401
    """Shade a range of the horizontal axis over the whole height.

    Parameters
    ----------
    x : pair of float
        From, to.
    low, high : float
        Of the height, 0 to 1.
    colour : str
        A name of the themes with an opacity.
    **options : object
        Further properties.

    Returns
    -------
    dict
        A plotly shape.
    """
    place = {"type": "rect", "xref": "x", "yref": "paper", "x0": float(x[0]), "x1": float(x[1]), "y0": low, "y1": high}
    return {**place, "fillcolor": colour, "line": {"width": 0}, "layer": "below", **options}


def _hover(text: str) -> Trace:
    return {"hovertemplate": f"{text}<extra>%{{fullData.name}}</extra>"} if text else {"hoverinfo": "skip"}
