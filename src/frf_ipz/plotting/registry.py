"""Pictures of a run by their names: what ``frf-ipz plot DIR NAME`` draws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

from matplotlib.figure import Figure

from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.plotting.diagnosis import plot_law, plot_levels, plot_mismatch, plot_proof, plot_ranking
from frf_ipz.plotting.frfs import plot_coherence, plot_fit, plot_frfs, plot_misfit, plot_phases
from frf_ipz.plotting.poles import plot_pairs, plot_pole_zero_map, plot_stabilization
from frf_ipz.plotting.recordings import plot_records, plot_structure
from frf_ipz.plotting.style import WIDTH_IN
from frf_ipz.plotting.targets import target_rows
from frf_ipz.plotting.updating import plot_convergence, plot_prediction, plot_stiffness_change, plot_targets

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes

    from frf_ipz.diagnosis.measured.levels import LevelDependence
    from frf_ipz.diagnosis.result import Diagnosis
    from frf_ipz.prediction.prediction import Prediction
    from frf_ipz.runs.folder import RunFolder
    from frf_ipz.updating.updated_model import UpdatedModel

Draw: TypeAlias = "Callable[..., Axes]"
HEIGHT_OF_ONE_IN = 2.6  # of each predicted FRF, where there are several


@dataclass(frozen=True, slots=True)
class _Entry:
    """A picture: which stages' results it takes, and what draws it."""

    stages: tuple[str, ...]
    draw: Draw


PICTURES: dict[str, _Entry] = {
    "records": _Entry(("ingest",), plot_records),
    "frfs": _Entry(("ingest",), lambda estimate: plot_frfs(estimate.frfs)),
    "phases": _Entry(("ingest",), lambda estimate: plot_phases(estimate.frfs)),
    "coherence": _Entry(("ingest",), lambda estimate: plot_coherence(estimate.frfs)),
    "stabilization": _Entry(("fit", "ingest"), lambda fit, estimate: plot_stabilization(fit, estimate.frfs)),
    "poles": _Entry(("fit",), plot_pole_zero_map),
    "fit": _Entry(("ingest", "fit"), lambda estimate, fit: plot_fit(estimate.frfs, fit)),
    "misfit": _Entry(("ingest", "fit"), lambda estimate, fit: plot_misfit(estimate.frfs, fit)),
    "pairs": _Entry(("pair", "fit"), lambda pairs, fit: plot_pairs(pairs, fit.labels)),
    "targets": _Entry(
        ("update", "pair", "fit"), lambda updated, pairs, fit: plot_targets(target_rows(updated, pairs, fit.labels))
    ),
    "convergence": _Entry(("update",), plot_convergence),
    "change": _Entry(("update",), lambda updated: _change(updated)),
    "prediction": _Entry(("predict",), lambda prediction: _predictions(prediction)),
    "structure": _Entry(("model", "ingest"), lambda model, estimate: _structure(model, estimate)),
    "mismatch": _Entry(("diagnose",), plot_mismatch),
    "ranking": _Entry(("diagnose",), plot_ranking),
    "proof": _Entry(("diagnose",), plot_proof),
    "law": _Entry(("diagnose",), lambda diagnosis: _law(diagnosis)),
    "levels": _Entry(("levels",), lambda levels: _levels(levels)),
}


def picture_names() -> tuple[str, ...]:
    """Names of all pictures.

    Returns
    -------
    tuple of str
        In the order of the chain.
    """
    return tuple(PICTURES)


def draw(name: str, folder: RunFolder) -> Figure:
    """Draw a picture of a run.

    Parameters
    ----------
    name : str
        One of `picture_names`.
    folder : RunFolder
        The run.

    Returns
    -------
    Figure
        To be saved with `plotting.style.save_figure`.

    Raises
    ------
    InputError
        If there is no such picture, or the run lacks what it shows.
    """
    if name not in PICTURES:
        raise InputError(f"there is no picture '{name}'; {did_you_mean(name, PICTURES)}")
    entry = PICTURES[name]
    results = [folder.load(stage) for stage in entry.stages]
    missing = [stage for stage, result in zip(entry.stages, results, strict=True) if result is None]
    if missing:
        raise InputError(f"the picture '{name}' needs the result of '{missing[0]}', which this run does not hold")
    figure = entry.draw(*results).figure
    return figure if isinstance(figure, Figure) else figure.figure


def _predictions(prediction: Prediction) -> Axes:
    count = len(prediction.labels)
    if not count:
        raise InputError("this run predicts no FRF: name points of interest in [predict] points")
    figure = Figure(figsize=(WIDTH_IN, 0.6 + HEIGHT_OF_ONE_IN * count), layout="constrained")
    for place, ax in enumerate(figure.subplots(count, 1, squeeze=False)[:, 0]):
        plot_prediction(prediction, frf=place, ax=ax)
    return figure.axes[0]


def _change(updated: UpdatedModel) -> Axes:
    if not len(updated.parts):
        raise InputError(
            "the update of this run has not changed named parts of the FE model, so there is no such picture"
        )
    return plot_stiffness_change(updated.parts)


def _law(diagnosis: Diagnosis) -> Axes:
    if diagnosis.law_in_time is None:
        raise InputError("the diagnosis of this run has found no force law, so there is no such picture")
    return plot_law(diagnosis.law_in_time)


def _levels(levels: LevelDependence) -> Axes:
    if not len(levels.modes):
        raise InputError("no input was excited at several levels, so there is no such picture")
    return plot_levels(levels)


def _structure(model: Any, estimate: Any) -> Axes:  # noqa: ANN401  results of stages as the folder gives them
    geometry = getattr(model, "geometry", model)
    return plot_structure(geometry, sensors=estimate.frfs.output_dofs, inputs=estimate.frfs.input_dofs)
