"""Each stage of the chain: what it computes, what its result depends on, which files it writes."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray
from frf_ipz.export import run_tables as tables
from frf_ipz.export.state_space import save_reduced_model, save_state_space, to_state_space
from frf_ipz.export.tables import write_table
from frf_ipz.fe.reduction import reduce_model
from frf_ipz.frf import FrfSet
from frf_ipz.identification.fit import fit_modes
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.pairing.assignment import pair as pair_roots
from frf_ipz.prediction.predict import predict_frfs
from frf_ipz.report.page import write_report
from frf_ipz.updating.update import update_model

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import pyarrow as pa

    from frf_ipz.export.state_space import StateSpaceModel
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.ingest.recordings import Recordings
    from frf_ipz.pairing.pairs import Pairs
    from frf_ipz.pipeline.desk import Desk
    from frf_ipz.prediction.prediction import Prediction
    from frf_ipz.structure import ReducedModel, StructuralModel
    from frf_ipz.updating.updated_model import UpdatedModel


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
            "frf.parquet": parquet(tables.frf_table(result.frfs)),
            "blows.parquet": parquet(tables.frame_table(result.blows, {}, meaning="quality of a blow")),
        },
    )


def fit(desk: Desk, frfs: FrfSet) -> ModalFit:
    """Turn FRFs into poles, residues and zeros.

    Parameters
    ----------
    desk : Desk
        The work.
    frfs : FrfSet
        The measured FRFs.

    Returns
    -------
    ModalFit
        The fitted model.
    """
    options = desk.job.pipeline.file.fit
    return desk.stage(
        "fit",
        {"options": asdict(options), "after": desk.after("ingest")},
        lambda progress: fit_modes(frfs, options, progress=progress),
        lambda result: {
            "poles.parquet": parquet(tables.pole_table(result)),
            "zeros.parquet": parquet(tables.zero_table(result)),
            "fit.parquet": parquet(tables.frame_table(result.misfit, {}, meaning="misfit against noise")),
            "modes.parquet": parquet(tables.mode_table(result)),
        },
    )


def reduce(desk: Desk, model: StructuralModel, modal_fit: ModalFit) -> ReducedModel:
    """Turn the FE model into a reduced model in physical DOFs.

    Parameters
    ----------
    desk : Desk
        The work.
    model : StructuralModel
        The FE model.
    modal_fit : ModalFit
        Says which band was fitted.

    Returns
    -------
    ReducedModel
        The reduced model.
    """
    job = desk.job
    options = job.pipeline.file.reduce
    return desk.stage(
        "reduce",
        {"options": asdict(options), "model": job.model_key, "after": desk.after("fit"), "points": repr(job.points)},
        lambda _: reduce_model(
            model,
            options,
            actuators=job.test.input_dofs,
            sensors=job.test.output_dofs,
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
            "pairs.parquet": parquet(tables.pair_table(result, modal_fit.labels, unknown_roots(len(result.targets))))
        },
    )


def update(desk: Desk, reduced: ReducedModel, modal_fit: ModalFit, pairs: Pairs) -> UpdatedModel:
    """Bring the reduced model to the measured poles and zeros.

    Parameters
    ----------
    desk : Desk
        The work.
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
    return desk.stage(
        "update",
        {"options": asdict(options), "after": desk.after("pair")},
        lambda progress: update_model(reduced, modal_fit, pairs, options, progress=progress),
        lambda result: {
            "pairs.parquet": parquet(tables.pair_table(pairs, modal_fit.labels, result.after)),
            "parameters.parquet": parquet(tables.history_table(result)),
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
    lines = frfs.frequency_hz[frfs.in_band(modal_fit.band_hz)]
    return desk.stage(
        "predict",
        {"points": repr(job.points), "after": desk.after("update")},
        lambda _: predict_frfs(updated, job.points, modal_fit.labels, lines),
        lambda result: {"poi_frf.parquet": parquet(tables.prediction_table(result))},
    )


def export(desk: Desk, updated: UpdatedModel, modal_fit: ModalFit) -> StateSpaceModel:
    """Turn the updated model into a state space.

    Parameters
    ----------
    desk : Desk
        The work.
    updated : UpdatedModel
        The updated model.
    modal_fit : ModalFit
        Names the sensors and actuators.

    Returns
    -------
    StateSpaceModel
        With named inputs and outputs.
    """
    job = desk.job
    options = job.pipeline.file.export
    return desk.stage(
        "export",
        {"options": asdict(options), "points": repr(job.points), "after": desk.after("update")},
        lambda _: to_state_space(updated, modal_fit.labels, job.points, options),
        lambda model: {name: partial(save_state_space, model) for name in ("statespace.json", "statespace.mat")},
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


def parquet(table: pa.Table) -> Callable[[Path], None]:
    """Give what writes a table.

    Parameters
    ----------
    table : pyarrow.Table
        The table.

    Returns
    -------
    callable
        Takes the path.
    """
    return partial(write_table, table)


def unknown_roots(count: int) -> ComplexArray:
    """Roots that are not known yet.

    Parameters
    ----------
    count : int
        How many.

    Returns
    -------
    (count,) complex array
        NaN.
    """
    return np.full(count, complex(np.nan, np.nan))
