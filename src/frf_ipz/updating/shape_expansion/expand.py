"""The step that puts measured shapes, expanded over the model, in the place of an update that does not meet them.

What is missing in a model need not be a change of its matrices: masses at its ends, something hidden that splits a
mode. Both ways are judged at measured points that are left out: half of them by half for the update, one by one for the
expansion, which costs less. An update that is as near there as any control needs is not replaced, for it names what
has changed; another one is where the expansion is nearer by more than the errors at the points scatter.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

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
    COVERED,
    FEWEST,
    LeftOutPoints,
    calibrate,
    errors_at_points,
    leave_points_out,
)
from frf_ipz.updating.shape_expansion.measured_shapes import gains_of_frfs, measured_shapes, side_with_more
from frf_ipz.updating.shape_expansion.wrong_gains import WrongGain, find_wrong_gains

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping

    import pandas as pd
    from scipy.special import stdtrit

    from frf_ipz.arrays import BoolArray, FloatArray
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
    stdtrit = import_late("scipy.special", "stdtrit")

MOST_ENDS = 100  # sensors and excited DOFs
NO_GAIN = WrongGain(log_gain=0.0, std=0.0)


def with_expanded_shapes(
    updated: UpdatedModel,
    fit: ModalFit,
    problem: UpdateProblem,
    *,
    update_without: Callable[[Collection[AnyDof]], UpdatedModel],
    geometry: Geometry | None,
    options: UpdateOptions,
) -> UpdatedModel:
    """Take expanded measured shapes where they predict left-out points better than the update does.

    Parameters
    ----------
    updated : UpdatedModel
        With its scale.
    fit : ModalFit
        The fitted model of all FRFs.
    problem : UpdateProblem
        The nominal model and the targets.
    update_without : callable
        Updates the nominal model without the FRFs of some points.
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
    if measured is None or not _is_expandable(fit, measured):
        return updated
    without = _left_out_of_update(fit, update_without)
    if not _may_exceed(without, SIXTH * GAIN_MARGIN_DB):
        return updated
    is_known = fit.unknown_scale == "none"
    places = attachment_places(problem.model, measured, geometry)
    _, is_inner = inner_points(side_with_more(fit), side_with_more(fit), problem.model.expanded_dofs, geometry)
    between = tuple(point for point, lies_inside in zip(side_with_more(fit), is_inner, strict=True) if lies_inside)
    causes = _find_causes(fit, problem.model, measured, tuple(dict.fromkeys(((), places))), between)
    loaded, measured, wrong_gains, left_out = _least_cause(causes)
    if left_out is None or not _is_nearer(left_out, dict(zip(side_with_more(fit), without, strict=True))):
        return updated
    modes = expand_modes(loaded.model, measured, error=loaded.error, scatter=loaded.scatter, is_scale_known=is_known)
    if is_known and abs(20 * np.log10(modes.gain)) > HALF * GAIN_MARGIN_DB:
        return updated  # a scale that is so far off where it is known is a mistake, which must show
    inner_nodes, is_inner = inner_points(left_out.points, side_with_more(fit), loaded.model.expanded_dofs, geometry)
    inner, anywhere = _calibrations(left_out, is_inner)
    model, ensemble = build_expanded_model(
        loaded.model, modes, count=options.ensemble, calibration=anywhere, seed=options.seed
    )
    if not _have_mass(ensemble):
        return updated
    gains = [wrong_gains.get(point, NO_GAIN) for point in left_out.points]
    corrected = replace(fit, gain=gains_of_frfs(fit, wrong_gains)) if wrong_gains else fit
    expansion = ShapeExpansion(
        points=tuple(point.name for point in left_out.points),
        ratio=np.exp(left_out.log_ratio + [gain.log_gain for gain in gains]),
        error_db=left_out.error_db,
        updated_error_db=without[np.isfinite(without)],
        stiffness_ratio=loaded.stiffness_ratio,
        masses=loaded.masses,
        split=_split_modes(modes),
        is_level_known=is_known,
        inner_nodes=inner_nodes,
        inner_spread=inner / anywhere,
        wrong_gains=tuple((point.name, gain.log_gain, gain.std) for point, gain in wrong_gains.items()),
        reciprocal_spread=calibrate(left_out.reciprocal) / anywhere if left_out.reciprocal else 1.0,
    )
    return replace(
        updated,
        model=model,
        after=replace(problem, model=model).nearest_roots(model, problem.values),
        ensemble=ensemble,
        unmet=(),
        parts=pd.DataFrame(),
        scale=fit_scale(
            corrected, _pairs_of_measured_modes(fit), model, fit.model.poles[: fit.n_modes], ensemble, local_std=0.0
        ),
        expansion=expansion,
    )


