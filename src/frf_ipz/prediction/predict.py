"""Prediction: FRFs at points that were never measured, with a band for what the measurements leave open.

Sits after updating. The band is that of the update's ensemble: the covariance of the targets, and the null space of the
update.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.errors import InputError
from frf_ipz.fe.response import model_frfs
from frf_ipz.frf import FrfLabel
from frf_ipz.prediction.advice import explain_wide_band, wide_bands
from frf_ipz.prediction.ensemble import ModelEnsemble
from frf_ipz.prediction.prediction import Prediction
from frf_ipz.prediction.zeros import predicted_zeros

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.dofs import Dof
    from frf_ipz.structure import ReducedModel
    from frf_ipz.updating.updated_model import UpdatedModel

BAND = (0.05, 0.95)


def predict_frfs(
    updated: UpdatedModel, points: Sequence[Dof], labels: Sequence[FrfLabel], frequency_hz: FloatArray
) -> Prediction:
    """Predict FRFs from every blow of the test to points of interest.

    Parameters
    ----------
    updated : UpdatedModel
        The updated model.
    points : sequence of Dof
        Where; any DOF that the reduced model knows, retained or not. Signs count.
    labels : sequence of FrfLabel
        What was measured: its blows are used, and the quantity of its first FRF.
    frequency_hz : (n_lines,) array
        Lines, Hz.

    Returns
    -------
    Prediction
        One FRF a point and blow; bands are NaN where the method of updating says nothing of what remains open.

    Raises
    ------
    InputError
        If nothing was measured, or the model does not know a point.
    """
    if not labels:
        raise InputError("a prediction needs at least one measured FRF: it says where the structure is struck")
    records = tuple(dict.fromkeys(label.input_dof for label in labels))
    wanted = tuple(FrfLabel(point, blow, labels[0].quantity) for point in points for blow in records)
    s = 2j * np.pi * np.asarray(frequency_hz, float)
    band = float(np.abs(s[0])), float(np.abs(s[-1]))
    lowest = float(np.abs(s[s != 0]).min())
    members = ModelEnsemble(ensemble=updated.ensemble, lowest_rad_s=lowest)
    low, high = _bands(updated, members, wanted, s)
    zeros, zero_std = predicted_zeros(updated.model, updated.ensemble, wanted, band)
    warnings = tuple(
        explain_wide_band(stretch, updated.model, members, labels, wanted[stretch.frf], frequency_hz, zeros)
        for stretch in wide_bands(frequency_hz, low, high)
    )
    return Prediction(
        frequency_hz=np.asarray(frequency_hz, float),
        labels=wanted,
        values=_evaluated(updated.model, wanted, s),
        nominal=_evaluated(updated.nominal, wanted, s),
        magnitude_low=low,
        magnitude_high=high,
        zeros=zeros,
        zero_std=zero_std,
        warnings=warnings,
    )


def _evaluated(model: ReducedModel, labels: Sequence[FrfLabel], s: ComplexArray) -> ComplexArray:
    """FRFs of a model, (n_lines, n_frfs); there may be no point of interest."""
    return model_frfs(model, labels, s) if labels else np.zeros((len(s), 0), complex)


def _bands(
    updated: UpdatedModel, members: ModelEnsemble, labels: Sequence[FrfLabel], s: ComplexArray
) -> tuple[FloatArray, FloatArray]:
    bands = np.full((2, len(s), len(labels)), np.nan)
    if len(updated.ensemble):
        for number, label in enumerate(labels):
            output, force = updated.model.row(label.output_dof), updated.model.row(label.input_dof)
            magnitude = np.abs(members.receptance(output, force, s) * s**label.quantity.power)
            bands[:, :, number] = np.quantile(magnitude, BAND, axis=0)
    return bands[0], bands[1]
