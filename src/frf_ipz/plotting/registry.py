"""Pictures of a run by their names: what ``frf-ipz plot DIR NAME`` draws, and the sections of the report show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.plotting.cmif import describe_cmif
from frf_ipz.plotting.diagnosis import (
    describe_data_checks,
    describe_expected_misfit,
    describe_mismatch,
    describe_proof,
    describe_ranking,
)
from frf_ipz.plotting.frfs import describe_fit, describe_frfs
from frf_ipz.plotting.mac import describe_mac
from frf_ipz.plotting.nonlinear import (
    describe_law_force,
    describe_law_response,
    describe_level_modes,
    describe_levels,
)
from frf_ipz.plotting.overlay import describe_overlay
from frf_ipz.plotting.picture import select_panel
from frf_ipz.plotting.poles import describe_pairs, describe_pole_zero_map, describe_stabilization
from frf_ipz.plotting.prediction import describe_prediction
from frf_ipz.plotting.records import describe_forces, describe_responses
from frf_ipz.plotting.structure import StructureMarks, describe_structure, finding_nodes, mismatch_nodes
from frf_ipz.plotting.updating import (
    describe_convergence,
    describe_flexibility_change,
    describe_modal_change,
    describe_stiffness_change,
    describe_targets,
)
from frf_ipz.prediction.reference import measured_at
from frf_ipz.runs.picture_data import (
    changed_parts,
    mode_indicator,
    models_beside_measurement,
    shape_agreements,
    update_targets,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from frf_ipz.plotting.picture import Picture
    from frf_ipz.runs.results import Results

Describe: TypeAlias = "Callable[[Results], Iterable[Picture | None]]"

# What a run holds, by the stage that gives it.
CONTENTS = {
    "ingest": "estimate",
    "fit": "fit",
    "pair": "pairs",
    "update": "updated_model",
    "predict": "prediction",
    "diagnose": "diagnosis",
    "levels": "level_dependence",
}
MOST_PREDICTIONS = 8  # predicted FRFs drawn; all stand in the file
MOST_OVERLAYS = 8  # measured FRFs drawn one below the other; the page shows any


@dataclass(frozen=True, slots=True)
class _Entry:
    """A picture, or several that belong together.

    Parameters
    ----------
    stages : tuple of str
        Whose results it shows.
    describe : callable
        Gives the descriptions; None for what this run has nothing to show of.
    otherwise : str
        Why there may be none.
    """

    stages: tuple[str, ...]
    describe: Describe
    otherwise: str = "this run has nothing to show there"


def picture_names(run: Results | None = None) -> tuple[str, ...]:
    """Names of all pictures, or of those whose stages a run holds.

    Parameters
    ----------
    run : Results, optional
        What the run holds.

    Returns
    -------
    tuple of str
        In the order of the chain.
    """
    return tuple(name for name, entry in PICTURES.items() if run is None or not _missing_stages(entry, run))


def describe(name: str, run: Results) -> tuple[Picture, ...]:
    """Describe a picture of a run.

    Parameters
    ----------
    name : str
        One of `picture_names`.
    run : Results
        What the run holds.

    Returns
    -------
    tuple of Picture
        Those of that name, from the top down.

    Raises
    ------
    InputError
        If there is no such picture, or the run lacks what it shows.
    """
    if name not in PICTURES:
        raise InputError(f"there is no picture '{name}'; {did_you_mean(name, PICTURES)}")
    missing = _missing_stages(PICTURES[name], run)
    if missing:
        raise InputError(f"the picture '{name}' needs the result of '{missing[0]}', which this run does not hold")
    pictures = run_pictures(run, name)
    if not pictures:
        raise InputError(f"{PICTURES[name].otherwise}, so there is no such picture")
    return pictures


def run_pictures(run: Results, *names: str) -> tuple[Picture, ...]:
    """Describe those pictures that a run has something to show in.

    Parameters
    ----------
    run : Results
        What the run holds.
    *names : str
        Some of `picture_names`.

    Returns
    -------
    tuple of Picture
        In the order of the names; empty where there is nothing to show.
    """
    entries = [PICTURES[name] for name in names]
    drawn = [picture for entry in entries if not _missing_stages(entry, run) for picture in entry.describe(run)]
    return tuple(picture for picture in drawn if picture is not None)


def _missing_stages(entry: _Entry, run: Results) -> list[str]:
    return [stage for stage in entry.stages if getattr(run, CONTENTS[stage]) is None]


def _of(attribute: str, describe_result: Callable[[Any], Picture | None]) -> Describe:
    """Describe one result of a run that is known to be there."""
    return lambda run: [describe_result(getattr(run, attribute))]


def _frfs(run: Results) -> list[Picture]:
    fitted = None if run.fit is None else run.fit.band_hz
    return [] if run.frfs is None else [describe_frfs(run.frfs, band_hz=run.band_hz, fitted_hz=fitted)]


def _coherence(run: Results) -> list[Picture]:
    return [select_panel(picture, 2) for picture in _frfs(run) if len(picture.panels) > 2]


def _fit(run: Results) -> list[Picture]:
    return [] if run.fit is None or run.frfs is None else [describe_fit(run.frfs, run.fit)]


def _cmif(run: Results) -> list[Picture]:
    return [] if run.frfs is None else [describe_cmif(mode_indicator(run.frfs), run.fit, band_hz=run.band_hz)]


def _stabilization(run: Results) -> list[Picture]:
    return [describe_stabilization(run.fit, run.frfs)] if run.fit is not None and len(run.fit.stabilization) else []


def _pairs(run: Results) -> list[Picture]:
    if run.pairs is None or not run.pairs.rows:
        return []
    return [describe_pairs(run.pairs, band_hz=run.band_hz)]


def _flexibility(run: Results) -> list[Picture | None]:
    return (
        [] if run.updated_model is None else [describe_flexibility_change(run.updated_model, run.geometry, run.labels)]
    )


def _predictions(run: Results) -> list[Picture]:
    if run.prediction is None:
        return []
    aside = measured_at(run.prediction, run.reference)
    measured = {**measured_at(run.prediction, run.frfs), **aside}
    count = min(len(run.prediction.labels), MOST_PREDICTIONS)
    return [
        describe_prediction(run.prediction, frf, measured.get(frf), is_kept_aside=frf in aside) for frf in range(count)
    ]


def _overlays(run: Results) -> list[Picture]:
    return list(overlay_pictures(run).values())[:MOST_OVERLAYS]


def overlay_pictures(run: Results) -> dict[str, Picture]:
    """Describe every measured FRF with the nominal and the updated model's.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    dict of str to Picture
        By the FRF; empty without a model.
    """
    compared = models_beside_measurement(run)
    if compared is None:
        return {}
    return {text: describe_overlay(compared, frf) for frf, text in enumerate(compared.names)}


def _mac(run: Results) -> list[Picture | None]:
    return [describe_mac(shape_agreements(run))]


def _structure(run: Results) -> list[Picture | None]:
    frfs = run.frfs
    marks = StructureMarks(
        sensors=() if frfs is None else frfs.output_dofs,
        inputs=() if frfs is None else frfs.input_dofs,
        points=run.points,
        missing=finding_nodes(run.diagnosis, frfs),
        mismatch=mismatch_nodes(run.diagnosis, frfs),
        across="Masses in a row" if run.geometry is not None and run.geometry.is_schematic else "Position, m",
    )
    return [describe_structure(run.geometry, marks)]


def _law(run: Results) -> list[Picture | None]:
    law = None if run.diagnosis is None else run.diagnosis.law_in_time
    return [] if law is None else [describe_law_force(law), describe_law_response(law)]


def _expected_misfit(run: Results) -> list[Picture | None]:
    return [] if run.diagnosis is None else [describe_expected_misfit(run.diagnosis, band_hz=run.band_hz)]


def _levels(run: Results) -> list[Picture | None]:
    if run.level_dependence is None:
        return []
    return [
        describe_levels(run.level_dependence, run.labels, band_hz=run.band_hz),
        describe_level_modes(run.level_dependence),
    ]


PICTURES: dict[str, _Entry] = {
    "structure": _Entry((), _structure),
    "records": _Entry(("ingest",), _of("estimate", describe_forces)),
    "responses": _Entry(("ingest",), _of("estimate", describe_responses)),
    "frfs": _Entry(("ingest",), _frfs),
    "phases": _Entry(("ingest",), lambda run: [select_panel(picture, 1) for picture in _frfs(run)]),
    "coherence": _Entry(("ingest",), _coherence, "the coherence of these FRFs is not known"),
    "cmif": _Entry(("ingest",), _cmif),
    "stabilization": _Entry(("fit",), _stabilization, "the fit has kept no diagram"),
    "poles": _Entry(("fit",), _of("fit", describe_pole_zero_map)),
    "fit": _Entry(("ingest", "fit"), _fit),
    "misfit": _Entry(("ingest", "fit"), lambda run: [select_panel(picture, 1) for picture in _fit(run)]),
    "pairs": _Entry(("pair", "fit"), _pairs, "there was nothing to pair"),
    "overlay": _Entry(("ingest", "update"), _overlays),
    "mac": _Entry(("fit", "update"), _mac, "mode shapes were measured at one DOF only, where all are alike"),
    "targets": _Entry(
        ("update", "pair", "fit"),
        lambda run: [describe_targets(update_targets(run))],
        "no measured pole or zero has a counterpart in the model",
    ),
    "convergence": _Entry(("update",), _of("updated_model", describe_convergence), "the update took one step"),
    "change": _Entry(
        ("update",),
        lambda run: [describe_stiffness_change(changed_parts(run))],
        "the update of this run has not changed named parts of the FE model",
    ),
    "flexibility": _Entry(("update",), _flexibility, "the model has no positions"),
    "modal-change": _Entry(("update",), _of("updated_model", describe_modal_change)),
    "prediction": _Entry(
        ("predict",), _predictions, "this run predicts no FRF: name points of interest in [predict] points"
    ),
    "mismatch": _Entry(("diagnose",), _of("diagnosis", describe_mismatch)),
    "ranking": _Entry(
        ("diagnose",),
        _of("diagnosis", describe_ranking),
        "no explanation of this run gains any evidence",
    ),
    "law": _Entry(("diagnose",), _law, "the diagnosis of this run has found no force law"),
    "proof": _Entry(("diagnose",), _of("diagnosis", describe_proof)),
    "expected-misfit": _Entry(
        ("diagnose",),
        _expected_misfit,
        "the diagnosis has kept no curves",
    ),
    "data-checks": _Entry(
        ("diagnose",),
        _of("diagnosis", describe_data_checks),
        "no check of the data could be made",
    ),
    "levels": _Entry(("levels",), _levels, "no input was excited at several levels"),
}
