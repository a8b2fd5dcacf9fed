"""Plots for publications: results in, Matplotlib axes out.

Each function describes a picture, as the report shows it, and draws one of its panels. They take results and compute
nothing; none opens a window.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.errors import InputError
from frf_ipz.plotting.diagnosis import describe_mismatch, describe_proof, describe_ranking
from frf_ipz.plotting.figures import draw_panel
from frf_ipz.plotting.frfs import describe_fit, describe_frfs
from frf_ipz.plotting.nonlinear import describe_law_force, describe_law_response, describe_level_modes
from frf_ipz.plotting.poles import describe_pairs, describe_pole_zero_map, describe_stabilization
from frf_ipz.plotting.prediction import describe_prediction
from frf_ipz.plotting.records import describe_forces, describe_responses
from frf_ipz.plotting.structure import StructureMarks, describe_structure
from frf_ipz.plotting.updating import describe_convergence, describe_stiffness_change, describe_targets

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from matplotlib.axes import Axes

    from frf_ipz.arrays import ComplexArray
    from frf_ipz.diagnosis.measured.levels import LevelDependence
    from frf_ipz.diagnosis.result import Diagnosis, LawInTime
    from frf_ipz.dofs import Dof
    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.pairing.pairs import Pairs
    from frf_ipz.plotting.picture import Picture
    from frf_ipz.prediction.prediction import Prediction
    from frf_ipz.structure import Geometry
    from frf_ipz.updating.targets import Target
    from frf_ipz.updating.updated_model import UpdatedModel


def plot_records(estimate: FrfEstimate, *, ax: Axes | None = None) -> Axes:
    """Draw the forces of all records; those left out are dotted.

    Parameters
    ----------
    estimate : FrfEstimate
        The result of ingest.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        Forces over time, aligned where they set in.

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    return _draw(describe_forces(estimate), ax, "no force was recorded")


def plot_responses(estimate: FrfEstimate, *, ax: Axes | None = None) -> Axes:
    """Draw the responses of the first channel in all records; those left out are dotted.

    Parameters
    ----------
    estimate : FrfEstimate
        The result of ingest.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        Responses over time.

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    return _draw(describe_responses(estimate), ax, "no response was recorded")


def plot_frfs(frfs: FrfSet, *, ax: Axes | None = None) -> Axes:
    """Draw the magnitudes of measured FRFs with their 95 % bands.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs; ``select_frfs`` and ``select_lines`` choose.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.
    """
    return draw_panel(describe_frfs(frfs), ax)


def plot_phases(frfs: FrfSet, *, ax: Axes | None = None) -> Axes:
    """Draw the phases of measured FRFs.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.
    """
    return draw_panel(describe_frfs(frfs), ax, panel=1)


def plot_coherence(frfs: FrfSet, *, ax: Axes | None = None) -> Axes:
    """Draw the coherence of measured FRFs.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    picture = describe_frfs(frfs)
    if len(picture.panels) < 3:
        raise InputError("the coherence of these FRFs is not known")
    return draw_panel(picture, ax, panel=2)


def plot_fit(frfs: FrfSet, fit: ModalFit, *, ax: Axes | None = None) -> Axes:
    """Draw measured FRFs as points, fitted ones as lines, and the 95 % bands of the fit.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs that were fitted, on all their lines.
    fit : ModalFit
        The fit.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.
    """
    return draw_panel(describe_fit(frfs, fit), ax)


def plot_misfit(frfs: FrfSet, fit: ModalFit, *, ax: Axes | None = None) -> Axes:
    """Draw the modulus of measurement minus fit, and the standard deviation of the measurement (dotted).

    Parameters
    ----------
    frfs : FrfSet
        The FRFs that were fitted, on all their lines.
    fit : ModalFit
        The fit.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.
    """
    return draw_panel(describe_fit(frfs, fit), ax, panel=1)


def plot_stabilization(fit: ModalFit, frfs: FrfSet | None = None, *, ax: Axes | None = None) -> Axes:
    """Draw the stabilisation diagram: poles over model order, and the modes of the fit.

    Parameters
    ----------
    fit : ModalFit
        The fit.
    frfs : FrfSet, optional
        Measured FRFs, whose sum is drawn behind.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.
    """
    return draw_panel(describe_stabilization(fit, frfs), ax)


def plot_pole_zero_map(fit: ModalFit, *, ax: Axes | None = None) -> Axes:
    """Draw poles and zeros over frequency and damping ratio, with the ellipses that hold them with 95 %.

    Parameters
    ----------
    fit : ModalFit
        The fit.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.
    """
    return draw_panel(describe_pole_zero_map(fit), ax)


