"""Time stepping of a structure with a law at one location.

The structure is in modal form, each mode as one complex number z with dz/dt = lambda z + force, whose imaginary part
over the damped frequency is the displacement. A step sums samples of the exact impulse response; the aliasing of that
sum is a constant to the fourth order, h^2/12 of the force, which is subtracted (for a free mass that is the method of
Numerov, 1924). Modes that turn too far in a step take forces that are linear in time.
At the end of each step the law is solved for the force that fits the motion that it itself changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.nonlinear.laws.law import StepCompliance

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.laws.law import Law

DIFFERENCE = 1e-6  # of a size: step of a derivative, half the digits of double precision
SMALLEST = 1e-300
SLOW = 1.0  # rad that a mode turns in a step: up to there its samples distinguish it from its aliases
HOLD_LEAD = 0.6  # part of a step: at 1/2 a held force is neither early nor late, above it does not ring while it sticks


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DiscreteModes:
    """Modes as complex numbers that turn and decay, advanced by one time step.

    Parameters
    ----------
    poles : (n_modes,) complex array
        lambda, 1/s.
    turn : (n_modes,) complex array
        exp(lambda step).
    before, after : (n_modes,) complex array
        Gains of the force at the start and at the end of a step, s.
    """

    poles: ComplexArray
    turn: ComplexArray
    before: ComplexArray
    after: ComplexArray

    def drive(self, force: FloatArray) -> ComplexArray:
        """Step through all times with known modal forces.

        Parameters
        ----------
        force : (..., n_modes, n_times) array
            At rest before.

        Returns
        -------
        (..., n_modes, n_times) complex array
            z.
        """
        z = np.zeros(force.shape, complex)
        for i, (turn, before, after) in enumerate(zip(self.turn, self.before, self.after, strict=True)):
            z[..., i, :] = lfilter([after, before], [1, -turn], force[..., i, :], axis=-1)
        return z

    def displacement(self, z: ComplexArray) -> FloatArray:
        """Modal displacements, for z of shape (..., n_modes, n_times)."""
        return np.asarray(z.imag / self.poles.imag[:, None])

    def velocity(self, z: ComplexArray) -> FloatArray:
        """Modal velocities, for z of shape (..., n_modes, n_times)."""
        return np.asarray((self.poles[:, None] * z).imag / self.poles.imag[:, None])


def discretise_modes(
    omega_rad_s: FloatArray, damping_ratio: FloatArray, step_s: float, *, hold: bool = False
) -> DiscreteModes:
    """Bring modes into complex form for a time step.

    Parameters
    ----------
    omega_rad_s, damping_ratio : (n_modes,) array
        Less than critically damped.
    step_s : float
        s.
    hold : bool
        The force has its value from `HOLD_LEAD` of a step before its time on, for a whole step.

    Returns
    -------
    DiscreteModes
        Advanced by one step.
    """
    ratio = np.minimum(damping_ratio, 0.999)
    poles = omega_rad_s * (-ratio + 1j * np.sqrt(1 - ratio**2))
    angle = poles * step_s
    turn = np.exp(angle)
    if hold:
        after = np.expm1(HOLD_LEAD * angle) / poles
        before = np.exp(HOLD_LEAD * angle) * np.expm1((1 - HOLD_LEAD) * angle) / poles
        return DiscreteModes(poles=poles, turn=turn, before=before, after=after)
    first = np.where(np.abs(angle) > 1e-3, np.expm1(angle) / angle, 1 + angle / 2 + angle**2 / 6)
    second = np.where(np.abs(angle) > 1e-3, (np.expm1(angle) - angle) / angle**2, 0.5 + angle / 6 + angle**2 / 24)
    sampled = 0.5 - angle.conj() / 12
    is_slow = np.abs(angle) < SLOW
    after = np.where(is_slow, sampled, second)
    return DiscreteModes(
        poles=poles,
        turn=turn,
        before=step_s * np.where(is_slow, turn * (1 - sampled), first - second),
        after=step_s * after,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TimeHistory:
    """Force and motion of a law over time.

    Parameters
    ----------
    force : (n_segments, n_times) array
        Against the motion, N.
    motion, velocity : (n_segments, n_times) array
        Of the location, m and m/s.
    free_motion, free_velocity : (n_segments, n_times) array
        Without the force of the same time step.
    step : StepCompliance
        Of a time step.
    """

    force: FloatArray
    motion: FloatArray
    velocity: FloatArray
    free_motion: FloatArray
    free_velocity: FloatArray
    step: StepCompliance


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LocationCompliance:
    """How a location moves under a force on it.

    Parameters
    ----------
    modes : DiscreteModes
        Of the structure, and one for the residual terms.
    weights : (n_modes,) array
        Squares of the shapes at the location.
    """

    modes: DiscreteModes
    weights: FloatArray

    @property
    def output_weights(self) -> ComplexArray:
        """(n_modes, 2): their products with z have the motion and the velocity as imaginary parts."""
        scaled = self.weights / self.modes.poles.imag
        return np.stack([scaled + 0j, scaled * self.modes.poles], 1)

    def per_unit_force(self) -> FloatArray:
        """(2,) motion and velocity that a unit force at the end of a step adds."""
        return np.asarray((self.modes.after @ self.output_weights).imag)


def step_in_time(
    law: Law, numbers: tuple[float, float], compliance: LocationCompliance, motion: FloatArray, velocity: FloatArray
) -> TimeHistory:
    """Step through all times with a law.

    Parameters
    ----------
    law : Law
        At the location.
    numbers : pair of float
        Strength and shape.
    compliance : LocationCompliance
        Of the location.
    motion, velocity : (n_segments, n_times) array
        Of the location without the law, m and m/s.

    Returns
    -------
    TimeHistory
        Force and motion.
    """
    outputs, modes = compliance.output_weights.T, compliance.modes
    per_unit = compliance.per_unit_force()
    step = StepCompliance(float(per_unit[0]), float(per_unit[1]), *numbers)
    n_segments, n_times = motion.shape
    turn, per_force = modes.turn[:, None], (modes.turn * modes.after + modes.before)[:, None]
    z = np.zeros((len(turn), n_segments), complex)  # by the law's force in all earlier steps
    forces, free = np.zeros((n_times, n_segments)), np.ascontiguousarray(np.stack([motion.T, velocity.T], 1))
    for k in range(n_times):
        at_step = free[k]
        at_step += (outputs @ z).imag
        force = law.solve(at_step[0], at_step[1], step)
        z *= turn
        z -= per_force * force
        forces[k] = force
    free_motion, free_velocity = free[:, 0].T, free[:, 1].T
    return TimeHistory(
        force=np.ascontiguousarray(forces.T),
        motion=free_motion - step.motion * forces.T,
        velocity=free_velocity - step.velocity * forces.T,
        free_motion=free_motion,
        free_velocity=free_velocity,
        step=step,
    )


def step_tangent(
    law: Law,
    compliance: LocationCompliance,
    history: TimeHistory,
    changes: FloatArray,
    added: FloatArray | None = None,
) -> FloatArray:
    """Derive the force by small changes of the free motion, by the law's parameters, and by added forces.

    Parameters
    ----------
    law : Law
        At the location.
    compliance : LocationCompliance
        Of the location.
    history : TimeHistory
        Of the law.
    changes : (n_changes, 2, n_segments, n_times) array
        Of motion and velocity.
    added : (n_added, n_segments, n_times) array, optional
        Forces beside the law, each a small one, in the motion of the history, N.

    Returns
    -------
    (n_changes + 1 or 2 + n_added, n_segments, n_times) array
        Of the force; after the changes by the strength, and by the shape if the law has one, relative to their size.
    """
    by_motion, by_velocity, by_numbers = _force_derivatives(law, history)
    if added is not None:
        feedback = 1 - history.step.motion * by_motion - history.step.velocity * by_velocity
        by_numbers = np.concatenate([by_numbers, added * feedback])
    direct = np.concatenate([changes[:, 0] * by_motion + changes[:, 1] * by_velocity, by_numbers])
    force = np.ascontiguousarray(direct.transpose(2, 1, 0))  # time, segment, change: without the motion by themselves
    slopes = np.stack([by_motion.T, by_velocity.T], 1)[..., None]
    outputs, modes = np.ascontiguousarray(compliance.output_weights.T), compliance.modes
    turn, per_force = modes.turn[:, None], -(modes.turn * modes.after + modes.before)[:, None]
    z = np.zeros((len(turn), force[0].size), complex)
    increment = np.empty_like(z)
    for at_step, (to_motion, to_velocity) in zip(force, slopes, strict=True):
        motion, velocity = (outputs @ z).imag.reshape(2, *at_step.shape)
        at_step += to_motion * motion + to_velocity * velocity
        z *= turn
        z += np.multiply(per_force, at_step.reshape(1, -1), out=increment)
    return np.ascontiguousarray(force.transpose(2, 1, 0))


def _force_derivatives(law: Law, history: TimeHistory) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derive the force by free motion and velocity, and by the law's parameters times their size."""
    w, v, step = history.free_motion, history.free_velocity, history.step
    motion_step = DIFFERENCE * max(float(np.abs(w).max()), SMALLEST)
    velocity_step = DIFFERENCE * max(float(np.abs(v).max()), SMALLEST)
    by_motion = (law.solve(w + motion_step, v, step) - law.solve(w - motion_step, v, step)) / (2 * motion_step)
    by_velocity = (law.solve(w, v + velocity_step, step) - law.solve(w, v - velocity_step, step)) / (2 * velocity_step)
    by_numbers = []
    for name in ("strength", "shape") if law.shape_name else ("strength",):
        values = {part: getattr(step, part) for part in ("motion", "velocity", "strength", "shape")}
        up, down = ({**values, name: values[name] * (1 + sign * DIFFERENCE)} for sign in (1, -1))
        change = law.solve(w, v, StepCompliance(**up)) - law.solve(w, v, StepCompliance(**down))
        by_numbers.append(change / (2 * DIFFERENCE))
    return by_motion, by_velocity, np.array(by_numbers)
