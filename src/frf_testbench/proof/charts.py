"""Pictures of the page, as data that stand inside it."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import matplotlib as mpl
from matplotlib.figure import Figure

from frf_testbench.proof.judging import ParameterScore
from frf_testbench.proof.points import PointErrors
from frf_testbench.proof.rates import Bin

BLUE, RED, GREY = "#1f6fb2", "#c23b22", "#8a8a8a"
SMALLEST_DRAWN, LARGEST_DRAWN = 1e-4, 1e2  # relative errors; others stand at the edge


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """An image that needs no other file.

    Parameters
    ----------
    text : str
        What it shows, for those who do not see it.
    source : str
        A ``data:`` address.
    """

    text: str
    source: str


def draw_parameter_errors(scores: Sequence[ParameterScore]) -> Picture:
    """Draw the error of each parameter.

    Parameters
    ----------
    scores : sequence of ParameterScore
        At least one.

    Returns
    -------
    Picture
        One row a parameter.
    """
    names = sorted({f"{score.effect}: {score.name}" for score in scores})
    figure = Figure(figsize=(8.2, 1.0 + 0.24 * len(names)), layout="constrained")
    axes = figure.add_subplot()
    for is_covered, colour, text in ((True, BLUE, "inside its interval"), (False, RED, "outside")):
        drawn = [score for score in scores if score.is_covered == is_covered]
        rows = [names.index(f"{score.effect}: {score.name}") for score in drawn]
        errors = [min(max(score.error, SMALLEST_DRAWN), LARGEST_DRAWN) for score in drawn]
        axes.plot(errors, rows, "o", color=colour, markersize=4, alpha=0.7, label=text)
    axes.axvline(0.03, color=GREY, linewidth=1)
    axes.set(
        xscale="log",
        xlim=(0.7 * SMALLEST_DRAWN, 1.4 * LARGEST_DRAWN),
        xlabel="relative error; the bar of the median is 3 %",
    )
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.invert_yaxis()
    axes.legend(loc="lower right", fontsize=8)
    return _to_picture(figure, "Errors of all parameters")


def draw_point_errors(points: Sequence[PointErrors]) -> Picture:
    """Draw the errors at unmeasured points, before and after.

    Parameters
    ----------
    points : sequence of PointErrors
        At least one.

    Returns
    -------
    Picture
        With the diagnosis over the nominal model, and over an update without it.
    """
    figure = Figure(figsize=(8.2, 3.6), layout="constrained")
    sides = figure.subplots(1, 2, sharex=True, sharey=True)
    diagnosed = [errors.diagnosed for errors in points]
    for axes, reference, text in (
        (sides[0], [errors.nominal for errors in points], "nominal model"),
        (sides[1], [errors.without for errors in points], "updated without a diagnosis"),
    ):
        positive = [error for error in (*diagnosed, *reference) if error > 0]
        ends = [0.7 * min(positive), 1.4 * max(positive)]
        axes.plot(ends, ends, color=GREY, linewidth=1)
        axes.plot(reference, diagnosed, "o", color=BLUE, markersize=4, alpha=0.7)
        axes.set(xscale="log", yscale="log", xlabel=f"error, {text}")
    sides[0].set_ylabel("error with the diagnosis")
    return _to_picture(figure, "Errors at points of interest")


def draw_calibration(bins: Sequence[Bin]) -> Picture:
    """Draw how often probabilities are right.

    Parameters
    ----------
    bins : sequence of Bin
        At least one.

    Returns
    -------
    Picture
        With the number of cases beside each bin.
    """
    figure = Figure(figsize=(4.2, 3.6), layout="constrained")
    axes = figure.add_subplot()
    axes.plot([0, 1], [0, 1], color=GREY, linewidth=1)
    axes.plot([group.claimed for group in bins], [group.reached for group in bins], "o-", color=BLUE)
    for group in bins:
        axes.annotate(str(group.count), (group.claimed, group.reached), xytext=(4, -10), textcoords="offset points")
    axes.set(xlabel="probability stated", ylabel="fraction that is right", xlim=(0, 1.05), ylim=(0, 1.05))
    return _to_picture(figure, "Calibration of probabilities")


def draw_times(times: Mapping[str, Sequence[float]], label: str) -> Picture | None:
    """Draw times by group.

    Parameters
    ----------
    times : mapping of str to sequence of float
        Seconds of each group; nan is left out.
    label : str
        What was timed.

    Returns
    -------
    Picture, or None
        None where no time is known.
    """
    measured = {group: [t for t in values if not math.isnan(t)] for group, values in times.items()}
    measured = {group: values for group, values in measured.items() if values}
    if not measured:
        return None
    figure = Figure(figsize=(8.2, 0.9 + 0.35 * len(measured)), layout="constrained")
    axes = figure.add_subplot()
    for row, values in enumerate(measured.values()):
        axes.plot(values, [row] * len(values), "|", color=BLUE, markersize=12)
    axes.set_yticks(range(len(measured)), list(measured))
    axes.set(xlabel=f"{label}, s", xlim=(0, None), ylim=(len(measured) - 0.5, -0.5))
    return _to_picture(figure, label)


def _to_picture(figure: Figure, text: str) -> Picture:
    buffer = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "proof"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    data = base64.b64encode(buffer.getvalue()).decode()
    return Picture(text=text, source=f"data:image/svg+xml;base64,{data}")
