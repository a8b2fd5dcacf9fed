"""The page: one HTML file that holds everything it needs.

The sections stand in `SECTIONS`, in the order of the chain; each is a function that takes what the run holds and gives
a section, or None where there is nothing to show. Adding a section is one file and one line here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from frf_ipz.output_files import write_text
from frf_ipz.progress import Progress, silent
from frf_ipz.report.html import PLOTLY, REPORT, RUN_SCRIPTS, packed_asset, page_environment, read_asset
from frf_ipz.report.page_data import page_data
from frf_ipz.report.plotly_drawing import colour_name
from frf_ipz.report.policy import page_policy
from frf_ipz.report.section import Section
from frf_ipz.report.sections import (
    comparison,
    diagnosis,
    fit,
    frfs,
    overview,
    pairing,
    poles,
    prediction,
    provenance,
    recordings,
    shapes,
    stabilization,
    state_space,
    updating,
)
from frf_ipz.runs.picture_data import hidden_frfs
from frf_ipz.runs.results import Results

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from frf_ipz.dofs import AnyDof
    from frf_ipz.runs.results import Results

Build: TypeAlias = "Callable[[Results], Section | None]"

SECTIONS: tuple[Build, ...] = (
    overview.build,
    comparison.build,
    shapes.build,
    recordings.build,
    frfs.build,
    stabilization.build,
    poles.build,
    fit.build,
    pairing.build,
    updating.build,
    prediction.build,
    diagnosis.build,
    state_space.build,
    provenance.build,
)


PARTICULARS = {
    "customer": "Customer",
    "equipment": "Equipment",
    "serial_number": "Serial number",
    "operator": "Operator",
    "date": "Measured on",
}  # of the test, as the page names them
LONGEST_NAME = 90  # characters that the margin of a printed page has room for


def write_report(run: Results, path: Path, *, progress: Progress = silent) -> None:
    """Put everything that a run holds on one page.

    Parameters
    ----------
    run : Results
        The run.
    path : Path
        File to write.
    progress : Progress
        Called with the fraction done and what is being done.

    Raises
    ------
    FileFormatError
        If a result in the folder is damaged.
    OSError
        If the page cannot be written.
    """
    sections = []
    for number, build in enumerate(SECTIONS):
        progress(number / len(SECTIONS), "drawing")
        section = build(run)
        sections += [section] if section is not None else []
    write_text(path, render_page(run, sections))


def render_page(run: Results, sections: Sequence[Section]) -> str:
    """Write the whole page as HTML.

    Parameters
    ----------
    run : Results
        What the run holds.
    sections : sequence of Section
        What to show.

    Returns
    -------
    str
        HTML.
    """
    template = page_environment().get_template("report/report.html")
    return template.render(
        **run_values(run, sections),
        style=read_asset(REPORT, "page.css"),
        margins=page_margins(run),
        library=packed_asset(REPORT, PLOTLY),
        scripts=[read_asset(REPORT, name) for name in RUN_SCRIPTS[1:]],
        policy=page_policy(*[read_asset(REPORT, name) for name in RUN_SCRIPTS]),
    )


def run_values(run: Results, sections: Sequence[Section]) -> dict[str, object]:
    """Give what ``report/run.html`` shows of a run.

    Parameters
    ----------
    run : Results
        What the run holds.
    sections : sequence of Section
        What to show.

    Returns
    -------
    dict
        Values of the template.
    """
    return {
        "title": str(run.manifest.get("name", "")) or "run",
        "version": str(run.manifest.get("frf_ipz", "")),
        "particulars": particulars(run),
        "chooser": frf_chooser(run),
        "sections": sections,
        "page_data": page_data(run, sections),
    }


def particulars(run: Results) -> list[tuple[str, str]]:
    """Give who measured what, when, with what and for whom.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    list of pairs of str
        What it is, and the text of the test; only what the test states.
    """
    stated = run.manifest.get("test", {})
    return [(name, str(stated[key])) for key, name in PARTICULARS.items() if stated.get(key)]


def page_margins(run: Results) -> str:
    """Write what stands in the margins of each printed page: the run's name, its program, the number of the page.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    str
        A style sheet, in which every character of a name is a number: none can end a text and start a rule.
    """
    program = f"frf_ipz {run.manifest.get('frf_ipz', '')}".strip()
    return margin_style(run.name, program, str(run.manifest.get("when", ""))[:10])


def margin_style(name: str, program: str, when: str) -> str:
    """Write what stands in the margins of each printed page.

    Parameters
    ----------
    name, program, when : str
        Of what is printed.

    Returns
    -------
    str
        A style sheet, in which every character of a name is a number: none can end a text and start a rule.
    """
    boxes = {
        "top-left": _css_text(name[:LONGEST_NAME]),
        "top-right": _css_text(when),
        "bottom-left": _css_text(program),
        "bottom-right": '"page " counter(page) " of " counter(pages)',
    }
    rules = " ".join(f"@{box} {{ content: {text}; }}" for box, text in boxes.items())
    return f"@page {{ {rules} }}"


def _css_text(text: str) -> str:
    """Write a text for a style sheet: control characters as spaces."""
    return '"' + "".join(f"\\{ord(char) if char.isprintable() else 32:06x}" for char in text) + '"'


@dataclass(frozen=True, slots=True, kw_only=True)
class FrfBox:
    """One box of the chooser of FRFs.

    Parameters
    ----------
    number : int
        Which FRF.
    label : str
        What it connects, and its quantity.
    colour : str
        A name of the themes.
    is_visible : bool
        The pictures show it at first.
    """

    number: int
    label: str
    colour: str
    is_visible: bool


def frf_chooser(run: Results) -> dict[str, object] | None:
    """Lay out a matrix of boxes, outputs by inputs: which FRFs the pictures show.

    Parameters
    ----------
    run : Results
        Says which FRFs there are.

    Returns
    -------
    dict or None
        ``inputs``, ``rows`` with ``output`` and ``cells``, ``n_visible`` and ``n_frfs``; None without FRFs.
    """
    if not run.labels:
        return None
    boxes: dict[tuple[AnyDof, AnyDof], list[FrfBox]] = {}
    for number, label in enumerate(run.labels):
        box = FrfBox(
            number=number,
            label=f"{label}, {label.quantity.value}",
            colour=colour_name(number),
            is_visible=number not in hidden_frfs(run),
        )
        boxes.setdefault((label.output_dof, label.input_dof), []).append(box)
    inputs = dict.fromkeys(label.input_dof for label in run.labels)
    return {
        "inputs": [str(dof) for dof in inputs],
        "rows": [
            {"output": str(output), "cells": [boxes.get((output, dof), []) for dof in inputs]}
            for output in dict.fromkeys(label.output_dof for label in run.labels)
        ],
        "n_visible": len(run.labels) - len(hidden_frfs(run)),
        "n_frfs": len(run.labels),
    }
