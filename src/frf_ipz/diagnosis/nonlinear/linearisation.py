"""A force law as spring and damper about the amplitudes of the test: what a linear model can hold of it.

Statistical linearisation: the linear force that misses the law's force least, in the mean square over the motion that
the blows caused (Caughey, Equivalent linearization techniques, J. Acoust. Soc. Am. 35 (1963) 1706-1711).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.result import LinearisedLaw
from frf_ipz.numerics.least_squares import solve_scaled_columns

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.nonlinear.fitting.refine import LawFit
    from frf_ipz.diagnosis.nonlinear.linear.modal_model import ModalModel


def linearise(fit: LawFit, modal_model: ModalModel) -> LinearisedLaw:
    """Replace a law by a spring and a damper.

    Parameters
    ----------
    fit : LawFit
        The law, with the motion of its place in each blow.
    modal_model : ModalModel
        The structure.

    Returns
    -------
    Linearised
        About all blows together, and about each of them: how far it can be trusted.
    """
    moved = np.abs(fit.motion).max(1) > 0
    motion, velocity = fit.motion[moved], fit.velocity[moved]
    force = fit.strength * fit.law.unit_force(motion, velocity, fit.shape)
    each = np.array([_spring_and_damper(*one) for one in zip(motion, velocity, force, strict=True)]).reshape(-1, 2)
    rms = np.sqrt(np.mean(motion**2, axis=1))
    order = np.argsort(rms)
    stiffness, damping = _spring_and_damper(motion.ravel(), velocity.ravel(), force.ravel())
    return LinearisedLaw(
        ends=modal_model.places[fit.place].ends,
        stiffness=stiffness,
        damping=damping,
        motion_rms_m=rms[order],
        stiffness_by_record=each[order, 0],
        damping_by_record=each[order, 1],
    )


def _spring_and_damper(motion: FloatArray, velocity: FloatArray, force: FloatArray) -> tuple[float, float]:
    columns = np.stack([motion, velocity], axis=1)
    found = solve_scaled_columns(columns, force)
    if found[1] < 0:  # no law of the catalogue gives energy: motion that dies away leaves a little of a spring's force
        return float(motion @ force / (motion @ motion)), 0.0
    return float(found[0]), float(found[1])
