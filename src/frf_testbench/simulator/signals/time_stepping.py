"""Time stepping of the force of a nonlinear law at one location of a linear structure.

What the structure does without the law is exact already (`laplace`). The law's force acts back through the impulse
response of its location: each mode is carried over a step exactly for a force that varies linearly within it, and modes
above those that are summed by their static compliance. So the only error is that of the linear interpolation of the
law's force, and it falls with the square of the step. Laws that can hold their location still keep their force constant
within a step: their error falls with the step itself.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.signals.laws import Law
from frf_testbench.simulator.signals.receptance import ModalReceptance

FloatArray = NDArray[np.float64]


def integrate_law_force(
    model: ModalReceptance, location: FloatArray, law: Law, motion: FloatArray, velocity: FloatArray, step_s: float
) -> FloatArray:
    """Integrate the force of a law that a structure feels while it is excited.

    Parameters
    ----------
    model : ModalReceptance
        The linear structure, without attachments.
    location : (n_rows,) array
        The law's motion in terms of the rows of the receptance.
    law : Law
        Restoring force for motion and velocity.
    motion, velocity : (n_records, n_steps) array
        Of the location without the law, m and m/s.
    step_s : float
        Time step.

    Returns
    -------
    (n_records, n_steps) array
        Restoring force, N; the structure feels its opposite. The force of a law that is constant within a step is that
        of the middle of the step before.

    Raises
    ------
    FloatingPointError
        If the motion runs away to infinity, as on a spring that softens without end.
    """
    shapes = location @ model.shapes
    damped = model.omega_rad_s * np.sqrt(1 - model.damping_ratio**2)
    poles = np.asarray(-model.damping_ratio * model.omega_rad_s + 1j * damped, np.complex128)
    decay, first, last = step_weights(np.asarray(poles * step_s, np.complex128))
    if law.is_constant_within_step:
        first, last = np.zeros_like(first), first + last
    first, last = first * step_s, last * step_s
    weight = shapes**2 / damped
    to_motion, to_velocity = weight.astype(complex), weight * poles
    static = float(location @ model.static @ location)
    beta = static + float((to_motion @ last).imag)
    gamma = static / step_s + float((to_velocity @ last).imag)
    to_motion_and_velocity = np.vstack([to_motion, to_velocity])
    n_records, n_steps = motion.shape
    force = np.zeros((n_steps, n_records))
    state = np.zeros((poles.size, n_records), dtype=complex)
    decay, first, last = decay[:, None], first[:, None], last[:, None]
    without_law = np.stack([motion.T, velocity.T], axis=1)  # step, motion or velocity, record
    law.restart(n_records)
    last_force = np.zeros(n_records)
    with np.errstate(over="raise", invalid="raise"):  # what runs away is no test
        for n in range(n_steps):
            state *= decay
            state += first * last_force
            felt = without_law[n] - (to_motion_and_velocity @ state).imag
            new_force = law.force(felt[0], felt[1] + static / step_s * last_force, beta, gamma)
            state += last * new_force
            force[n] = last_force = new_force
    return force.T


def step_weights(a: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], ...]:
    """Give the decay over a step, and the weights of the force at its start and end, for a = pole times step."""
    decay = np.exp(a)
    small = np.abs(a) < 1e-2
    safe = np.where(small, 1.0, a)
    end = np.where(small, 1 / 2 + a / 6 + a**2 / 24 + a**3 / 120, (decay - 1 - safe) / safe**2)
    whole = np.where(small, 1 + a / 2 + a**2 / 6 + a**3 / 24, (decay - 1) / safe)
    return decay, whole - end, end
