"""Prediction: FRFs at points that were not measured, with a band for what the measurements do not determine.

Sits after updating. The band is that of the update's ensemble (the covariance of the targets, and the null space of the
update), widened by what the updated model misses of the measured FRFs, and by the gains where the scale is unknown.
FRFs are in the unit of the measurement: where its scale is unknown, the model's times the fitted gain.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from frf_ipz.arguments import require_each, require_type, take_array
from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.dofs import AnyDof, as_dofs
from frf_ipz.errors import InputError
from frf_ipz.fe.response import compute_frfs
from frf_ipz.frf import FrfLabel, Measured, require_measured
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.numerics.one_thread import on_one_thread
from frf_ipz.prediction.advice import explain_wide_bands, wide_bands
from frf_ipz.prediction.ensemble import ModelEnsemble
from frf_ipz.prediction.model_error import ModelError, as_ensemble, estimate_model_error, frf_rows, frf_sizes
from frf_ipz.prediction.prediction import Prediction
from frf_ipz.prediction.suspension import Suspension, find_suspension, on_suspension
from frf_ipz.prediction.zeros import predicted_zeros
from frf_ipz.updating.updated_model import UpdatedModel

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from frf_ipz.structure import ReducedModel
    from frf_ipz.updating.expansion import ShapeExpansion

BAND = (0.05, 0.95)


@on_one_thread
def predict_frfs(
    measured: Measured,
    updated_model: UpdatedModel,
    *,
    points: Sequence[AnyDof | str],
    frequency_hz: FloatArray | None = None,
) -> Prediction:
    """Predict FRFs from every excited DOF of the test to points of interest.

    Parameters
    ----------
    measured : ModalFit or FrfSet
        What was measured: its excited DOFs are used, and the quantity of its first FRF.
    updated_model : UpdatedModel
        The updated model.
    points : sequence of Dof or str
        Points of interest: any DOF of the reduced model's expansion, retained or not. Signs count.
    frequency_hz : (n_lines,) array, optional
        Lines, Hz; those that were fitted or measured where they are left out.

    Returns
    -------
    Prediction
        One FRF a point and excited DOF; bands are NaN where the method of updating gives no ensemble.

    Raises
    ------
    InputError
        If nothing was measured, or the model does not know a point.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    >>> updated_model = frf_ipz.update_model(fit, reduced_model)
    >>> frf_ipz.predict_frfs(fit, updated_model, points=["9:+z"], frequency_hz=np.array([10.0, 20.0]))
    Prediction: 9:+z / 11:+z on 2 lines from 10 to 20 Hz
    """
    require_measured(measured)
    require_type("updated_model", updated_model, UpdatedModel)
    labels = measured.connections
    suspension, updated = _as_tested(measured, updated_model)
    frequency_hz = take_array(
        "the frequencies", measured.frequency_hz if frequency_hz is None else frequency_hz, np.float64
    )
    if not len(frequency_hz) or (frequency_hz < 0).any() or not frequency_hz.any():
        raise InputError(f"the frequencies are {frequency_hz}; at least one above 0 Hz is needed, and none below")
    if not labels:
        raise InputError("a prediction needs at least one measured FRF: its label says where the structure is excited")
    input_dofs = tuple(dict.fromkeys(label.input_dof for label in labels))
    predicted = tuple(FrfLabel(point, dof, labels[0].quantity) for point in as_dofs(points) for dof in input_dofs)
    s: ComplexArray = np.asarray(2j * np.pi * frequency_hz)
    band_rad_s = float(np.abs(s[0])), float(np.abs(s[-1]))
    ensemble = _ensemble(updated, s)
    low, high = _magnitude_bands(measured, updated, ensemble, predicted, s)
    zeros, zero_std = predicted_zeros(updated.model, ensemble, predicted, band_rad_s)
    statement = updated.scale.statement if predicted else ""
    bands = wide_bands(frequency_hz, low, high)
    notes = explain_wide_bands(bands, updated.model, ensemble, labels, predicted, frequency_hz, zeros)
    hung = "" if suspension is None else suspension.statement
    warnings = (*filter(None, (statement, hung)), *notes)
    return Prediction(
        frequency_hz=frequency_hz,
        labels=predicted,
        values=_evaluate(updated.model, predicted, s) * updated.scale.gains(predicted),
        nominal=_evaluate(updated.nominal, predicted, s) * updated.nominal_scale.gains(predicted),
        magnitude_low=low,
        magnitude_high=high,
        zeros=zeros,
        zero_std=zero_std,
        warnings=warnings,
        relative=tuple(place for place, label in enumerate(predicted) if not updated.scale.knows_level(label)),
    )


def _evaluate(model: ReducedModel, labels: Sequence[FrfLabel], s: ComplexArray) -> ComplexArray:
    """FRFs of a model, (n_lines, n_frfs); there may be no point of interest."""
    return compute_frfs(model, labels, s) if labels else np.zeros((len(s), 0), complex)


@on_one_thread
def band_of_magnitudes(
    measured: Measured, updated_model: UpdatedModel, *, labels: Sequence[FrfLabel], s: ComplexArray
) -> tuple[FloatArray, FloatArray]:
    """Give the 90 % band of any FRFs of an updated model, without the rest of a prediction.

    Parameters
    ----------
    measured : ModalFit or FrfSet
        What was measured.
    updated_model : UpdatedModel
        The updated model.
    labels : sequence of FrfLabel
        Which FRFs; they need not be excited where the test excites.
    s : (n_lines,) complex array
        Lines, rad/s; not all 0.

    Returns
    -------
    low, high : (n_lines, n_frfs) array
        Of the magnitudes; NaN where the method of updating gives no ensemble.

    Raises
    ------
    InputError
        If there is no line above 0, or the model does not know a DOF.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> updated_model = frf_ipz.update_model(fit, frf_ipz.reduce_model(fit, beam, points=["9:+z"]))
    >>> label = frf_ipz.FrfLabel(frf_ipz.Dof(6, "z"), frf_ipz.Dof(9, "z"), frf_ipz.FrfQuantity.ACCELERANCE)
    >>> low, high = frf_ipz.band_of_magnitudes(fit, updated_model, labels=[label], s=2j * np.pi * lines)
    >>> bool(np.all(low <= high))
    True
    """
    require_measured(measured)
    require_type("updated_model", updated_model, UpdatedModel)
    require_each("labels", labels, FrfLabel)
    s = take_array("the lines", s, np.complex128)
    if not s.any():
        raise InputError("all lines are 0; at least one above 0 is needed")
    _, updated = _as_tested(measured, updated_model)
    return _magnitude_bands(measured, updated, _ensemble(updated, s), labels, s)


_hung: WeakKeyDictionary[UpdatedModel, tuple[Measured, tuple[Suspension, UpdatedModel] | None]] = WeakKeyDictionary()


def _as_tested(measured: Measured, updated: UpdatedModel) -> tuple[Suspension | None, UpdatedModel]:
    """Give the updated model on the suspension that was measured, and what is known of it."""
    known = _hung.get(updated)
    if known is None or known[0] is not measured:
        suspension = find_suspension(measured, updated)
        hung = None if suspension is None else (suspension, on_suspension(updated, suspension))
        known = _hung[updated] = measured, hung
    return known[1] or (None, updated)


_ensembles: WeakKeyDictionary[UpdatedModel, ModelEnsemble] = WeakKeyDictionary()  # roots of all members cost the most


def _ensemble(updated: UpdatedModel, s: ComplexArray) -> ModelEnsemble:
    """Give the ensemble in modes: that of before where a model is asked for other FRFs."""
    lowest_rad_s = float(np.abs(s[s != 0]).min())
    known = _ensembles.get(updated)
    if known is None or known.lowest_rad_s != lowest_rad_s:
        known = _ensembles[updated] = ModelEnsemble(matrices=updated.ensemble, lowest_rad_s=lowest_rad_s)
    return known


def _magnitude_bands(
    measured: Measured, updated: UpdatedModel, ensemble: ModelEnsemble, labels: Sequence[FrfLabel], s: ComplexArray
) -> tuple[FloatArray, FloatArray]:
    bands = np.full((2, len(s), len(labels)), np.nan)
    if len(updated.ensemble):
        error = _model_error(measured, updated, ensemble, s)
        centre = as_ensemble(updated, ensemble.lowest_rad_s)
        sizes = frf_sizes(updated, labels, s, centre) if error is not None and labels else None
        gains, powers = np.abs(updated.scale.gains(tuple(labels))), np.array([label.quantity.power for label in labels])
        drawn = [updated.scale.drawn(label, len(updated.ensemble)) for label in labels]
        for lines, frfs, block in _receptances(measured, updated, (ensemble, centre), labels, s):
            block *= s[lines, None] ** powers[frfs]
            if error is not None and sizes is not None:
                block += error.draw(len(block))[:, None, None] * (error.ratio[lines, None] * sizes[lines, frfs])
            magnitude = np.abs(block)
            magnitude *= (gains[frfs] * np.stack(drawn[frfs], axis=1))[:, None]
            bands[:, lines, frfs] = _limits(magnitude)
    return bands[0], bands[1]


def _limits(magnitude: FloatArray) -> FloatArray:
    """Quantiles `BAND` over the members, (2, ...), as `np.quantile` has them: to sort them all takes a third of it."""
    magnitude.sort(axis=0)
    places = np.array(BAND) * (len(magnitude) - 1)
    below = places.astype(int)
    low, high = magnitude[below], magnitude[np.minimum(below + 1, len(magnitude) - 1)]
    return np.asarray(low + (places - below).reshape(-1, *[1] * (magnitude.ndim - 1)) * (high - low))


_errors: WeakKeyDictionary[UpdatedModel, tuple[ModalFit, ComplexArray, ModelError]] = WeakKeyDictionary()


def _model_error(
    measured: Measured, updated: UpdatedModel, ensemble: ModelEnsemble, s: ComplexArray
) -> ModelError | None:
    """Give what the model cannot express: that of before where a model is asked for other FRFs on the same lines."""
    if not isinstance(measured, ModalFit) or not measured.labels:
        return None
    known = _errors.get(updated)
    if known is None or known[0] is not measured or not np.array_equal(known[1], s):
        known = _errors[updated] = measured, s, estimate_model_error(measured, updated, ensemble, s)
    return known[2]


def _receptances(
    measured: Measured,
    updated: UpdatedModel,
    models: tuple[ModelEnsemble, ModelEnsemble],
    labels: Sequence[FrfLabel],
    s: ComplexArray,
) -> Iterator[tuple[slice, slice, ComplexArray]]:
    """Receptances of an ensemble, some at a time; of measured shapes with the spread about its centre that is due."""
    (ensemble, centre), rows, expansion = models, frf_rows(updated, labels), updated.expansion
    if expansion is None:
        yield from ensemble.receptances(*rows, s)
        return
    due = _due_spread(measured, expansion, labels)
    centres = centre.receptances(*rows, s)
    for (lines, frfs, block), (_, _, middle) in zip(ensemble.receptances(*rows, s), centres, strict=True):
        yield lines, frfs, middle + due[frfs] * (block - middle)


def _due_spread(measured: Measured, expansion: ShapeExpansion, labels: Sequence[FrfLabel]) -> FloatArray:
    """Factor on the ensemble's spread that is due in each FRF: the larger of those at its two ends.

    What the other side of the test measured is known as well as reciprocity holds, of which measured points tell that
    are on both sides: sensors see more than the motion that excites them.
    """
    outputs = {label.output_dof.unsigned for label in measured.connections}
    inputs = {label.input_dof.unsigned for label in measured.connections}

    def at(dof: AnyDof, known: set[AnyDof], opposite: set[AnyDof]) -> float:
        if dof.unsigned in known:
            return expansion.inner_spread
        return expansion.reciprocal_spread if dof.unsigned in opposite else expansion.spread_at(dof)

    dues = [(at(label.output_dof, outputs, inputs), at(label.input_dof, inputs, outputs)) for label in labels]
    due: FloatArray = np.array(dues, float).reshape(-1, 2).max(axis=1)
    return due
