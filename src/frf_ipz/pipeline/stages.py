"""Each stage of the chain: what it computes, what its result depends on, which files it writes."""

from __future__ import annotations

import json
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray
from frf_ipz.diagnosis.apply import apply_to_frfs, apply_to_model
from frf_ipz.diagnosis.diagnose import diagnose as find_mismatch
from frf_ipz.diagnosis.observed import observe
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.export import run_tables as tables
from frf_ipz.export.design_files import save_ensemble, save_weights
from frf_ipz.export.mode_table import mode_table
from frf_ipz.export.state_space import save_reduced_model, save_state_space, to_ensemble, to_state_space
from frf_ipz.export.tables import write_table
from frf_ipz.export.uncertainty import uncertainty_weights
from frf_ipz.fe.reduction import reduce_model
from frf_ipz.frf import FrfSet
from frf_ipz.identification.fit import fit_modes
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.pairing.assignment import pair as pair_roots
from frf_ipz.pipeline.delays import known_delays
from frf_ipz.pipeline.sensors import unweighed_sensors
from frf_ipz.prediction.predict import predict_frfs
from frf_ipz.rational import without_window
from frf_ipz.report.page import write_report
from frf_ipz.updating.parameters import structural_basis
from frf_ipz.updating.update import update_model

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path

    import pyarrow as pa

    from frf_ipz.diagnosis.diagnosis import Diagnosis
    from frf_ipz.dofs import Dof
    from frf_ipz.export.options import ExportOptions
    from frf_ipz.export.state_space import StateSpaceModel
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.ingest.recordings import Recordings
    from frf_ipz.pairing.pairs import Pairs
    from frf_ipz.pipeline.desk import Desk
    from frf_ipz.prediction.prediction import Prediction
    from frf_ipz.progress import Progress
    from frf_ipz.runs.folder import Writers
    from frf_ipz.structure import ReducedModel, StructuralModel
    from frf_ipz.updating.updated_model import UpdatedModel


WEIGHT_LINES = 400  # of the band, at equal ratios, on which the uncertainty of an output is bounded


def ingest(desk: Desk) -> Recordings:
    """Turn recordings into FRFs.

    Parameters
    ----------
    desk : Desk
        The work.

    Returns
    -------
    Recordings
        FRFs and the table of blows.
    """
    options = desk.job.pipeline.file.ingest
    files = {name: value for name, value in desk.job.inputs.items() if name in map(str, desk.job.test.files)}
    return desk.stage(
        "ingest",
        {"options": asdict(options), "test": repr(desk.job.test), "files": files},
        lambda progress: estimate_frfs(desk.job.test, options, progress=progress),
        lambda result: {
            "frf.parquet": _parquet(tables.frf_table(result.frfs)),
            "blows.parquet": _parquet(tables.frame_table(result.blows, {}, meaning="quality of a blow")),
        },
    )


def diagnose(desk: Desk, model: StructuralModel, frfs: FrfSet) -> Diagnosis:
    """Say what the model left out.

    Parameters
    ----------
    desk : Desk
        The work.
    model : StructuralModel
        The FE model.
    frfs : FrfSet
        The measured FRFs.

    Returns
    -------
    Diagnosis
        The verdict and what it rests on.
    """
    job = desk.job
    options = job.pipeline.file.diagnose or DiagnoseOptions()
    ingest_options = job.pipeline.file.ingest
    band = {"fit": [job.pipeline.file.fit.band_hz, job.pipeline.file.fit.exclude_hz]}

    def compute(progress: Progress) -> Diagnosis:
        seen = observe(job.test, ingest_options, frfs, fit=job.pipeline.file.fit)
        return find_mismatch(model, seen, options, folder=job.pipeline.path.parent, progress=progress)

    return desk.stage(
        "diagnose",
        {"options": asdict(options), "model": job.model_key, "after": desk.after("ingest"), **band},
        compute,
        lambda result: {"diagnosis.json": partial(_write_json, result.to_json())},
    )


