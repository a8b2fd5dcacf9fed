"""The page of a comparison of two runs: one HTML file with the modes that have moved, and the FRFs of both tests."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.fleet.mode_changes import ModeOutcome
from frf_ipz.fleet.page import write_sections
from frf_ipz.plotting.curves import Q95, magnitude_title
from frf_ipz.plotting.frfs import PHASE_AXIS, magnitude_and_phase, magnitude_hover
from frf_ipz.plotting.picture import Axis, Layer, Line, Panel, Picture, Points, Role, frequency_axis
from frf_ipz.plotting.wording import NOTHING, number, with_error
from frf_ipz.report.section import Block, Card, Cards, Choice, Figure, Headline, Section, Table
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from frf_ipz.arrays import FloatArray
    from frf_ipz.fleet.mode_changes import ModeChange, RunComparison
    from frf_ipz.runs.results import Results

COLUMNS = (
    "before, Hz",
    "after, Hz",
    "change of frequency, %",
    "in deviations",
    "damping before, %",
    "damping after, %",
    "in deviations",
    "MAC",
    "outcome",
)


def write_comparison(comparison: RunComparison, before: Results, after: Results, path: Path) -> None:
    """Put a comparison on one page.

    Parameters
    ----------
    comparison : RunComparison
        Of both runs.
    before, after : Results
        The runs.
    path : Path
        File to write.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    sections = [_overview(comparison), *_frfs(before, after), _provenance(before, after)]
    title = f"{before.name} and {after.name}" if before.name != after.name else f"{before.name}, before and after"
    bands = np.array([before.band_hz, after.band_hz])
    write_sections(
        path,
        title,
        sections,
        frequency_scale=frequency_axis(float(bands[:, 0].min()), float(bands[:, 1].max())).scale,
        lowest_hz=float(min(1.0, *bands[bands > 0])),
        date=str(after.manifest.get("when", ""))[:10],
    )


def _overview(comparison: RunComparison) -> Section:
    moved = comparison.of(ModeOutcome.MOVED)
    largest = max(moved, key=lambda mode: abs(mode.change), default=None)
    alone = comparison.of(ModeOutcome.NEW, ModeOutcome.GONE)
    cards = [
        Card("Modes that have moved", f"{len(moved)} of {len(comparison.common)}", "of those that both tests have"),
        Card("In one test only", str(len(alone)), counted(len(alone), "mode")),
    ]
    if largest is not None:
        meaning = f"the mode at {number(largest.before_hz)} Hz, {number(abs(largest.frequency_sigma), 2)} deviations"
        cards.insert(1, Card("Largest change", f"{100 * largest.change:+.2g} %", meaning))
    blocks: list[Block] = [Headline(sentence=comparison.statement, addition=" ".join(comparison.additions))]
    blocks += [Figure(picture=_changes(comparison))] if comparison.common else []
    blocks += [Cards(tuple(cards)), _table(comparison)]
    choices = (
        f"a change counts from {number(comparison.limit_sigma, 2)} deviations on: of twenty comparisons where nothing "
        "has changed one shows such a change",
        "deviations are those of the noise in both tests and, from test to test with nothing changed, "
        f"{number(100 * comparison.frequency_scatter, 2)} % of a frequency and "
        f"{number(100 * comparison.damping_scatter, 2)} % of a damping ratio",
    )
    return Section(anchor="overview", title="Overview", lead="", blocks=tuple(blocks), choices=choices)


def _table(comparison: RunComparison) -> Table:
    rows = [
        [
            with_error(mode.before_hz, mode.before_hz_std, 7),
            with_error(mode.after_hz, mode.after_hz_std, 7),
            _signed(with_error(100 * mode.change, 100 * mode.change_std, 3)),
            _signed(number(mode.frequency_sigma, 2)),
            with_error(100 * mode.before_damping, 100 * mode.before_damping_std, 5),
            with_error(100 * mode.after_damping, 100 * mode.after_damping_std, 5),
            _signed(number(mode.damping_sigma, 2)),
            number(mode.mac, 2),
            mode.outcome.value,
        ]
        for mode in comparison.modes
    ]
    marked = {place for place, mode in enumerate(comparison.modes) if mode.outcome is not ModeOutcome.SAME}
    return Table(caption="Modes", columns=COLUMNS, rows=rows, marked=frozenset(marked))


def _signed(text: str) -> str:
    return text if text.startswith(("-", NOTHING)) else f"+{text}"


