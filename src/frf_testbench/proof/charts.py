"""Pictures of the page, as images that stand inside it."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Sequence

import matplotlib as mpl
from matplotlib.figure import Figure

from frf_testbench.proof.judging import ParameterScore
from frf_testbench.proof.points import PointErrors
from frf_testbench.proof.rates import Bin

BLUE, RED, GREY = "#1f6fb2", "#c23b22", "#8a8a8a"
LEAST, MOST = 1e-4, 1e2  # of relative errors that are drawn; others stand at the edge


def parameter_chart(scores: Sequence[ParameterScore]) -> str:
    """Draw the error of each parameter.

    Parameters
    ----------
    scores : sequence of ParameterScore
        At least one.

    Returns
    -------
    str
        An ``img`` element.
    """
    names = sorted({f"{score.effect}: {score.name}" for score in scores})
    figure = Figure(figsize=(8.2, 1.0 + 0.24 * len(names)), layout="constrained")
    axes = figure.add_subplot()
    for covered, colour, text in ((True, BLUE, "inside its interval"), (False, RED, "outside")):
        mine = [score for score in scores if score.covered == covered]
        rows = [names.index(f"{score.effect}: {score.name}") for score in mine]
        errors = [min(max(score.error, LEAST), MOST) for score in mine]
        axes.plot(errors, rows, "o", color=colour, markersize=4, alpha=0.7, label=text)
    axes.axvline(0.03, color=GREY, linewidth=1)
    axes.set(xscale="log", xlim=(0.7 * LEAST, 1.4 * MOST), xlabel="relative error; the bar of the median is 3 %")
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.invert_yaxis()
    axes.legend(loc="lower right", fontsize=8)
    return _image(figure, "Errors of all parameters")


def point_chart(errors: Sequence[PointErrors]) -> str:
    """Draw the errors at unmeasured points, before and after.

    Parameters
    ----------
    errors : sequence of PointErrors
        At least one.

    Returns
    -------
    str
        An ``img`` element.
    """
    figure = Figure(figsize=(8.2, 3.6), layout="constrained")
    sides = figure.subplots(1, 2, sharex=True, sharey=True)
    said = [one.diagnosed for one in errors]
    for axes, others, text in (
        (sides[0], [one.nominal for one in errors], "nominal model"),
        (sides[1], [one.without for one in errors], "updated without a diagnosis"),
    ):
        everything = [value for value in (*said, *others) if value > 0]
        ends = [0.7 * min(everything), 1.4 * max(everything)]
        axes.plot(ends, ends, color=GREY, linewidth=1)
        axes.plot(others, said, "o", color=BLUE, markersize=4, alpha=0.7)
        axes.set(xscale="log", yscale="log", xlabel=f"error, {text}")
    sides[0].set_ylabel("error with the diagnosis")
    return _image(figure, "Errors at points of interest")


def calibration_chart(bins: Sequence[Bin]) -> str:
    """Draw how often probabilities are right.

    Parameters
    ----------
    bins : sequence of Bin
        At least one.

    Returns
    -------
    str
        An ``img`` element.
    """
    figure = Figure(figsize=(4.2, 3.6), layout="constrained")
    axes = figure.add_subplot()
    axes.plot([0, 1], [0, 1], color=GREY, linewidth=1)
    axes.plot([one.claimed for one in bins], [one.reached for one in bins], "o-", color=BLUE)
    for one in bins:
        axes.annotate(str(one.count), (one.claimed, one.reached), xytext=(4, -10), textcoords="offset points")
    axes.set(xlabel="probability said", ylabel="part that is right", xlim=(0, 1.05), ylim=(0, 1.05))
    return _image(figure, "Calibration of probabilities")


def time_chart(groups: dict[str, Sequence[float]], label: str) -> str:
    """Draw times by group.

    Parameters
    ----------
    groups : dict of str to sequence of float
        Seconds; nan is left out.
    label : str
        What was timed.

    Returns
    -------
    str
        An ``img`` element, or a sentence where no time is known.
    """
    known = {group: [t for t in times if not math.isnan(t)] for group, times in groups.items()}
    known = {group: times for group, times in known.items() if times}
    if not known:
        return f"<p>No times of {label} are known.</p>"
    figure = Figure(figsize=(8.2, 0.9 + 0.35 * len(known)), layout="constrained")
    axes = figure.add_subplot()
    for row, times in enumerate(known.values()):
        axes.plot(times, [row] * len(times), "|", color=BLUE, markersize=12)
    axes.set_yticks(range(len(known)), list(known))
    axes.set(xlabel=f"{label}, s", xlim=(0, None), ylim=(len(known) - 0.5, -0.5))
    return _image(figure, label)


def _image(figure: Figure, text: str) -> str:
    """Turn a figure into an element that needs no other file."""
    buffer = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "proof"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    data = base64.b64encode(buffer.getvalue()).decode()
    return f'<img alt="{text}" src="data:image/svg+xml;base64,{data}">'
