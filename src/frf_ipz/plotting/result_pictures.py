"""The pictures of a result by their names: what its `plot` draws."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias

from frf_ipz.diagnosis.result import Diagnosis
from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.frf import FrfSet
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.ingest.frf_estimate import FrfEstimate
from frf_ipz.pairing.pairs import Pairs
from frf_ipz.plotting import plots
from frf_ipz.plotting.figures import draw_pictures
from frf_ipz.plotting.registry import describe
from frf_ipz.prediction.prediction import Prediction
from frf_ipz.structure import StructuralModel
from frf_ipz.updating.updated_model import UpdatedModel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from frf_ipz.runs.results import Results

Draw: TypeAlias = Callable[..., "Axes"]


def plot(result: object, picture: str | None = None, *, ax: Axes | None = None) -> Axes:
    """Draw a picture of a result.

    Parameters
    ----------
    result : object
        Of a type in `DRAWINGS`.
    picture : str, optional
        Its name; the first of the type where it is left out.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

    Raises
    ------
    InputError
        If the type has no such picture, or there is nothing to draw.
    """
    drawings = DRAWINGS[type(result)]
    name = next(iter(drawings)) if picture is None else picture
    if name not in drawings:
        raise InputError(f"{type(result).__name__} has no picture '{name}'; {did_you_mean(name, list(drawings))}")
    return drawings[name](result, ax=ax)


def plot_run(run: Results, picture: str) -> Figure:
    """Draw a picture of a run.

    Parameters
    ----------
    run : Results
        The run.
    picture : str
        Its name.

    Returns
    -------
    Figure
        With the picture, or the pictures that belong together.

    Raises
    ------
    InputError
        If there is no such picture, or its stage has not run.
    """
    return draw_pictures(describe(picture, run))


def _of(attribute: str, draw: Draw) -> Draw:
    def draw_attribute(result: Any, *, ax: Axes | None) -> Axes:  # noqa: ANN401  any type in DRAWINGS
        return draw(getattr(result, attribute), ax=ax)

    return draw_attribute


DRAWINGS: dict[type, dict[str, Draw]] = {
    FrfSet: {"frfs": plots.plot_frfs, "phases": plots.plot_phases, "coherence": plots.plot_coherence},
    FrfEstimate: {
        "frfs": _of("frfs", plots.plot_frfs),
        "records": plots.plot_records,
        "responses": plots.plot_responses,
        "coherence": _of("frfs", plots.plot_coherence),
    },
    ModalFit: {"poles": plots.plot_pole_zero_map, "stabilization": plots.plot_stabilization},
    StructuralModel: {"structure": _of("geometry", plots.plot_structure)},
    Pairs: {"pairs": plots.plot_pairs},
    UpdatedModel: {
        "stiffness-change": _of("parts", plots.plot_stiffness_change),
        "convergence": plots.plot_convergence,
    },
    Prediction: {"prediction": plots.plot_prediction},
    Diagnosis: {"mismatch": plots.plot_mismatch, "ranking": plots.plot_ranking, "proof": plots.plot_proof},
}
