"""Back to the nominal model, where an update has made the agreement with the measured FRFs worse.

An update moves poles and zeros to those that were measured. Where some are paired wrongly (many light local modes in
few sensors), the FRFs in between move away from the measurement. So the median deviation of the measured FRFs, in dB,
is compared before and after; the noise of the fitted FRFs is what it may grow by without meaning anything. A factor
that all FRFs share is taken off: a level that is wrong, of units or of the mass, is no work of the update. It is the
same one before and after, so what amplitudes of modes differ by in level between the two is left on the one that is
farther from the test's: an update that changes the level of FRFs that were right has bent shapes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.fe.response import compute_frfs
from frf_ipz.late_imports import import_late
from frf_ipz.numerics.noise_floor import above_noise
from frf_ipz.updating.updated_model import UpdatedModel, UpdateStatus

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.structure import ReducedModel
    from frf_ipz.updating.scale import MeasuredScale
else:
    pd = import_late("pandas")

DB = 20.0 / np.log(10.0)  # of a small relative deviation


def keep_if_better(updated: UpdatedModel, fit: ModalFit) -> UpdatedModel:
    """Keep an updated model, or fall back to the nominal one where that is nearer to the measured FRFs.

    Parameters
    ----------
    updated : UpdatedModel
        The result of a method, with its scales.
    fit : ModalFit
        The fitted model of the measured FRFs.

    Returns
    -------
    UpdatedModel
        As it was; or the nominal model with the spread of the ensemble around it and a warning, its scale still to be
        fitted.
    """
    if not fit.labels or updated.model is updated.nominal or not len(updated.after):
        return updated
    models, scales = (updated.nominal, updated.model), (updated.nominal_scale, updated.scale)
    before_db, after_db = (
        median_deviation_db(fit, model, np.abs(scale.gains(fit.labels)), level_db=level_db)
        for model, scale, level_db in zip(models, scales, _changed_db(*scales), strict=True)
    )
    if not after_db > before_db + _noise_db(fit):
        return updated
    nominal = updated.nominal
    return replace(
        updated,
        model=nominal,
        status=UpdateStatus.NO_BETTER,
        after=updated.before,
        ensemble=_around_nominal(updated),
        parts=pd.DataFrame(),
        warnings=(
            *updated.warnings,
            f"with the update the model is {after_db:.2g} dB off the measured FRFs (median), without it "
            f"{before_db:.2g} dB: it is taken as it was before. Some poles or zeros may be paired wrongly: look at the "
            "pairs, measure at more points, or set a narrower [fit] band_hz",
        ),
    )


def _changed_db(nominal: MeasuredScale, updated: MeasuredScale) -> tuple[float, float]:
    """Levels of the nominal and the updated model over that of the one that is nearer to the test, dB.

    0 as far as they differ by no more than their deviation.
    """
    before, after = (-DB * float(np.log(scale.level)) for scale in (nominal, updated))
    std = DB * float(np.hypot(nominal.level_std, updated.level_std))
    change = float(np.copysign(max(abs(after - before) - std, 0.0), after - before))
    return (-change, 0.0) if abs(before) > abs(after) else (0.0, change)


def median_deviation_db(
    fit: ModalFit, model: ReducedModel, gains: FloatArray | None = None, *, level_db: float = 0.0
) -> float:
    """Tell how far a model is from the measured FRFs.

    Parameters
    ----------
    fit : ModalFit
        The fitted model of the measured FRFs.
    model : ReducedModel
        The model.
    gains : (n_frfs,) array, optional
        Of the measured FRFs over it; 1 where they are left out.
    level_db : float
        Of the model, dB, that is none of the factor that all FRFs share.

    Returns
    -------
    float
        Median over all lines above their noise, beside one factor that all FRFs share, dB; 0 where there is none.
    """
    s, measured, is_heard = _heard(fit)
    if not is_heard.any():
        return 0.0
    values = np.abs(compute_frfs(model, fit.labels, s) * (1.0 if gains is None else gains))[is_heard]
    off_db = DB * np.log(np.maximum(values, np.finfo(float).tiny) / measured[is_heard])
    return float(np.median(np.abs(off_db - np.median(off_db) + level_db)))


def _heard(fit: ModalFit) -> tuple[ComplexArray, FloatArray, BoolArray]:
    """Lines, rad/s, magnitudes of the fitted FRFs there, and which of them stand above their noise."""
    s: ComplexArray = np.asarray(2j * np.pi * fit.frequency_hz)
    measured = np.abs(fit.model(s))
    return s, measured, above_noise(measured, fit.value_std)


def _noise_db(fit: ModalFit) -> float:
    """Median of the noise of the fitted FRFs, on the lines that stand above it, dB."""
    _, measured, is_heard = _heard(fit)
    return float(np.median(DB * fit.value_std[is_heard] / measured[is_heard])) if is_heard.any() else 0.0


def _around_nominal(updated: UpdatedModel) -> FloatArray:
    """Move the ensemble to the nominal model; a member that is no structure there becomes the nominal model."""
    nominal, model = updated.nominal, updated.model
    centre = np.stack([nominal.mass, nominal.damping, nominal.stiffness])
    moved = updated.ensemble + (centre - np.stack([model.mass, model.damping, model.stiffness]))
    for place, (mass, _, stiffness) in enumerate(moved):
        lowest = np.linalg.eigvalsh(np.stack([mass, stiffness]))[:, 0]
        allowed = np.linalg.eigvalsh(np.stack([nominal.mass, nominal.stiffness]))[:, [0, -1]]
        if lowest[0] <= 0.0 or lowest[1] < min(allowed[1, 0], 0.0) - np.finfo(float).eps * allowed[1, 1]:
            moved[place] = centre
    return np.asarray(moved)
