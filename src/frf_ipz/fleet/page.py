"""The page of a fleet: one HTML file with the spread over machines, outliers, drift, population, and links."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz import __version__
from frf_ipz.fleet.drift import position
from frf_ipz.fleet.fleet_file import MODEL
from frf_ipz.fleet.machine_record import FAILED, MachineRecord
from frf_ipz.fleet.outliers import FALSE_ALARMS, FEWEST
from frf_ipz.fleet.pictures import draw_drift, draw_population, draw_spread
from frf_ipz.fleet.results import ENSEMBLE, MACHINES, PAGE, POPULATION
from frf_ipz.output_files import write_text
from frf_ipz.report.html import PLOTLY, REPORT, SCRIPTS, packed_asset, page_environment, read_asset
from frf_ipz.report.page import margin_style
from frf_ipz.report.page_data import Packer, packed_pictures
from frf_ipz.report.policy import page_policy
from frf_ipz.report.section import MOST_ROWS, Card, Cards, Choice, Figure, Form, Headline, Section, Table

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from frf_ipz.fleet.analysis import FleetAnalysis, FleetRoots

COLUMNS = ("Machine", "Status", "Modes", "Assessment", "Diagnosis", "At points of interest", "Serial number", "Date")
TEMPLATES = "frf_ipz.fleet"
NO_NUMBER = "–"


def write_page(name: str, analysis: FleetAnalysis, out: Path) -> None:
    """Put what a fleet knows on one page.

    Parameters
    ----------
    name : str
        What the fleet is called.
    analysis : FleetAnalysis
        What is known of it.
    out : Path
        The fleet's folder: the page goes there, and names the pages of machines that are there.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    write_sections(out / PAGE, name, [section for section in _sections(analysis, out) if section is not None])


