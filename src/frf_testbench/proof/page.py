"""The page of a proof, in one file, and the same numbers for programs.

Python computes tables and pictures; the template ``templates/proof.html.jinja`` lays them out, and escapes all text.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

import frf_ipz
from frf_ipz.report.policy import page_policy
from frf_testbench.proof.charts import draw_calibration, draw_parameter_errors, draw_point_errors, draw_times
from frf_testbench.proof.judging import Judgement, ParameterScore
from frf_testbench.proof.plan import FULL
from frf_testbench.proof.rates import Rate, calibration
from frf_testbench.proof.scoring import Bar, Cases, ScoredCase, list_probabilities

LONGEST_FAULT = 120  # characters of a message in the list of cases


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of texts; columns after the first ones hold numbers."""

    head: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    n_text_columns: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfusionCell:
    """How often a label was stated for a true one, and whether that is right."""

    count: int
    is_right: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfusionRow:
    """All that was stated for one true label."""

    label: str
    cells: list[ConfusionCell]


@dataclass(frozen=True, slots=True, kw_only=True)
class Confusion:
    """Rows are true, columns are stated."""

    columns: list[str]
    rows: list[ConfusionRow]


def make_environment(*, autoescape: bool) -> Environment:
    """Make the environment of the templates of this package.

    Parameters
    ----------
    autoescape : bool
        For a page in HTML.

    Returns
    -------
    Environment
        In which a name that is missing is an error.
    """
    environment = Environment(
        loader=PackageLoader("frf_testbench.proof"),
        autoescape=autoescape,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    environment.filters["value_reached"] = format_reached
    return environment


def write_page(path: Path, cases: Cases, bars: Sequence[Bar], *, title: str, code: str) -> None:
    """Write the page.

    Parameters
    ----------
    path : Path
        ``proof.html``.
    cases : sequence of ScoredCase
        All cases.
    bars : sequence of Bar
        What was reached.
    title : str
        Of the page.
    code : str
        Digest of the package that was judged.
    """
    judgements = [case.judgement for case in cases]
    counts = Counter(judgement.group for judgement in judgements)
    groups = [group for group in FULL if counts[group]]
    scores = _list_number_scores(judgements)
    bins = calibration(*list_probabilities(cases))
    points = [case.points for case in cases if case.points]
    stage_s = {group: [case.stage_s for case in cases if case.judgement.group == group] for group in groups}
    cpu_s = {group: _list_cpu_times(cases, group) for group in groups}
    template = make_environment(autoescape=True).get_template("proof.html.jinja")
    text = template.render(
        title=title,
        policy=page_policy(),
        code=code,
        n_cases=len(cases),
        group_counts=", ".join(f"{counts[group]} {group}" for group in groups),
        bars=bars,
        confusion=_count_labels(judgements),
        locations=_tabulate_locations(judgements),
        parameters=_tabulate_parameters(judgements),
        parameter_picture=draw_parameter_errors(scores) if scores else None,
        nulls=_tabulate_nulls(judgements),
        pairs=_tabulate_pairs(judgements),
        unknown=_tabulate_unknown(judgements),
        calibration_picture=draw_calibration(bins) if bins else None,
        held_out=_tabulate_held_out(judgements),
        points=_tabulate_points(cases),
        point_picture=draw_point_errors(points) if points else None,
        time_pictures={
            label: draw_times(times, label)
            for label, times in (("diagnosis from FRFs", stage_s), ("whole command, processor time", cpu_s))
        },
        times=_tabulate_times(stage_s, cpu_s),
        cases=_tabulate_cases(cases),
    )
    path.write_text(text, encoding="utf-8")


def write_scores(path: Path, cases: Cases, bars: Sequence[Bar], *, title: str, code: str) -> None:
    """Write the numbers of the page as JSON; what is not known or not finite is null.

    Parameters
    ----------
    path : Path
        ``scores.json``.
    cases : sequence of ScoredCase
        All cases.
    bars : sequence of Bar
        What was reached.
    title : str
        Of the proof.
    code : str
        Digest of the package that was judged.
    """
    table = {
        "title": title,
        "package": {"version": frf_ipz.__version__, "code": code},
        "machines": dict(Counter(case.judgement.group for case in cases)),
        "seeds": _find_seed_ranges(cases),
        "bars": [
            {**asdict(bar), "interval": bar.rate.interval if bar.rate and bar.rate.count else None} for bar in bars
        ],
        "cases": [asdict(case) for case in cases],
    }
    path.write_text(json.dumps(_replace_non_finite(table), indent=1) + "\n", encoding="utf-8")


def _find_seed_ranges(cases: Cases) -> dict[str, list[int]]:
    """Find the smallest and the largest seed of each group, where answers state them."""
    ranges: dict[str, list[int]] = {}
    for case in cases:
        seed, group = case.judgement.seed, case.judgement.group
        if seed is not None:
            low, high = ranges.get(group, [seed, seed])
            ranges[group] = [min(low, seed), max(high, seed)]
    return ranges


def _replace_non_finite(tree: Any) -> Any:  # noqa: ANN401 - a tree of anything that JSON knows
    if isinstance(tree, dict):
        return {key: _replace_non_finite(branch) for key, branch in tree.items()}
    if isinstance(tree, list | tuple):
        return [_replace_non_finite(branch) for branch in tree]
    return None if isinstance(tree, float) and not math.isfinite(tree) else tree


def format_number(value: float) -> str:
    """Format a number with three digits; nan is unknown, infinity is a parameter that is missing."""
    return "-" if math.isnan(value) else "missing" if math.isinf(value) else f"{value:.3g}"


def format_rate(rate: Rate) -> str:
    """Format a rate with its counts and its interval."""
    if not rate.count:
        return "no case"
    low, high = rate.interval
    return f"{rate.hits} of {rate.count}: {rate.value:.1%} ({low:.1%} to {high:.1%})"


def format_reached(bar: Bar) -> str:
    """Format what was reached of a bar."""
    if bar.rate:
        return format_rate(bar.rate)
    is_percentage = bar.requirement.endswith("%") and math.isfinite(bar.value)
    return f"{bar.value:.1%}" if is_percentage else format_number(bar.value)


def _compute_median(values: Iterable[float]) -> float:
    """Compute the median without what is unknown; infinite values count."""
    ordered = sorted(value for value in values if not math.isnan(value))
    return (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]) / 2 if ordered else math.nan