def _is_expandable(fit: ModalFit, measured: MeasuredShapes) -> bool:
    n_ends = len(measured.outputs) + len(measured.inputs)
    return len(side_with_more(fit)) >= FEWEST and n_ends <= MOST_ENDS


def _have_mass(ensemble: FloatArray) -> bool:
    """Tell whether members are structures: shapes that scatter by far more than they are large leave no mass."""
    return bool((np.linalg.matrix_rank(ensemble[:, 0], hermitian=True) == ensemble.shape[-1]).all())


def _left_out_of_update(fit: ModalFit, update_without: Callable[[Collection[AnyDof]], UpdatedModel]) -> FloatArray:
    """Errors of an update at points whose half, every other one, it was not given, dB; NaN where nothing is heard."""
    points = side_with_more(fit)
    errors = np.full(len(points), np.nan)
    for first in (0, 1):
        errors[first::2] = errors_at_points(fit, update_without(points[first::2]))[first::2]
    return errors


def _may_exceed(errors_db: FloatArray, limit_db: float) -> bool:
    """Tell whether the mean error of points may lie above a limit, by Student's distribution."""
    known = errors_db[np.isfinite(errors_db)]
    return len(known) > 1 and float(np.mean(known)) + _chance(known) > limit_db


def _chance(values: FloatArray) -> float:
    """How far the mean of some values may be off by chance."""
    return float(stdtrit(len(values) - 1, COVERED) * np.std(values, ddof=1) / np.sqrt(len(values)))


def _is_nearer(left_out: LeftOutPoints, of_update: Mapping[AnyDof, float]) -> bool:
    """Tell whether an expansion is nearer at left-out points, by more than Student's distribution gives by chance."""
    ratios = np.log([of_update[point] / error for point, error in zip(left_out.points, left_out.error_db, strict=True)])
    ratios = ratios[np.isfinite(ratios)]
    return len(ratios) > 1 and float(np.mean(ratios)) > _chance(ratios)


class _Cause(NamedTuple):
    """What is taken to be wrong: masses that the model lacks, gains of the test; and how points then follow."""

    loaded: LoadedModel
    measured: MeasuredShapes
    wrong_gains: dict[AnyDof, WrongGain]
    left_out: LeftOutPoints | None


def _least_cause(causes: list[_Cause]) -> _Cause:
    """Take masses only where left-out points follow better with them, by more than chance.

    Masses fit errors of gain and place as well, and then bend the shapes between the points.
    """
    least = causes[0]
    for cause in causes[1:]:
        if least.left_out is None or (
            cause.left_out is not None and _is_nearer(cause.left_out, least.left_out.errors_db)
        ):
            least = cause
    return least


def _find_causes(
    fit: ModalFit,
    model: ReducedModel,
    measured: MeasuredShapes,
    causes: tuple[tuple[AnyDof, ...], ...],
    between: tuple[AnyDof, ...],
) -> list[_Cause]:
    """Find masses at the places of each cause, and gains that are wrong whatever the cause.

    Each spoils what the other is found from, so masses are found again once gains are known.
    """
    loaded = [find_attached_masses(model, measured, places) for places in causes]
    wrong: list[dict[AnyDof, WrongGain]] = [{} for _ in causes]
    if between and fit.unknown_scale == "none":
        wrong = [find_wrong_gains(each.model, measured, between, scatter=each.scatter) for each in loaded]
        common = set.intersection(*(set(each) for each in wrong))
        wrong = [{point: gain for point, gain in each.items() if point in common} for each in wrong]
    found = []
    for places, each, gains in zip(causes, loaded, wrong, strict=True):
        corrected = measured_shapes(fit, wrong_gains=gains) if gains else None
        cause = each if corrected is None else find_attached_masses(model, corrected, places)
        left_out = leave_points_out(fit, cause.model, error=cause.error, scatter=cause.scatter, wrong_gains=gains)
        found.append(_Cause(cause, corrected or measured, gains, left_out))
    return found


def _calibrations(left_out: LeftOutPoints, is_inner: BoolArray) -> tuple[float, float]:
    """Factors on standard deviations between measured points, and anywhere.

    Points that reciprocity tells speak for no others, unless there are only such. Where it is not known which points
    lie between others, the worst one speaks for all.
    """
    counts = ~left_out.is_told if not left_out.is_told.all() else np.ones(len(is_inner), bool)
    inner = [errors for errors, use in zip(left_out.errors, counts & is_inner, strict=True) if use]
    outer = [errors for errors, use in zip(left_out.errors, counts & ~is_inner, strict=True) if use]
    if not inner:
        worst = max(calibrate([errors], n_points=len(outer)) for errors in outer)
        return worst, worst
    between = calibrate(inner)
    return between, max(between, calibrate(outer, n_points=len(inner) + len(outer))) if outer else between


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
