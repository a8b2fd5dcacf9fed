"""What a run found, on one screen of text."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.rational import natural_frequency_hz
from frf_ipz.runs.figures import coherence_text, deviation_of
from frf_ipz.visible_text import counted, one_line, written_out

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from frf_ipz.assessment.assessment import Assessment
    from frf_ipz.diagnosis.result import Diagnosis
    from frf_ipz.export.state_space import StateSpaceModel
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.pairing.pairs import Pairs
    from frf_ipz.prediction.prediction import Prediction
    from frf_ipz.runs.results import Results
    from frf_ipz.structure import ReducedModel
    from frf_ipz.updating.updated_model import UpdatedModel

MOST_MODES = 12
MOST_CHECKS = 3  # on the first screen; the others are on the page
MOST_NOTES = 3  # likewise
MOST_PREDICTIONS = 3  # likewise, those with the widest bands
NOTE = "  note"
SECTIONS = {  # of the page, in which a stage's notes stand
    "fit": "Poles and zeros",
    "diagnose": "Diagnosis",
    "pair": "Pairing",
    "update": "Updating",
    "predict": "Points of interest",
    "export": "State space",
}


def summarise(results: Results) -> str:
    """Sum up what a run has found.

    Parameters
    ----------
    results : Results
        The run.

    Returns
    -------
    str
        At most a screen of text.
    """
    writers: dict[str, tuple[object, Callable[[Any], list[tuple[str, str]]]]] = {
        "ingest": (results.estimate, lambda estimate: estimate_lines(estimate, coherence=coherence_text(results))),
        "fit": (results.fit, fit_lines),
        "reduce": (results.reduced_model, reduced_lines),
        "pair": (results.pairs, pairs_lines),
        "update": (results.updated_model, update_lines),
        "predict": (results.prediction, prediction_lines),
        "export": (results.state_space_arrays, state_space_lines),
    }
    lines = [results.name]
    if results.assessment is not None:
        lines += [f"{title:<12}{text}" for title, text in assessment_lines(results.assessment)]
    lines += [f"{title:<12}{text}" for title, text in deviation_lines(results)]
    notes: dict[str, list[str]] = {}
    if results.diagnosis is not None:
        lines += _lines_of("diagnose", diagnosis_lines(results.diagnosis), notes, results)
    for stage, (result, write) in writers.items():
        if result is not None:
            lines += _lines_of(stage, write(result), notes, results)
    has_page = results.path is not None and "report" in results.stages and "report" not in results.stale
    sections = SECTIONS | {"ingest": _section_of_test(results)}
    lines += [f"{title:<12}{text}" for title, text in note_lines(notes, has_page=has_page, sections=sections)]
    mended = results.manifest.get("notes", [])
    lines += [f"{'' if place else 'mended':<12}{note}" for place, note in enumerate(mended)]
    lines[1:] = map(written_out, lines[1:])
    seconds = sum(entry.get("seconds", 0.0) for entry in results.manifest.get("stages", {}).values())
    lines.append(f"{'results':<12}{results.path or 'in memory'}  ({seconds:.1f} s of computing)")
    if results.path is not None and has_page:
        lines.append(f"{'page':<12}{results.path / 'report.html'}")
    return "\n".join(map(one_line, lines))


def _lines_of(stage: str, texts: list[tuple[str, str]], notes: dict[str, list[str]], results: Results) -> list[str]:
    """Give the lines of a stage, and put its notes aside."""
    stale = " (stale: made before the last change; run it again)" if stage in results.stale else ""
    notes[stage] = [text + stale for title, text in texts if title == NOTE]
    return [f"{title:<12}{text}{stale}" for title, text in texts if title != NOTE]


def _section_of_test(results: Results) -> str:
    if results.estimate is not None and len(results.estimate.records):
        return "Records"
    return "Test" if results.frfs is None else "FRFs"


def note_lines(
    notes: Mapping[str, Sequence[str]], *, has_page: bool, sections: Mapping[str, str]
) -> list[tuple[str, str]]:
    """Choose the notes of the first screen: one of each stage before a second one, and where the others stand.

    Parameters
    ----------
    notes : mapping of str to sequence of str
        Of each stage.
    has_page : bool
        There is a page that has them all.
    sections : mapping of str to str
        Where on it those of each stage stand.

    Returns
    -------
    list of pairs of str
        Title and text of each line.
    """
    ranked = [(place, stage) for stage, texts in notes.items() for place in range(len(texts))]
    ranked.sort(key=lambda entry: entry[0])  # stages stay in their order
    shown, rest = ranked[:MOST_NOTES], [stage for _, stage in ranked[MOST_NOTES:]]
    lines = [(NOTE, notes[stage][place]) for place, stage in shown]
    if rest:
        where = ", ".join(f"{rest.count(stage)} under {sections[stage]}" for stage in dict.fromkeys(rest))
        lines.append(("", f"and {len(rest)} more notes {'on the page' if has_page else 'in the report'}: {where}"))
    return lines


def deviation_lines(results: Results) -> list[tuple[str, str]]:
    """Say how far the models are from what was measured, at a point of interest where something was.

    Parameters
    ----------
    results : Results
        The run.

    Returns
    -------
    list of pairs of str
        Title and text of each line.
    """
    deviation = deviation_of(results)
    if deviation is None:
        return []
    return [("error", f"{deviation.figures} (median of {deviation.where}; {deviation.described})")]


def assessment_lines(assessment: Assessment) -> list[tuple[str, str]]:
    """Sum up the assessment: the verdict, what most likely has to be corrected, and the checks that say what to do.

    Parameters
    ----------
    assessment : Assessment
        Whether the result can be used.

    Returns
    -------
    list of pairs of str
        Title and text of each line.
    """
    costly = assessment.costly
    lines = [("verdict", assessment.verdict.value)]
    cause = assessment.likely_cause
    if cause is not None:
        lines.append(("cause", f"{cause.says} ({cause.place})"))
    for check in costly[:MOST_CHECKS]:
        advice = f": {check.advice}" if check.advice and cause is None else ""
        lines.append(("because" if check is costly[0] else "", check.says + advice))
    if len(costly) > MOST_CHECKS:
        lines.append(("", f"and {len(costly) - MOST_CHECKS} more, on the page and in run.json"))
    free = [check for check in assessment.checks if check not in costly and check.is_answered and check.advice]
    return [*lines, *(("look at", f"{check.says}: {check.advice}") for check in free)]


def estimate_lines(estimate: FrfEstimate, *, coherence: str = "") -> list[tuple[str, str]]:
    """Sum up recordings and FRFs.

    Parameters
    ----------
    estimate : FrfEstimate
        The result of ingest.
    coherence : str
        How coherent the FRFs are, in words.

    Returns
    -------
    list of pairs of str
        Title and text of each line.
    """
    records, frfs = estimate.records, estimate.frfs
    if estimate.modes is not None:
        return [
            ("measured", f"modes at {counted(len(estimate.modes.dofs), 'DOF')}, no FRF"),
            *_notes(estimate.warnings),
        ]
    lines = []
    if len(records):
        used = int(records["used"].astype(bool).sum())
        lines.append(("recordings", f"{counted(len(records), 'record')}, {used} used"))
    span = f"{counted(frfs.n_frfs, 'FRF')}, {frfs.frequency_hz[0]:g} to {frfs.frequency_hz[-1]:g} Hz"
    span += f", coherence {coherence}" if coherence else ""
    return [*lines, ("FRFs", span), *_notes(estimate.warnings)]


def fit_lines(fit: ModalFit) -> list[tuple[str, str]]:
    """Sum up the fit.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.

    Returns
    -------
    list of pairs of str
        Title and text of each line.
    """
    frequencies = natural_frequency_hz(fit.model.poles[: fit.n_modes])
    values = ", ".join(f"{value:.6g}" for value in frequencies[:MOST_MODES])
    rest = f" and {fit.n_modes - MOST_MODES} more" if fit.n_modes > MOST_MODES else ""
    zeros = int(np.count_nonzero(fit.zeros.identifiable))
    if fit.modes_given is not None:
        return [("modes", f"{fit.n_modes} identified elsewhere: {values}{rest} Hz"), *_notes(fit.warnings)]
    return [
        ("fit", f"{counted(fit.n_modes, 'mode')}: {values}{rest} Hz"),
        ("", f"{counted(zeros, 'zero')} with a number, {len(fit.zeros.values) - zeros} not identifiable"),
        *_notes(fit.warnings),
    ]


def diagnosis_lines(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Sum up the diagnosis.

    Parameters
    ----------
    diagnosis : Diagnosis
        What is missing from the model.

    Returns
    -------
    list of pairs of str
        Title and text of each line.
    """
    findings = [finding.statement for finding in diagnosis.findings]
    verdict = diagnosis.statement
    for statement in (*findings, *diagnosis.statements):  # each on a line of its own
        verdict = " ".join(verdict.replace(statement, "").split())
    texts = [*findings, verdict] if diagnosis.is_explained else [verdict, *findings]
    texts += [*diagnosis.statements, *(ambiguity.statement for ambiguity in diagnosis.ambiguity)]
    lines = [("" if place else "diagnosis", text) for place, text in enumerate(filter(None, texts))]
    return [*lines, *_notes(diagnosis.warnings)]