def _count_labels(judgements: Sequence[Judgement]) -> Confusion:
    """Count stated labels for true ones; pairs have a table of their own."""
    judgements = [judgement for judgement in judgements if judgement.group != "pair"]
    verdicts = ("consistent", "unexplained", "failed")
    stated_labels = {judgement.stated_label for judgement in judgements}
    columns = [*sorted(stated_labels - set(verdicts)), *(verdict for verdict in verdicts if verdict in stated_labels)]
    counts = Counter((judgement.true_label, judgement.stated_label) for judgement in judgements)
    named = sorted({judgement.true_label for judgement in judgements if judgement.group in ("linear", "nonlinear")})
    unnamed = sorted({judgement.true_label for judgement in judgements} - set(named))
    return Confusion(
        columns=columns,
        rows=[
            ConfusionRow(
                label=label,
                cells=[
                    ConfusionCell(count=counts[label, column], is_right=_is_right_label(label, column))
                    for column in columns
                ],
            )
            for label in (*named, *unnamed)
        ],
    )


def _is_right_label(true_label: str, stated_label: str) -> bool:
    if true_label.startswith("outside"):
        return stated_label == "unexplained"
    return stated_label == {"nothing": "consistent"}.get(true_label, true_label)


def _tabulate_locations(judgements: Sequence[Judgement]) -> Table:
    located = [
        judgement
        for judgement in judgements
        if judgement.is_right and judgement.location_match and judgement.group in ("linear", "nonlinear")
    ]
    rows = []
    for effect in sorted({judgement.true_label for judgement in located}):
        counts = Counter(judgement.location_match for judgement in located if judgement.true_label == effect)
        rows.append((effect, *(str(counts[match]) for match in ("exact", "near", "wrong"))))
    return Table(head=("effect, where it is right", "exact", "within one node or element", "wrong"), rows=rows)


def _list_number_scores(judgements: Sequence[Judgement]) -> list[ParameterScore]:
    right = [judgement for judgement in judgements if judgement.is_right and judgement.group != "pair"]
    return [score for judgement in right for score in judgement.parameters if score.is_number]


def _tabulate_parameters(judgements: Sequence[Judgement]) -> Table:
    scores = _list_number_scores(judgements)
    rows = []
    for effect, name in sorted({(score.effect, score.name) for score in scores}):
        group = [score for score in scores if (score.effect, score.name) == (effect, name)]
        errors = [score.error for score in group]
        covered = Rate.of(score.is_covered for score in group)
        median, largest = format_number(_compute_median(errors)), format_number(max(errors))
        rows.append((effect, name, str(len(group)), median, largest, format_rate(covered)))
    head = ("effect", "parameter", "cases", "median error", "largest", "inside its 95 % interval")
    return Table(head=head, rows=rows, n_text_columns=2)


def _tabulate_nulls(judgements: Sequence[Judgement]) -> Table:
    nulls = [judgement for judgement in judgements if judgement.group == "null"]
    rows = []
    for structure in sorted({judgement.structure for judgement in nulls}):
        group = [judgement for judgement in nulls if judgement.structure == structure]
        alarms = [judgement.stated_label for judgement in group if judgement.verdict != "consistent"]
        rows.append((structure, str(len(group)), str(len(alarms)), ", ".join(alarms)))
    return Table(head=("structure", "cases", "false alarms", "stated"), rows=rows)


