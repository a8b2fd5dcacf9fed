"""The first screen: the verdict, the FRF at the point of interest, three numbers, the checks, the structure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.assessment import Verdict
from frf_ipz.assessment.checks.agreement import ALL_FRFS, TOGETHER
from frf_ipz.assessment.deviations import POINTS
from frf_ipz.plotting.wording import listed, number, percent, small_percent
from frf_ipz.report.findings import card_texts, verdict_of
from frf_ipz.report.section import Card, Cards, Headline, Section, Table, run_figures
from frf_ipz.runs.figures import coherence_text, deviation_of
from frf_ipz.runs.picture_data import update_targets
from frf_ipz.visible_text import counted, written_out

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from frf_ipz.assessment.assessment import Assessment, Check
    from frf_ipz.runs.results import Results
    from frf_ipz.updating.targets import Target

VERDICTS = {
    Verdict.USABLE: "Usable",
    Verdict.WITH_CARE: "To be used with care",
    Verdict.NOT_USABLE: "Not usable",
}
BESIDE = frozenset({"causes"})  # only where a diagnosis finds any: an old one may be left over
MOST_MASSES = 3  # named on the card
NO_ERROR = 1e-5  # a smaller error of a frequency interests nobody


def build(run: Results) -> Section:
    """Give the first screen.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    Section
        The section.
    """
    sentence, addition = verdict(run)
    notes: tuple[str, ...] = ()
    if run.stale - BESIDE:
        notes = (f"Made before the last change, and not yet run again: {listed(sorted(run.stale - BESIDE), 10)}.",)
    return Section(
        anchor="overview",
        title="Overview",
        lead="",
        blocks=(
            Headline(sentence=sentence, addition=addition),
            *run_figures(run, "prediction")[:1],
            Cards(tuple(_cards(run))),
            *_checks(run),
            *run_figures(run, "structure"),
        ),
        notes=notes,
    )


def verdict(run: Results) -> tuple[str, str]:
    """Sum up the run.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    pair of str
        The verdict in a sentence, and what there is to add.
    """
    parts = [] if run.assessment is None else [assessment_sentence(run.assessment)]
    if run.diagnosis is not None and "diagnose" not in run.stale:
        sentence, addition = verdict_of(run.diagnosis)
        is_said = not run.diagnosis.is_explained and _is_said(run.assessment, "diagnosis")
        parts += [addition] if is_said else [sentence, addition]
    if run.updated_model is not None and run.pairs is not None:
        parts.append(_of_update(run))
    elif run.fit is not None:
        low, high = run.fit.band_hz
        modes = counted(run.fit.n_modes, "mode")
        frfs = counted(len(run.fit.labels), "FRF")
        parts.append(f"{modes} found between {number(low)} and {number(high)} Hz in {frfs}.")
    elif run.frfs is not None:
        parts.append(f"{counted(run.frfs.n_frfs, 'FRF')} estimated; nothing fitted yet.")
    sentence, *additions = parts or ["This run holds no results yet."]
    return sentence, " ".join(filter(None, additions))


def assessment_sentence(assessment: Assessment) -> str:
    """Say whether the result can be used, and what stands against it first.

    Parameters
    ----------
    assessment : Assessment
        The verdict with its checks.

    Returns
    -------
    str
        A sentence.
    """
    word = VERDICTS[assessment.verdict]
    cause = assessment.likely_cause
    if cause is not None:
        return f"{word}: most likely {cause.says} ({cause.place})."
    costly = assessment.costly
    return written_out(f"{word}: {costly[0].says}.") if costly else f"{word}: all checks are within their limits."


def _is_said(assessment: Assessment | None, name: str) -> bool:
    """Tell whether the sentence of the assessment is that of a check."""
    if assessment is None or assessment.likely_cause is not None:
        return False
    return any(check.name == name for check in assessment.costly[:1])


def _checks(run: Results) -> list[Table]:
    """List the checks of the assessment, the worst first."""
    if run.assessment is None:
        return []
    checks = run.assessment.checks
    rows = [
        (
            check.name,
            check.outcome,
            _figure(check.figure, check.unit),
            _figure(check.limit, check.unit),
            check.where,
            _words(check),
        )
        for check in checks
    ]
    return [
        Table(
            caption="What the verdict rests on",
            columns=("check", "verdict", "figure", "limit", "where", "what to know, what to do"),
            rows=rows,
            marked=frozenset(range(len(run.assessment.costly))),  # the worst stand first
            file="run.json",
        )
    ]


def _words(check: Check) -> str:
    """Say what costs the verdict, or was not looked at, and what to do; figures say enough of the others."""
    if check.verdict is Verdict.USABLE and check.is_answered:
        return ""
    return written_out(f"{check.says}: {check.advice}" if check.advice else check.says)


def _figure(value: float, unit: str) -> str:
    if not np.isfinite(value):
        return ""
    if unit == "1":
        return percent(value, 2) if value <= 1 else number(value, 2)
    return f"{number(value, 2)} {unit}".strip()


def _of_update(run: Results) -> str:
    rows = update_targets(run)
    if not rows:
        return "No measured pole or zero has a counterpart in the model, so the model is left as it was."
    kinds = {kind: sum(row.kind == kind for row in rows) for kind in ("pole", "zero")}
    paired = " and ".join(counted(count, f"measured {kind}") for kind, count in kinds.items() if count)
    text = f"The updated model has {paired} right within {_errors(rows)}"
    prediction = run.prediction
    if prediction is not None and np.isfinite(prediction.half_width_db).any():
        worst = int(np.nanargmax(prediction.half_width_db))
        reach = prediction.band_db_text(worst).replace("+-", "±")
        reach = reach if "±" in reach else f"between {reach.replace(' to ', ' and ')}"
        shape = "the shape of " if worst in prediction.relative else ""
        text += f", and predicts {shape}{prediction.labels[worst]} to {reach}"
        text += f" (90 % band, {prediction.band_text}, median)"
        others = len(prediction.labels) - 1
        text += f" and {counted(others, 'other FRF')} to less" if others else ""
    return text + "."


def _errors(rows: Sequence[Target]) -> str:
    """Say how far targets are off; where the worst one did not come closer, it stands apart from the others."""
    before, after = np.abs([[row.before, row.after] for row in rows]).T
    if after.max() <= before.max():
        return f"{percent(max(after.max(), NO_ERROR), 2)} in frequency (before: {percent(before.max(), 2)})"
    middle = f"{percent(max(np.median(after), NO_ERROR), 2)} in frequency in the median"
    return f"{middle} (before: {percent(np.median(before), 2)}), but the worst {percent(after.max(), 2)}"


def _cards(run: Results) -> list[Card]:
    if run.updated_model is None:
        return _cards_without_model(run)
    return [_deviation_card(run), _target_card(run), _missing_card(run)]


def _cards_without_model(run: Results) -> list[Card]:
    cards = []
    if run.frfs is not None:
        figure, _, band = coherence_text(run).partition(" (")
        cards.append(Card("Coherence", figure or "unknown", band.rstrip(")") or "one record, or not stated"))
    if run.fit is not None:
        cards.insert(0, Card("Modes", str(run.fit.n_modes), "in the band"))
        ratio = run.fit.misfit["ratio"].to_numpy(float) if "ratio" in run.fit.misfit else np.zeros(0)
        if ratio.size:
            figure = f"{number(float(np.nanmax(ratio)), 2)} x noise"
            cards.append(Card("Worst misfit of the fit", figure, "1 is all that the measurement can tell"))
    return cards


def _deviation_card(run: Results) -> Card:
    deviation = deviation_of(run)
    if deviation is None:
        why = "no FRF was measured" if run.frfs is None else "no FRF stands above its noise"
        return Card("Error at the measured points", "unknown", why)
    figures = [deviation.nominal_db, deviation.updated_db, deviation.with_causes_db]
    figure = written_out(" → ".join(f"{value:.2g}" for value in figures if np.isfinite(value)) + " dB")
    names = "before updating, after" + (", with the causes in the model" if np.isfinite(figures[2]) else "")
    meaning = f"{names}; median of {deviation.where}, {deviation.described}"
    if deviation.at == POINTS:
        return Card("Error at the point of interest", figure, meaning)
    meaning += "; unknown gains are fitted" if run.frfs is not None and run.frfs.unknown_scale != "none" else ""
    together = [check for check in run.assessment.checks if check.name == TOGETHER] if run.assessment else []
    if together and together[0].where == ALL_FRFS:
        meaning += written_out(f"; all together: {together[0].limit:.2g} → {together[0].figure:.2g} dB")
    meaning += "; nothing was measured at the points of interest" if run.points else ""
    return Card("Error at the measured points", figure, meaning)


def _target_card(run: Results) -> Card:
    rows = update_targets(run)
    if not rows:
        return Card("Worst target", "none", "no measured pole or zero has a counterpart in the model")
    worst = max(rows, key=lambda row: abs(row.after))
    meaning = f"{worst.name} at {number(worst.measured_hz)} Hz; before: {small_percent(abs(worst.before))}"
    return Card("Worst target after updating", small_percent(abs(worst.after)), meaning)


def _missing_card(run: Results) -> Card:
    if "diagnose" in run.stale:
        return Card("Missing in the model", "not looked for", "since the last change")
    if run.diagnosis is not None:
        figure, meaning = card_texts(run.diagnosis)
        return Card("Missing in the model", figure, meaning)
    counts = [] if run.pairs is None else [run.pairs.count(kind) for kind in ("pole", "zero")]
    lacking = sum(count.missing for count in counts)
    figure = counted(lacking, "pole or zero", "poles and zeros") if lacking else "not looked for"
    meaning = "; ".join(count.text for count in counts if count.measured)
    masses = None if run.updated_model is None else run.updated_model.masses
    if masses is not None and len(masses):
        figure = counted(len(masses), "mass", "masses") + (f", {figure}" if lacking else "")
        meaning = f"the update found {_largest_masses(masses)}; {meaning}".removesuffix("; ")
    return Card("Missing in the model", figure, f"{meaning}; no diagnosis was run".removeprefix("; "))


def _largest_masses(masses: pd.DataFrame) -> str:
    named = [f"{row.mass_kg:+.2g} kg at node {row.node}" for row in masses.head(MOST_MASSES).itertuples()]
    rest = len(masses) - len(named)
    return written_out(", ".join(named) + (f" and {counted(rest, 'other')}" if rest else ""))