def apply_diagnosis(model: StructuralModel, frfs: FrfSet, diagnosis: Diagnosis) -> tuple[StructuralModel, FrfSet]:
    """Put what was found missing into the model, and take what was wrong in the measuring chain off the FRFs.

    Parameters
    ----------
    model : StructuralModel
        The FE model.
    frfs : FrfSet
        The measured FRFs.
    diagnosis : Diagnosis
        What was found.

    Returns
    -------
    model : StructuralModel
        The corrected model.
    frfs : FrfSet
        The corrected FRFs.
    """
    return apply_to_model(model, diagnosis), apply_to_frfs(frfs, diagnosis)


def fit(desk: Desk, frfs: FrfSet, *, corrected_by: Diagnosis | None = None) -> ModalFit:
    """Turn FRFs into poles, residues and zeros.

    Parameters
    ----------
    desk : Desk
        The work.
    frfs : FrfSet
        The measured FRFs.
    corrected_by : Diagnosis, optional
        What they were corrected by, if they were.

    Returns
    -------
    ModalFit
        The fitted model.
    """
    options = desk.job.pipeline.file.fit
    return desk.stage(
        "fit",
        {"options": asdict(options), "after": desk.after("ingest"), "corrected": _corrections(corrected_by)},
        lambda progress: fit_modes(frfs, options, progress=progress),
        lambda result: {
            "frf.parquet": _parquet(tables.frf_table(without_window(frfs, result.model))),
            "poles.parquet": _parquet(tables.pole_table(result)),
            "zeros.parquet": _parquet(tables.zero_table(result)),
            "fit.parquet": _parquet(tables.frame_table(result.misfit, {}, meaning="misfit against noise")),
            "modes.parquet": _parquet(mode_table(result, scale_is_known=frfs.unknown_scale == "none")),
        },
    )


def reduce(
    desk: Desk, model: StructuralModel, modal_fit: ModalFit, *, corrected_by: Diagnosis | None = None
) -> ReducedModel:
    """Turn the FE model into a reduced model in physical DOFs.

    Parameters
    ----------
    desk : Desk
        The work.
    model : StructuralModel
        The FE model.
    modal_fit : ModalFit
        Says which band was fitted.
    corrected_by : Diagnosis, optional
        What the model was corrected by, if it was.

    Returns
    -------
    ReducedModel
        The reduced model.
    """
    job = desk.job
    options = job.pipeline.file.reduce
    desk.stage("model", {"model": job.model_key, "corrected": _corrections(corrected_by)}, lambda _: model.geometry)
    return desk.stage(
        "reduce",
        {
            "options": asdict(options),
            "model": job.model_key,
            "corrected": _corrections(corrected_by),
            "after": desk.after("fit"),
            "points": repr(job.points),
        },
        lambda _: reduce_model(
            model,
            options,
            actuators=_once(label.input_dof for label in modal_fit.labels),
            sensors=_once(label.output_dof for label in modal_fit.labels),
            points=job.points,
            band_hz=modal_fit.band_hz,
        ),
    )


def pair(desk: Desk, modal_fit: ModalFit, reduced: ReducedModel) -> Pairs:
    """Set measured poles and zeros against those of the model.

    Parameters
    ----------
    desk : Desk
        The work.
    modal_fit : ModalFit
        The fitted model.
    reduced : ReducedModel
        The reduced FE model.

    Returns
    -------
    Pairs
        Who belongs to whom, and why.
    """
    return desk.stage(
        "pair",
        {"after": desk.after("fit", "reduce")},
        lambda _: pair_roots(modal_fit, reduced),
        lambda result: {
            "pairs.parquet": _parquet(tables.pair_table(result, modal_fit.labels, _unknown_roots(len(result.targets))))
        },
    )


