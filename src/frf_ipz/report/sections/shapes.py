"""Mode shapes: the structure in space and in motion, measured beside the model before and after updating."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from frf_ipz.plotting.wording import number
from frf_ipz.report.section import Form, Section
from frf_ipz.runs.shapes import draw_shape, draw_structure, mode_shapes
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from frf_ipz.runs.results import Results

LEAD = "How the structure moves: what was measured beside the model before and after updating."
TEMPLATE = "report/shape.html"
MOST_MOVES = 120_000  # of nodes, in all modes and models: a megabyte and a half of a page


def build(run: Results) -> Section | None:
    """Give the section with the mode shapes.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    Section or None
        None without modes.
    """
    if run.fit is None or not run.fit.n_modes:
        return None
    shapes = mode_shapes(run)
    structure = draw_structure(run, shapes[0].measured_dofs)
    drawn: list[dict[str, Any]] = []
    n_moves = 0
    for shape in shapes:
        drawing = draw_shape(shape, structure)
        n_moves += sum(len(motion["rows"]) for motion in drawing["motions"])
        if drawn and n_moves > MOST_MOVES:
            break
        drawn.append(drawing)
    left_out = len(shapes) - len(drawn)
    lead = LEAD
    if left_out:
        lead += f" The last {counted(left_out, 'mode')} would make the page too large: frf-ipz show draws them."
    return Section(anchor="shapes", title="Shapes", lead=lead, blocks=(shape_block(run, drawn, structure.to_json()),))


def shape_block(run: Results, shapes: list[dict[str, Any]], structure: dict[str, Any]) -> Form:
    """Lay out the drawing that a page holds.

    Parameters
    ----------
    run : Results
        What the run holds.
    shapes : list of dict
        What each mode does.
    structure : dict
        What is drawn.

    Returns
    -------
    Form
        The drawing with its controls.
    """
    data = {"modes": mode_names(run)[: len(shapes)], "drawings": {"structure": structure, "shapes": shapes}}
    return Form(template=TEMPLATE, data=data)


def mode_names(run: Results) -> list[str]:
    """Name the modes of the fit.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    list of str
        Number and natural frequency; empty without a fit.
    """
    if run.fit is None:
        return []
    hertz = run.fit.model.natural_frequency_hz[: run.fit.n_modes]
    return [f"{mode}: {number(float(value), 5)} Hz" for mode, value in enumerate(hertz, start=1)]