def write_sections(
    path: Path,
    title: str,
    sections: Sequence[Section],
    *,
    frequency_scale: str = "linear",
    lowest_hz: float = 1.0,
    date: str = "",
) -> None:
    """Write a page of sections that is about more than one run.

    Parameters
    ----------
    path : Path
        File to write.
    title : str
        Of the page.
    sections : sequence of Section
        What is on it.
    frequency_scale : str
        ``linear`` or ``log``, of frequency axes.
    lowest_hz : float
        At which they may begin.
    date : str
        That the margins of printed pages show.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    packer = Packer()
    template = page_environment(TEMPLATES).get_template("report/report.html")
    text = template.render(
        title=title,
        version=__version__,
        particulars=[],
        chooser=None,
        sections=sections,
        page_data={
            "pictures": packed_pictures(sections, packer),
            "hiddenFrfs": [],
            "frequencyScale": frequency_scale,
            "lowestHz": lowest_hz,
            "arrays": packer.arrays,
        },
        style=read_asset(REPORT, "page.css"),
        margins=margin_style(title, f"frf_ipz {__version__}", date),
        library=packed_asset(REPORT, PLOTLY),
        scripts=[read_asset(REPORT, "page.js")],
        policy=page_policy(*[read_asset(REPORT, script) for script in SCRIPTS]),
    )
    write_text(path, text)


def _sections(analysis: FleetAnalysis, out: Path) -> list[Section | None]:
    return [
        _overview(analysis, out),
        _findings(analysis),
        _poles(analysis),
        _zeros(analysis),
        _drift(analysis),
        _population(analysis),
    ]


def _overview(analysis: FleetAnalysis, out: Path) -> Section:
    records = analysis.records
    counts = Counter(record.status for record in records)
    words = ", ".join(f"{count} {status}" for status, count in counts.most_common())
    common = [finding for finding in analysis.findings if finding.of == MODEL]
    modes = len(np.unique(analysis.poles.number))
    cards = (
        Card("Machines", f"{len(records)}", words),
        Card("Modes", f"{modes}", "matched over machines by their shapes"),
        Card("Outliers", f"{len(analysis.outliers)}", "machines with a pole or a zero unlike the others'"),
        Card("Faults of the model", f"{len(common)}", "that all machines show"),
    )
    first = {record.machine for record in records if record.status == FAILED}
    ordered = sorted(records, key=lambda record: (record.machine not in first, record.machine not in analysis.outliers))
    rows = [
        {
            "machine": record.machine,
            "has_page": (out / MACHINES / record.machine / "report.html").is_file(),
            "is_marked": record.machine in first or record.machine in analysis.outliers,
            "cells": _cells(record, analysis),
        }
        for record in ordered[:MOST_ROWS]
    ]
    table = Form(
        template="fleet/machines.html",
        data={"columns": COLUMNS, "rows": rows, "n_left_out": max(len(records) - MOST_ROWS, 0)},
    )
    off = ", ".join(analysis.outliers[:10]) + (" and others" if len(analysis.outliers) > 10 else "")
    headline = Headline(
        sentence=f"{len(records)} machines: {words}",
        addition=f"Unlike the others: {off}." if off else "No machine is an outlier.",
    )
    few = (
        f"An outlier needs {FEWEST} machines to be told from; there are {len(records)}."
        if len(records) < FEWEST
        else ""
    )
    return Section(
        anchor="overview",
        title="Fleet",
        lead="",
        blocks=(headline, Cards(cards), table),
        notes=tuple(filter(None, (few,))),
    )


def _cells(record: MachineRecord, analysis: FleetAnalysis) -> list[str]:
    status = record.status + (", outlier" if record.machine in analysis.outliers else "")
    error = f"{record.poi_error_db:.2g} dB" if np.isfinite(record.poi_error_db) else NO_NUMBER
    return [
        f"{status}: {record.message}" if record.message else status,
        NO_NUMBER if record.poles is None else str(record.poles.count),
        record.assessment or NO_NUMBER,
        record.verdict or NO_NUMBER,
        error,
        record.particulars.get("serial_number", "") or NO_NUMBER,
        record.particulars.get("date", "") or NO_NUMBER,
    ]


def _findings(analysis: FleetAnalysis) -> Section | None:
    findings = analysis.findings
    if not findings:
        return None
    common = sum(finding.of == MODEL for finding in findings)
    table = Table(
        caption="Findings over machines",
        columns=("Effect", "Where", "Whose", "Size", "Log evidence", "Probability", "Machines"),
        rows=[
            (
                finding.effect.replace("_", " "),
                finding.location,
                "the model's" if finding.of == MODEL else finding.of,
                f"{finding.value:.3g} ± {finding.std:.1g} ({finding.parameter})" if finding.parameter else NO_NUMBER,
                f"{finding.log_evidence:.3g}",
                f"{finding.probability:.3f}",
                f"{len(finding.machines)}",
            )
            for finding in findings
        ],
        marked=frozenset(place for place, finding in enumerate(findings) if finding.of == MODEL),
        file="fleet_findings.parquet",
    )
    return Section(
        anchor="findings",
        title="What the model left out",
        lead=f"{common} of {len(findings)} findings are the model's: all machines show them, so correct it once. "
        "The others are one machine's own.",
        blocks=(table,),
    )


def _poles(analysis: FleetAnalysis) -> Section | None:
    if not len(analysis.poles.number):
        return None
    picture = draw_spread(analysis, analysis.poles, name="fleet-poles")
    return Section(
        anchor="poles",
        title="Poles",
        lead="",
        blocks=(Figure(picture=picture), _spread_table(analysis.poles, "Modes", "fleet_poles.parquet")),
        notes=(
            "In a fleet without a faulty machine, whose machines scatter normally, the probability that any pole or "
            f"zero of any machine is marked is at most {100 * FALSE_ALARMS:.0f} %.",
        ),
    )


def _zeros(analysis: FleetAnalysis) -> Section | None:
    zeros = analysis.zeros
    frfs = list(dict.fromkeys(zeros.frf))
    if not frfs:
        return None
    pictures = {
        frf: draw_spread(analysis, zeros, frf=frf, name=f"fleet-zeros-{place}") for place, frf in enumerate(frfs)
    }
    drawn = (
        Choice(name="fleet-zeros", label="FRF", pictures=pictures)
        if len(frfs) > 1
        else Figure(picture=pictures[frfs[0]])
    )
    return Section(
        anchor="zeros",
        title="Zeros",
        lead="",
        blocks=(drawn, _spread_table(zeros, "Zeros", "fleet_zeros.parquet")),
    )


def _spread_table(roots: FleetRoots, caption: str, file: str) -> Table:
    rows: list[tuple[str, ...]] = []
    marked: set[int] = set()
    for key in sorted(set(roots.keys)):
        chosen = np.array([of == key for of in roots.keys])
        frequency, damping = roots.frequency_hz[chosen], roots.damping_ratio[chosen]
        n_off = int(roots.is_outlier[chosen].sum())
        marked |= {len(rows)} if n_off else set()
        rows.append(
            (
                f"{key[1]}" + (f" of {key[0]}" if key[0] else ""),
                f"{len(frequency)}",
                f"{np.mean(frequency):.5g}",
                f"{100 * np.std(frequency) / np.mean(frequency):.2g}",
                f"{np.mean(damping):.3g}",
                f"{100 * np.std(damping) / abs(np.mean(damping)):.2g}" if np.mean(damping) else NO_NUMBER,
                f"{n_off}",
            )
        )
    columns = ("Number", "Machines", "Mean, Hz", "Spread, %", "Damping ratio", "Spread, %", "Outliers")
    return Table(caption=f"{caption} over machines", columns=columns, rows=rows, marked=frozenset(marked), file=file)


def _drift(analysis: FleetAnalysis) -> Section | None:
    blocks: list[Figure | Table] = []
    clear = [drift for drift in analysis.drifts if drift.is_significant]
    for along in dict.fromkeys(drift.along for drift in analysis.drifts):
        drifts = [drift for drift in analysis.drifts if drift.along == along]
        positions = np.array([position(along, record.particulars) for record in analysis.records])
        blocks.append(Figure(picture=draw_drift(analysis, along, drifts, positions)))
    if not blocks:
        return None
    rows = [
        (
            f"mode {drift.mode} along the {drift.along.replace('_', ' ')}",
            f"{drift.percent_in_all:+.2g}",
            f"{drift.p_value:.2g}",
            "yes" if drift.is_significant else "no",
        )
        for drift in analysis.drifts
    ]
    marked = frozenset(place for place, drift in enumerate(analysis.drifts) if drift.is_significant)
    blocks.append(
        Table(
            caption="Change from the first machine to the last",
            columns=("What", "Change, %", "p value", "Drifts"),
            rows=rows,
            marked=marked,
        )
    )
    return Section(
        anchor="drift",
        title="Drift",
        lead=f"{len(clear)} of {len(analysis.drifts)} orders are clearer than chance."
        if clear
        else "No frequency changes with the date or the serial number by more than chance.",
        blocks=tuple(blocks),
        notes=(
            f"Rank correlation of Kendall; without any drift the probability that one is marked is at most "
            f"{100 * FALSE_ALARMS:.0f} %.",
        ),
    )


def _population(analysis: FleetAnalysis) -> Section | None:
    population = analysis.population
    if not population.names:
        return None
    kinds = Counter(name.partition(" of ")[0] for name in population.names)
    named = {kind: [name for name in population.names if name.startswith(f"{kind} of ")] for kind in kinds}
    ratios = [names for kind, names in named.items() if kind != "mass"]  # that of a sensor is no ratio
    return Section(
        anchor="population",
        title="Population",
        lead=f"Mean and spread of {len(population.names)} updated parameters over {len(population.machines)} machines, "
        f"outliers left out, are in {POPULATION}; models of such machines, for a controller that has to suit all of "
        f"them, in {ENSEMBLE}.",
        blocks=tuple(Figure(picture=draw_population(population, names)) for names in ratios),
        choices=(f"correlations over machines are shrunk by {100 * population.shrinkage:.0f} %",),
    )
