"""The chain, top to bottom: recordings, FRFs, fitted model, pairs, updated model, prediction, export, report.

Every stage is a function of what stands before it. Its result is kept in the run's folder under a digest of all that it
depends on, and taken from there where the digest agrees.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.diagnosis.options import WITHOUT_FRFS
from frf_ipz.errors import InputError
from frf_ipz.late_imports import import_late
from frf_ipz.pipeline.stage_runner import StageRunner
from frf_ipz.pipeline.stages import measurement, mismatch

if TYPE_CHECKING:
    from collections.abc import Iterator

    from frf_ipz.ingest.recording_files import RecordingFiles
    from frf_ipz.pipeline.inputs import PipelineInputs
    from frf_ipz.pipeline.stage_runner import RunStore
    from frf_ipz.pipeline.stages import causes, hints, modelling, outputs
    from frf_ipz.progress import Progress
else:
    RecordingFiles = import_late("frf_ipz.ingest.recording_files", "RecordingFiles")
    causes = import_late("frf_ipz.pipeline.stages.causes")
    hints = import_late("frf_ipz.pipeline.stages.hints")
    modelling = import_late("frf_ipz.pipeline.stages.modelling")
    outputs = import_late("frf_ipz.pipeline.stages.outputs")

STAGES = ("ingest", "fit", "diagnose", "pair", "update", "predict", "export", "report")


def chain(
    inputs: PipelineInputs, store: RunStore, *, until: str, diagnosing: bool | None, progress: Progress
) -> Iterator[str]:
    """Run the stages one after another.

    Parameters
    ----------
    inputs : PipelineInputs
        What to work on.
    store : RunStore
        Where results are kept.
    until : str
        The last stage that is wanted. A diagnosis is looked at: one that is the last has its page.
    diagnosing : bool, optional
        Look for what the model left out, in any time; by default as ``[diagnose]`` says. Where it is not looked for,
        what the folder holds of these very inputs still counts.
    progress : Progress
        Called with the fraction done and what is being done.

    Yields
    ------
    str
        The name of each stage when it is done.
    """
    runner = StageRunner(inputs=inputs, recordings=RecordingFiles(test=inputs.test), store=store, progress=progress)
    recordings = measurement.ingest(runner)
    yield "ingest"
    frfs, model = recordings.frfs, inputs.fe_model
    options = inputs.options.diagnose
    diagnosis = found = None
    is_asked = diagnosing is True
    if recordings.modes is not None and (is_asked or options.apply):
        raise InputError(f"{inputs.source}: {WITHOUT_FRFS}")
    is_diagnosing = options.run != "never" if diagnosing is None else diagnosing
    is_diagnosing &= recordings.modes is None
    is_known = model is not None and mismatch.is_known(runner)
    if not is_diagnosing and not is_known:
        store.mark_stale(mismatch.STAGES)
    if model is not None and is_diagnosing and options.apply:
        diagnosis = mismatch.diagnose(runner, model, frfs, is_asked=is_asked)
        model, frfs = mismatch.apply_diagnosis(runner, model, frfs, diagnosis)
    with hints.naming_exchanged_columns(inputs, recordings):
        fit = measurement.fit(runner, frfs, modes=recordings.modes, corrected_by=diagnosis)
    if inputs.test.has_frf_levels:
        mismatch.levels(runner, fit, recordings.frfs)
    outputs.files(runner, fit, frfs)
    yield "fit"
    if model is not None:
        modelling.outline(runner, model, corrected_by=diagnosis)
        if is_diagnosing or is_known:
            if diagnosis is None:
                found = mismatch.diagnose(runner, model, frfs, is_asked=is_asked)
            if not inputs.test.has_frf_levels:
                mismatch.levels(runner, fit, recordings.frfs)
            if until == "diagnose":
                outputs.report(runner)
            yield "diagnose"
        with hints.naming_the_cause(inputs, recordings, fit, model):
            reduced = modelling.reduce(runner, model, fit, corrected_by=diagnosis)
            pairs = modelling.pair(runner, fit, reduced)
            yield "pair"
            updated = modelling.update(runner, model, reduced, fit, pairs, corrected_by=diagnosis)
            pairs = updated.pairs or pairs
            yield "update"
            prediction = outputs.predict(runner, updated, fit, frfs)
            with_causes = None if found is None else causes.predict_with_causes(runner, model, frfs, found, prediction)
            outputs.assess(
                runner,
                frfs,
                recordings,
                fit,
                model,
                pairs,
                updated,
                prediction,
                diagnosis=found if diagnosis is None else diagnosis,
                with_causes=with_causes,
            )
        yield "predict"
        outputs.export(runner, updated, fit, corrected_by=diagnosis)
        yield "export"
    outputs.report(runner)
    yield "report"