def update(
    desk: Desk, model: StructuralModel, reduced: ReducedModel, modal_fit: ModalFit, pairs: Pairs
) -> UpdatedModel:
    """Bring the reduced model to the measured poles and zeros.

    Parameters
    ----------
    desk : Desk
        The work.
    model : StructuralModel
        The FE model, whose parts may be softer or stiffer than they should be.
    reduced : ReducedModel
        The reduced FE model.
    modal_fit : ModalFit
        The fitted model with its covariance.
    pairs : Pairs
        The targets.

    Returns
    -------
    UpdatedModel
        The updated model.
    """
    options = desk.job.pipeline.file.update
    sensors = unweighed_sensors(desk.job.test, modal_fit.labels)

    def compute(progress: Progress) -> UpdatedModel:
        basis = structural_basis(model, reduced, mass=options.mass, sensors=sensors)
        return update_model(reduced, modal_fit, pairs, options, basis=basis, progress=progress)

    return desk.stage(
        "update",
        {"options": asdict(options), "sensors": repr(sensors), "after": desk.after("pair")},
        compute,
        lambda result: {
            "pairs.parquet": _parquet(tables.pair_table(pairs, modal_fit.labels, result.after)),
            "parameters.parquet": _parquet(tables.history_table(result)),
            "updated_model.npz": partial(save_reduced_model, result.model),
        },
    )


def predict(desk: Desk, updated: UpdatedModel, modal_fit: ModalFit, frfs: FrfSet) -> Prediction:
    """Predict FRFs at the points of interest, on the measured lines of the band.

    Parameters
    ----------
    desk : Desk
        The work.
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
    job = desk.job
    if job.reference is not None:
        desk.stage("reference", {"file": job.inputs[str(job.pipeline.reference_path)]}, lambda _: job.reference)
    lines = frfs.frequency_hz[frfs.in_band(modal_fit.band_hz)]
    return desk.stage(
        "predict",
        {"points": repr(job.points), "after": desk.after("update")},
        lambda _: predict_frfs(updated, job.points, modal_fit.labels, lines),
        lambda result: {"poi_frf.parquet": _parquet(tables.prediction_table(result))},
    )


def export(
    desk: Desk, updated: UpdatedModel, modal_fit: ModalFit, *, corrected_by: Diagnosis | None = None
) -> StateSpaceModel:
    """Turn the updated model into a state space; and, for robust design, into members of its posterior.

    Parameters
    ----------
    desk : Desk
        The work.
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
    job = desk.job
    options = job.pipeline.file.export
    delays = known_delays(modal_fit, corrected_by)
    return desk.stage(
        "export",
        {"options": asdict(options), "points": repr(job.points), "after": desk.after("update"), "delays": delays},
        lambda _: to_state_space(updated, modal_fit.labels, job.points, options, delays_s=delays),
        lambda model: {
            **{name: partial(save_state_space, model) for name in ("statespace.json", "statespace.mat")},
            **(_design_files(updated, modal_fit, job.points, options, delays) if options.ensemble else {}),
        },
    )


def report(desk: Desk) -> None:
    """Put everything that the folder holds on one page.

    Parameters
    ----------
    desk : Desk
        The work.
    """
    key = desk.sign("report", {"after": sorted(desk.keys.values())})
    tell = desk.listener("report")
    desk.folder.page("report", key, {"report.html": lambda path: write_report(desk.folder, path, progress=tell)})


def _design_files(
    updated: UpdatedModel, modal_fit: ModalFit, points: Sequence[Dof], options: ExportOptions, delays: dict[str, float]
) -> Writers:
    """Members of the posterior, and the bound of what they do to each output."""
    members = to_ensemble(updated, modal_fit.labels, points, options, delays_s=delays)
    weights = uncertainty_weights(updated, modal_fit.labels, points, np.geomspace(*modal_fit.band_hz, WEIGHT_LINES))
    return {
        "statespace_ensemble.mat": partial(save_ensemble, members),
        "uncertainty.json": partial(save_weights, weights),
    }


def _once(dofs: Iterable[Dof]) -> tuple[Dof, ...]:
    return tuple(dict.fromkeys(dofs))


def _corrections(diagnosis: Diagnosis | None) -> str:
    return "" if diagnosis is None else repr(diagnosis.findings)


def _parquet(table: pa.Table) -> Callable[[Path], None]:
    return partial(write_table, table)


def _unknown_roots(count: int) -> ComplexArray:
    """Roots that are not known yet."""
    return np.full(count, complex(np.nan, np.nan))


def _write_json(table: dict[str, object], path: Path) -> None:
    path.write_text(json.dumps(table, indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
