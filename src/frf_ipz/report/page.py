"""The page: one HTML file that holds everything it needs.

The sections stand in `SECTIONS`, in the order of the chain; each is a function that takes what the run holds and gives
a section, or None where there is nothing to show. Adding a section is one file and one line here.
"""

from __future__ import annotations

from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, TypeAlias

from plotly.offline import get_plotlyjs

from frf_ipz.progress import Progress, silent
from frf_ipz.report.contents import RunContents, read_contents
from frf_ipz.report.packing import Packer, to_json
from frf_ipz.report.picture import colour_of
from frf_ipz.report.section import Section, pictures_of, render_section
from frf_ipz.report.sections import (
    diagnosis,
    fit,
    frfs,
    overview,
    pairing,
    poles,
    prediction,
    provenance,
    recordings,
    stabilization,
    state_space,
    updating,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from frf_ipz.runs.folder import RunFolder

Build: TypeAlias = "Callable[[RunContents], Section | None]"

SECTIONS: tuple[Build, ...] = (
    overview.build,
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
WIDE = 30.0  # ratio of the ends of the band from which the frequency axis starts logarithmic


def write_report(folder: RunFolder, path: Path, *, progress: Progress = silent) -> None:
    """Put everything that a run holds on one page.

    Parameters
    ----------
    folder : RunFolder
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
    run = read_contents(folder)
    sections = []
    for number, build in enumerate(SECTIONS):
        progress(number / len(SECTIONS), "drawing")
        section = build(run)
        sections += [section] if section is not None else []
    path.write_text(render_page(run, sections), encoding="utf-8", newline="\n")


def render_page(run: RunContents, sections: Sequence[Section]) -> str:
    """Write the whole page as HTML.

    Parameters
    ----------
    run : RunContents
        What the run holds.
    sections : sequence of Section
        What to show.

    Returns
    -------
    str
        HTML.
    """
    name = str(run.manifest.get("name", "")) or "run"
    links = "".join(f'<a href="#{section.anchor}">{escape(section.title)}</a>' for section in sections)
    body = "\n".join(render_section(section) for section in sections)
    return "\n".join(
        [
            '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(name)} – frf_ipz</title><style>{_asset('page.css')}</style></head><body>",
            '<a class="skip" href="#overview">Skip to the results</a>',
            f'<div class="bar"><nav aria-label="Sections">{links}</nav>',
            f'<div class="tools">{page_tools(run)}</div></div>',
            f'<header class="head"><h1>{escape(name)}</h1></header><main>{body}</main>',
            f"<footer>frf_ipz {escape(str(run.manifest.get('frf_ipz', '')))}. Pictures: drag to zoom, double-click to "
            "go back; with the keyboard: Tab, then arrow keys, + and −, 0; Enter on a name of the legend.</footer>",
            f'<script type="application/json" id="page-data">{page_data(run, sections)}</script>',
            f"<script>{get_plotlyjs()}</script><script>{_asset('page.js')}</script></body></html>",
        ]
    )


def page_data(run: RunContents, sections: Sequence[Section]) -> str:
    """Give what the page's script draws from.

    Parameters
    ----------
    run : RunContents
        What the run holds.
    sections : sequence of Section
        With the pictures.

    Returns
    -------
    str
        JSON that can stand inside a script element.
    """
    packer = Packer()
    pictures = {
        picture.name: {"data": packer.pack(picture.traces), "layout": packer.pack(picture.layout)}
        for picture in pictures_of(sections)
    }
    low, high = run.band_hz
    frequencies = [] if run.frfs is None else run.frfs.frequency_hz[run.frfs.frequency_hz > 0][:1].tolist()
    return to_json(
        {
            "pictures": pictures,
            "hiddenFrfs": run.hidden_frfs,
            "frequencyScale": "log" if low > 0 and high > WIDE * low else "linear",
            "lowestHz": min([1.0, *frequencies]),
            "arrays": packer.arrays,
        }
    )


def page_tools(run: RunContents) -> str:
    """Give the tools of the page's bar: which FRFs are shown, how axes are divided, light or dark, print.

    Parameters
    ----------
    run : RunContents
        Says which FRFs there are.

    Returns
    -------
    str
        HTML.
    """
    buttons = (
        '<button id="scale" type="button" title="Frequency axes: linear or logarithmic">Frequency</button>'
        '<button id="theme" type="button" title="Light or dark">Light / dark</button>'
        '<button id="print" type="button">Print</button>'
    )
    return _chooser(run) + buttons if run.labels else buttons


def _chooser(run: RunContents) -> str:
    """Offer a matrix of boxes, outputs by inputs: which FRFs the pictures show."""
    rows = dict.fromkeys(label.output_dof for label in run.labels)
    columns = dict.fromkeys(label.input_dof for label in run.labels)
    numbers: dict[object, list[int]] = {}
    for number, label in enumerate(run.labels):
        numbers.setdefault((label.output_dof, label.input_dof), []).append(number)
    head = "".join(f'<th scope="col">{escape(str(dof))}</th>' for dof in columns)
    body = ""
    for row in rows:
        cells = "".join(f"<td>{_boxes(run, numbers.get((row, column), []))}</td>" for column in columns)
        body += f'<tr><th scope="row">{escape(str(row))}</th>{cells}</tr>'
    n_visible = len(run.labels) - len(run.hidden_frfs)
    return (
        f'<details class="chooser"><summary class="button">FRFs: <span id="shown">{n_visible} of {len(run.labels)}'
        '</span></summary><div><p><button type="button" data-all="1">All</button>'
        f'<button type="button" data-all="0">None</button></p>'
        f'<table><thead><tr><th scope="col">output \\ input</th>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div></details>"
    )


def _boxes(run: RunContents, numbers: Sequence[int]) -> str:
    boxes = ""
    for number in numbers:
        checked = "" if number in run.hidden_frfs else " checked"
        label = escape(f"{run.labels[number]}, {run.labels[number].quantity.value}")
        boxes += (
            f'<label title="{label}"><input type="checkbox" value="{number}" aria-label="FRF {label}"{checked}>'
            f'<span class="swatch" data-colour="{colour_of(number)}"></span></label>'
        )
    return boxes


def _asset(name: str) -> str:
    return (files("frf_ipz.report") / "assets" / name).read_text(encoding="utf-8")
