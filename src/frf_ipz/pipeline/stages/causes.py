"""The stage that asks how much better the prediction is with what the diagnosis found."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING

from frf_ipz.pipeline.stage_runner import StageRunner
from frf_ipz.pipeline.stages import measurement, mismatch, modelling
from frf_ipz.prediction.predict import predict_frfs
from frf_ipz.prediction.reference import measured_at
from frf_ipz.runs.memory import RunMemory

if TYPE_CHECKING:
    from frf_ipz.diagnosis.result import Diagnosis
    from frf_ipz.frf import FrfSet
    from frf_ipz.prediction.prediction import Prediction
    from frf_ipz.progress import Progress
    from frf_ipz.structure import StructuralModel


def predict_with_causes(
    runner: StageRunner, model: StructuralModel, frfs: FrfSet, diagnosis: Diagnosis, prediction: Prediction
) -> Prediction | None:
    """Predict the points of interest as ``[diagnose] apply`` would: with what was found put into model and FRFs.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.
    model : StructuralModel
        The FE model that was diagnosed.
    frfs : FrfSet
        The measured FRFs.
    diagnosis : Diagnosis
        What the model left out.
    prediction : Prediction
        FRFs at the points of interest without that.

    Returns
    -------
    Prediction or None
        None where no cause was found, or nothing was measured at the points of interest that could judge it.
    """
    reference = runner.inputs.reference
    if not (diagnosis.findings and diagnosis.is_explained):
        return None
    if not (measured_at(prediction, reference) or measured_at(prediction, frfs)):
        return None

    def compute(progress: Progress) -> Prediction:
        apart = replace(runner, store=RunMemory(), progress=progress, keys=dict(runner.keys))
        corrected, corrected_frfs = mismatch.apply_diagnosis(apart, model, frfs, diagnosis)
        fit = measurement.fit(apart, corrected_frfs, corrected_by=diagnosis)
        reduced = modelling.reduce(apart, corrected, fit, corrected_by=diagnosis)
        pairs = modelling.pair(apart, fit, reduced)
        updated = modelling.update(apart, corrected, reduced, fit, pairs, corrected_by=diagnosis)
        return predict_frfs(fit, updated, points=runner.inputs.points, frequency_hz=prediction.frequency_hz)

    # the inputs of each stage that is gone through again are in the keys of predict and diagnose already
    optional = () if reference is None else ("reference",)
    return runner.stage(
        "causes",
        {"after": runner.after("predict", "diagnose", *optional), "fit": asdict(runner.inputs.options.fit)},
        compute,
    )
