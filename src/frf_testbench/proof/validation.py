"""The figures of proofs as a page of the documentation, in Markdown (MyST).

``frf-testbench validation SCORES.json [SCORES.json ...] --out docs/validation.md`` renders one section for each file,
in the order in which they stand. A file is the ``scores.json`` of a proof, or a shorter one of the same form in which
the figures of an earlier campaign were written down: ``title``, ``machines`` (number by group), ``bars`` (``group``,
``name``, and ``rate`` or ``value``), and where known ``seeds``, ``package`` and ``notes`` (paragraphs). A file with
notes only makes a section of text.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from frf_testbench.proof.page import format_number, make_environment
from frf_testbench.proof.rates import Rate

NOT_RECORDED = "not recorded"


class ScoresError(Exception):
    """A file that holds no scores."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BarLine:
    """One line of the table of a campaign, as text."""

    group: str
    name: str
    requirement: str
    counted: str
    value: str
    interval: str
    reached: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """Machines that one version of the code has diagnosed, as text; `n_machines` is 0 for a section of text."""

    title: str
    anchor: str
    n_machines: int
    machines: str
    seeds: str
    version: str
    notes: tuple[str, ...]
    bars: tuple[BarLine, ...]

    @property
    def has_requirements(self) -> bool:
        """Whether any bar states what is required."""
        return any(bar.requirement for bar in self.bars)


def write_validation(paths: Sequence[Path], out: Path) -> None:
    """Write the page of the documentation.

    Parameters
    ----------
    paths : sequence of Path
        Files of scores.
    out : Path
        The page.

    Raises
    ------
    ScoresError
        If a file holds no scores.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(render_validation([read_campaign(path) for path in paths]), encoding="utf-8")


def render_validation(campaigns: Sequence[Campaign]) -> str:
    """Render the page of the documentation.

    Parameters
    ----------
    campaigns : sequence of Campaign
        One a section.

    Returns
    -------
    str
        Markdown.
    """
    template = make_environment(autoescape=False).get_template("validation.md.jinja")
    measured = [campaign for campaign in campaigns if campaign.n_machines]
    return template.render(campaigns=campaigns, measured=measured, comparison=_compare_counts(measured))


def _compare_counts(campaigns: Sequence[Campaign]) -> list[tuple[str, str, list[str]]]:
    """Put side by side what more than one campaign has counted: group, name, and the counts of each campaign."""
    tables = [{(bar.group, bar.name): bar.counted for bar in campaign.bars if bar.counted} for campaign in campaigns]
    keys = dict.fromkeys(key for table in tables for key in table)
    rows = [(*key, [table.get(key, "") for table in tables]) for key in keys]
    return [row for row in rows if sum(bool(counted) for counted in row[2]) > 1]


def read_campaign(path: Path) -> Campaign:
    """Read a file of scores.

    Parameters
    ----------
    path : Path
        ``scores.json`` of a proof, or a file of the same form.

    Returns
    -------
    Campaign
        Its figures as text.

    Raises
    ------
    ScoresError
        If it holds no scores.
    """
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        machines = table.get("machines", {})
        return Campaign(
            title=table["title"],
            anchor=re.sub(r"[^a-z0-9]+", "-", table["title"].lower()).strip("-"),
            n_machines=sum(machines.values()),
            machines=", ".join(f"{count} {group}" for group, count in machines.items()),
            seeds=_format_seeds(table.get("seeds") or {}),
            version=_format_version(table.get("package") or {}),
            notes=tuple(table.get("notes", ())),
            bars=tuple(_read_bar(bar) for bar in table.get("bars", ())),
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise ScoresError(
            f"{path} holds no scores ({error!r}): needed is the scores.json of a proof, or a file with "
            f"'title', 'machines' and 'bars'"
        ) from None


def _format_seeds(seeds: Mapping[str, Sequence[int]]) -> str:
    ranges = [f"{group} {low} to {high}" if low != high else f"{group} {low}" for group, (low, high) in seeds.items()]
    return "; ".join(ranges) or NOT_RECORDED


def _format_version(package: Mapping[str, str]) -> str:
    parts = [package.get("version"), f"code {package['code']}" if package.get("code") else None]
    return ", ".join(part for part in parts if part) or NOT_RECORDED


def _read_bar(bar: Mapping[str, Any]) -> BarLine:
    counted = interval = ""
    if bar.get("rate"):
        rate = Rate(hits=bar["rate"]["hits"], count=bar["rate"]["count"])
        low, high = rate.interval
        counted = f"{rate.hits} of {rate.count}"
        value = f"{100 * rate.value:.1f} %" if rate.count else ""
        interval = f"{100 * low:.1f} to {100 * high:.1f} %" if rate.count else ""
    else:
        value = format_number(math.nan if bar.get("value") is None else float(bar["value"]))
    return BarLine(
        group=bar["group"],
        name=bar["name"],
        requirement=bar.get("requirement", ""),
        counted=counted,
        value=value,
        interval=interval,
        reached={True: "yes", False: "no", None: ""}[bar.get("passes")],
    )
