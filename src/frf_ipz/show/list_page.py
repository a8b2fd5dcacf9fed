"""The first page of a campaign: its pipelines and runs, to choose from."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.json_files import read_json
from frf_ipz.report.findings import SENTENCES
from frf_ipz.report.html import page_environment
from frf_ipz.show.page import SHOW

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.show.workbench import Workbench


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
    template = page_environment(SHOW).get_template("show/list.html")
    return template.render(title="Runs", folder=str(top), runs=[_describe(bench, top) for bench in benches])


def _describe(bench: Workbench, top: Path) -> dict[str, str]:
    manifest = bench.manifest
    when = str(manifest.get("when", ""))[:16].replace("T", " ")
    return {
        "name": str(manifest.get("name", "")) or _name_in_file(bench),
        "pipeline": str(_below(bench.pipeline, top)),
        "folder": str(_below(bench.folder, top)),
        "computed": f"{when} UTC" if when else "at work" if bench.status.running else "not yet",
        "verdict": _verdict(bench.folder, manifest) if manifest else "",
    }


def _below(path: Path, top: Path) -> Path:
    return path.relative_to(top) if path.is_relative_to(top) else path


def _name_in_file(bench: Workbench) -> str:
    try:
        return bench.choices().pipeline.name or bench.pipeline.stem
    except InputError:
        return bench.pipeline.stem


def _verdict(folder: Path, manifest: dict[str, Any]) -> str:
    """Say whether the result can be used, and what a diagnosis has found, where one was made."""
    assessment = manifest.get("assessment")
    word = str(assessment.get("verdict", "")) if isinstance(assessment, dict) else ""
    try:
        diagnosis = read_json(folder / "diagnosis.json")
        found = str(diagnosis.get("statement") or SENTENCES[str(diagnosis["verdict"])])
    except (FileFormatError, KeyError):
        found = "no diagnosis was run"
    return f"{word}; {found}" if word else found
