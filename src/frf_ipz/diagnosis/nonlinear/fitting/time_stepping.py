"""Goes through time step by step with a law at its place.

The structure is in modal form, each mode as one complex number z with dz/dt = lambda z + force, whose imaginary part
over the damped frequency is the displacement. A step sums samples of the exact response to an impulse; what sampling
folds down from above is a constant to the fourth order, h^2/12 of the force, which is taken back (for a free mass that
is the method of Numerov, 1924). Modes that turn too far in a step take forces that are linear in time there.
The law is asked at the end of each step for the force that fits the motion that it itself changes.
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
SLOW = 1.0  # rad that a mode turns in a step: up to there its samples tell it apart from what they fold down
AHEAD = 0.6  # part of a step: at 1/2 a held force is neither early nor late, above it does not ring while it holds


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Modes:
    """Modes as complex numbers that turn and decay, advanced by one time step.

    Parameters
    ----------
    poles : (n_modes,) complex array
        lambda, 1/s.
    turn : (n_modes,) complex array
        exp(lambda step).
    before, after : (n_modes,) complex array
        What the force at the start and at the end of a step adds, s.
    """

    poles: ComplexArray
    turn: ComplexArray
    before: ComplexArray
    after: ComplexArray

    def drive(self, force: FloatArray) -> ComplexArray:
        """Go through all times with known modal forces.

        Parameters
        ----------
        force : (..., n_modes, n_times) array
            At rest before.

        Returns
        -------
        (..., n_modes, n_times) complex array
            z.
        """
        found = np.zeros(force.shape, complex)
        for i, (turn, before, after) in enumerate(zip(self.turn, self.before, self.after, strict=True)):
            found[..., i, :] = lfilter([after, before], [1, -turn], force[..., i, :], axis=-1)
        return found

    def displacement(self, z: ComplexArray) -> FloatArray:
        """Modal displacements, for z of shape (..., n_modes, n_times)."""
        return np.asarray(z.imag / self.poles.imag[:, None])

    def velocity(self, z: ComplexArray) -> FloatArray:
        """Modal velocities, for z of shape (..., n_modes, n_times)."""
        return np.asarray((self.poles[:, None] * z).imag / self.poles.imag[:, None])


def make_modes(omega_rad_s: FloatArray, damping_ratio: FloatArray, step_s: float, *, constant: bool = False) -> Modes:
    """Bring modes into complex form.

    Parameters
    ----------
    omega_rad_s, damping_ratio : (n_modes,) array
        Less than critically damped.
    step_s : float
        s.
    constant : bool
        The force has its value from `AHEAD` of a step before its time on, for a whole step.

    Returns
    -------
    Modes
        Advanced by one step.
    """
    ratio = np.minimum(damping_ratio, 0.999)
    poles = omega_rad_s * (-ratio + 1j * np.sqrt(1 - ratio**2))
    way = poles * step_s
    turn = np.exp(way)
    if constant:
        after, before = np.expm1(AHEAD * way) / poles, np.exp(AHEAD * way) * np.expm1((1 - AHEAD) * way) / poles
        return Modes(poles=poles, turn=turn, before=before, after=after)
    first = np.where(np.abs(way) > 1e-3, np.expm1(way) / way, 1 + way / 2 + way**2 / 6)
    second = np.where(np.abs(way) > 1e-3, (np.expm1(way) - way) / way**2, 0.5 + way / 6 + way**2 / 24)
    own = 0.5 - way.conj() / 12
    is_slow = np.abs(way) < SLOW
    after = np.where(is_slow, own, second)
    return Modes(
        poles=poles,
        turn=turn,
        before=step_s * np.where(is_slow, turn * (1 - own), first - second),
        after=step_s * after,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TimeSteps:
    """What a law did.

    Parameters
    ----------
    force : (n_blows, n_times) array
        Against the motion, N.
    motion, velocity : (n_blows, n_times) array
        Of the place, m and m/s.
    free_motion, free_velocity : (n_blows, n_times) array
        What they would have been without the force of the same time.
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
class Yielding:
    """How a place gives way to a force on it.

    Parameters
    ----------
    modes : Modes
        Of the structure, and one for all that lies above.
    weights : (n_modes,) array
        Squares of the shapes at the place.
    """

    modes: Modes
    weights: FloatArray

    @property
    def readers(self) -> ComplexArray:
        """(n_modes, 2): their products with z have the motion and the velocity as imaginary parts."""
        scaled = self.weights / self.modes.poles.imag
        return np.stack([scaled + 0j, scaled * self.modes.poles], 1)

    def compliance(self) -> FloatArray:
        """(2,) motion and velocity that a unit force at the end of a step adds."""
        return np.asarray((self.modes.after @ self.readers).imag)


