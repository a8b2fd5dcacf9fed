"""The look of all pictures for publications: sizes, colours that colour-blind people can tell apart, axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib import rc_context
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes

WIDTH_IN, HEIGHT_IN = 6.3, 3.2  # a text column of most journals; lengths in inches, as Matplotlib takes them
CYCLE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6a00", "#56b4e9", "#4d4d4d")  # Okabe and Ito, yellow left out
DASHES = ("-", "--", ":", "-.")
MEASURED, NOMINAL, UPDATED, GOOD, BAD, FAINT = "#1b1f24", "#b45f00", "#0072b2", "#009e73", "#d55e00", "#8c959f"
FORMATS = ("svg", "pdf", "png")


def axes_or_new(ax: Axes | None, *, height_in: float = HEIGHT_IN) -> Axes:
    """Give axes to draw on.

    Parameters
    ----------
    ax : Axes, optional
        Those of the caller.
    height_in : float
        Height of a new figure, inches.

    Returns
    -------
    Axes
        The caller's, or those of a new figure that belongs to no window.
    """
    if ax is None:
        ax = Figure(figsize=(WIDTH_IN, height_in), layout="constrained").subplots()
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(visible=True, color="#e4e8ec", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.tick_params(labelsize=8)
    return ax


def label_axes(ax: Axes, x: str, y: str, *, legend: bool = True) -> Axes:
    """Title the axes, and set the legend above them where there is anything to name.

    Parameters
    ----------
    ax : Axes
        The axes.
    x, y : str
        Quantity and unit.
    legend : bool
        Draw a legend.

    Returns
    -------
    Axes
        The same.
    """
    ax.set_xlabel(x, fontsize=9)
    ax.set_ylabel(y, fontsize=9)
    handles, _ = ax.get_legend_handles_labels()
    if legend and handles:
        ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, frameon=False, fontsize=8, borderaxespad=0.2)
    return ax


def colour(number: int) -> str:
    """Colour of the n-th curve.

    Parameters
    ----------
    number : int
        From 0.

    Returns
    -------
    str
        A colour.
    """
    return CYCLE[number % len(CYCLE)]


def dash(number: int) -> str:
    """Dash of the n-th curve; curves of one colour differ in it.

    Parameters
    ----------
    number : int
        From 0.

    Returns
    -------
    str
        A line style.
    """
    return DASHES[(number // len(CYCLE)) % len(DASHES)]


def save_figure(figure: Figure, path: Path, *, file_format: str) -> None:
    """Write a figure to a file, with text as text.

    Parameters
    ----------
    figure : Figure
        The picture.
    path : Path
        File to write.
    file_format : str
        ``svg``, ``pdf`` or ``png``.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    with rc_context({"svg.fonttype": "none", "pdf.fonttype": 42, "savefig.dpi": 200}):  # text stays text
        figure.savefig(path, format=file_format)