def _tabulate_pairs(judgements: Sequence[Judgement]) -> Table:
    pairs = [judgement for judgement in judgements if judgement.group == "pair"]
    rows = [
        (name, format_rate(Rate.of(claims)))
        for name, claims in (
            ("both named", [pair.n_right == 2 for pair in pairs]),
            ("both named and located", [pair.n_right_exact == 2 for pair in pairs]),
            ("at least one named", [pair.n_right > 0 for pair in pairs]),
            ("the first one named is true", [pair.first_is_right for pair in pairs]),
            ("stated to be consistent", [pair.verdict == "consistent" for pair in pairs]),
        )
    ]
    return Table(head=("of all pairs", ""), rows=rows, n_text_columns=2)


def _tabulate_unknown(judgements: Sequence[Judgement]) -> Table:
    rows = []
    for label in sorted({judgement.true_label for judgement in judgements if judgement.group == "unknown"}):
        group = [judgement for judgement in judgements if judgement.true_label == label]
        flagged = sum(judgement.verdict == "unexplained" for judgement in group)
        matches = Counter(judgement.mismatch_location_match for judgement in group if judgement.mismatch_location_match)
        names = ", ".join(
            f"{judgement.stated_label} ({format_number(judgement.probability)})"
            for judgement in group
            if judgement.verdict == "explained"
        )
        rows.append((label, str(len(group)), str(flagged), str(matches["exact"]) if matches else "", names))
    return Table(head=("true", "cases", "flagged", "location right", "named instead (probability)"), rows=rows)


def _tabulate_held_out(judgements: Sequence[Judgement]) -> Table:
    measured = [
        judgement
        for judgement in judgements
        if not math.isnan(judgement.held_out_after) and judgement.group != "unknown"
    ]
    rows = []
    for name in sorted({judgement.group for judgement in measured}):
        group = [judgement for judgement in measured if judgement.group == name]
        columns = (
            [judgement.held_out_before for judgement in group],
            [judgement.held_out_after for judgement in group],
            [judgement.held_out_over_noise for judgement in group],
        )
        rows.append((name, str(len(group)), *(format_number(_compute_median(values)) for values in columns)))
    return Table(head=("group", "cases", "error before, median", "after", "after, over that of noise"), rows=rows)


def _tabulate_points(cases: Cases) -> Table:
    points = [case.points for case in cases if case.points]
    rows = [
        (name, format_number(_compute_median(errors)))
        for name, errors in (
            ("nominal model", [errors.nominal for errors in points]),
            ("updated without a diagnosis", [errors.without for errors in points]),
            ("with the diagnosis", [errors.diagnosed for errors in points]),
        )
    ]
    return Table(head=(f"median error of {len(points)} cases", ""), rows=rows)


def _list_cpu_times(cases: Cases, group: str) -> list[float]:
    outcomes = [case.outcome for case in cases if case.outcome and case.judgement.group == group]
    return [math.nan if outcome.cpu_s is None else outcome.cpu_s for outcome in outcomes]


def _tabulate_times(stage_s: dict[str, list[float]], cpu_s: dict[str, list[float]]) -> Table:
    rows = []
    for group in stage_s:
        cells = []
        for times in (stage_s[group], cpu_s[group]):
            longest = max((time for time in times if not math.isnan(time)), default=math.nan)
            cells += [format_number(_compute_median(times)), format_number(longest)]
        rows.append((group, *cells))
    head = ("group", "from FRFs, median s", "longest", "whole command, processor s, median", "longest")
    return Table(head=head, rows=rows)


def _tabulate_cases(cases: Cases) -> Table:
    def order(case: ScoredCase) -> tuple[str, str, str]:
        return case.judgement.group, case.judgement.true_label, case.judgement.name

    rows = []
    for case in sorted(cases, key=order):
        judgement = case.judgement
        is_right_single = judgement.group in ("linear", "nonlinear") and judgement.is_right
        match = (judgement.location_match or "no location") if is_right_single else judgement.mismatch_location_match
        rows.append(
            (
                judgement.name,
                judgement.group,
                judgement.true_label,
                judgement.structure,
                case.fault[:LONGEST_FAULT] if judgement.verdict == "failed" else judgement.stated_label,
                match or "",
                ", ".join(format_number(score.error) for score in judgement.parameters),
                format_number(judgement.probability),
            )
        )
    head = ("case", "group", "true", "structure", "stated", "location", "errors of parameters", "probability")
    return Table(head=head, rows=rows, n_text_columns=7)
