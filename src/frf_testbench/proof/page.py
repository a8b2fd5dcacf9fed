"""The page of a proof, in one file, and the same numbers for programs."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from html import escape
from pathlib import Path
from typing import Any

from frf_testbench.proof.charts import calibration_chart, parameter_chart, point_chart, time_chart
from frf_testbench.proof.judging import Judgement
from frf_testbench.proof.plan import FULL
from frf_testbench.proof.rates import Rate, calibration
from frf_testbench.proof.scoring import Bar, Scored, calibrated

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #1b1b1b; max-width: 1060px; margin: 2em auto; padding: 0 1em; }
h1 { font-size: 1.6em; } h2 { font-size: 1.2em; margin-top: 2em; }
table { border-collapse: collapse; margin: 0.6em 0; } img { max-width: 100%; }
td, th { padding: 0.2em 0.6em; text-align: left; border-bottom: 1px solid #ddd; vertical-align: top; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; }
.yes { color: #13702f; } .no { color: #b3261e; } .open { color: #777; } .wide { overflow-x: auto; }
table.bars td { white-space: nowrap; } table.bars td:nth-child(2) { white-space: normal; }
table.confusion { font-size: 12px; } table.confusion td { text-align: center; padding: 0.15em 0.35em; }
table.confusion th.top { writing-mode: vertical-rl; transform: rotate(180deg); border: 0; }
"""


def write_page(path: Path, cases: Sequence[Scored], bars: Sequence[Bar], *, title: str, code: str) -> None:
    """Write the page.

    Parameters
    ----------
    path : Path
        ``proof.html``.
    cases : sequence of Scored
        All cases.
    bars : sequence of Bar
        What was reached.
    title : str
        Of the page.
    code : str
        Digest of the package that was judged.
    """
    judgements = [case.judgement for case in cases]
    counts = Counter(one.group for one in judgements)
    parts = [
        f"<h1>{escape(title)}</h1>",
        f"<p>{len(cases)} cases: {', '.join(f'{counts[group]} {group}' for group in FULL if counts[group])}. "
        f"Package {escape(code)}. Intervals are those of Clopper and Pearson, 95 %.</p>",
        "<h2>Bars</h2>", _bar_table(bars),
        "<h2>What was said for what</h2>", _confusion(judgements),
        "<h2>Places</h2>", _place_table(judgements),
        "<h2>Parameters</h2>", _parameters(judgements),
        "<h2>Nothing missing</h2>", _null_table(judgements),
        "<h2>Two effects</h2>", _pair_table(judgements),
        "<h2>Outside the catalogue</h2>", _open_table(judgements),
        "<h2>Calibration of probabilities</h2>", _calibration(cases),
        "<h2>Held-out blows</h2>", _held_out(judgements),
        "<h2>Points that were never measured</h2>", _points(cases),
        "<h2>Times</h2>", _times(cases),
        "<h2>Cases</h2>", _case_table(cases),
    ]  # fmt: skip
    head = f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
    text = f"{head}<style>{STYLE}</style></head><body>{''.join(parts)}</body></html>\n"
    path.write_text(text, encoding="utf-8")


def write_scores(path: Path, cases: Sequence[Scored], bars: Sequence[Bar], *, code: str) -> None:
    """Write the numbers of the page as JSON; what is not known or not finite is null.

    Parameters
    ----------
    path : Path
        ``scores.json``.
    cases : sequence of Scored
        All cases.
    bars : sequence of Bar
        What was reached.
    code : str
        Digest of the package that was judged.
    """
    table = {
        "package": code,
        "bars": [
            {**asdict(bar), "interval": bar.rate.interval if bar.rate and bar.rate.count else None} for bar in bars
        ],
        "cases": [asdict(case) for case in cases],
    }
    path.write_text(json.dumps(_plain(table), indent=1) + "\n", encoding="utf-8")


def _plain(value: Any) -> Any:  # noqa: ANN401 - a tree of anything that JSON knows
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], *, text_columns: int = 1) -> str:
    """Make a table; columns after the first ones hold numbers."""

    def row(tag: str, cells: Sequence[str]) -> str:
        marks = ["" if i < text_columns else ' class="n"' for i in range(len(cells))]
        return (
            "<tr>" + "".join(f"<{tag}{mark}>{cell}</{tag}>" for cell, mark in zip(cells, marks, strict=True)) + "</tr>"
        )

    return f'<div class="wide"><table>{row("th", head)}{"".join(row("td", cells) for cells in rows)}</table></div>'


