"""Stages that turn recordings into FRFs, and FRFs into a fitted model."""

from __future__ import annotations

from dataclasses import asdict, fields, replace
from functools import partial
from typing import TYPE_CHECKING

from frf_ipz.export import run_tables as tables
from frf_ipz.export.parquet import write_table
from frf_ipz.frf import FrfSet
from frf_ipz.ingest.estimate import estimate_from
from frf_ipz.late_imports import import_late
from frf_ipz.pipeline.config import StageOptions
from frf_ipz.pipeline.stages.mismatch import corrections
from frf_ipz.runs.digests import digest_arrays

if TYPE_CHECKING:
    from frf_ipz.diagnosis.result import Diagnosis
    from frf_ipz.identification.fit import fit_modes
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.modes import ModalParameters
    from frf_ipz.pipeline.stage_runner import StageRunner
    from frf_ipz.progress import Progress
    from frf_ipz.runs.folder import Writers
    from frf_ipz.structure import Geometry
else:
    fit_modes = import_late("frf_ipz.identification.fit", "fit_modes")


WITHOUT_MODEL = (("diagnose", "run"), ("export", "files"))  # what can be said where there is none


def ingest(runner: StageRunner) -> FrfEstimate:
    """Turn recordings into FRFs.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.

    Returns
    -------
    FrfEstimate
        FRFs and the table of records.
    """
    geometry = runner.inputs.test.geometry
    if runner.inputs.fe_model is None and geometry is not None:
        _outline(runner, geometry)
    options = runner.inputs.options.ingest
    said = {"options": asdict(options), "test": repr(runner.inputs.test)}
    files = {name: runner.inputs.digests[name] for name in runner.inputs.measurement_names}
    idle = () if runner.inputs.fe_model is not None else _idle_without_model(runner.inputs.options)

    def estimate(progress: Progress) -> FrfEstimate:
        estimate = estimate_from(runner.recordings, options, progress)
        return replace(estimate, warnings=(*estimate.warnings, *idle)) if idle else estimate

    return runner.stage(
        "ingest",
        {**said, "files": files, **({"idle": idle} if idle else {})},
        estimate,
        _files_of_ingest,
    )


def _idle_without_model(options: StageOptions) -> tuple[str, ...]:
    """Name keys of the sections whose stages run only where there is an FE model."""
    default, texts = StageOptions(), []
    for section in ("diagnose", "reduce", "update", "export"):
        chosen, usual = getattr(options, section), getattr(default, section)
        idle = [
            field.name
            for field in fields(chosen)
            if getattr(chosen, field.name) != getattr(usual, field.name) and (section, field.name) not in WITHOUT_MODEL
        ]
        if idle:
            texts.append(f"[{section}] {', '.join(idle)}")
    return (f"{'; '.join(texts)}: no effect without an FE model",) if texts else ()


def fit(
    runner: StageRunner,
    frfs: FrfSet,
    *,
    modes: ModalParameters | None = None,
    corrected_by: Diagnosis | None = None,
) -> ModalFit:
    """Turn FRFs into poles, residues and zeros.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.
    frfs : FrfSet
        The measured FRFs.
    modes : ModalParameters, optional
        Modes of a test that has no FRFs.
    corrected_by : Diagnosis, optional
        What they were corrected by, if they were.

    Returns
    -------
    ModalFit
        The fitted model.
    """
    options = runner.inputs.options.fit
    return runner.stage(
        "fit",
        {"options": asdict(options), "after": runner.after("ingest"), "corrected": corrections(corrected_by)},
        lambda progress: fit_modes(frfs if modes is None else modes, options=options, progress=progress),
        lambda result: _files_of_fit(frfs, result),
    )


def _outline(runner: StageRunner, geometry: Geometry) -> None:
    """Keep where measured nodes are, and what joins them, for pictures of a structure without an FE model."""
    places = [geometry.nodes, geometry.coordinates_m, geometry.lines]
    faces = [] if geometry.mesh is None else [geometry.mesh.faces]
    runner.stage("model", {"geometry": digest_arrays([*places, *faces])}, lambda _: geometry)


def _files_of_ingest(result: FrfEstimate) -> Writers:
    """Write FRFs and records, where there are any; and the coherences of several forces."""
    if result.modes is not None:
        return {}
    files: Writers = {
        "frf.parquet": partial(write_table, tables.frf_table(result.frfs)),
        "records.parquet": partial(write_table, tables.record_table(result)),
    }
    if not len(result.coherences):
        return files
    return {**files, "coherence.parquet": partial(write_table, tables.coherence_table(result))}


def _delays_s(frfs: FrfSet, result: ModalFit) -> list[float]:
    """Give the delay of each FRF that the fit took off, s."""
    delays = dict(zip(result.misfit["frf"], result.misfit["delay_s"], strict=True))
    return [float(delays.get(number, 0.0)) for number in range(frfs.n_frfs)]


def _files_of_fit(frfs: FrfSet, result: ModalFit) -> Writers:
    """Write the modes; and, where there are FRFs, them, their zeros and what the fit leaves of them."""
    scale_is_known = frfs.unknown_scale == "none"
    files: Writers = {
        "poles.parquet": partial(write_table, tables.pole_table(result)),
        "modes.parquet": partial(write_table, tables.mode_table(result, scale_is_known=scale_is_known)),
    }
    if not frfs.n_frfs:
        return files
    return {
        **files,
        "frf.parquet": partial(write_table, tables.frf_table(result.without_window(frfs), _delays_s(frfs, result))),
        "zeros.parquet": partial(write_table, tables.zero_table(result)),
        "fit.parquet": partial(write_table, tables.misfit_table(result)),
    }
