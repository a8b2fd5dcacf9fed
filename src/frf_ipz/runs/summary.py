"""What a run found, on one screen of text."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.pairing.pairs import PairVerdict
from frf_ipz.rational import natural_frequency_hz
from frf_ipz.visible_text import one_line

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

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
        "ingest": (results.estimate, estimate_lines),
        "fit": (results.fit, fit_lines),
        "diagnose": (results.diagnosis, diagnosis_lines),
        "reduce": (results.reduced_model, reduced_lines),
        "pair": (results.pairs, pairs_lines),
        "update": (results.updated_model, update_lines),
        "predict": (results.prediction, prediction_lines),
        "export": (results.state_space_arrays, state_space_lines),
    }
    lines = [results.name]
    if results.assessment is not None:
        lines += [f"{title:<12}{text}" for title, text in assessment_lines(results.assessment)]
    for stage, (result, write) in writers.items():
        if result is not None:
            stale = " (stale: made before the last change; run it again)" if stage in results.stale else ""
            lines += [f"{title:<12}{text}{stale}" for title, text in write(result)]
    notes = results.manifest.get("notes", [])
    lines += [f"{'' if place else 'mended':<12}{note}" for place, note in enumerate(notes)]
    seconds = sum(entry.get("seconds", 0.0) for entry in results.manifest.get("stages", {}).values())
    lines.append(f"{'results':<12}{results.path or 'in memory'}  ({seconds:.1f} s of computing)")
    if results.path is not None and "report" in results.stages and "report" not in results.stale:
        lines.append(f"{'page':<12}{results.path / 'report.html'}")
    return "\n".join(map(one_line, lines))


def assessment_lines(assessment: Assessment) -> list[tuple[str, str]]:
    """Sum up the assessment: the verdict, what most likely has to be corrected, and the checks that cost it.

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
    return lines


def estimate_lines(estimate: FrfEstimate) -> list[tuple[str, str]]:
    """Sum up recordings and FRFs.

    Parameters
    ----------
    estimate : FrfEstimate
        The result of ingest.

    Returns
    -------
    list of pairs of str
        Title and text of each line.
    """
    records, frfs = estimate.records, estimate.frfs
    lines = []
    if len(records):
        left_out = records[~records["used"].astype(bool)]
        text = f"{len(records)} records, {len(records) - len(left_out)} used"
        lines.append(("recordings", text))
        lines += [("", f"left out: {row.record} ({row.marks})") for row in left_out.itertuples()]
    coherence = frfs.coherence[np.isfinite(frfs.coherence)]
    quality = f", median coherence {np.median(coherence):.4f}" if coherence.size else ""
    span = f"{frfs.n_frfs} FRFs, {frfs.frequency_hz[0]:g} to {frfs.frequency_hz[-1]:g} Hz{quality}"
    return [*lines, ("FRFs", span), *_warnings(estimate.warnings)]


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
    return [
        ("fit", f"{fit.n_modes} modes: {values}{rest} Hz"),
        ("", f"{zeros} zeros with a number, {len(fit.zeros.values) - zeros} not identifiable"),
        *_warnings(fit.warnings),
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
    statement = diagnosis.statement
    findings = [("", finding.statement) for finding in diagnosis.findings if finding.statement not in statement]
    ambiguities = [("", ambiguity.statement) for ambiguity in diagnosis.ambiguity]
    return [("diagnosis", statement), *findings, *ambiguities, *_warnings(diagnosis.warnings)]


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
    return [("model", f"reduced to {len(reduced.dofs)} DOFs: {dofs}"), *[("", text) for text in reduced.choices]]


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
    counts = {
        kind: (
            sum(row.kind == kind and row.verdict is PairVerdict.PAIRED for row in pairs.rows),
            sum(row.kind == kind and row.measured >= 0 for row in pairs.rows),
        )
        for kind in ("pole", "zero")
    }
    text = ", ".join(f"{paired} of {measured} measured {kind}s" for kind, (paired, measured) in counts.items())
    return [("pairs", f"{text} have a counterpart in the model"), *_warnings(pairs.warnings)]


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
        *[("", f"cannot be met: {target}") for target in updated.unmet],
        *_warnings(updated.warnings),
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
    lines = []
    for index, label in enumerate(prediction.labels):
        with np.errstate(divide="ignore", invalid="ignore"):  # a band may reach down to nothing, or be unknown
            width = 10 * np.log10(prediction.magnitude_high[:, index] / prediction.magnitude_low[:, index])
        band = f", 90 % band +-{np.nanmedian(width):.2g} dB (median)" if np.isfinite(width).any() else ""
        shape = ", its shape only" if index in prediction.relative else ""
        lines.append(("prediction", f"{label}{shape}{band}"))
    return [*lines, *_warnings(prediction.warnings)]


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
    return [("export" if not place else "", text) for place, text in enumerate(model.notes)]


def _warnings(texts: Sequence[str]) -> list[tuple[str, str]]:
    return [("  note", text) for text in texts]