def _changes(comparison: RunComparison) -> Picture:
    modes = comparison.common
    panels = []
    for title, changes, deviations in (
        ("Frequency, %", [mode.change for mode in modes], [mode.change_std for mode in modes]),
        ("Damping, %", [mode.damping_change for mode in modes], [mode.damping_change_std for mode in modes]),
    ):
        layers = _change_layers(modes, 100 * np.array(changes), 100 * Q95 * np.nan_to_num(deviations))
        panels.append(Panel(y=Axis(title=title, has_zero_line=True), layers=layers))
    return Picture(
        name="changes",
        title="Change of each mode from the test before to the test after",
        alt=f"Relative change of frequency and damping of {counted(len(modes), 'mode')} with 95 % bars.",
        panels=tuple(panels),
        x=Axis(
            title="Mode",
            ticks=tuple(float(place) for place in range(1, len(modes) + 1)),
            tick_labels=tuple(f"{number(mode.before_hz)} Hz" for mode in modes),
        ),
        note="Bars: 95 % by the noise of both tests.",
        height_px=460,
    )


def _change_layers(modes: Sequence[ModeChange], changes: FloatArray, bars: FloatArray) -> tuple[Layer, ...]:
    places = np.arange(1.0, len(modes) + 1)
    has_moved = np.array([mode.outcome is ModeOutcome.MOVED for mode in modes])
    layers: list[Layer] = []
    for name, chosen, colour in (("as before", ~has_moved, Role.MUTED), ("frequency moved", has_moved, Role.BAD)):
        if not chosen.any():
            continue
        bar_x, bar_y = (np.full(3 * int(chosen.sum()), np.nan) for _ in range(2))
        bar_x[::3] = bar_x[1::3] = places[chosen]
        bar_y[::3], bar_y[1::3] = changes[chosen] - bars[chosen], changes[chosen] + bars[chosen]
        layers.append(Line(name=name, colour=colour, group=name, in_legend=False, x=bar_x, y=bar_y, width=2.0))
        texts = [f"{number(mode.before_hz)} Hz" for mode, is_chosen in zip(modes, chosen, strict=True) if is_chosen]
        hover = "{text}: {y:.3g} %"
        layers.append(
            Points(name=name, colour=colour, group=name, x=places[chosen], y=changes[chosen], texts=texts, hover=hover)
        )
    return tuple(layers)


def _frfs(before: Results, after: Results) -> list[Section]:
    """Lay the FRFs of both tests over each other, those that both have."""
    names = [[f"{label}, {label.quantity.value}" for label in run.labels] for run in (before, after)]
    common = [name for name in dict.fromkeys(names[0]) if name in names[1]]
    if not common:
        return []
    pictures = {
        name: _overlay(before, after, (names[0].index(name), names[1].index(name)), place)
        for place, name in enumerate(common)
    }
    return [
        Section(
            anchor="frfs",
            title="FRFs",
            lead=f"{counted(len(common), 'FRF')} measured in both tests.",
            blocks=(Choice(name="frfs-of-both", label="FRF", pictures=pictures),),
        )
    ]


def _overlay(before: Results, after: Results, columns: tuple[int, int], place: int) -> Picture:
    curves: list[tuple[Line, Line]] = []
    styles = (("before", before, Role.REFERENCE, 0.35, 5.0), ("after", after, Role.UPDATED, 1.0, 1.6))
    for (name, run, colour, opacity, width), column in zip(styles, columns, strict=True):
        frfs = run.frfs
        if frfs is None:
            continue
        lines = frfs.in_band(run.band_hz)
        x, values = frfs.frequency_hz[lines], np.asarray(frfs.values[lines, column])
        hover = magnitude_hover(frfs.labels[column])
        curves.append(magnitude_and_phase(name, colour, x, values, hover, opacity=opacity, width=width))
    label = before.labels[columns[0]]
    magnitudes, phases = zip(*curves, strict=True)
    ends = np.array([before.band_hz, after.band_hz])
    return Picture(
        name=f"both-{place}",
        title=f"{label}: before and after",
        alt=f"Magnitude and phase of the FRF {label}: before as a broad grey line, after as a thin one.",
        panels=(
            Panel(y=Axis(title=magnitude_title([label]), scale="log"), layers=magnitudes, share=2.2),
            Panel(y=PHASE_AXIS, layers=phases),
        ),
        x=frequency_axis(float(ends[:, 0].min()), float(ends[:, 1].max())),
        height_px=460,
    )


def _provenance(before: Results, after: Results) -> Section:
    rows = [
        [
            name,
            run.name,
            "" if run.path is None else run.path.name,
            str(run.manifest.get("test", {}).get("date", "")),
            str(run.manifest.get("when", ""))[:19],
            str(run.manifest.get("frf_ipz", "")),
        ]
        for name, run in (("before", before), ("after", after))
    ]
    columns = ("test", "run", "folder", "measured on", "run on", "frf_ipz")
    return Section(
        anchor="provenance",
        title="Provenance",
        lead="Frequencies, damping and deviations are those of the fits of both runs.",
        blocks=(Table(caption="Runs", columns=columns, rows=rows, file="run.json"),),
    )
