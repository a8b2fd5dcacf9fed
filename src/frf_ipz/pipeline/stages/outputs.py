"""Stages that give what users take away: predictions, state spaces, the report."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import InputError
from frf_ipz.export import run_tables as tables
from frf_ipz.export.parquet import write_table
from frf_ipz.frf import FrfSet
from frf_ipz.late_imports import import_late
from frf_ipz.pipeline.stage_runner import errors_of_stage
from frf_ipz.pipeline.stages.delays import known_delays
from frf_ipz.pipeline.stages.mismatch import effects_of
from frf_ipz.runs.digests import digest_arrays
from frf_ipz.runs.results import Results

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.assessment.assess import assess as judge_run
    from frf_ipz.assessment.assessment import Assessment
    from frf_ipz.assessment.evidence import Evidence
    from frf_ipz.diagnosis.apply import correct_model
    from frf_ipz.diagnosis.result import Diagnosis
    from frf_ipz.dofs import AnyDof
    from frf_ipz.export.modal_files import write_frfs, write_modes
    from frf_ipz.export.options import ExportOptions
    from frf_ipz.export.state_space import StateSpaceModel, make_state_space, make_state_space_ensemble
    from frf_ipz.export.state_space_files import write_ensemble, write_state_space, write_uncertainty_weights
    from frf_ipz.export.uncertainty import estimate_uncertainty_weights
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.pairing.pairs import Pairs
    from frf_ipz.pipeline.stage_runner import StageRunner
    from frf_ipz.prediction.predict import predict_frfs
    from frf_ipz.prediction.prediction import Prediction
    from frf_ipz.report.page import write_report
    from frf_ipz.runs.folder import Writers
    from frf_ipz.structure import Geometry, StructuralModel
    from frf_ipz.updating import updated_model
    from frf_ipz.updating.updated_model import UpdatedModel
else:
    judge_run = import_late("frf_ipz.assessment.assess", "assess")
    Evidence = import_late("frf_ipz.assessment.evidence", "Evidence")
    correct_model = import_late("frf_ipz.diagnosis.apply", "correct_model")
    write_frfs = import_late("frf_ipz.export.modal_files", "write_frfs")
    write_modes = import_late("frf_ipz.export.modal_files", "write_modes")
    make_state_space = import_late("frf_ipz.export.state_space", "make_state_space")
    make_state_space_ensemble = import_late("frf_ipz.export.state_space", "make_state_space_ensemble")
    write_ensemble = import_late("frf_ipz.export.state_space_files", "write_ensemble")
    write_state_space = import_late("frf_ipz.export.state_space_files", "write_state_space")
    write_uncertainty_weights = import_late("frf_ipz.export.state_space_files", "write_uncertainty_weights")
    estimate_uncertainty_weights = import_late("frf_ipz.export.uncertainty", "estimate_uncertainty_weights")
    predict_frfs = import_late("frf_ipz.prediction.predict", "predict_frfs")
    updated_model = import_late("frf_ipz.updating.updated_model")
    write_report = import_late("frf_ipz.report.page", "write_report")

WEIGHT_LINES = 400  # of the band, at equal ratios, on which the uncertainty of an output is bounded


def predict(runner: StageRunner, updated: UpdatedModel, modal_fit: ModalFit, frfs: FrfSet) -> Prediction:
    """Predict FRFs at the points of interest, on the measured lines of the band.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.
    updated : UpdatedModel
        The updated model.
    modal_fit : ModalFit
        Says which lines were fitted.
    frfs : FrfSet
        The measured FRFs.

    Returns
    -------
    Prediction
        With bands.
    """
    inputs = runner.inputs
    if inputs.reference is not None:
        runner.stage("reference", {"file": inputs.digests[inputs.reference_name]}, lambda _: inputs.reference)
    # without measured FRFs no line was measured but those of the reference
    measured = frfs if frfs.n_frfs or inputs.reference is None else inputs.reference
    lines = measured.frequency_hz[measured.in_band(modal_fit.band_hz)]
    return runner.stage(
        "predict",
        {
            "points": repr(inputs.points),
            "after": runner.after("update", *(("reference",) if measured is inputs.reference else ())),
        },
        lambda _: predict_frfs(modal_fit, updated, points=inputs.points, frequency_hz=lines),
        lambda result: {"poi_frf.parquet": partial(write_table, tables.prediction_table(result))},
    )


def assess(
    runner: StageRunner,
    frfs: FrfSet,
    recordings: FrfEstimate,
    modal_fit: ModalFit,
    fe_model: StructuralModel,
    pairs: Pairs,
    updated: UpdatedModel,
    prediction: Prediction,
    *,
    diagnosis: Diagnosis | None,
    with_causes: Prediction | None = None,
) -> Assessment:
    """Say whether the result can be used, in `run.json` too.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.
    frfs : FrfSet
        The measured FRFs.
    recordings : FrfEstimate
        What the FRFs were estimated from.
    modal_fit : ModalFit
        The fitted model.
    fe_model : StructuralModel
        The FE model.
    pairs : Pairs
        Who belongs to whom.
    updated : UpdatedModel
        The updated model.
    prediction : Prediction
        FRFs at the points of interest.
    diagnosis : Diagnosis, optional
        What the model left out; None where it was not looked for.
    with_causes : Prediction, optional
        FRFs at the points of interest of a model that has what the diagnosis found.

    Returns
    -------
    Assessment
        The verdict with its checks.
    """
    inputs = runner.inputs
    places = inputs.places_of_mistakes
    optional = {"diagnose": diagnosis, "reference": inputs.reference, "causes": with_causes}
    rests_on = ("predict", *(name for name, result in optional.items() if result is not None))
    assessment = runner.stage(
        "assess",
        {"after": runner.after(*rests_on), **places},
        lambda _: judge_run(
            Evidence(
                frfs=frfs,
                fit=modal_fit,
                fe_model=fe_model,
                pairs=pairs,
                updated_model=updated,
                prediction=prediction,
                reference=inputs.reference,
                diagnosis=diagnosis,
                with_causes=with_causes,
                explained_model=_explained_model(runner, fe_model, diagnosis),
                is_corrected=inputs.options.diagnose.apply,
                impacts=inputs.impacts(recordings),
                records=recordings.records,
                **places,
            )
        ),
    )
    runner.store.manifest["assessment"] = assessment.to_json()
    return assessment


def _explained_model(
    runner: StageRunner, fe_model: StructuralModel, diagnosis: Diagnosis | None
) -> StructuralModel | None:
    """FE model with what was found; None where that does not explain the measurement, or is in the model already."""
    if diagnosis is None or not (diagnosis.findings and diagnosis.is_explained):
        return None
    if runner.inputs.options.diagnose.apply:
        return None
    return correct_model(diagnosis, fe_model, effects=effects_of(runner))


def export(
    runner: StageRunner, updated: UpdatedModel, modal_fit: ModalFit, *, corrected_by: Diagnosis | None = None
) -> StateSpaceModel:
    """Turn the updated model into a state space; and, for robust design, into members of its posterior.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.
    updated : UpdatedModel
        The updated model.
    modal_fit : ModalFit
        Names the sensors and actuators.
    corrected_by : Diagnosis, optional
        What the FRFs were corrected by, if they were: a delay belongs to the plant.

    Returns
    -------
    StateSpaceModel
        With named inputs and outputs.
    """
    inputs = runner.inputs
    options = inputs.options.export
    delays = known_delays(modal_fit, corrected_by)
    has_members = options.ensemble and updated.status is not updated_model.UpdateStatus.NOTHING_TO_DO
    return runner.stage(
        "export",
        {"options": asdict(options), "points": repr(inputs.points), "after": runner.after("update"), "delays": delays},
        lambda _: make_state_space(modal_fit, updated, points=inputs.points, options=options, delays_s=delays),
        lambda model: {
            **{name: partial(write_state_space, model) for name in ("statespace.json", "statespace.mat")},
            **(_design_files(updated, modal_fit, inputs.points, options, delays) if has_members else {}),
        },
    )


def files(runner: StageRunner, modal_fit: ModalFit, frfs: FrfSet) -> None:
    """Write what the user has asked for in the files of other modal software.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.
    modal_fit : ModalFit
        The fitted model.
    frfs : FrfSet
        The measured FRFs; without an exponential window in the file.
    """
    asked = runner.inputs.options.export.files
    if "frf.unv" in asked and not frfs.n_frfs:
        raise InputError(f"{runner.inputs.source}: [export] files has 'frf.unv', and the test has no FRF; take it out")
    if not asked:
        runner.store.mark_stale(("files",))
        return
    measured = modal_fit.without_window(frfs)
    geometry = _geometry(runner)
    places = "" if geometry is None else digest_arrays([geometry.nodes, geometry.coordinates_m, geometry.lines])
    key = runner.make_key("files", {"after": runner.after("fit"), "asked": sorted(asked), "places": places})
    write_all: Writers = {
        name: partial(write_frfs, measured) if name == "frf.unv" else partial(write_modes, modal_fit, geometry=geometry)
        for name in asked
    }
    with errors_of_stage("files"):
        runner.store.page("files", key, write_all)


def _geometry(runner: StageRunner) -> Geometry | None:
    """Where the nodes are: of the model, else of the test; None where they are drawn in a row."""
    model = runner.inputs.fe_model
    geometry = runner.inputs.test.geometry if model is None else model.drawn_geometry
    return None if geometry is None or geometry.is_schematic else geometry


def report(runner: StageRunner) -> None:
    """Put everything that the folder holds on one page.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.
    """
    key = runner.make_key(
        "report", {"after": sorted(runner.keys.values()), "test": dict(runner.inputs.test.particulars)}
    )
    progress = runner.stage_progress("report")
    with errors_of_stage("report"):
        runner.store.page(
            "report", key, {"report.html": lambda path: write_report(Results(runner.store), path, progress=progress)}
        )


def _design_files(
    updated: UpdatedModel,
    modal_fit: ModalFit,
    points: Sequence[AnyDof],
    options: ExportOptions,
    delays: dict[str, float],
) -> Writers:
    """Members of the posterior, and the bound of what they do to each output."""
    members = make_state_space_ensemble(modal_fit, updated, points=points, options=options, delays_s=delays)
    weights = estimate_uncertainty_weights(
        modal_fit, updated, points=points, options=options, frequency_hz=np.geomspace(*modal_fit.band_hz, WEIGHT_LINES)
    )
    return {
        "statespace_ensemble.mat": partial(write_ensemble, members),
        "uncertainty.json": partial(write_uncertainty_weights, weights),
    }
