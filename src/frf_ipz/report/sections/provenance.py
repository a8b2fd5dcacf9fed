"""What ran: versions, inputs with their digests, options, times."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from posixpath import basename, commonpath, dirname, normpath, relpath
from typing import TYPE_CHECKING, Any

from frf_ipz.plotting.wording import number
from frf_ipz.report.section import Listing, Section, Table

if TYPE_CHECKING:
    from frf_ipz.runs.results import Results

ABSOLUTE = re.compile(r"([A-Za-z]:|)(/.*)", re.DOTALL)
DRIVE, PLACE = 1, 2
SHOWN_DIGITS = 16  # of a digest; all stand in run.json


def build(run: Results) -> Section:
    """Give the section on provenance.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    Section
        The section.
    """
    manifest = run.manifest
    versions = {
        "frf_ipz": manifest.get("frf_ipz", ""),
        "Python": manifest.get("python", ""),
        **manifest.get("packages", {}),
    }
    pipeline = str(manifest.get("pipeline", ""))
    name = basename(pipeline.replace("\\", "/"))
    lead = f"Pipeline {name}" + (f", run on {manifest['when']}." if "when" in manifest else ".")
    options = json.dumps(_shown(manifest.get("configuration", {}), pipeline), indent=1, ensure_ascii=False)
    blocks = (
        Table(
            caption="Versions",
            columns=("package", "version"),
            rows=[[name, str(text)] for name, text in versions.items()],
        ),
        Table(
            caption="Stages", columns=("stage", "time, s", "state", "digest of all it depends on"), rows=_stages(run)
        ),
        Table(
            caption="Input files, as seen from the pipeline's folder",
            columns=("file", "SHA-256"),
            rows=[
                [path_from(name, pipeline), digest[:SHOWN_DIGITS] + "…"]
                for name, digest in manifest.get("inputs", {}).items()
            ],
            file="run.json",
        ),
        Listing(title="All options, as resolved", text=options),
    )
    return Section(anchor="provenance", title="Provenance", lead=lead, blocks=blocks)


def _shown(value: object, pipeline: str) -> Any:  # noqa: ANN401  a tree of plain values
    """Take the folders above the campaign, which only the computer of the run has, out of options."""
    if isinstance(value, Mapping):
        return {key: _shown(item, pipeline) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_shown(item, pipeline) for item in value]
    return path_from(value, pipeline) if isinstance(value, str) else value


def path_from(path: str, pipeline: str) -> str:
    """Write an absolute path as it is seen from the folder of a pipeline.

    Parameters
    ----------
    path : str
        Of a file, with the separators of any system; what is no absolute path stays as it is.
    pipeline : str
        Path of the pipeline file.

    Returns
    -------
    str
        The name alone where the two have no folder in common.

    Examples
    --------
    >>> path_from("/home/me/beam/data/../test.toml", "/home/me/beam/runs/pipeline.toml")
    '../test.toml'
    >>> path_from("/mnt/test.toml", "/home/me/pipeline.toml")
    'test.toml'
    """
    given = ABSOLUTE.fullmatch(path.replace("\\", "/"))
    if given is None:
        return path
    place = normpath(given[PLACE])
    start = ABSOLUTE.fullmatch(pipeline.replace("\\", "/"))
    if start is None or start[DRIVE].lower() != given[DRIVE].lower():
        return basename(place)
    folder = dirname(normpath(start[PLACE]))
    return basename(place) if commonpath([place, folder]) == "/" else relpath(place, folder)


def _stages(run: Results) -> list[list[str]]:
    return [
        [
            name,
            number(float(entry.get("seconds", float("nan"))), 3),
            "stale" if name in run.stale else "current",
            str(entry.get("key", ""))[:SHOWN_DIGITS] + "…",
        ]
        for name, entry in run.manifest.get("stages", {}).items()
    ]
