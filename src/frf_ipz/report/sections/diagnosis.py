"""Diagnosis: where model and measurement disagree, what explains it, and the proof on what was not shown to the fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.result import Estimate
from frf_ipz.plotting.curves import Q95, magnitude_title
from frf_ipz.report.findings import mismatch_sentence, typeset, verdict_of
from frf_ipz.report.picture import Axis, Picture, Trace, colour_of, dash_of, frequency_axis, line, markers, panels
from frf_ipz.report.section import Block, Section, Table
from frf_ipz.report.thinning import BINS, bins_for, thin
from frf_ipz.report.wording import counted, number, percent, with_error

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd

    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.measured.levels import LevelDependence
    from frf_ipz.diagnosis.result import Curves, Diagnosis, Finding, LawInTime
    from frf_ipz.frf import FrfLabel
    from frf_ipz.report.contents import RunContents

MOST_ALTERNATIVES = 15
POWERS = {"exponentformat": "power", "dtick": 1}
SURELY_NOT = 1e-6  # a probability below is written as being below
CLOSE = 0.8  # of the best evidence: where all explanations gain more, their differences are drawn
SLIVER = 1e-4  # of the longest bar: all that is drawn of a loss, so that its text still shows
BESIDE_LABELS_PX = 10  # from names of FRFs to the title of their axis
WIDE = 30.0  # ratio of evidences from which their axis is logarithmic
PERIODS = 12.0  # of the strongest line: what is seen before one zooms out
MOST_POINTS = 4000  # of the force
MOST_MODES = 6  # in the picture; the table has them all
SYMBOLS = ("circle", "square", "diamond", "cross", "triangle-up", "x", "star")


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
        gains = [finding.log_evidence_gain for finding in (*diagnosis.findings, *diagnosis.alternatives)]
        blocks += [_ranking(diagnosis)] if max(gains) > 0 else []
        blocks.append(_findings(diagnosis))
    blocks += law_pictures(diagnosis.law_in_time)
    blocks.append(_proof(diagnosis))
    if diagnosis.curves is not None:
        blocks.append(_curves(diagnosis.curves, run.band_hz, _explained(diagnosis)))
    blocks += _data_checks(diagnosis) + level_pictures(run.levels, run.labels, run.band_hz) + _detectability(diagnosis)
    lead = typeset(diagnosis.statement) or verdict_of(diagnosis)[0]
    notes = (
        *mismatch_sentence(diagnosis),
        *[ambiguity.statement for ambiguity in diagnosis.ambiguity],
        *map(typeset, diagnosis.warnings),
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
    if diagnosis.linearised_law is not None:
        return {"before": "as it is"}
    return {"before": "as it is", "after": _explained(diagnosis).replace("the ", "").replace("its ", "")}


def _of_maps(diagnosis: Diagnosis) -> str:
    if diagnosis.linearised_law is not None:
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
    names = [f"{_plain(finding.effect)} {_where(finding.location)}".strip() for finding in ranked]
    names = [f"{place + 1}. {name}" for place, name in enumerate(names)]
    n_findings = len(diagnosis.findings)
    gains = np.array([finding.log_evidence_gain for finding in ranked])
    close = len(gains) > 1 and gains.min() > CLOSE * gains.max()
    sizes = gains.max() - gains if close else np.maximum(gains, SLIVER * gains.max())
    wide = close or bool(gains.max() > WIDE * max(float(np.median(gains)), 1.0))
    bars: Trace = {
        "type": "bar",
        "orientation": "h",
        "x": np.maximum(sizes, 1.0) if wide else sizes,
        "customdata": gains,
        "y": names,
        "marker": {"color": ["@updated"] * n_findings + ["@muted/0.7"] * (len(ranked) - n_findings)},
        "text": [
            f"p {_chance(finding)}" if finding.log_evidence_gain > 0 else "worse than without" for finding in ranked
        ],
        "textposition": "auto",
        "insidetextfont": {"color": "@paper"},
        "hovertemplate": "%{y}: log Bayes factor %{customdata:.6g}, %{text}<extra></extra>",
        "name": "evidence",
    }
    y = Axis(title="", options={"autorange": "reversed", "type": "category"})
    scale = {"type": "log", **POWERS} if wide else {}
    falls_short = "Log evidence below the best explanation: the longer, the worse"
    across = falls_short if close else "Log Bayes factor over the model without it"
    return Picture(
        name="ranking",
        title="Explanations by their evidence",
        alt="Log Bayes factors: "
        + "; ".join(
            f"{name}: {number(finding.log_evidence_gain)}" for name, finding in zip(names, ranked, strict=True)
        ),
        traces=(bars,),
        layout=panels({"title": {"text": across}, **scale}, y),
        note="Blue: the findings; grey: other explanations. p is the probability among all that were tried; a log "
        "Bayes factor of 7 makes one a thousand times more probable than the other.",
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
                _plain(finding.effect),
                kind,
                _where(finding.location),
                _parameters(finding),
                _chance(finding).removeprefix("= "),
                number(finding.log_evidence_gain, 6),
                typeset(finding.statement),
            ]
            for finding in entries
        ]
    columns = ("effect", "", "where", "parameters", "probability", "log Bayes factor", "in words")
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
    held = f"{diagnosis.held_out_kind} not shown to the fit" if diagnosis.held_out_kind else "held out"
    rows = [
        [
            name,
            percent(misfit.training),
            percent(misfit.held_out),
            number(misfit.training_noise, 3),
            number(misfit.held_out_noise, 3),
        ]
        for name, misfit in steps
    ]
    columns = ("model", "error, fitted", f"error, {held}", "over what one expects, fitted", "the same, held out")
    return Picture(
        name="proof",
        title="Error of the FRFs before and after, on what was fitted and on what was held out",
        alt="; ".join(f"{row[0]}: {row[1]} fitted, {row[2]} held out" for row in rows),
        traces=(
            _bars([(name, misfit.training) for name, misfit in steps], "fitted", "@c0", ""),
            _bars([(name, misfit.held_out) for name, misfit in steps], held, "@c1", "/"),
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
    return "with the findings" if diagnosis.findings and diagnosis.linearised_law is None else "within its tolerances"


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


def _data_checks(diagnosis: Diagnosis) -> list[Block]:
    checks = [check for check in diagnosis.data_checks if np.isfinite(check.value)]
    if not checks:
        return []
    names = [check.name for check in checks]
    values = np.array([check.value for check in checks])
    points = markers(values, names, "measured", "@updated", size=11, hover="%{y}: %{x:.3g}")
    limits = markers(
        [check.limit for check in checks], names, "limit", "@bad", symbol="line-ns-open", size=22, hover="limit %{x}"
    )
    rows = [
        [
            check.name,
            number(check.value, 3),
            number(check.limit, 3),
            "passed" if check.passed else "failed",
            typeset(check.statement),
        ]
        for check in diagnosis.data_checks
    ]
    return [
        Picture(
            name="data-checks",
            title="Checks of the measurement alone: level dependence, reciprocity, coherence",
            alt="; ".join(f"{row[0]}: {row[1]}, limit {row[2]}, {row[3]}" for row in rows),
            traces=(points, limits),
            layout=panels(
                {"title": {"text": "Mean squared difference over its expected square"}, "type": "log", **POWERS},
                Axis(title="", options={"type": "category", "range": [-0.6, len(checks) - 0.4]}),
            ),
            note="A structure whose FRFs change with the level of excitation (homogeneity) is not linear.",
            table=Table(
                caption="Checks", columns=("check", "value", "limit", "", "in words"), rows=rows, file="diagnosis.json"
            ),
            height_px=130 + 50 * len(checks),
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


def law_pictures(law: LawInTime | None) -> list[Picture]:
    """Draw a law at work.

    Parameters
    ----------
    law : LawInTime, optional
        From the diagnosis.

    Returns
    -------
    list of Picture
        Empty where no law was found; the force alone where all records start in motion.
    """
    if law is None:
        return []
    return [_law_force(law), *([_law_response(law)] if law.record else [])]


def _law_force(law: LawInTime) -> Picture:
    points = slice(None, None, max(1, len(law.motion_m) // MOST_POINTS))
    hover = "%{x:.4g}: %{y:.4g} N"
    over_motion = line(law.motion_m[points], law.force_N[points], "over motion", "@updated", hover=hover)
    over_velocity = line(law.velocity_m_s[points], law.force_N[points], "over velocity", "@c1", hover=hover)
    motion_axis = {"title": {"text": "Motion, m"}, "domain": [0, 0.46]}
    layout = panels(motion_axis, Axis(title="Force of the law, N"), showlegend=False)
    layout["xaxis2"] = {"title": {"text": "Velocity, m/s"}, "domain": [0.54, 1.0], "anchor": "y"}
    return Picture(
        name="law-force",
        title="Force of the law over motion and velocity at its location",
        alt=f"Curves of a force of up to {number(float(np.abs(law.force_N).max()), 3)} N over a motion of up to "
        f"{number(float(np.abs(law.motion_m).max()), 3)} m, and over its velocity.",
        traces=(over_motion, {**over_velocity, "xaxis": "x2"}),
        layout=layout,
        note="In the record that moves it most, over its motion. A spring shows as a line on the left, a "
        "damper or friction as one on the right.",
        height_px=360,
    )


def _law_response(law: LawInTime) -> Picture:
    curves = (law.measured, law.without, law.simulated)
    samples = thin(law.time_s, curves, BINS[1])
    hover = f"%{{x:.5g}} s: %{{y:.4g}} {law.unit}"
    x = law.time_s[samples]
    traces = (
        line(x, law.measured[samples], "measured", "@measured", hover=hover, width=2.6),
        line(x, law.without[samples], "without the law", "@muted", hover=hover, dash="dash", width=1.2),
        line(x, law.simulated[samples], "with the law", "@updated", hover=hover),
        line(
            x, (law.measured - law.simulated)[samples], "measured minus with the law", "@bad", hover=hover, yaxis="y2"
        ),
    )
    errors = [_law_error(law, model) for model in (law.without, law.simulated)]
    use = "not shown to the fit" if law.is_held_out else "among those that were fitted"
    note = "Simulated in time from the measured force. The misfit has a norm of "
    return Picture(
        name="law-response",
        title=f"{law.channel} in {law.record} ({use}): measured, with the law and without it",
        alt=f"{law.response.capitalize()} over time. The model without the law misses {percent(errors[0], 2)} of it, "
        f"with the law {percent(errors[1], 2)}.",
        traces=traces,
        layout=panels(
            {"title": {"text": "Time, s"}, "range": _law_window(law)},
            Axis(title=f"{law.response.capitalize()}, {law.unit}", share=2.0),
            Axis(title=f"Misfit, {law.unit}"),
        ),
        note=f"{note}{percent(errors[0], 2)} of the measured one without the law, of {percent(errors[1], 2)} with it. "
        "Double-click to see the whole record.",
        height_px=440,
    )


def _law_error(law: LawInTime, model: FloatArray) -> float:
    size = max(float(np.linalg.norm(law.measured)), np.finfo(float).tiny)
    return float(np.linalg.norm(law.measured - model)) / size


def _law_window(law: LawInTime) -> list[float]:
    """Choose a few periods about where the law changes most."""
    step = law.time_s[1] - law.time_s[0]
    lines = np.abs(np.fft.rfft(law.measured))
    strongest = 1 + int(np.argmax(lines[1:]))
    width = PERIODS * len(law.time_s) * step / strongest
    end = float(law.time_s[-1])
    largest = float(law.time_s[np.argmax(np.abs(law.simulated - law.without))])
    start = float(np.clip(largest - width / 2, 0.0, max(end - width, 0.0)))
    return [start, min(start + width, end)]


def level_pictures(
    levels: LevelDependence | None, measured: Sequence[FrfLabel], band_hz: tuple[float, float]
) -> list[Block]:
    """Draw what changes with the level of excitation.

    Parameters
    ----------
    levels : LevelDependence, optional
        Weak beside strong records.
    measured : sequence of FrfLabel
        All FRFs of the run, by whose numbers the page shows and hides them.
    band_hz : pair of float
        What is shown at first.

    Returns
    -------
    list of Picture
        Empty where there is one level only.
    """
    if levels is None or not levels.labels:
        return []
    return [_level_frfs(levels, measured, band_hz), *([_level_modes(levels.modes)] if len(levels.modes) else [])]


def _level_frfs(levels: LevelDependence, measured: Sequence[FrfLabel], band_hz: tuple[float, float]) -> Picture:
    places = {(label.output_dof, label.input_dof, label.quantity): place for place, label in enumerate(measured)}
    traces: list[Trace] = []
    for row, label in enumerate(levels.labels):
        place = places.get((label.output_dof, label.input_dof, label.quantity), row)
        traces += _weak_and_strong(levels, row, place)
    difference = np.linalg.norm(levels.strong - levels.weak) / max(np.linalg.norm(levels.strong), np.finfo(float).tiny)
    low, high = float(levels.weak_N.min()), float(levels.strong_N.max())
    return Picture(
        name="levels",
        title="FRFs at low level (dashed) and at high level of excitation (solid)",
        alt=f"Magnitude of {counted(len(levels.labels), 'FRF')} from the weaker and from the stronger half of the "
        f"records, {number(low, 3)} to {number(high, 3)} N on average; they differ by {percent(float(difference), 2)}.",
        traces=tuple(traces),
        layout=panels(frequency_axis(*band_hz), Axis(title=magnitude_title(levels.labels), scale="log")),
        note=f"Each half is averaged by itself; the two differ by {percent(float(difference), 2)} of their norm. Of a "
        "linear structure the curves fall onto each other, but for noise.",
        height_px=420,
        is_over_frequency=True,
    )


def _weak_and_strong(levels: LevelDependence, row: int, place: int) -> list[Trace]:
    label, colour = levels.labels[row], colour_of(place)
    tiny = np.finfo(float).tiny
    weak, strong = (np.maximum(values[:, row], tiny) for values in (levels.weak, levels.strong))
    lines = thin(levels.frequency_hz, [np.log10(weak), np.log10(strong)], bins_for(len(levels.labels)) // 2)
    x, group = levels.frequency_hz[lines], {"meta": {"frf": place}, "legendgroup": str(label)}
    hover = f"%{{x:.6g}} Hz: %{{y:.4g}} {label.unit}"
    named = (
        f"{label} strong, {number(float(levels.strong_N[row]), 3)} N",
        f"weak, {number(float(levels.weak_N[row]), 3)} N",
    )
    return [
        line(x, strong[lines], named[0], colour, hover=hover, **group),
        line(x, weak[lines], named[1], colour, hover=hover, dash="dash", width=1.2, **group),
    ]


def _level_modes(modes: pd.DataFrame) -> Picture:
    traces: list[Trace] = []
    groups = _clearest_modes(modes)
    for place, rows in enumerate(groups):
        traces += _level_mode(rows, place)
    limits = [float(modes["level_N"].min()), float(modes["level_N"].max())]
    wide = [0.9 * limits[0], 1.1 * limits[1]]
    x = {"title": {"text": "Peak force, N"}, "type": "log", "range": np.log10(wide).tolist()}
    return Picture(
        name="level-modes",
        title="Frequency and damping of each mode against the level of excitation, with 95 % bars",
        alt=f"Change of frequency and damping ratio of {counted(len(groups), 'mode')} over the peak force of "
        f"single records, {number(limits[0], 3)} to {number(limits[1], 3)} N.",
        traces=tuple(traces),
        layout=panels(x, Axis(title="Change of frequency, %"), Axis(title="Damping ratio, %", scale="log")),
        note="From the FRF of each single record, in the sensor that shows the mode best; the change is that from the "
        "strongest record. A line that leaves the level by more than its bars is a mode that is not linear. "
        "A mode that a single record shows on a few lines only, or not by itself, is left out.",
        table=_level_table(modes),
        height_px=460,
    )


def _clearest_modes(modes: pd.DataFrame) -> list[pd.DataFrame]:
    """Of each mode the FRF with the most records, and of many modes those that are known best, by frequency."""
    best = []
    for _, of_mode in modes.groupby("mode"):
        groups = [rows.sort_values("level_N") for _, rows in of_mode.groupby("frf")]
        best.append(max(groups, key=lambda rows: (len(rows), -_relative_std(rows))))
    best = [rows for rows in best if len(rows) > 1]
    best = sorted(best, key=lambda rows: (-len(rows), _relative_std(rows)))[:MOST_MODES]
    return sorted(best, key=lambda rows: float(rows["frequency_hz"].iloc[-1]))


def _relative_std(rows: pd.DataFrame) -> float:
    return float((rows["frequency_std_hz"] / rows["frequency_hz"]).max())


def _level_mode(rows: pd.DataFrame, place: int) -> list[Trace]:
    level, hertz = rows["level_N"].to_numpy(float), rows["frequency_hz"].to_numpy(float)
    deviation = Q95 * rows["frequency_std_hz"].to_numpy(float)
    name = f"mode {int(rows['mode'].iloc[0]) + 1}, {number(float(hertz[-1]), 4)} Hz, {rows['frf'].iloc[0]}"
    style: Trace = {
        "mode": "lines+markers",
        "marker": {"symbol": SYMBOLS[place % len(SYMBOLS)], "size": 8, "color": colour_of(place)},
        "legendgroup": name,
        "dash": dash_of(place),
        "width": 1.1,
    }
    change, damping = 100 * (hertz / hertz[-1] - 1), 100 * rows["damping_ratio"].to_numpy(float)
    bars = 100 * deviation / hertz, 100 * Q95 * rows["damping_ratio_std"].to_numpy(float)
    texts = [f"{record}: {value:.6g} Hz" for record, value in zip(rows["record"], hertz, strict=True)]
    hover = "%{text}, %{x:.4g} N: "
    options: Trace = {**style, "text": texts}
    return [
        line(
            level, change, name, colour_of(place), hover=hover + "%{y:.3g} %", error_y=_error_bars(bars[0]), **options
        ),
        line(
            level,
            damping,
            name,
            colour_of(place),
            hover=hover + "damping %{y:.4g} %",
            error_y=_error_bars(bars[1]),
            yaxis="y2",
            showlegend=False,
            **options,
        ),
    ]


def _error_bars(size: np.ndarray) -> Trace:
    return {"type": "data", "array": size, "thickness": 1.2, "width": 3}


def _level_table(modes: pd.DataFrame) -> Table:
    rows = [
        [
            str(int(row["mode"]) + 1),
            row["frf"],
            row["record"],
            number(row["level_N"]),
            with_error(row["frequency_hz"], row["frequency_std_hz"]),
            with_error(100 * row["damping_ratio"], 100 * row["damping_ratio_std"]),
        ]
        for row in modes.sort_values(["mode", "frf", "level_N"]).to_dict("records")
    ]
    columns = ("mode", "FRF (output / input)", "record", "peak force, N", "frequency, Hz", "damping ratio, %")
    return Table(caption="Modes of single records", columns=columns, rows=rows)
