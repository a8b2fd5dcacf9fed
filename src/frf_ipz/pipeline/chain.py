"""The chain, top to bottom: recordings, FRFs, fitted model, pairs, updated model, prediction, export, report.

Every stage is a function of what stands before it. Its result is kept in the run's folder under a digest of all that it
depends on, and taken from there where the digest agrees.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.pipeline.stage_runner import StageRunner
from frf_ipz.pipeline.stages import measurement, mismatch, modelling, results

if TYPE_CHECKING:
    from collections.abc import Iterator

    from frf_ipz.pipeline.inputs import PipelineInputs
    from frf_ipz.progress import Progress
    from frf_ipz.runs.folder import RunFolder

STAGES = ("ingest", "fit", "diagnose", "pair", "update", "predict", "export", "report")


def chain(job: PipelineInputs, folder: RunFolder, *, until: str, diagnosing: bool, progress: Progress) -> Iterator[str]:
    """Run the stages one after another.

    Parameters
    ----------
    job : PipelineInputs
        What to work on.
    folder : RunFolder
        Where results are kept.
    until : str
        The last stage that is wanted. A diagnosis is looked at: one that is the last has its page.
    diagnosing : bool
        Look for what the model left out.
    progress : Progress
        Told how far the work is.

    Yields
    ------
    str
        The name of each stage when it is done.
    """
    desk = StageRunner(job=job, folder=folder, progress=progress)
    recordings = measurement.ingest(desk)
    yield "ingest"
    frfs, model = recordings.frfs, job.model
    options = job.pipeline.file.diagnose
    diagnosis = None
    if model is not None and diagnosing and options is not None and options.apply:
        diagnosis = mismatch.diagnose(desk, model, frfs)
        model, frfs = mismatch.apply_diagnosis(desk, model, frfs, diagnosis)
    fit = measurement.fit(desk, frfs, corrected_by=diagnosis)
    yield "fit"
    if model is not None:
        modelling.outline(desk, model, corrected_by=diagnosis)
        if diagnosing:
            if diagnosis is None:
                mismatch.diagnose(desk, model, frfs)
            mismatch.levels(desk, fit, recordings.frfs)
            if until == "diagnose":
                results.report(desk)
            yield "diagnose"
        reduced = modelling.reduce(desk, model, fit, corrected_by=diagnosis)
        pairs = modelling.pair(desk, fit, reduced)
        yield "pair"
        updated = modelling.update(desk, model, reduced, fit, pairs, corrected_by=diagnosis)
        yield "update"
        results.predict(desk, updated, fit, frfs)
        yield "predict"
        results.export(desk, updated, fit, corrected_by=diagnosis)
        yield "export"
    results.report(desk)
    yield "report"
