"""Diagnosis: where model and measurement disagree, what explains it, and the proof on what was not shown to the fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.result import Estimate
from frf_ipz.report.findings import place_of_mismatch, plain_signs, verdict_of
from frf_ipz.report.picture import Axis, Picture, Trace, colour_of, frequency_axis, line, markers, panels
from frf_ipz.report.section import Block, Section
from frf_ipz.report.sections.diagnosis.law import law_pictures
from frf_ipz.report.sections.diagnosis.levels import level_pictures
from frf_ipz.report.table import Table
from frf_ipz.report.wording import counted, number, percent, with_error

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.diagnosis.result import Curves, Diagnosis, Finding
    from frf_ipz.report.contents import RunContents

MOST_ALTERNATIVES = 15
POWERS = {"exponentformat": "power", "dtick": 1}
SURELY_NOT = 1e-6  # a probability below is written as being below
CLOSE = 0.8  # of the best evidence: where all explanations gain more, their differences are drawn
SLIVER = 1e-4  # of the longest bar: all that is drawn of a loss, so that its text still shows
BESIDE_LABELS_PX = 10  # from names of FRFs to the title of their axis
WIDE = 30.0  # ratio of evidences from which their axis is logarithmic


def build(run: RunContents) -> Section | None:
    """Give the section on the diagnosis.

    Parameters
    ----------
    run : RunContents
        What the run holds.

    Returns
    -------
    Section or None
        None where no diagnosis was made.
    """
    diagnosis: Diagnosis | None = run.diagnosis
    if diagnosis is None:
        return None
    blocks: list[Block] = []
    if len(diagnosis.mismatch):
        blocks.append(_map(diagnosis))
    if diagnosis.findings or diagnosis.alternatives:
        gains = [one.log_evidence_gain for one in (*diagnosis.findings, *diagnosis.alternatives)]
        blocks += [_ranking(diagnosis)] if max(gains) > 0 else []
        blocks.append(_findings(diagnosis))
    blocks += law_pictures(diagnosis.at_work)
    blocks.append(_proof(diagnosis))
    if diagnosis.curves is not None:
        blocks.append(_curves(diagnosis.curves, run.band_hz, _explained(diagnosis)))
    blocks += _gates(diagnosis) + level_pictures(run.levels, run.labels, run.band_hz) + _detectability(diagnosis)
    lead = plain_signs(diagnosis.statement) or verdict_of(diagnosis)[0]
    notes = (
        *place_of_mismatch(diagnosis),
        *[one.statement for one in diagnosis.ambiguity],
        *map(plain_signs, diagnosis.warnings),
    )
    return Section(anchor="diagnosis", title="Diagnosis", lead=lead, blocks=tuple(blocks), notes=notes)


def _map(diagnosis: Diagnosis) -> Picture:
    table = diagnosis.mismatch
    names = list(dict.fromkeys(table["frf"].astype(str)))
    bands = sorted({(float(low), float(high)) for low, high in zip(table["low_hz"], table["high_hz"], strict=True)})
    titles = _maps(diagnosis)
    traces: list[Trace] = []
    top = float(np.log10(max(float(table[list(titles)].to_numpy(float).max()), 3.0)))
    for rank, column in enumerate(titles):
        values = np.full((len(names), len(bands)), np.nan)
        for row in table.to_dict("records"):
            place = names.index(str(row["frf"])), bands.index((float(row["low_hz"]), float(row["high_hz"])))
            values[place] = row[column]
        traces.append(_heat(values, names, bands, (rank, column, top)))
    shared = {"type": "category", "autorange": "reversed"}
    axes = [
        Axis(title=title, options={**shared, "title": {"text": title, "standoff": BESIDE_LABELS_PX}})
        for title in titles.values()
    ]
    x = {"title": {"text": "Band, Hz", "standoff": 30}, "type": "category", "tickangle": -40}
    return Picture(
        name="mismatch",
        title="Where model and measurement disagree: misfit over what noise and tolerances explain",
        alt=f"Maps of FRFs by bands: the model {' and '.join(titles.values())}. {diagnosis.mismatch_where}",
        traces=tuple(traces),
        layout=panels(x, *axes),
        note=f"1 is as good as the measurement. {diagnosis.mismatch_where}{_of_maps(diagnosis)}",
        height_px=int(np.clip(140 + 22 * len(names) * len(titles) + 50 * len(titles), 190 * len(titles), 900)),
    )


def _maps(diagnosis: Diagnosis) -> dict[str, str]:
    """Columns that are drawn, with their titles: what a law explains, no linear model shows."""
    if diagnosis.linearised is not None:
        return {"before": "as it is"}
    return {"before": "as it is", "after": _explained(diagnosis).replace("the ", "").replace("its ", "")}


def _of_maps(diagnosis: Diagnosis) -> str:
    if diagnosis.linearised is not None:
        return " The model is linear: what the force law explains follows below."
    if diagnosis.findings:
        return ""
    return " The lower map counts noise alone: what is left once the model has moved within its tolerances."


def _heat(
    values: np.ndarray, names: Sequence[str], bands: Sequence[tuple[float, float]], how: tuple[int, str, float]
) -> Trace:
    rank, name, top = how
    columns = [f"{number(low, 3)}–{number(high, 3)}" for low, high in bands]
    texts = [[number(float(value), 2) for value in row] for row in values]
    return {
        "type": "heatmap",
        "x": columns,
        "y": [f"{label} " for label in names],
        "z": np.log10(np.maximum(values, 1e-3)),
        "text": texts,
        "texttemplate": "%{text}" if values.size <= 240 else "",
        "hovertemplate": "%{y}, %{x} Hz: %{text} times noise<extra></extra>",
        "name": name,
        "zmin": 0,
        "zmax": top,
        "colorscale": "Cividis",
        "showscale": False,
        "yaxis": "y" if rank == 0 else "y2",
    }


def _ranking(diagnosis: Diagnosis) -> Picture:
    ranked = [*diagnosis.findings, *diagnosis.alternatives[:MOST_ALTERNATIVES]]
    names = [f"{_plain(one.effect)} {_where(one.location)}".strip() for one in ranked]
    names = [f"{place + 1}. {name}" for place, name in enumerate(names)]
    found = len(diagnosis.findings)
    gains = np.array([one.log_evidence_gain for one in ranked])
    close = len(gains) > 1 and gains.min() > CLOSE * gains.max()
    sizes = gains.max() - gains if close else np.maximum(gains, SLIVER * gains.max())
    wide = close or bool(gains.max() > WIDE * max(float(np.median(gains)), 1.0))
    bars: Trace = {
        "type": "bar",
        "orientation": "h",
        "x": np.maximum(sizes, 1.0) if wide else sizes,
        "customdata": gains,
        "y": names,
        "marker": {"color": ["@updated"] * found + ["@muted/0.7"] * (len(ranked) - found)},
        "text": [f"p {_chance(one)}" if one.log_evidence_gain > 0 else "worse than without" for one in ranked],
        "textposition": "auto",
        "insidetextfont": {"color": "@paper"},
        "hovertemplate": "%{y}: gains %{customdata:.6g} nats, %{text}<extra></extra>",
        "name": "evidence",
    }
    y = Axis(title="", options={"autorange": "reversed", "type": "category"})
    scale = {"type": "log", **POWERS} if wide else {}
    falls_short = "Log evidence that is missing to the best one, nats: the longer, the worse"
    across = falls_short if close else "Gain of log evidence over the model without it, nats"
    return Picture(
        name="ranking",
        title="Explanations by their evidence",
        alt="Bars: "
        + "; ".join(f"{name}: {number(one.log_evidence_gain)} nats" for name, one in zip(names, ranked, strict=True)),
        traces=(bars,),
        layout=panels({"title": {"text": across}, **scale}, y),
        note="Blue: the findings; grey: other explanations. p is the probability among all that were tried; 7 nats "
        "make one a thousand times more probable than the other.",
        height_px=int(np.clip(110 + 30 * len(ranked), 180, 640)),
    )


def _chance(finding: Finding) -> str:
    """Probability for people: what is not needed has none, and nobody reads a number with 190 zeros."""
    if finding.log_evidence_gain <= 0:
        return "–"
    return f"= {number(finding.probability, 3)}" if finding.probability > SURELY_NOT else "< 1e-6"


def _findings(diagnosis: Diagnosis) -> Table:
    rows = []
    for kind, entries in (("found", diagnosis.findings), ("alternative", diagnosis.alternatives[:MOST_ALTERNATIVES])):
        rows += [
            [
                _plain(one.effect),
                kind,
                _where(one.location),
                _parameters(one),
                _chance(one).removeprefix("= "),
                number(one.log_evidence_gain, 6),
                plain_signs(one.statement),
            ]
            for one in entries
        ]
    columns = ("effect", "", "where", "parameters", "probability", "evidence, nats", "in words")
    caption = "Findings and alternatives" if diagnosis.findings else "What was tried and is not needed"
    return Table(caption=caption, columns=columns, rows=rows, file="diagnosis.json")


def _parameters(finding: Finding) -> str:
    return ", ".join(
        f"{name} = {with_error(value.value, value.std)}" if isinstance(value, Estimate) else f"{name} = {value}"
        for name, value in finding.parameters.items()
    )


def _where(location: Mapping[str, object]) -> str:
    texts = []
    for name, value in location.items():
        items = ", ".join(str(item) for item in value) if isinstance(value, tuple | list) else str(value)
        texts.append(f"{name} {items}")
    return "; ".join(texts)


def _plain(effect: str) -> str:
    return effect.replace("_", " ")


def _proof(diagnosis: Diagnosis) -> Picture:
    steps = [
        ("model as it is", diagnosis.before),
        ("within its tolerances", diagnosis.updated),
        *([("with the findings", diagnosis.after)] if diagnosis.findings else []),
    ]
    held = f"{diagnosis.held} not shown to the fit" if diagnosis.held else "held out"
    rows = [
        [
            name,
            percent(one.training),
            percent(one.held_out),
            number(one.training_noise, 3),
            number(one.held_out_noise, 3),
        ]
        for name, one in steps
    ]
    columns = ("model", "error, fitted", f"error, {held}", "over what one expects, fitted", "the same, held out")
    return Picture(
        name="proof",
        title="Error of the FRFs before and after, on what was fitted and on what was held out",
        alt="; ".join(f"{row[0]}: {row[1]} fitted, {row[2]} held out" for row in rows),
        traces=(
            _bars([(name, one.training) for name, one in steps], "fitted", "@c0", ""),
            _bars([(name, one.held_out) for name, one in steps], held, "@c1", "/"),
        ),
        layout=panels({"type": "category"}, Axis(title="Normalised FRF error, %", scale="log")),
        table=Table(caption="Normalised FRF error", columns=columns, rows=rows, file="diagnosis.json"),
        height_px=340,
    )


def _bars(values: Sequence[tuple[str, float]], name: str, colour: str, pattern: str) -> Trace:
    return {
        "type": "bar",
        "x": [text for text, _ in values],
        "y": 100 * np.array([value for _, value in values]),
        "name": name,
        "marker": {"color": colour, "pattern": {"shape": pattern}},
        "hovertemplate": "%{x}: %{y:.3g} %",
    }


def _explained(diagnosis: Diagnosis) -> str:
    """Name the better of the two linear models that are compared: one that holds no force law."""
    return "with the findings" if diagnosis.findings and diagnosis.linearised is None else "within its tolerances"


def _curves(curves: Curves, band_hz: tuple[float, float], explained: str) -> Picture:
    frequency = curves.s.imag / (2 * np.pi)
    traces: list[Trace] = []
    for place, label in enumerate(curves.labels):
        traces += _misfits(curves, place, frequency, (str(label), explained))
    return Picture(
        name="diagnosed",
        title=f"Misfit of the model as it is (dashed) and {explained} (solid), over what one expects",
        alt=f"Misfit of {counted(len(curves.labels), 'FRF')} over frequency, before and after, over the expected one.",
        traces=tuple(traces),
        layout=panels(frequency_axis(*band_hz), Axis(title="Misfit over expected", scale="log")),
        note="1 is all that noise and tolerances let one expect.",
        height_px=420,
        is_over_frequency=True,
    )


def _misfits(curves: Curves, place: int, frequency: np.ndarray, names: tuple[str, str]) -> list[Trace]:
    label, explained = names
    expected = np.maximum(curves.expected[:, place], np.finfo(float).tiny)
    colour, group = colour_of(place), {"meta": {"frf": place}, "legendgroup": label}
    before = np.abs(curves.measured[:, place] - curves.nominal[:, place]) / expected
    after = np.abs(curves.measured[:, place] - curves.explained[:, place]) / expected
    hover = "%{x:.6g} Hz: %{y:.3g} times what one expects"
    return [
        line(frequency, before, f"{label} model as it is", colour, hover=hover, dash="dash", width=1.1, **group),
        line(frequency, after, f"{label} {explained}", colour, hover=hover, **group),
    ]


def _gates(diagnosis: Diagnosis) -> list[Block]:
    gates = [gate for gate in diagnosis.gates if np.isfinite(gate.value)]
    if not gates:
        return []
    names = [gate.name for gate in gates]
    values = np.array([gate.value for gate in gates])
    points = markers(values, names, "measured", "@updated", size=11, hover="%{y}: %{x:.3g}")
    limits = markers(
        [gate.limit for gate in gates], names, "limit", "@bad", symbol="line-ns-open", size=22, hover="limit %{x}"
    )
    rows = [
        [
            gate.name,
            number(gate.value, 3),
            number(gate.limit, 3),
            "passed" if gate.passed else "failed",
            plain_signs(gate.statement),
        ]
        for gate in diagnosis.gates
    ]
    return [
        Picture(
            name="gates",
            title="Checks of the measurement alone: level dependence, reciprocity, coherence",
            alt="; ".join(f"{row[0]}: {row[1]}, limit {row[2]}, {row[3]}" for row in rows),
            traces=(points, limits),
            layout=panels(
                {"title": {"text": "Mean squared difference over its expected square"}, "type": "log", **POWERS},
                Axis(title="", options={"type": "category", "range": [-0.6, len(gates) - 0.4]}),
            ),
            note="A structure whose FRFs change with the level of the blows (homogeneity) is not linear.",
            table=Table(
                caption="Checks", columns=("check", "value", "limit", "", "in words"), rows=rows, file="diagnosis.json"
            ),
            height_px=130 + 50 * len(gates),
        )
    ]


def _detectability(diagnosis: Diagnosis) -> list[Block]:
    rows = [
        [_plain(effect), name, number(float(size), 3)]
        for effect, sizes in diagnosis.detectability.items()
        for name, size in sizes.items()
    ]
    if not rows:
        return []
    caption = "Smallest effects that these data would show, where they show best"
    return [Table(caption=caption, columns=("effect", "parameter", "smallest size"), rows=rows, file="diagnosis.json")]