def _number(value: float) -> str:
    return "-" if math.isnan(value) else "missing" if math.isinf(value) else f"{value:.3g}"


def _rate(rate: Rate) -> str:
    if not rate.count:
        return "no case"
    low, high = rate.interval
    return f"{rate.hits} of {rate.count}: {rate.value:.1%} ({low:.1%} to {high:.1%})"


def _bar_table(bars: Sequence[Bar]) -> str:
    words = {True: '<b class="yes">reached</b>', False: '<b class="no">missed</b>', None: '<span class="open">-</span>'}
    rows = []
    for bar in bars:
        percent = bar.wanted.endswith("%") and not math.isinf(bar.value)
        plain = f"{bar.value:.1%}" if percent and not math.isnan(bar.value) else _number(bar.value)
        reached = _rate(bar.rate) if bar.rate else plain
        rows.append([bar.group, escape(bar.name), bar.wanted, reached, words[bar.passes]])
    return _table(["", "bar", "wanted", "reached", ""], rows, text_columns=5).replace("<table>", '<table class="bars">')


def _confusion(judgements: Sequence[Judgement]) -> str:
    """Rows are true, columns are said; pairs have a table of their own."""
    judgements = [one for one in judgements if one.group != "pair"]
    ends = ("consistent", "unexplained", "failed")
    names = sorted({one.said for one in judgements} - set(ends))
    columns = [*names, *(end for end in ends if any(one.said == end for one in judgements))]
    counted = Counter((one.true, one.said) for one in judgements)
    single = sorted({one.true for one in judgements if one.group in ("linear", "nonlinear")})
    others = sorted({one.true for one in judgements} - set(single))
    lines = ["<tr><th></th>" + "".join(f'<th class="top">{escape(column)}</th>' for column in columns) + "</tr>"]
    for true in (*single, *others):
        cells = "".join(_cell(counted[true, said], good=_is_good(true, said)) for said in columns)
        lines.append(f"<tr><th>{escape(true)}</th>{cells}</tr>")
    note = "<p>Rows: what is true. Columns: the verdict, or the effect named first where it is <i>explained</i>.</p>"
    return f'{note}<div class="wide"><table class="confusion">{"".join(lines)}</table></div>'


def _is_good(true: str, said: str) -> bool:
    if true.startswith("outside"):
        return said == "unexplained"
    return said == {"nothing": "consistent"}.get(true, true)


def _cell(count: int, *, good: bool) -> str:
    colour = "#cfe8d5" if good else "#f6d3cf"
    return f'<td style="background:{colour}">{count}</td>' if count else "<td></td>"


def _place_table(judgements: Sequence[Judgement]) -> str:
    placed = [one for one in judgements if one.right and one.place and one.group in ("linear", "nonlinear")]
    rows = []
    for effect in sorted({one.true for one in placed}):
        found = Counter(one.place for one in placed if one.true == effect)
        rows.append([effect, *(str(found[place]) for place in ("exact", "near", "wrong"))])
    return _table(["effect, where it is right", "exact", "within one node or element", "wrong"], rows)


