"""Prediction: FRFs at points that were not measured, with a band for what the measurements do not determine.

Sits after updating. The band is that of the update's ensemble: the covariance of the targets, and the null space of the
update.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.dofs import Dof, as_dof
from frf_ipz.errors import InputError
from frf_ipz.fe.response import compute_frfs
from frf_ipz.frf import FrfLabel, Measured
from frf_ipz.prediction.advice import explain_wide_band, wide_bands
from frf_ipz.prediction.ensemble import ModelEnsemble
from frf_ipz.prediction.prediction import Prediction
from frf_ipz.prediction.zeros import predicted_zeros

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.structure import ReducedModel
    from frf_ipz.updating.updated_model import UpdatedModel

BAND = (0.05, 0.95)


def predict_frfs(
    measured: Measured,
    updated_model: UpdatedModel,
    *,
    points: Sequence[Dof | str],
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
    """
    labels, updated = measured.labels, updated_model
    frequency_hz = np.asarray(measured.frequency_hz if frequency_hz is None else frequency_hz, float)
    if not labels:
        raise InputError("a prediction needs at least one measured FRF: its label says where the structure is excited")
    input_dofs = tuple(dict.fromkeys(label.input_dof for label in labels))
    predicted = tuple(FrfLabel(as_dof(point), dof, labels[0].quantity) for point in points for dof in input_dofs)
    s: ComplexArray = np.asarray(2j * np.pi * frequency_hz)
    band_rad_s = float(np.abs(s[0])), float(np.abs(s[-1]))
    lowest = float(np.abs(s[s != 0]).min())
    ensemble = ModelEnsemble(matrices=updated.ensemble, lowest_rad_s=lowest)
    low, high = _magnitude_bands(updated, ensemble, predicted, s)
    zeros, zero_std = predicted_zeros(updated.model, updated.ensemble, predicted, band_rad_s)
    warnings = tuple(
        explain_wide_band(band, updated.model, ensemble, labels, predicted[band.frf], frequency_hz, zeros)
        for band in wide_bands(frequency_hz, low, high)
    )
    return Prediction(
        frequency_hz=frequency_hz,
        labels=predicted,
        values=_evaluate(updated.model, predicted, s),
        nominal=_evaluate(updated.nominal, predicted, s),
        magnitude_low=low,
        magnitude_high=high,
        zeros=zeros,
        zero_std=zero_std,
        warnings=warnings,
    )


def _evaluate(model: ReducedModel, labels: Sequence[FrfLabel], s: ComplexArray) -> ComplexArray:
    """FRFs of a model, (n_lines, n_frfs); there may be no point of interest."""
    return compute_frfs(model, labels, s) if labels else np.zeros((len(s), 0), complex)


def _magnitude_bands(
    updated: UpdatedModel, ensemble: ModelEnsemble, labels: Sequence[FrfLabel], s: ComplexArray
) -> tuple[FloatArray, FloatArray]:
    bands = np.full((2, len(s), len(labels)), np.nan)
    if len(updated.ensemble):
        for number, label in enumerate(labels):
            output, force = updated.model.row(label.output_dof), updated.model.row(label.input_dof)
            magnitude = np.abs(ensemble.receptance(output, force, s) * s**label.quantity.power)
            bands[:, :, number] = np.quantile(magnitude, BAND, axis=0)
    return bands[0], bands[1]