def step_in_time(
    law: Law, numbers: tuple[float, float], place: Yielding, motion: FloatArray, velocity: FloatArray
) -> TimeSteps:
    """Go through all times with a law.

    Parameters
    ----------
    law : Law
        At the place.
    numbers : pair of float
        Strength and shape.
    place : Yielding
        How the place gives way.
    motion, velocity : (n_blows, n_times) array
        Of the place without the law, m and m/s.

    Returns
    -------
    TimeSteps
        Force and motion.
    """
    readers, modes = place.readers.T, place.modes
    per_unit = place.compliance()
    step = StepCompliance(float(per_unit[0]), float(per_unit[1]), *numbers)
    n_records, n_times = motion.shape
    turn, per_force = modes.turn[:, None], (modes.turn * modes.after + modes.before)[:, None]
    z = np.zeros((len(turn), n_records), complex)  # all that happened before the present step does
    forces, free = np.zeros((n_times, n_records)), np.ascontiguousarray(np.stack([motion.T, velocity.T], 1))
    for k in range(n_times):
        here = free[k]
        here += (readers @ z).imag
        force = law.solve(here[0], here[1], step)
        z *= turn
        z -= per_force * force
        forces[k] = force
    free_motion, free_velocity = free[:, 0].T, free[:, 1].T
    return TimeSteps(
        force=np.ascontiguousarray(forces.T),
        motion=free_motion - step.motion * forces.T,
        velocity=free_velocity - step.velocity * forces.T,
        free_motion=free_motion,
        free_velocity=free_velocity,
        step=step,
    )


def step_tangent(
    law: Law, place: Yielding, done: TimeSteps, changes: FloatArray, added: FloatArray | None = None
) -> FloatArray:
    """Change of the force by small changes of the motion without it and of the law's numbers, and by further forces.

    Parameters
    ----------
    law : Law
        At the place.
    place : Yielding
        How the place gives way.
    done : TimeSteps
        What the law did.
    changes : (n_changes, 2, n_blows, n_times) array
        Of motion and velocity.
    added : (n_added, n_blows, n_times) array, optional
        Forces besides the law, each a little of it, in the motion as it is, N.

    Returns
    -------
    (n_changes + 1 or 2 + n_added, n_blows, n_times) array
        Of the force; after the changes for a strength, and a shape if the law has one, that grow by their own size.
    """
    by_motion, by_velocity, by_numbers = _slopes(law, done)
    if added is not None:
        yields = 1 - done.step.motion * by_motion - done.step.velocity * by_velocity
        by_numbers = np.concatenate([by_numbers, added * yields])
    by_free = np.concatenate([changes[:, 0] * by_motion + changes[:, 1] * by_velocity, by_numbers])
    force = np.ascontiguousarray(by_free.transpose(2, 1, 0))  # time, blow, change: without what they do to the place
    slopes = np.stack([by_motion.T, by_velocity.T], 1)[..., None]
    readers, modes = np.ascontiguousarray(place.readers.T), place.modes
    turn, per_force = modes.turn[:, None], -(modes.turn * modes.after + modes.before)[:, None]
    z = np.zeros((len(turn), force[0].size), complex)
    added_to = np.empty_like(z)
    for here, (to_motion, to_velocity) in zip(force, slopes, strict=True):
        motion, velocity = (readers @ z).imag.reshape(2, *here.shape)
        here += to_motion * motion + to_velocity * velocity
        z *= turn
        z += np.multiply(per_force, here.reshape(1, -1), out=added_to)
    return np.ascontiguousarray(force.transpose(2, 1, 0))


def _slopes(law: Law, done: TimeSteps) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derive the force by free motion and velocity, and by the law's numbers times their size."""
    w, v, step = done.free_motion, done.free_velocity, done.step
    way = DIFFERENCE * max(float(np.abs(w).max()), SMALLEST)
    pace = DIFFERENCE * max(float(np.abs(v).max()), SMALLEST)
    by_motion = (law.solve(w + way, v, step) - law.solve(w - way, v, step)) / (2 * way)
    by_velocity = (law.solve(w, v + pace, step) - law.solve(w, v - pace, step)) / (2 * pace)
    by_numbers = []
    for name in ("strength", "shape") if law.shape_name else ("strength",):
        values = {part: getattr(step, part) for part in ("motion", "velocity", "strength", "shape")}
        up, down = ({**values, name: values[name] * (1 + sign * DIFFERENCE)} for sign in (1, -1))
        change = law.solve(w, v, StepCompliance(**up)) - law.solve(w, v, StepCompliance(**down))
        by_numbers.append(change / (2 * DIFFERENCE))
    return by_motion, by_velocity, np.array(by_numbers)
