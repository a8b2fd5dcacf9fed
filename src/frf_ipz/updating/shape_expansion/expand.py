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
from frf_ipz.updating.expansion import ShapeExpansion
from frf_ipz.updating.scale import fit_scale
from frf_ipz.updating.shape_expansion.attached_masses import attachment_places, find_attached_masses
from frf_ipz.updating.shape_expansion.between_points import inner_points
from frf_ipz.updating.shape_expansion.expanded_model import ExpandedModes, build_expanded_model, expand_modes
from frf_ipz.updating.shape_expansion.left_out_points import (
    FEWEST,
    LeftOutPoints,
    errors_at_points,
    leave_points_out,
    side_with_more,
)
from frf_ipz.updating.shape_expansion.measured_shapes import measured_shapes

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.structure import Geometry
    from frf_ipz.updating.options import UpdateOptions
    from frf_ipz.updating.problem import UpdateProblem
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
    places = attachment_places(problem.model, measured, geometry)
    causes = [find_attached_masses(problem.model, measured, tried) for tried in dict.fromkeys(((), places))]
    left_out_of = [leave_points_out(fit, loaded.model, error=loaded.error) for loaded in causes]
    errors = [np.inf if left_out is None else float(np.median(left_out.error_db)) for left_out in left_out_of]
    best = int(np.argmin(errors))
    loaded, left_out = causes[best], left_out_of[best]
    if left_out is None or errors[best] >= own_db:
        return updated
    modes = expand_modes(loaded.model, measured, error=loaded.error, is_scale_known=fit.unknown_scale == "none")
    if fit.unknown_scale == "none" and abs(20 * np.log10(modes.gain)) > HALF * GAIN_MARGIN_DB:
        return updated  # a scale that is so far off where it is known is a mistake, which must show
    model, ensemble = build_expanded_model(
        loaded.model, modes, count=options.ensemble, calibration=float(left_out.calibration.max()), seed=options.seed
    )
    inner_nodes, inner_spread = inner_points(left_out, side_with_more(fit), loaded.model.expanded_dofs, geometry)
    expansion = ShapeExpansion(
        points=tuple(point.name for point in left_out.points),
        ratio=np.exp(left_out.log_ratio),
        error_db=left_out.error_db,
        updated_error_db=own[np.isfinite(own)],
        stiffness_ratio=loaded.stiffness_ratio,
        masses=loaded.masses,
        split=_split_modes(modes),
        is_level_known=fit.unknown_scale == "none",
        inner_nodes=inner_nodes,
        inner_spread=inner_spread,
        reciprocal_spread=_reciprocal_spread(left_out),
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


def _reciprocal_spread(left_out: LeftOutPoints) -> float:
    """Tell by how much errors exceed what is stated where the other side has the point, over those at any other."""
    seen = left_out.reciprocal[np.isfinite(left_out.reciprocal)]
    return float(seen.max() / left_out.calibration.max()) if seen.size else 1.0


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
