"""The step that puts measured shapes, expanded over the model, in the place of an update that does not meet them.

What is missing in a model need not be a change of its matrices: masses at its ends, something hidden that splits a
mode. Both ways are judged at the measured points: the update where it was given them, the expansion where each was left
out. Only an update that takes care is replaced, and only by an expansion that predicts better than it meets.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.control_margins import GAIN_MARGIN_DB, HALF, SIXTH
from frf_ipz.late_imports import import_late
from frf_ipz.pairing.pairs import Pair, Pairs, PairVerdict
from frf_ipz.rational import natural_frequency_hz
from frf_ipz.updating.expansion import ShapeExpansion, points_apart
from frf_ipz.updating.scale import fit_scale
from frf_ipz.updating.shape_expansion.attached_masses import attachment_places, find_attached_masses
from frf_ipz.updating.shape_expansion.between_points import inner_points
from frf_ipz.updating.shape_expansion.expanded_model import ExpandedModes, build_expanded_model, expand_modes
from frf_ipz.updating.shape_expansion.left_out_points import (
    FEWEST,
    LeftOutPoints,
    calibrate,
    errors_at_points,
    leave_points_out,
)
from frf_ipz.updating.shape_expansion.measured_shapes import measured_shapes, side_with_more

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

    from frf_ipz.arrays import BoolArray
    from frf_ipz.dofs import AnyDof
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.structure import Geometry, ReducedModel
    from frf_ipz.updating.options import UpdateOptions
    from frf_ipz.updating.problem import UpdateProblem
    from frf_ipz.updating.shape_expansion.attached_masses import LoadedModel
    from frf_ipz.updating.shape_expansion.measured_shapes import MeasuredShapes
    from frf_ipz.updating.updated_model import UpdatedModel
else:
    pd = import_late("pandas")

MOST_ENDS = 100  # sensors and excited DOFs


def with_expanded_shapes(
    updated: UpdatedModel,
    fit: ModalFit,
    problem: UpdateProblem,
    *,
    geometry: Geometry | None,
    options: UpdateOptions,
) -> UpdatedModel:
    """Take expanded measured shapes where they predict left-out points better than the update meets given ones.

    Parameters
    ----------
    updated : UpdatedModel
        With its scale.
    fit : ModalFit
        The fitted model of all FRFs.
    problem : UpdateProblem
        The nominal model and the targets.
    geometry : Geometry, optional
        Of the FE model: free ends are seen in it.
    options : UpdateOptions
        Of the user: the number of members, and the seed.

    Returns
    -------
    UpdatedModel
        The same one where the update stays.
    """
    measured = measured_shapes(fit)
    if measured is None or len(side_with_more(fit)) < FEWEST:
        return updated
    if len(measured.outputs) + len(measured.inputs) > MOST_ENDS:
        return updated
    own = errors_at_points(fit, updated)
    own_db = float(np.median(own[np.isfinite(own)])) if np.isfinite(own).any() else 0.0
    if own_db <= SIXTH * GAIN_MARGIN_DB:
        return updated
    is_known = fit.unknown_scale == "none"
    places = attachment_places(problem.model, measured, geometry)
    loaded, left_out = _best_cause(fit, problem.model, measured, places, {})
    doubts = _find_doubts(fit, loaded, left_out) if left_out is not None and is_known else {}
    if doubts:
        measured = measured_shapes(fit, doubts=doubts) or measured
        loaded, left_out = _best_cause(fit, problem.model, measured, places, doubts)
    if left_out is None or np.median(left_out.error_db) >= own_db:
        return updated
    modes = expand_modes(loaded.model, measured, error=loaded.error, is_scale_known=is_known)
    if is_known and abs(20 * np.log10(modes.gain)) > HALF * GAIN_MARGIN_DB:
        return updated  # a scale that is so far off where it is known is a mistake, which must show
    inner_nodes, is_inner = inner_points(left_out.points, side_with_more(fit), loaded.model.expanded_dofs, geometry)
    inner, anywhere = _calibrations(left_out, is_inner)
    model, ensemble = build_expanded_model(
        loaded.model, modes, count=options.ensemble, calibration=anywhere, seed=options.seed
    )
    expansion = ShapeExpansion(
        points=tuple(point.name for point in left_out.points),
        ratio=np.exp(left_out.log_ratio),
        error_db=left_out.error_db,
        updated_error_db=own[np.isfinite(own)],
        stiffness_ratio=loaded.stiffness_ratio,
        masses=loaded.masses,
        split=_split_modes(modes),
        is_level_known=is_known,
        inner_nodes=inner_nodes,
        inner_spread=inner / anywhere,
        reciprocal_spread=calibrate(left_out.reciprocal) / anywhere if left_out.reciprocal else 1.0,
    )
    return replace(
        updated,
        model=model,
        after=replace(problem, model=model).nearest_roots(model, problem.values),
        ensemble=ensemble,
        unmet=(),
        parts=pd.DataFrame(),
        scale=fit_scale(fit, _pairs_of_measured_modes(fit), model, fit.model.poles[: fit.n_modes], ensemble),
        expansion=expansion,
    )


def _best_cause(
    fit: ModalFit,
    model: ReducedModel,
    measured: MeasuredShapes,
    places: tuple[AnyDof, ...],
    doubts: Mapping[AnyDof, float],
) -> tuple[LoadedModel, LeftOutPoints | None]:
    """Take the model as it is or with attached masses: where left-out points follow better from the others."""
    causes = [find_attached_masses(model, measured, tried) for tried in dict.fromkeys(((), places))]
    left_out_of = [leave_points_out(fit, loaded.model, error=loaded.error, doubts=doubts) for loaded in causes]
    errors = [np.inf if left_out is None else float(np.median(left_out.error_db)) for left_out in left_out_of]
    best = int(np.argmin(errors))
    return causes[best], left_out_of[best]


def _find_doubts(fit: ModalFit, loaded: LoadedModel, left_out: LeftOutPoints) -> dict[AnyDof, float]:
    """Relative errors of points that all others contradict: what they are off by, so that they hardly count.

    A wrong point spoils what is predicted at its neighbours. So the one that is off most is doubted first, and stays so
    where it stands apart from what the others then are off by.
    """
    doubts: dict[AnyDof, float] = {}
    judged: LeftOutPoints | None = left_out
    while judged is not None:
        sizes = np.abs(points_apart(judged.log_ratio)[0])
        places = [place for place, point in enumerate(judged.points) if point not in doubts]
        if not places:
            break
        worst = max(places, key=sizes.__getitem__)
        tried = {**doubts, judged.points[worst]: float(sizes[worst])}
        judged = leave_points_out(fit, loaded.model, error=loaded.error, doubts=tried)
        if judged is None or not points_apart(judged.log_ratio)[2][worst]:
            break
        doubts = tried
    return doubts


def _calibrations(left_out: LeftOutPoints, is_inner: BoolArray) -> tuple[float, float]:
    """Factors on standard deviations between measured points, and anywhere.

    Points that reciprocity tells speak for no others, unless there are only such. Where it is not known which points
    lie between others, the worst one speaks for all.
    """
    counts = ~left_out.is_told if not left_out.is_told.all() else np.ones(len(is_inner), bool)
    inner = [errors for errors, use in zip(left_out.errors, counts & is_inner, strict=True) if use]
    outer = [errors for errors, use in zip(left_out.errors, counts & ~is_inner, strict=True) if use]
    if not inner:
        worst = max(calibrate([errors]) for errors in outer)
        return worst, worst
    between = calibrate(inner)
    return between, max(between, calibrate(outer)) if outer else between


def _split_modes(modes: ExpandedModes) -> tuple[tuple[float, ...], ...]:
    """Frequencies of measured modes that follow the same mode of the model, Hz."""
    hertz = natural_frequency_hz(modes.measured.poles)
    groups = [tuple(hertz[modes.followed == mode].tolist()) for mode in np.unique(modes.followed)]
    return tuple(group for group in groups if len(group) > 1)


def _pairs_of_measured_modes(fit: ModalFit) -> Pairs:
    """Pair each measured mode with itself: the expanded model has it."""
    rows = [
        Pair(
            kind="pole",
            frf=-1,
            measured=mode,
            computed=mode,
            measured_value=complex(pole),
            computed_value=complex(pole),
            distance=0.0,
            verdict=PairVerdict.PAIRED,
            reason="the model holds the measured mode",
        )
        for mode, pole in enumerate(fit.model.poles[: fit.n_modes])
    ]
    return Pairs(rows=tuple(rows), labels=fit.labels)