def reduced_lines(reduced: ReducedModel) -> list[tuple[str, str]]:
    """Sum up the reduction.

    Parameters
    ----------
    reduced : ReducedModel
        The reduced model.

    Returns
    -------
    list of pairs of str
        Title and text of each line.
    """
    dofs = " ".join(dof.name for dof in reduced.dofs)
    listed = f"dofs: {', '.join(dof.name for dof in reduced.dofs)}"  # what the first line says
    choices = [text for text in reduced.choices if text != listed]
    return [("model", f"reduced to {counted(len(reduced.dofs), 'DOF')}: {dofs}"), *[("", text) for text in choices]]


def pairs_lines(pairs: Pairs) -> list[tuple[str, str]]:
    """Sum up the pairing.

    Parameters
    ----------
    pairs : Pairs
        Who belongs to whom.

    Returns
    -------
    list of pairs of str
        Title and text of each line.
    """
    poles, zeros = (pairs.count(kind) for kind in ("pole", "zero"))
    texts = [count.text for count in (poles, zeros) if count.measured or count is poles]
    return [*(("" if place else "pairs", text) for place, text in enumerate(texts)), *_notes(pairs.warnings)]


def update_lines(updated: UpdatedModel) -> list[tuple[str, str]]:
    """Sum up the update.

    Parameters
    ----------
    updated : UpdatedModel
        The updated model.

    Returns
    -------
    list of pairs of str
        Title and text of each line.
    """
    text = f"{updated.method}: {updated.status.value}, {len(updated.history)} iterations"
    return [
        ("update", text),
        *[(NOTE, f"cannot be met: {target}") for target in updated.unmet],
        *_notes(updated.warnings),
    ]


