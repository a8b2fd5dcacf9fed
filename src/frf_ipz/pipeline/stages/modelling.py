"""Stages that reduce the model, pair it with what was measured, and update it."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING

from frf_ipz.diagnosis.parameters import make_diagnosed_basis
from frf_ipz.diagnosis.position_uncertainty import propagate_position_tolerance
from frf_ipz.errors import InputError
from frf_ipz.export import run_tables as tables
from frf_ipz.export.parquet import write_table
from frf_ipz.export.reduced_model_file import write_reduced_model
from frf_ipz.fe.reduction.reduce import reduce_to_dofs
from frf_ipz.pairing.pair import pair_roots
from frf_ipz.pipeline.sensors import unweighed_sensors
from frf_ipz.pipeline.stages.mismatch import corrections, effects_of
from frf_ipz.runs.digests import digest
from frf_ipz.runs.software import software
from frf_ipz.updating.parameters import make_structural_basis
from frf_ipz.updating.update import update_model

if TYPE_CHECKING:
    from collections.abc import Iterable

    from frf_ipz.diagnosis.result import Diagnosis
    from frf_ipz.dofs import AnyDof
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.pairing.pairs import Pairs
    from frf_ipz.pipeline.stage_runner import StageRunner
    from frf_ipz.progress import Progress
    from frf_ipz.structure import ReducedModel, StructuralModel
    from frf_ipz.updating.updated_model import UpdatedModel


def outline(runner: StageRunner, model: StructuralModel, *, corrected_by: Diagnosis | None = None) -> None:
    """Keep where the nodes are, and what joins them: pictures of the structure need no more of a model.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.
    model : StructuralModel
        The FE model.
    corrected_by : Diagnosis, optional
        What the model was corrected by, if it was.
    """
    key = {"model": runner.inputs.model_key, "corrected": corrections(corrected_by)}
    runner.stage("model", key, lambda _: model.drawn_geometry)


def reduce(
    runner: StageRunner, model: StructuralModel, modal_fit: ModalFit, *, corrected_by: Diagnosis | None = None
) -> ReducedModel:
    """Turn the FE model into a reduced model in physical DOFs.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.
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
    inputs, shared = runner.inputs, runner.inputs.shared
    options = inputs.options.reduce
    actuators = _once(label.input_dof for label in modal_fit.connections)
    sensors = _once(label.output_dof for label in modal_fit.connections)
    rests_on = {
        "options": asdict(options),
        "model": inputs.model_key,
        "corrected": corrections(corrected_by),
        "points": repr(inputs.points),
    }

    def compute() -> ReducedModel:
        return reduce_to_dofs(
            model,
            options=options,
            actuators=actuators,
            sensors=sensors,
            points=inputs.points,
            band_hz=modal_fit.band_hz,
        )

    def take_or_compute(_: Progress) -> ReducedModel:
        if shared is None:
            return compute()
        measured = {"actuators": repr(actuators), "sensors": repr(sensors), "band_hz": modal_fit.band_hz}
        return shared.reduce(digest({**rests_on, **measured, "software": software()}), compute)

    return runner.stage("reduce", {**rests_on, "after": runner.after("fit")}, take_or_compute)


def pair(runner: StageRunner, modal_fit: ModalFit, reduced: ReducedModel) -> Pairs:
    """Set measured poles and zeros against those of the model.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.
    modal_fit : ModalFit
        The fitted model.
    reduced : ReducedModel
        The reduced FE model.

    Returns
    -------
    Pairs
        Who belongs to whom, and why.
    """
    return runner.stage(
        "pair",
        {"after": runner.after("fit", "reduce")},
        lambda _: pair_roots(modal_fit, reduced),
        lambda result: {"pairs.parquet": partial(write_table, tables.pair_table(result))},
    )


def update(
    runner: StageRunner,
    model: StructuralModel,
    reduced: ReducedModel,
    modal_fit: ModalFit,
    pairs: Pairs,
    *,
    corrected_by: Diagnosis | None = None,
) -> UpdatedModel:
    """Bring the reduced model to the measured poles and zeros.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.
    model : StructuralModel
        The FE model, whose parts may be softer or stiffer than they should be.
    reduced : ReducedModel
        The reduced FE model.
    modal_fit : ModalFit
        The fitted model with its covariance.
    pairs : Pairs
        The targets.
    corrected_by : Diagnosis, optional
        What the model was corrected by, if it was: `[update] parameters = "diagnosis"` changes these values only.

    Returns
    -------
    UpdatedModel
        The updated model.

    Raises
    ------
    InputError
        If the parameters are to be those of a diagnosis that is not applied.
    """
    options = runner.inputs.options.update
    tolerance = runner.inputs.options.diagnose.position_tolerance_m_per_m
    sensors = unweighed_sensors(runner.inputs.test, modal_fit.labels)
    nominal = runner.inputs.fe_model
    measured = _once(dof for label in modal_fit.labels for dof in (label.output_dof, label.input_dof))
    if options.parameters == "diagnosis" and corrected_by is None:
        raise InputError(
            f"{runner.inputs.source}: [update] parameters = 'diagnosis' needs what a diagnosis has found; set "
            "[diagnose] apply = true, or leave parameters out"
        )

    def compute(progress: Progress) -> UpdatedModel:
        if options.parameters == "diagnosis" and corrected_by and nominal is not None and model is not nominal:
            basis = make_diagnosed_basis(corrected_by, nominal, reduced, effects=effects_of(runner))
        else:
            basis = make_structural_basis(model, reduced, mass=options.mass, sensors=sensors)
        return update_model(
            modal_fit,
            reduced,
            pairs=pairs,
            fe_model=model,
            options=options,
            basis=basis,
            position_uncertainty=propagate_position_tolerance(
                modal_fit, reduced, fe_model=model, tolerance_m_per_m=tolerance
            )
            if tolerance
            else (),
            progress=progress,
        )

    return runner.stage(
        "update",
        {"options": asdict(options), "sensors": repr(sensors), "tolerance": tolerance, "after": runner.after("pair")},
        compute,
        lambda result: {
            "pairs.parquet": partial(write_table, tables.pair_table(result.pairs or pairs, result.after)),
            "parameters.parquet": partial(write_table, tables.history_table(result)),
            "updated_model.npz": partial(write_reduced_model, result.model, dofs=(*measured, *runner.inputs.points)),
        },
    )


def _once(dofs: Iterable[AnyDof]) -> tuple[AnyDof, ...]:
    return tuple(dict.fromkeys(dofs))
