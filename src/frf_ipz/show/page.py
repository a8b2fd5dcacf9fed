"""The page to work on: the report's sections with forms beside the pictures."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from frf_ipz.errors import InputError
from frf_ipz.report.html import page_environment
from frf_ipz.report.page import SECTIONS, run_values
from frf_ipz.report.section import Block, Choice, Figure, Section
from frf_ipz.report.sections import shapes
from frf_ipz.show.controls import (
    Choices,
    command_line,
    dof_forms,
    list_choices,
    pole_forms,
    record_list,
    shape_form,
)
from frf_ipz.show.downloads import downloads
from frf_ipz.show.marks import DIAGRAM, STRUCTURE, with_choices, with_retained
from frf_ipz.show.setup import read_setup

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from frf_ipz.pipeline.config import PipelineFile
    from frf_ipz.plotting.picture import Picture
    from frf_ipz.runs.results import Results
    from frf_ipz.show.ghost import Ghost
    from frf_ipz.show.workbench import Workbench

SHOW = "frf_ipz.show"
EDGES_HINT = "Drag an edge of the band to fit another one; with the keyboard: Tab to it, arrow keys, Enter."


@dataclass(frozen=True, slots=True, kw_only=True)
class Addresses:
    """Where a page finds what stands beside it.

    Parameters
    ----------
    home : str
        The list of runs; empty where there is one run only.
    assets : str
        Folder of scripts and styles.
    files : str
        The run's folder.
    """

    home: str = ""
    assets: str = "assets/"
    files: str = ""


def render_page(bench: Workbench, addresses: Addresses) -> str:
    """Write the page.

    Parameters
    ----------
    bench : Workbench
        The run.
    addresses : Addresses
        Where it finds the rest.

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
    choices, _ = _read_choices(bench)
    if stamp:
        run = bench.contents()
        sections = [_with_ghost(section, run, bench.ghost()) for section in page_sections(run, choices)]
        sections += filter(None, [downloads(run, addresses.files)])
    else:
        run, setup = read_setup(bench.pipeline, bench.read)
        sections = [setup if choices is None or not setup.blocks else _pickable(setup, run, choices)]
    template = page_environment(SHOW).get_template("show/workbench.html")
    return template.render(
        **run_values(run, sections),
        stamp=stamp,
        addresses=addresses,
        folder=str(bench.folder),
        choices=_choices_of(bench),
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
    return page_environment(SHOW).get_template("show/choices.html").render(choices=_choices_of(bench))


def _choices_of(bench: Workbench) -> Choices:
    file, problem = _read_choices(bench)
    if file is None:
        return Choices(problem=problem)
    can_undo, can_redo = bench.steps()
    return Choices(
        entries=list_choices(file),
        command=command_line(bench.pipeline, bench.folder),
        text=bench.text(),
        is_first_run=not bench.stamp,
        has_model=file.pipeline.model is not None,
        can_undo=can_undo,
        can_redo=can_redo,
        code=bench.code_to_allow(),
    )


def page_sections(run: Results, choices: PipelineFile | None) -> list[Section]:
    """Give the report's sections, and beside their pictures what the user can change.

    Parameters
    ----------
    run : Results
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
        section = _shapes(run) if build is shapes.build else build(run)
        if section is not None:
            sections.append(section if choices is None else _with_controls(section, run, choices))
    return sections


def _with_controls(section: Section, run: Results, choices: PipelineFile) -> Section:
    blocks = list(section.blocks)
    if section.anchor == "stabilization" and run.fit is not None:
        fit = run.fit
        blocks = _redrawn(blocks, DIAGRAM, lambda picture: with_choices(picture, fit, choices.fit))
        blocks.insert(1, pole_forms(fit, run.frfs))
    if section.anchor == "frfs" and run.fit is not None:
        blocks = [
            replace(block, hint=f"{block.hint} {EDGES_HINT}") if isinstance(block, Figure) else block
            for block in blocks
        ]
    if section.anchor == "recordings":
        records = record_list(run, choices)
        blocks += [] if records is None else [records]
    if section.anchor == "overview" and (run.geometry is not None or run.labels):
        return _pickable(section, run, choices)
    return replace(section, blocks=tuple(blocks))


def _pickable(section: Section, run: Results, choices: PipelineFile) -> Section:
    """Let the user pick DOFs on the drawing of the structure."""
    retained, geometry = () if run.reduced_model is None else run.reduced_model.dofs, run.geometry
    blocks = list(section.blocks)
    if geometry is not None:
        blocks = _redrawn(blocks, STRUCTURE, lambda picture: with_retained(picture, geometry, retained))
    return replace(section, blocks=(*blocks, dof_forms(run, choices, retained)))


def _with_ghost(section: Section, run: Results, ghost: Ghost | None) -> Section:
    prediction = run.prediction
    if ghost is None or prediction is None:
        return section
    blocks: list[Block] = []
    for block in section.blocks:
        if isinstance(block, Figure):
            blocks.append(replace(block, picture=ghost.behind(block.picture, prediction)))
        elif isinstance(block, Choice):
            pictures = {name: ghost.behind(picture, prediction) for name, picture in block.pictures.items()}
            blocks.append(replace(block, pictures=pictures))
        else:
            blocks.append(block)
    return replace(section, blocks=tuple(blocks))


def _redrawn(blocks: Sequence[Block], name: str, change: Callable[[Picture], Picture]) -> list[Block]:
    """Change the picture of some name among the blocks of a section."""
    return [
        replace(block, picture=change(block.picture))
        if isinstance(block, Figure) and block.picture.name == name
        else block
        for block in blocks
    ]


def _shapes(run: Results) -> Section | None:
    """Give the section of the shapes, of which the page asks for one at a time."""
    if run.fit is None and not run.labels:
        return None
    return Section(anchor="shapes", title="Shapes", lead=shapes.LEAD, blocks=(shape_form(run),))


def _read_choices(bench: Workbench) -> tuple[PipelineFile | None, str]:
    try:
        return bench.choices(), ""
    except InputError as error:
        return None, str(error)
