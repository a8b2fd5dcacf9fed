"""Stages that turn recordings into FRFs, and FRFs into a fitted model."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING

from frf_ipz.export import run_tables as tables
from frf_ipz.export.parquet import write_table
from frf_ipz.export.run_tables import mode_table
from frf_ipz.frf import FrfSet
from frf_ipz.identification.fit import fit_modes
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.pipeline.stages.mismatch import corrections
from frf_ipz.rational import without_window

if TYPE_CHECKING:
    from frf_ipz.diagnosis.result import Diagnosis
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.pipeline.stage_runner import StageRunner


def ingest(desk: StageRunner) -> FrfEstimate:
    """Turn recordings into FRFs.

    Parameters
    ----------
    desk : StageRunner
        The work.

    Returns
    -------
    FrfEstimate
        FRFs and the table of blows.
    """
    options = desk.job.pipeline.file.ingest
    files = {name: value for name, value in desk.job.inputs.items() if name in map(str, desk.job.test.files)}
    return desk.stage(
        "ingest",
        {"options": asdict(options), "test": repr(desk.job.test), "files": files},
        lambda progress: estimate_frfs(desk.job.test, options, progress=progress),
        lambda result: {
            "frf.parquet": partial(write_table, tables.frf_table(result.frfs)),
            "records.parquet": partial(
                write_table, tables.frame_table(result.records, {}, meaning="quality of a blow")
            ),
        },
    )


def fit(desk: StageRunner, frfs: FrfSet, *, corrected_by: Diagnosis | None = None) -> ModalFit:
    """Turn FRFs into poles, residues and zeros.

    Parameters
    ----------
    desk : StageRunner
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
        {"options": asdict(options), "after": desk.after("ingest"), "corrected": corrections(corrected_by)},
        lambda progress: fit_modes(frfs, options, progress=progress),
        lambda result: {
            "frf.parquet": partial(write_table, tables.frf_table(without_window(frfs, result.model))),
            "poles.parquet": partial(write_table, tables.pole_table(result)),
            "zeros.parquet": partial(write_table, tables.zero_table(result)),
            "fit.parquet": partial(write_table, tables.frame_table(result.misfit, {}, meaning="misfit against noise")),
            "modes.parquet": partial(write_table, mode_table(result, scale_is_known=frfs.unknown_scale == "none")),
        },
    )
