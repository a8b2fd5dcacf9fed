"""The first page of a campaign: its pipelines and runs, to choose from."""

from __future__ import annotations

import json
import os
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from frf_ipz.errors import InputError
from frf_ipz.report.findings import SENTENCES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.show.workbench import Workbench

HEAD = (
    '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
    '<meta name="viewport" content="width=device-width, initial-scale=1"><title>Runs – frf_ipz</title>'
    '<link rel="icon" href="data:,"><link rel="stylesheet" href="page.css"><link rel="stylesheet" href="show.css">'
    '</head><body><header class="head"><h1>Runs of this campaign</h1></header><main>'
)
COLUMNS = ("run", "pipeline", "results", "computed", "what came out")


def render_list(benches: Sequence[Workbench]) -> str:
    """Write the page that lists the runs.

    Parameters
    ----------
    benches : sequence of Workbench
        The runs, and pipelines that have not been run yet.

    Returns
    -------
    str
        HTML; the k-th run is at ``k/``, from 1.
    """
    top = Path(os.path.commonpath([bench.folder for bench in benches]))
    rows = "".join(_row(number, bench, top) for number, bench in enumerate(benches, start=1))
    head = "".join(f'<th scope="col">{name}</th>' for name in COLUMNS)
    lead = f"In {top}. Open one to look at it and to work on it; one that is not yet computed can be started there."
    return (
        f'{HEAD}<p class="lead">{escape(lead)}</p><table id="runs"><thead><tr>{head}</tr></thead><tbody>{rows}</tbody>'
        "</table></main></body></html>"
    )


def _row(number: int, bench: Workbench, top: Path) -> str:
    manifest = bench.manifest
    name = str(manifest.get("name", "")) or _name_in_file(bench)
    when = str(manifest.get("when", ""))[:16].replace("T", " ")
    computed = f"{when} UTC" if when else "at work" if bench.status.running else "not yet"
    verdict = _verdict(bench.folder) if manifest else ""
    cells = [_below(bench.pipeline, top), _below(bench.folder, top), computed, verdict]
    return (
        f'<tr><th scope="row"><a href="{number}/">{escape(name)}</a></th>'
        + "".join(f"<td>{escape(str(cell))}</td>" for cell in cells)
        + "</tr>"
    )


def _below(path: Path, top: Path) -> Path:
    return path.relative_to(top) if path.is_relative_to(top) else path


def _name_in_file(bench: Workbench) -> str:
    try:
        return bench.choices().pipeline.name or bench.pipeline.stem
    except InputError:
        return bench.pipeline.stem


def _verdict(folder: Path) -> str:
    """Take the sentence of a diagnosis, where one was made."""
    try:
        diagnosis = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
        return str(diagnosis.get("statement") or SENTENCES[diagnosis["verdict"]])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return "no diagnosis was run"
