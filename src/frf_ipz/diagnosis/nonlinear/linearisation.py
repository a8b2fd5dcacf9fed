"""A force law as spring and damper at the amplitudes of the test, for linear models.

Statistical linearisation: the linear force with the least mean square difference from the law's force over the motion
in the test (Caughey, Equivalent linearization techniques, J. Acoust. Soc. Am. 35 (1963) 1706-1711).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.result import LinearisedLaw
from frf_ipz.numerics.least_squares import solve_scaled_columns

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawFit
    from frf_ipz.diagnosis.nonlinear.model.modal_model import ModalModel


def linearise(fit: LawFit, modal_model: ModalModel) -> LinearisedLaw:
    """Replace a law by a spring and a damper.

    Parameters
    ----------
    fit : LawFit
        The law, with the motion of its location in each segment.
    modal_model : ModalModel
        The structure.

    Returns
    -------
    Linearised
        For all segments together, and for each of them: they show how far it can be trusted.
    """
    moved = np.abs(fit.motion).max(1) > 0
    motion, velocity = fit.motion[moved], fit.velocity[moved]
    force = fit.strength * fit.law.unit_force(motion, velocity, fit.shape)
    per_segment = np.array(
        [_spring_and_damper(*signals) for signals in zip(motion, velocity, force, strict=True)]
    ).reshape(-1, 2)
    rms = np.sqrt(np.mean(motion**2, axis=1))
    order = np.argsort(rms)
    stiffness, damping = _spring_and_damper(motion.ravel(), velocity.ravel(), force.ravel())
    return LinearisedLaw(
        ends=modal_model.ends[fit.location],
        stiffness=stiffness,
        damping=damping,
        motion_rms_m=rms[order],
        stiffness_by_record=per_segment[order, 0],
        damping_by_record=per_segment[order, 1],
    )


def _spring_and_damper(motion: FloatArray, velocity: FloatArray, force: FloatArray) -> tuple[float, float]:
    columns = np.stack([motion, velocity], axis=1)
    coefficients = solve_scaled_columns(columns, force)
    if coefficients[1] < 0:  # no law of the catalogue adds energy: a decaying motion correlates with a spring's force
        return float(motion @ force / (motion @ motion)), 0.0
    return float(coefficients[0]), float(coefficients[1])
