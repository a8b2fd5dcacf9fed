"""Diagnosis: where model and measurement disagree, what explains it, and the proof on what was not shown to the fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.plotting.picture import Axis, Bars, HeatMap, Layer, Line, Panel, Picture, Points, Role, frequency_axis
from frf_ipz.plotting.wording import number, percent
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from frf_ipz.diagnosis.result import Curves, Diagnosis, Finding, Misfit

MOST_ALTERNATIVES = 15
CLOSE = 0.8  # of the best evidence: where all explanations gain more, their differences are drawn
SLIVER = 1e-4  # of the longest bar: all that is drawn of a loss, so that its text still shows
WIDE_EVIDENCES = 30.0  # ratio of evidences from which their axis is logarithmic
LEAST_HIGHEST = 3.0  # of the shades of the map: below, noise alone would look like a mismatch


def describe_mismatch(diagnosis: Diagnosis) -> Picture | None:
    """Describe the misfit over what noise and tolerances explain, by FRF and band, before and after.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.

    Returns
    -------
    Picture or None
        Maps, of which 1 is as good as the measurement; None where nothing was compared.
    """
    table = diagnosis.mismatch
    if not len(table):
        return None
    names = list(dict.fromkeys(table["frf"].astype(str)))
    bands = sorted({(float(low), float(high)) for low, high in zip(table["low_hz"], table["high_hz"], strict=True)})
    titles = _compared_models(diagnosis)
    highest = max(float(table[list(titles)].to_numpy(float).max()), LEAST_HIGHEST)
    cells = [
        (names.index(str(row["frf"])), bands.index((float(row["low_hz"]), float(row["high_hz"]))), row)
        for row in table.to_dict("records")
    ]
    panels = []
    for column, title in titles.items():
        values = np.full((len(names), len(bands)), np.nan)
        for row, band, cell in cells:
            values[row, band] = cell[column]
        panels.append(
            Panel(
                y=Axis(title=title, scale="category", is_reversed=True),
                layers=(
                    HeatMap(
                        name=column,
                        colour=Role.INK,
                        in_legend=False,
                        columns=[f"{number(low, 3)}–{number(high, 3)}" for low, high in bands],
                        rows=names,
                        values=values,
                        texts=[[number(float(value), 2) for value in row] for row in values],
                        highest=highest,
                        scale_title="misfit over noise",
                        hover="{y}, {x} Hz: {text} times noise",
                    ),
                ),
            )
        )
    return Picture(
        name="mismatch",
        title="Where model and measurement disagree: misfit over what noise and tolerances explain",
        alt=f"Maps of FRFs by bands: the model {' and '.join(titles.values())}. {diagnosis.mismatch_where}",
        panels=tuple(panels),
        x=Axis(title="Band, Hz", scale="category", tick_angle=-40),
        note=f"1 is as good as the measurement. {diagnosis.mismatch_where}{_note_on_models(diagnosis)}",
        height_px=int(np.clip(140 + 22 * len(names) * len(panels) + 50 * len(panels), 190 * len(panels), 900)),
    )


def _compared_models(diagnosis: Diagnosis) -> dict[str, str]:
    """Columns that are drawn, with their titles: what a law explains, no linear model shows."""
    if diagnosis.linearised_law is not None:
        return {"before": "as it is"}
    return {"before": "as it is", "after": _better_model(diagnosis).replace("the ", "").replace("its ", "")}


def _note_on_models(diagnosis: Diagnosis) -> str:
    if diagnosis.linearised_law is not None:
        return " The model is linear: what the force law explains follows below."
    if diagnosis.findings:
        return ""
    return " The lower map counts noise alone: what is left once the model has moved within its tolerances."


def _better_model(diagnosis: Diagnosis) -> str:
    """Name the better of the two linear models that are compared: one that holds no force law."""
    return "with the findings" if diagnosis.findings and diagnosis.linearised_law is None else "within its tolerances"


def describe_ranking(diagnosis: Diagnosis) -> Picture | None:
    """Describe findings and alternatives by their evidence.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.

    Returns
    -------
    Picture or None
        Bars, of which the findings stand out; None where nothing gains any evidence.
    """
    ranked = [*diagnosis.findings, *diagnosis.alternatives[:MOST_ALTERNATIVES]]
    gains = np.array([finding.log_evidence_gain for finding in ranked])
    if not len(ranked) or gains.max() <= 0:
        return None
    names = [
        f"{rank}. {effect_name(finding.effect)} {finding.location.text}".strip()
        for rank, finding in enumerate(ranked, start=1)
    ]
    is_close = len(gains) > 1 and gains.min() > CLOSE * gains.max()
    sizes = gains.max() - gains if is_close else np.maximum(gains, SLIVER * gains.max())
    is_wide = is_close or bool(gains.max() > WIDE_EVIDENCES * max(float(np.median(gains)), 1.0))
    n_findings = len(diagnosis.findings)
    bars = Bars(
        name="evidence",
        colour=Role.UPDATED,
        in_legend=False,
        labels=names,
        sizes=np.maximum(sizes, 1.0) if is_wide else sizes,
        colours=[Role.UPDATED] * n_findings + [Role.MUTED] * (len(ranked) - n_findings),
        is_horizontal=True,
        texts=[
            f"p {probability_text(finding)}" if finding.log_evidence_gain > 0 else "worse than without"
            for finding in ranked
        ],
        values=gains,
        hover="{y}: log Bayes factor {value:.0f}, {text}",
    )
    falls_short = "Log evidence below the best explanation: the longer, the worse"
    return Picture(
        name="ranking",
        title="Explanations by their evidence",
        alt="Log Bayes factors: "
        + "; ".join(f"{name}: {evidence_text(finding)}" for name, finding in zip(names, ranked, strict=True)),
        panels=(Panel(y=Axis(scale="category", is_reversed=True), layers=(bars,)),),
        x=Axis(
            title=falls_short if is_close else "Log Bayes factor over the model without it",
            scale="log" if is_wide else "linear",
            tick_step=1.0 if is_wide else None,
        ),
        note="Blue: the findings; grey: other explanations. p is the probability among all that were tried; a log "
        "Bayes factor of 7 makes one a thousand times more probable than the other.",
        height_px=int(np.clip(110 + 30 * len(ranked), 180, 640)),
    )


def effect_name(effect: str) -> str:
    """Name an effect for people.

    Parameters
    ----------
    effect : str
        As in the catalogue.

    Returns
    -------
    str
        For example ``added mass``.
    """
    return effect.replace("_", " ")


def probability_text(finding: Finding) -> str:
    """Write a probability as the statements do; what is not needed has none.

    Parameters
    ----------
    finding : Finding
        Found or tried.

    Returns
    -------
    str
        As in ``= 0.98`` or ``above 0.999``; a dash where there is none.
    """
    if finding.log_evidence_gain <= 0:
        return "–"
    words = finding.confidence.removeprefix("probability ")
    return f"= {words}" if words[0].isdigit() else words


def evidence_text(finding: Finding) -> str:
    """Write a log Bayes factor in the digits that the Laplace approximation gives it: no decimals.

    Parameters
    ----------
    finding : Finding
        Found or tried.

    Returns
    -------
    str
        As in ``2310``.
    """
    return f"{finding.log_evidence_gain:.0f}"


def compared_misfits(diagnosis: Diagnosis) -> dict[str, Misfit]:
    """Give the misfits that the proof compares.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.

    Returns
    -------
    dict of str to Misfit
        By the model that has it.
    """
    misfits = {"model as it is": diagnosis.before, "within its tolerances": diagnosis.updated}
    return {**misfits, "with the findings": diagnosis.after} if diagnosis.findings else misfits


def held_out_name(diagnosis: Diagnosis) -> str:
    """Name what was held out.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.

    Returns
    -------
    str
        For example ``records not shown to the fit``.
    """
    return f"{diagnosis.held_out_kind} not shown to the fit" if diagnosis.held_out_kind else "held out"


def describe_proof(diagnosis: Diagnosis) -> Picture:
    """Describe the error of the FRFs before and after, on what was fitted and on what was held out.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.

    Returns
    -------
    Picture
        Bars.
    """
    misfits = compared_misfits(diagnosis)
    errors = {
        "fitted": [misfit.training for misfit in misfits.values()],
        held_out_name(diagnosis): [misfit.held_out for misfit in misfits.values()],
    }
    bars = tuple(
        Bars(
            name=name,
            colour=rank,
            labels=list(misfits),
            sizes=100 * np.array(values, float),
            is_hatched=rank > 0,
            hover="{x}: {y:.3g} %",
        )
        for rank, (name, values) in enumerate(errors.items())
    )
    return Picture(
        name="proof",
        title="Error of the FRFs before and after, on what was fitted and on what was held out",
        alt="; ".join(
            f"{name}: {percent(misfit.training)} fitted, {percent(misfit.held_out)} held out"
            for name, misfit in misfits.items()
        ),
        panels=(Panel(y=Axis(title="Normalised FRF error, %", scale="log"), layers=bars),),
        x=Axis(scale="category"),
        height_px=340,
    )


def describe_expected_misfit(diagnosis: Diagnosis, *, band_hz: tuple[float, float] | None = None) -> Picture | None:
    """Describe the misfit of the model over frequency, before and after, over what one expects.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    band_hz : pair of float, optional
        What is seen at first; all lines where it is left out.

    Returns
    -------
    Picture or None
        None where the diagnosis kept no curves.
    """
    curves = diagnosis.curves
    if curves is None:
        return None
    frequency, better = curves.s.imag / (2 * np.pi), _better_model(diagnosis)
    layers: list[Layer] = []
    for index in range(len(curves.labels)):
        layers += _misfit_curves(curves, index, frequency, better)
    ends = (float(frequency.min()), float(frequency.max()))
    return Picture(
        name="diagnosed",
        title=f"Misfit of the model as it is (dashed) and {better} (solid), over what one expects",
        alt=f"Misfit of {counted(len(curves.labels), 'FRF')} over frequency, before and after, over the expected one.",
        panels=(Panel(y=Axis(title="Misfit over expected", scale="log"), layers=tuple(layers)),),
        x=frequency_axis(*(ends if band_hz is None else band_hz)),
        note="1 is all that noise and tolerances let one expect.",
        height_px=420,
    )


def _misfit_curves(curves: Curves, index: int, frequency: FloatArray, better: str) -> list[Layer]:
    label = str(curves.labels[index])
    expected = np.maximum(curves.expected[:, index], np.finfo(float).tiny)
    return [
        Line(
            name=f"{label} {name}",
            colour=index,
            frf=index,
            group=label,
            x=frequency,
            y=np.abs(curves.measured[:, index] - values[:, index]) / expected,
            dash=dash,
            width=width,
            hover="{x:.6g} Hz: {y:.3g} times what one expects",
        )
        for name, values, dash, width in (
            ("model as it is", curves.nominal, "dash", 1.1),
            (better, curves.explained, "solid", 1.6),
        )
    ]


def describe_data_checks(diagnosis: Diagnosis) -> Picture | None:
    """Describe the checks of the measurement alone, each with its limit.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.

    Returns
    -------
    Picture or None
        None where no check could be made.
    """
    checks = [check for check in diagnosis.data_checks if np.isfinite(check.value)]
    if not checks:
        return None
    names = [check.name for check in checks]
    values, limits = (np.array([getattr(check, kind) for check in checks]) for kind in ("value", "limit"))
    layers = (
        Points(name="measured", colour=Role.UPDATED, x=values, y=names, size=11, hover="{y}: {x:.3g}"),
        Points(name="limit", colour=Role.BAD, x=limits, y=names, symbol="tick", size=22, hover="limit {x:.3g}"),
    )
    return Picture(
        name="data-checks",
        title="Checks of the measurement alone: level dependence, reciprocity, coherence",
        alt="; ".join(
            f"{check.name}: {number(check.value, 3)}, limit {number(check.limit, 3)}, "
            f"{'passed' if check.passed else 'failed'}"
            for check in diagnosis.data_checks
        ),
        panels=(Panel(y=Axis(scale="category", limits=(-0.6, len(checks) - 0.4)), layers=layers),),
        x=Axis(title="Mean squared difference over its expected square", scale="log", tick_step=1.0),
        note="A structure whose FRFs change with the level of excitation (homogeneity) is not linear.",
        height_px=130 + 50 * len(checks),
    )
