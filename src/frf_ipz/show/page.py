"""The page to work on: the report's sections with forms beside the pictures."""

from __future__ import annotations

from dataclasses import replace
from html import escape
from typing import TYPE_CHECKING

from frf_ipz.errors import InputError
from frf_ipz.report.page import SECTIONS, page_data, page_tools
from frf_ipz.report.picture import Picture
from frf_ipz.report.section import Markup, Section, render_section
from frf_ipz.show.controls import (
    choices_panel,
    command_line,
    dof_controls,
    pole_controls,
    record_controls,
    shape_controls,
)
from frf_ipz.show.marks import DIAGRAM, STRUCTURE, with_choices, with_retained
from frf_ipz.show.setup import read_setup

if TYPE_CHECKING:
    from frf_ipz.pipeline.config import PipelineFile
    from frf_ipz.report.contents import RunContents
    from frf_ipz.show.workbench import Workbench

HEAD = (
    '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
    '<meta name="viewport" content="width=device-width, initial-scale=1"><title>{name} – frf_ipz</title>'
    '<link rel="icon" href="data:,"><link rel="stylesheet" href="page.css"><link rel="stylesheet" href="show.css">'
    '</head><body data-stamp="{stamp}"><a class="skip" href="#overview">Skip to the results</a>'
)
STATUS = (
    '<div id="status" role="status" aria-live="polite" hidden><progress id="progress" max="1" value="0"></progress>'
    '<span id="doing"></span></div><div id="problem" role="alert" hidden><span></span> '
    '<button type="button" id="read">Close</button></div>'
)
SCRIPTS = (
    '<script src="plotly.js"></script><script src="page.js"></script><script src="show.js"></script></body></html>'
)


def render_page(bench: Workbench, *, home: str = "") -> str:
    """Write the page.

    Parameters
    ----------
    bench : Workbench
        The run.
    home : str
        Address of the list of runs, where there are several.

    Returns
    -------
    str
        HTML.

    Raises
    ------
    InputError
        If a result of the run is damaged.
    """
    stamp = bench.stamp
    choices, _ = _choices(bench)
    if stamp:
        run = bench.contents()
        sections = page_sections(run, choices)
    else:
        run, setup = read_setup(bench.pipeline, bench.read)
        sections = [setup if choices is None or not setup.blocks else _pickable(setup, run, choices)]
    name = escape(str(run.manifest.get("name", "")) or "run")
    links = "".join(f'<a href="#{section.anchor}">{escape(section.title)}</a>' for section in sections)
    body = "\n".join(render_section(section) for section in sections)
    back = f'<a href="{home}">All runs</a> ' if home else ""
    report = ' <a href="run/report.html">The report to send on</a>' if stamp else ""
    return "\n".join(
        [
            HEAD.format(name=name, stamp=escape(stamp)),
            f'<div class="bar"><nav aria-label="Sections">{links}</nav><div class="tools">{page_tools(run)}</div>',
            f"{STATUS}</div>",
            f'<header class="head"><h1>{back}{name}</h1><div id="choices">{render_choices(bench)}</div></header>',
            f"<main>{body}</main><footer>frf_ipz {escape(str(run.manifest.get('frf_ipz', '')))}, ",
            f"{escape(str(bench.folder))}.{report}</footer>",
            f'<script type="application/json" id="page-data">{page_data(run, sections)}</script>',
            SCRIPTS,
        ]
    )


def render_choices(bench: Workbench) -> str:
    """Write the list of what the user has chosen.

    Parameters
    ----------
    bench : Workbench
        The run.

    Returns
    -------
    str
        HTML.
    """
    choices, problem = _choices(bench)
    text = "" if choices is None else bench.text()
    command = command_line(bench.pipeline, bench.folder)
    return choices_panel(choices, problem, text, command, is_first=not bench.stamp)


def page_sections(run: RunContents, choices: PipelineFile | None) -> list[Section]:
    """Give the report's sections, and beside their pictures what the user can change.

    Parameters
    ----------
    run : RunContents
        What the run holds.
    choices : PipelineFile, optional
        What the user has chosen; None where nothing can be changed.

    Returns
    -------
    list of Section
        In the order of the chain.
    """
    sections: list[Section] = []
    for build in SECTIONS:
        section = build(run)
        if section is not None:
            sections.append(section if choices is None else _with_controls(section, run, choices))
            if section.anchor == "overview" and (run.fit is not None or run.labels):
                sections.append(_shapes(run))
    return sections


def _with_controls(section: Section, run: RunContents, choices: PipelineFile) -> Section:
    blocks = list(section.blocks)
    if section.anchor == "stabilization" and run.fit is not None:
        blocks = [
            with_choices(block, run.fit, choices.fit) if isinstance(block, Picture) and block.name == DIAGRAM else block
            for block in blocks
        ]
        blocks.insert(1, Markup(html=pole_controls(run.fit)))
    if section.anchor == "recordings":
        blocks.append(Markup(html=record_controls(run, choices)))
    if section.anchor == "overview" and (run.geometry is not None or run.labels):
        return _pickable(section, run, choices)
    return replace(section, blocks=tuple(blocks))


def _pickable(section: Section, run: RunContents, choices: PipelineFile) -> Section:
    """Let the user pick DOFs on the drawing of the structure."""
    retained = () if run.reduced is None else run.reduced.dofs
    blocks = [
        with_retained(block, run.geometry, retained)
        if isinstance(block, Picture) and block.name == STRUCTURE and run.geometry is not None
        else block
        for block in section.blocks
    ]
    return replace(section, blocks=(*blocks, Markup(html=dof_controls(run, choices, retained))))


def _shapes(run: RunContents) -> Section:
    lead = "How the structure moves: what was measured beside the model before and after updating."
    return Section(anchor="shapes", title="Shapes", lead=lead, blocks=(Markup(html=shape_controls(run)),))


def _choices(bench: Workbench) -> tuple[PipelineFile | None, str]:
    try:
        return bench.choices(), ""
    except InputError as error:
        return None, str(error)