def prediction_lines(prediction: Prediction) -> list[tuple[str, str]]:
    """Sum up the prediction.

    Parameters
    ----------
    prediction : Prediction
        FRFs at the points of interest.

    Returns
    -------
    list of pairs of str
        Title and text of each line.
    """
    widths = prediction.half_width_db
    order = np.argsort(-np.nan_to_num(widths, nan=-1.0), kind="stable")
    lines = []
    for index in order[:MOST_PREDICTIONS]:
        shape = ", its shape only" if index in prediction.relative else ""
        band = f", 90 % band {prediction.band_db_text(index)} ({prediction.band_text}, median)"
        lines.append(("prediction", f"{prediction.labels[index]}{shape}{band if np.isfinite(widths[index]) else ''}"))
    if len(order) > MOST_PREDICTIONS:
        lines.append(("", f"and {len(order) - MOST_PREDICTIONS} more, with narrower bands"))
    return [*lines, *_notes(prediction.warnings)]


def state_space_lines(model: StateSpaceModel) -> list[tuple[str, str]]:
    """Sum up the state space, where there is something to say about it.

    Parameters
    ----------
    model : StateSpaceModel
        What was exported.

    Returns
    -------
    list of pairs of str
        Title and text of each line.
    """
    return _notes(model.notes)


def _notes(texts: Sequence[str]) -> list[tuple[str, str]]:
    return [(NOTE, text) for text in texts]
