"""How well measured points are predicted from the others: each is left out of the expansion in turn."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, FloatArray
from frf_ipz.late_imports import import_late
from frf_ipz.numerics.noise_floor import above_noise
from frf_ipz.pairing.poles import measured_amplitudes
from frf_ipz.updating.shape_expansion.expanded_model import expand_modes, receptance
from frf_ipz.updating.shape_expansion.measured_shapes import gains_of_frfs, measured_shapes, side_with_more

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from scipy.optimize import brentq
    from scipy.special import stdtrit

    from frf_ipz.arrays import ComplexArray
    from frf_ipz.dofs import AnyDof
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.structure import ReducedModel
    from frf_ipz.updating.shape_expansion.wrong_gains import WrongGain
    from frf_ipz.updating.updated_model import UpdatedModel
else:
    brentq = import_late("scipy.optimize", "brentq")
    stdtrit = import_late("scipy.special", "stdtrit")

LINES = 300  # of the band, at equal ratios
FEWEST = 3  # points of a side: of two, one alone would tell the other's shape
MOST = 12  # points left out, evenly over the side
COVERED, COVERED_SQUARE = 0.9, 2.7055  # share of the modes that a band is to hold; that quantile of a normal square


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShapeErrors:
    """Errors of expanded shapes at a left-out point, one a mode.

    Parameters
    ----------
    difference : (n_modes,) array
        Measured minus expanded amplitudes.
    variance : (n_modes,) array
        That the expansion states.
    own_variance : (n_modes,) array
        Of what was measured there, by the gain and place of its transducer.
    """

    difference: FloatArray
    variance: FloatArray
    own_variance: FloatArray


def calibrate(errors: Sequence[ShapeErrors], *, n_points: int | None = None) -> float:
    """Give the factor on stated standard deviations with which they hold 90 % of the modes at a further point.

    What was measured at a left-out point has an error of its own, which a point of interest has not: it comes off.
    Errors of one point have much in common, so that few points tell the factor hardly: that of a further point has a
    Student distribution with as many degrees of freedom as there are points.

    Parameters
    ----------
    errors : sequence of ShapeErrors
        Of the points, taken together.
    n_points : int, optional
        How many tell by how much such a factor varies; as many where it is left out.

    Returns
    -------
    float
        1 or more.
    """
    squares = np.concatenate([each.difference**2 for each in errors])
    stated = np.concatenate([each.variance for each in errors])
    own = np.concatenate([each.own_variance for each in errors])

    def excess(logarithm: float) -> float:
        return float(np.quantile(squares / (np.exp(2 * logarithm) * stated + own), COVERED)) - COVERED_SQUARE

    of_few = float(stdtrit(n_points or len(errors), (1 + COVERED) / 2) / np.sqrt(COVERED_SQUARE))
    least = -np.log(of_few)
    if excess(least) <= 0.0:
        return 1.0
    alone = 0.5 * np.log(float(np.quantile(squares / stated, COVERED)) / COVERED_SQUARE)  # without errors of their own
    return of_few * float(np.exp(brentq(excess, least, alone + 1.0)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LeftOutPoints:
    """Errors at measured points, each predicted from the others.

    Parameters
    ----------
    points : tuple of Dof or PortDof
        Sensors, or excited DOFs: the side that has more.
    error_db : (n_points,) array
        Median over lines and FRFs, after one factor a point where the scale of the test is unknown.
    log_ratio : (n_points,) array
        Logarithm of measured over predicted amplitude, the median over the modes.
    errors : tuple of ShapeErrors
        Errors of the shapes there.
    is_told : (n_points,) bool array
        The other side of the test has the point too, and no other that could stand for it: reciprocity tells it.
    reciprocal : tuple of ShapeErrors
        The errors at points that both sides have, where only this side is left out.
    """

    points: tuple[AnyDof, ...]
    error_db: FloatArray
    log_ratio: FloatArray
    errors: tuple[ShapeErrors, ...]
    is_told: BoolArray
    reciprocal: tuple[ShapeErrors, ...]

    @property
    def errors_db(self) -> dict[AnyDof, float]:
        """Error of each point, dB."""
        return dict(zip(self.points, self.error_db.tolist(), strict=True))


def leave_points_out(
    fit: ModalFit,
    model: ReducedModel,
    *,
    error: float,
    scatter: float,
    wrong_gains: Mapping[AnyDof, WrongGain] | None = None,
) -> LeftOutPoints | None:
    """Predict each measured point from the others.

    Parameters
    ----------
    fit : ModalFit
        The fitted model of all FRFs.
    model : ReducedModel
        The model over which shapes are expanded.
    error : float
        Relative error of the measured amplitudes.
    scatter : float
        Standard deviation of the logarithms of measured frequencies about those of the model.
    wrong_gains : mapping of Dof or PortDof to WrongGain, optional
        Taken off what was measured at these points.

    Returns
    -------
    LeftOutPoints or None
        None where there are too few points.
    """
    points = side_with_more(fit)
    if len(points) < FEWEST:
        return None
    chosen = [points[place] for place in np.unique(np.linspace(0, len(points) - 1, MOST).round().astype(int))]
    s = _lines(fit)
    measured = _heard(fit, s) / gains_of_frfs(fit, wrong_gains or {}) * gains_of_frfs(fit, {})
    judge = partial(
        _judge, fit, model, error=error, scatter=scatter, wrong_gains=wrong_gains or {}, s=s, measured=measured
    )
    judged = {point: judge(point, _without(fit, point)) for point in chosen}
    known = {point: judgement for point, judgement in judged.items() if judgement is not None}
    if not known:
        return None
    beside = [judge(point, _without(fit, point, other_side=False)) for point in known if _is_on_both_sides(fit, point)]
    return LeftOutPoints(
        points=tuple(known),
        error_db=np.array([judgement.error_db for judgement in known.values()]),
        log_ratio=np.array([judgement.log_ratio for judgement in known.values()]),
        errors=tuple(judgement.errors for judgement in known.values()),
        is_told=np.array([_is_told(fit, point) for point in known], bool),
        reciprocal=tuple(judgement.errors for judgement in beside if judgement is not None),
    )


def errors_at_points(fit: ModalFit, updated: UpdatedModel) -> FloatArray:
    """Give the errors of an updated model at the points that it was given.

    Parameters
    ----------
    fit : ModalFit
        The fitted model of all FRFs.
    updated : UpdatedModel
        With its scale.

    Returns
    -------
    (n_points,) array
        As `LeftOutPoints` has them, dB; NaN for a point where nothing is heard.
    """
    points, s = side_with_more(fit), _lines(fit)
    measured, computed = _heard(fit, s), updated.compute_frfs(fit.labels, s)
    columns = [
        [number for number, label in enumerate(fit.labels) if point in (label.output_dof, label.input_dof)]
        for point in points
    ]
    is_known = fit.unknown_scale == "none"
    return np.array(
        [median_error_db(measured[:, frfs], computed[:, frfs], is_level_known=is_known) for frfs in columns]
    )


def _lines(fit: ModalFit) -> ComplexArray:
    low = max(fit.band_hz[0], float(fit.frequency_hz[fit.frequency_hz > 0][0]))
    return np.asarray(2j * np.pi * np.geomspace(low, fit.band_hz[1], LINES))


def _heard(fit: ModalFit, s: ComplexArray) -> ComplexArray:
    """Fitted FRFs; NaN where they do not stand above the noise that is left in them."""
    values = fit.model(s)
    lines = np.clip(np.searchsorted(fit.frequency_hz, s.imag / (2 * np.pi)), 0, len(fit.frequency_hz) - 1)
    return np.where(above_noise(np.abs(values), fit.value_std[lines]), values, np.nan)


def median_error_db(measured: ComplexArray, predicted: ComplexArray, *, is_level_known: bool) -> float:
    """Give the median difference of magnitudes.

    Parameters
    ----------
    measured, predicted : (n_lines, n_frfs) complex array
        FRFs of one point; NaN where nothing is heard.
    is_level_known : bool
        Where it is not, one factor is free: the median of the ratios.

    Returns
    -------
    float
        dB; NaN where nothing is heard in any.
    """
    heard = np.isfinite(measured)
    difference = 20 * np.log10(np.abs(predicted[heard]) / np.abs(measured[heard]))
    if not heard.any():
        return np.nan
    if not is_level_known:
        difference = difference - np.median(difference)
    return float(np.median(np.abs(difference)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Judgement:
    """A point predicted from the others: error, logarithm of a ratio, errors of shapes."""

    error_db: float
    log_ratio: float
    errors: ShapeErrors


def _judge(
    fit: ModalFit,
    model: ReducedModel,
    point: AnyDof,
    kept: BoolArray,
    *,
    error: float,
    scatter: float,
    wrong_gains: Mapping[AnyDof, WrongGain],
    s: ComplexArray,
    measured: ComplexArray,
) -> _Judgement | None:
    """Predict a point from the FRFs that are kept; None where they do not tell it."""
    is_output, ends = _ends(fit, point)
    others = measured_shapes(fit, kept=kept, wrong_gains=wrong_gains)
    if others is None:
        return None
    is_known = fit.unknown_scale == "none"
    modes = expand_modes(model, others, error=error, scatter=scatter, is_scale_known=is_known)
    row = model.row(point) @ modes.model.shapes
    at_point = np.array([row @ shape.amplitudes for shape in modes.shapes])
    variance = np.array([row @ shape.covariance @ row for shape in modes.shapes])
    opposite = others.inputs if is_output else others.outputs
    frfs = [number for number, (end, partner) in enumerate(ends) if end == point and partner in opposite]
    if not np.isfinite(measured[:, frfs]).any():
        return None
    predicted, at_partners = [], []
    for number in frfs:
        partner, place = ends[number][1], opposite.index(ends[number][1])
        at_partner = np.array(
            [shape.sign * (shape.at_inputs if is_output else shape.at_outputs)[place] for shape in modes.shapes]
        )
        rest = row * (model.row(partner) @ modes.model.shapes)
        predicted.append(receptance(modes, at_point, at_partner, rest, s) * s ** fit.labels[number].quantity.power)
        at_partners.append(at_partner)
    amplitudes = (measured_amplitudes(fit)[0].real / gains_of_frfs(fit, wrong_gains))[:, frfs]
    partners = np.stack(at_partners, axis=1)
    shape = np.sum(amplitudes * partners, axis=1) / np.maximum(np.sum(partners**2, axis=1), np.finfo(float).tiny)
    large = np.abs(at_point) >= np.median(np.abs(at_point))
    # as the expansion has it: an error of place counts by the slope, so that it is as large where a mode hardly moves
    at_others = np.stack([shape.at_outputs if is_output else shape.at_inputs for shape in modes.shapes])
    typical = np.mean(np.column_stack([at_others, shape]) ** 2, axis=1)
    doubt = wrong_gains[point].std ** 2 if point in wrong_gains else 0.0
    return _Judgement(
        error_db=median_error_db(measured[:, frfs], np.stack(predicted, axis=1), is_level_known=is_known),
        log_ratio=float(np.median(np.log(np.abs(shape[large] / at_point[large])))),
        errors=ShapeErrors(
            difference=shape - at_point,
            variance=variance,
            own_variance=error**2 * typical + doubt * at_point**2,
        ),
    )


def _ends(fit: ModalFit, point: AnyDof) -> tuple[bool, list[tuple[AnyDof, AnyDof]]]:
    """Tell whether a point is a sensor, and give the ends of all FRFs, that of its side first."""
    is_output = any(label.output_dof == point for label in fit.labels)
    pairs = [(label.output_dof, label.input_dof) for label in fit.labels]
    return is_output, pairs if is_output else [(force, output) for output, force in pairs]


def _without(fit: ModalFit, point: AnyDof, *, other_side: bool = True) -> BoolArray:
    """FRFs without a point; what it does on the other side is left out too where others are there."""
    ends = _ends(fit, point)[1]
    there = np.array([end != point for end, _ in ends], bool)
    nowhere = there & np.array([partner.unsigned != point.unsigned for _, partner in ends], bool)
    return nowhere if other_side and nowhere.any() else there


def _is_told(fit: ModalFit, point: AnyDof) -> bool:
    """Tell whether the other side has a point that cannot be left out there, as nothing else is on that side."""
    return all(partner.unsigned == point.unsigned for _, partner in _ends(fit, point)[1])


def _is_on_both_sides(fit: ModalFit, point: AnyDof) -> bool:
    return any(partner.unsigned == point.unsigned for _, partner in _ends(fit, point)[1])