def _parameters(judgements: Sequence[Judgement]) -> str:
    right = [one for one in judgements if one.right and one.group != "pair"]
    scores = [score for one in right for score in one.parameters if score.is_number]
    if not scores:
        return "<p>None.</p>"
    rows = []
    for effect, name in sorted({(score.effect, score.name) for score in scores}):
        mine = [score for score in scores if (score.effect, score.name) == (effect, name)]
        errors = sorted(score.error for score in mine)
        median = (errors[(len(errors) - 1) // 2] + errors[len(errors) // 2]) / 2
        covered = Rate.of(score.covered for score in mine)
        rows.append([effect, name, str(len(mine)), _number(median), _number(errors[-1]), _rate(covered)])
    head = ["effect", "parameter", "cases", "median error", "largest", "inside its 95 % interval"]
    return parameter_chart(scores) + _table(head, rows, text_columns=2)


def _null_table(judgements: Sequence[Judgement]) -> str:
    nulls = [one for one in judgements if one.group == "null"]
    rows = []
    for structure in sorted({one.structure for one in nulls}):
        mine = [one for one in nulls if one.structure == structure]
        alarms = [one.said for one in mine if one.verdict != "consistent"]
        rows.append([structure, str(len(mine)), str(len(alarms)), ", ".join(alarms)])
    return _table(["structure", "cases", "false alarms", "said"], rows)


def _pair_table(judgements: Sequence[Judgement]) -> str:
    pairs = [one for one in judgements if one.group == "pair"]
    rows = [
        [name, _rate(Rate.of(claims))]
        for name, claims in (
            ("both named", [one.n_right == 2 for one in pairs]),
            ("both named and placed", [one.pair_places == 2 for one in pairs]),
            ("at least one named", [one.n_right > 0 for one in pairs]),
            ("the first one named is true", [one.first_right for one in pairs]),
            ("said to be consistent", [one.verdict == "consistent" for one in pairs]),
        )
    ]
    return _table(["of all pairs", ""], rows, text_columns=2)


def _open_table(judgements: Sequence[Judgement]) -> str:
    rows = []
    for true in sorted({one.true for one in judgements if one.group == "unknown"}):
        mine = [one for one in judgements if one.true == true]
        flagged = sum(one.verdict == "unexplained" for one in mine)
        placed = Counter(one.flagged_place for one in mine if one.flagged_place)
        named = ", ".join(f"{one.said} ({_number(one.probability)})" for one in mine if one.verdict == "explained")
        rows.append([true, str(len(mine)), str(flagged), str(placed["exact"]) if placed else "", named])
    return _table(["true", "cases", "flagged", "place right", "named instead (probability)"], rows)


def _calibration(cases: Sequence[Scored]) -> str:
    bins = calibration(*calibrated(cases))
    return calibration_chart(bins) if bins else "<p>No effect was named.</p>"


def _held_out(judgements: Sequence[Judgement]) -> str:
    known = [one for one in judgements if not math.isnan(one.held_out) and one.group != "unknown"]
    rows = []
    for group in sorted({one.group for one in known}):
        mine = [one for one in known if one.group == group]
        columns = ([one.before for one in mine], [one.held_out for one in mine], [one.held_over_noise for one in mine])
        rows.append([group, str(len(mine)), *(_number(_median(values)) for values in columns)])
    return _table(["group", "cases", "error before, median", "after", "after, over that of noise"], rows)


def _median(values: Sequence[float]) -> float:
    known = sorted(value for value in values if not math.isnan(value))
    return (known[(len(known) - 1) // 2] + known[len(known) // 2]) / 2 if known else math.nan


def _points(cases: Sequence[Scored]) -> str:
    known = [case.points for case in cases if case.points]
    if not known:
        return "<p>Nothing was predicted.</p>"
    rows = [
        [name, _number(_median(values))]
        for name, values in (
            ("nominal model", [one.nominal for one in known]),
            ("updated without a diagnosis", [one.without for one in known]),
            ("with the diagnosis", [one.diagnosed for one in known]),
        )
    ]
    return point_chart(known) + _table([f"median error of {len(known)} cases", ""], rows)


def _times(cases: Sequence[Scored]) -> str:
    groups = [group for group in FULL if any(case.judgement.group == group for case in cases)]
    stage = {group: [case.stage_s for case in cases if case.judgement.group == group] for group in groups}
    whole = {
        group: [case.done.cpu_s for case in cases if case.done and case.judgement.group == group] for group in groups
    }
    rows = [
        [group, *(_number(f(values[group])) for values in (stage, whole) for f in (_median, _largest))]
        for group in groups
    ]
    head = ["group", "from FRFs, median s", "longest", "whole command, processor s, median", "longest"]
    return (
        time_chart(stage, "diagnosis from FRFs")
        + time_chart(whole, "whole command, processor time")
        + _table(head, rows)
    )


def _largest(values: Sequence[float]) -> float:
    return max((value for value in values if not math.isnan(value)), default=math.nan)


def _case_table(cases: Sequence[Scored]) -> str:
    rows = []
    for case in sorted(cases, key=lambda case: (case.judgement.group, case.judgement.true, case.judgement.name)):
        one = case.judgement
        known = one.group in ("linear", "nonlinear") and one.right
        errors = ", ".join(_number(score.error) for score in one.parameters)
        said = escape(case.fault[:120]) if one.verdict == "failed" else one.said
        place = (one.place or "no place") if known else one.flagged_place or ""
        rows.append([one.name, one.group, one.true, one.structure, said, place, errors, _number(one.probability)])
    head = ["case", "group", "true", "structure", "said", "place", "errors of parameters", "probability"]
    return _table(head, rows, text_columns=7)
