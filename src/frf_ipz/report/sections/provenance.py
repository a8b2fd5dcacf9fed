"""What ran: versions, inputs with their digests, options, times."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from frf_ipz.plotting.wording import number
from frf_ipz.report.section import Listing, Section, Table

if TYPE_CHECKING:
    from frf_ipz.runs.results import Results

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
    lead = f"Pipeline {manifest.get('pipeline', '')}" + (f", run on {manifest['when']}." if "when" in manifest else ".")
    options = json.dumps(manifest.get("configuration", {}), indent=1, ensure_ascii=False)
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
            caption="Input files",
            columns=("file", "SHA-256"),
            rows=[[name, digest[:SHOWN_DIGITS] + "…"] for name, digest in manifest.get("inputs", {}).items()],
            file="run.json",
        ),
        Listing(title="All options, as resolved", text=options),
    )
    return Section(anchor="provenance", title="Provenance", lead=lead, blocks=blocks)


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