def plot_pairs(pairs: Pairs, *, ax: Axes | None = None) -> Axes:
    """Draw measured (upper) and computed (lower) poles and zeros, linked where they are paired.

    Parameters
    ----------
    pairs : Pairs
        Who belongs to whom.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        One lane for the poles and one for the zeros of each FRF.
    """
    return draw_panel(describe_pairs(pairs), ax)


def plot_targets(targets: Sequence[Target], *, ax: Axes | None = None) -> Axes:
    """Draw the frequency errors of an update's targets, before and after.

    Parameters
    ----------
    targets : sequence of Target
        What `updating.targets.target_rows` gives.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    return _draw(describe_targets(targets), ax, "the update had no targets")


def plot_convergence(updated: UpdatedModel, *, ax: Axes | None = None) -> Axes:
    """Draw the misfit of the targets over the iterations.

    Parameters
    ----------
    updated : UpdatedModel
        The update.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    return _draw(describe_convergence(updated), ax, "the update took one step")


def plot_stiffness_change(parts: pd.DataFrame, *, ax: Axes | None = None) -> Axes:
    """Draw how much stiffer or softer every part of the FE model has become, with its 90 % band.

    Parameters
    ----------
    parts : DataFrame
        ``UpdatedModel.parts``.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        Over the position for a structure that is a line, else coloured points.

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    return _draw(describe_stiffness_change(parts), ax, "the update has changed no named parts")


def plot_prediction(
    prediction: Prediction, *, frf: int = 0, measured: ComplexArray | None = None, ax: Axes | None = None
) -> Axes:
    """Draw a predicted FRF with its 90 % band, beside the nominal one.

    Parameters
    ----------
    prediction : Prediction
        The prediction.
    frf : int
        Which of its FRFs.
    measured : (n_lines,) complex array, optional
        What was measured there, on the lines of the prediction, in SI units.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.
    """
    return draw_panel(describe_prediction(prediction, frf, measured), ax)


def plot_structure(
    geometry: Geometry,
    *,
    sensors: Sequence[Dof] = (),
    inputs: Sequence[Dof] = (),
    points: Sequence[Dof] = (),
    ax: Axes | None = None,
) -> Axes:
    """Draw a structure with sensors, inputs and points of interest.

    Parameters
    ----------
    geometry : Geometry
        Of the FE model.
    sensors, inputs, points : sequence of Dof
        What to mark.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    marks = StructureMarks(sensors=sensors, inputs=inputs, points=points)
    return _draw(describe_structure(geometry, marks), ax, "the model has no nodes")


def plot_mismatch(diagnosis: Diagnosis, *, column: str = "before", ax: Axes | None = None) -> Axes:
    """Draw the misfit over what noise and tolerances explain, by FRF and band.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    column : str
        ``before`` or ``after``: of the model as it is, or with the findings.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        A map; 1 is as good as the measurement.

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    picture = describe_mismatch(diagnosis)
    names = [] if picture is None else [layer.name for layer in picture.layers]
    if picture is None or column not in names:
        raise InputError(f"there is no misfit '{column}' of this diagnosis; there is {', '.join(names) or 'none'}")
    return draw_panel(picture, ax, panel=names.index(column))


def plot_ranking(diagnosis: Diagnosis, *, ax: Axes | None = None) -> Axes:
    """Draw findings and alternatives by their evidence.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        Bars; the findings stand out.

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    return _draw(describe_ranking(diagnosis), ax, "no explanation gains any evidence")


def plot_proof(diagnosis: Diagnosis, *, ax: Axes | None = None) -> Axes:
    """Draw the error of the FRFs before and after, on what was fitted and on what was held out.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        Bars.
    """
    return draw_panel(describe_proof(diagnosis), ax)


def plot_law(law: LawInTime, *, ax: Axes | None = None) -> Axes:
    """Draw a record as measured, with a force law and without it; the law's force, where none was simulated.

    Parameters
    ----------
    law : LawInTime
        Of a diagnosis.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        Responses over time, or the force over the motion at its location.
    """
    return draw_panel(describe_law_response(law) or describe_law_force(law), ax)


def plot_levels(levels: LevelDependence, *, ax: Axes | None = None) -> Axes:
    """Draw the change of each mode's frequency over the level of excitation, with 95 % bars.

    Parameters
    ----------
    levels : LevelDependence
        Weak beside strong records.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        A line of a linear structure stays at zero.

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    return _draw(describe_level_modes(levels), ax, "no mode was found at several levels")


def _draw(picture: Picture | None, ax: Axes | None, otherwise: str) -> Axes:
    if picture is None:
        raise InputError(f"{otherwise}: there is nothing to draw")
    return draw_panel(picture, ax)
