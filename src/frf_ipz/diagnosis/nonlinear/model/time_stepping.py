"""Time stepping of a structure with a law at one location.

The structure is in modal form, each mode as one complex number z with dz/dt = lambda z + force, whose imaginary part
over the damped frequency is the displacement. A step sums samples of the exact impulse response; the aliasing of that
sum is a constant to the fourth order, h^2/12 of the force, which is subtracted (for a free mass that is the method of
Numerov, 1924). Modes that turn too far in a step take forces that are linear in time.
At the end of each step the law is solved for the force that fits the motion that it itself changes.

Many steps are taken at once. A force moves its location at later steps only, so that its feedback within a block of
steps is a triangular matrix, the sampled impulse response; a law is solved in a block by Newton's method, and its
derivatives by all parameters together are one triangular system. The results are those of steps one by one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dtrtrs
from scipy.signal import lfilter

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.nonlinear.laws.law import StepCompliance

if TYPE_CHECKING:
    from collections.abc import Iterator

    from frf_ipz.diagnosis.nonlinear.laws.law import Law

DIFFERENCE = 1e-6  # of a size: step of a derivative, half the digits of double precision
SMALLEST = 1e-300
SLOW = 1.0  # rad that a mode turns in a step: up to there its samples distinguish it from its aliases
BLOCK_STEPS = 32  # that are taken at once: a longer triangle costs more than the calls that it saves
HALF = 0.5  # of an error: rounds that leave more are too many
PRECISION = 1e-12  # of the largest force so far: what a round may leave, next to which rounding of all steps shows
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _StepBlock:
    """Many time steps at once: how a location moves by the state before them, and by the forces in them.

    No step feels forces of later ones: the matrices by forces are strictly lower triangular.

    Parameters
    ----------
    by_state : (2 n_modes, 2 n_steps) array
        Motions, then velocities, by the real and imaginary parts of z at the first step.
    by_force : (2, n_steps, n_steps) array
        Motion and velocity at a step (row) that a unit force at an earlier one (column) subtracts.
    state_by_state, state_by_force : (2 n_modes, 2 n_modes) and (n_steps, 2 n_modes) array
        z at the first step of the next block.
    """

    by_state: FloatArray
    by_force: FloatArray
    state_by_state: FloatArray
    state_by_force: FloatArray

    @classmethod
    def of_compliance(cls, compliance: LocationCompliance, n_steps: int) -> _StepBlock:
        """Sum the modes of a location."""
        modes = compliance.modes
        powers = modes.turn[:, None] ** np.arange(n_steps + 1)
        per_force = modes.turn * modes.after + modes.before
        response = compliance.output_weights[:, :, None] * powers[:, None, :n_steps]  # mode, motion or velocity, step
        kernel = np.einsum("mok,m->ok", response, per_force).imag
        delay = np.arange(n_steps)[:, None] - np.arange(n_steps) - 1
        by_force = -(per_force * powers[:, n_steps - 1 :: -1].T)
        real, imaginary = np.diag(powers[:, -1].real), np.diag(powers[:, -1].imag)
        return cls(
            by_state=np.concatenate([response.imag, response.real]).reshape(-1, 2 * n_steps),
            by_force=np.where(delay >= 0, kernel[:, np.maximum(delay, 0)], 0.0),
            state_by_state=np.block([[real, imaginary], [-imaginary, real]]),
            state_by_force=np.concatenate([by_force.real, by_force.imag], 1),
        )

    @property
    def n_steps(self) -> int:
        """Number of time steps."""
        return len(self.state_by_force)

    def move_freely(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(..., n_steps) motion and velocity by the state before."""
        both = state @ self.by_state
        return both[..., : self.n_steps], both[..., self.n_steps :]

    def advance(self, state: FloatArray, force: FloatArray) -> FloatArray:
        """(..., 2 n_modes) state of the next block, from this block's and its forces, (..., n_steps)."""
        return np.asarray(state @ self.state_by_state + force @ self.state_by_force)

    def feed_back(self, force: FloatArray, by_motion: FloatArray, by_velocity: FloatArray) -> FloatArray:
        """Let forces change the motion, and through the slopes of a law the forces of later steps.

        Parameters
        ----------
        force : (n_segments, n_columns, n_steps) array
            In the motion without it, N.
        by_motion, by_velocity : (n_segments, n_steps) array
            Slopes of the law, N/m and N s/m.

        Returns
        -------
        (n_segments, n_columns, n_steps) array
            N.
        """
        to_motion, to_velocity = self.by_force
        slopes = by_motion[..., None] * to_motion + by_velocity[..., None] * to_velocity
        result = force.copy()
        for number in np.flatnonzero(by_motion.any(1) | by_velocity.any(1)):
            # transposed, rows of numpy are columns of LAPACK; the diagonal is one
            solved, _ = dtrtrs(slopes[number].T, force[number].T, lower=0, trans=1, unitdiag=1)
            result[number] = solved.T
        return result


def _split_into_blocks(compliance: LocationCompliance, n_times: int) -> Iterator[tuple[slice, _StepBlock]]:
    """Give the times of each block with its matrices; the last block may be shorter."""
    block = _StepBlock.of_compliance(compliance, min(BLOCK_STEPS, n_times))
    for first in range(0, n_times, BLOCK_STEPS):
        if first + block.n_steps > n_times:
            block = _StepBlock.of_compliance(compliance, n_times - first)
        yield slice(first, first + block.n_steps), block


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
    per_unit = compliance.per_unit_force()
    step = StepCompliance(float(per_unit[0]), float(per_unit[1]), *numbers)
    differences = _difference_step(motion), _difference_step(velocity)
    state = np.zeros((len(motion), 2 * len(compliance.weights)))  # by the law's force in all earlier steps
    force, free_motion, free_velocity = (np.zeros(motion.shape) for _ in range(3))
    held, largest = np.zeros(len(motion)), SMALLEST
    for times, block in _split_into_blocks(compliance, motion.shape[1]):
        by_motion, by_velocity = block.move_freely(state)
        law_block = _LawBlock(
            law=law,
            step=step,
            block=block,
            motion=motion[:, times] + by_motion,
            velocity=velocity[:, times] + by_velocity,
            differences=differences,
        )
        force[:, times] = law_block.solve(held, largest)
        free_motion[:, times], free_velocity[:, times] = law_block.free_motion(force[:, times])
        held, largest = force[:, times.stop - 1], max(largest, float(np.abs(force[:, times]).max()))
        state = block.advance(state, force[:, times])
    return TimeHistory(
        force=force,
        motion=free_motion - step.motion * force,
        velocity=free_velocity - step.velocity * force,
        free_motion=free_motion,
        free_velocity=free_velocity,
        step=step,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _LawBlock:
    """A law in a block of time steps.

    Parameters
    ----------
    law, step, block
        The law, its parameters with the compliance of a step, and the time steps.
    motion, velocity : (n_segments, n_steps) array
        Of the location without the law's forces of this block, m and m/s.
    differences : pair of float
        Of motion and velocity, for the slopes of the law.
    """

    law: Law
    step: StepCompliance
    block: _StepBlock
    motion: FloatArray
    velocity: FloatArray
    differences: tuple[float, float]

    def free_motion(self, force: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Motion and velocity without the force of the same step."""
        by_motion, by_velocity = self.block.by_force
        return self.motion - force @ by_motion.T, self.velocity - force @ by_velocity.T

    def solve(self, held: FloatArray, largest: float) -> FloatArray:
        """Find the forces by Newton's method, as long as each round halves the error; what it leaves step by step.

        Each round makes at least one more step exact, and all where the law has no kink there; where friction switches
        every few steps, rounds are of little use. They start from a force that is held, (n_segments,).
        """
        if not np.isfinite(self.motion).all():  # a motion that has diverged
            return np.full(self.motion.shape, np.nan)
        w, v = self.free_motion(np.repeat(held[:, None], self.block.n_steps, axis=1))
        force, before = self.law.solve(w, v, self.step), np.inf
        while True:
            w, v = self.free_motion(force)
            by_law = self.law.solve(w, v, self.step)
            error, negligible = np.abs(by_law - force), PRECISION * max(largest, float(np.abs(by_law).max()))
            size = float(error.max())
            if size <= negligible:
                return by_law
            if not size < HALF * before:  # or not finite
                return self._solve_singly(force, int(np.argmax(~(error <= negligible).all(0))))
            in_motion, in_velocity = self.differences
            by_motion = (self.law.solve(w + in_motion, v, self.step) - by_law) / in_motion
            by_velocity = (self.law.solve(w, v + in_velocity, self.step) - by_law) / in_velocity
            force = force + self.block.feed_back((by_law - force)[:, None], by_motion, by_velocity)[:, 0]
            before = size

    def _solve_singly(self, force: FloatArray, first: int) -> FloatArray:
        """Find the force of one step after the other, from a first one on."""
        for k in range(first, self.block.n_steps):
            by_motion, by_velocity = (force[:, :k] @ self.block.by_force[:, k, :k].T).T
            force[:, k] = self.law.solve(self.motion[:, k] - by_motion, self.velocity[:, k] - by_velocity, self.step)
        return force


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
    changes : (n_segments, n_changes, 2, n_times) array
        Of motion and velocity.
    added : (n_added, n_segments, n_times) array, optional
        Forces beside the law, each a small one, in the motion of the history, N.

    Returns
    -------
    (n_segments, n_changes + 1 or 2 + n_added, n_times) array
        Of the force; after the changes by the strength, and by the shape if the law has one, relative to their size.
    """
    by_motion, by_velocity, by_numbers = _force_derivatives(law, history)
    if added is not None:
        feedback = 1 - history.step.motion * by_motion - history.step.velocity * by_velocity
        by_numbers = np.concatenate([by_numbers, added * feedback])
    direct = changes[:, :, 0] * by_motion[:, None]  # without the motion by the forces themselves
    if by_velocity.any():
        direct += changes[:, :, 1] * by_velocity[:, None]
    force = np.concatenate([direct, by_numbers.swapaxes(0, 1)], axis=1)
    state = np.zeros((*force.shape[:2], 2 * len(compliance.weights)))
    for times, block in _split_into_blocks(compliance, force.shape[-1]):
        to_motion, to_velocity = by_motion[:, times], by_velocity[:, times]
        motion, velocity = block.move_freely(state)
        force[..., times] += to_motion[:, None] * motion + to_velocity[:, None] * velocity
        force[..., times] = block.feed_back(force[..., times], to_motion, to_velocity)
        state = block.advance(state, force[..., times])
    return force


def _force_derivatives(law: Law, history: TimeHistory) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derive the force by free motion and velocity, and by the law's parameters times their size."""
    w, v, step = history.free_motion, history.free_velocity, history.step
    motion_step, velocity_step = _difference_step(w), _difference_step(v)
    by_motion = (law.solve(w + motion_step, v, step) - law.solve(w - motion_step, v, step)) / (2 * motion_step)
    by_velocity = (law.solve(w, v + velocity_step, step) - law.solve(w, v - velocity_step, step)) / (2 * velocity_step)
    by_numbers = []
    for name in ("strength", "shape") if law.shape_name else ("strength",):
        values = {part: getattr(step, part) for part in ("motion", "velocity", "strength", "shape")}
        up, down = ({**values, name: values[name] * (1 + sign * DIFFERENCE)} for sign in (1, -1))
        change = law.solve(w, v, StepCompliance(**up)) - law.solve(w, v, StepCompliance(**down))
        by_numbers.append(change / (2 * DIFFERENCE))
    return by_motion, by_velocity, np.array(by_numbers)


def _difference_step(values: FloatArray) -> float:
    """Step of a derivative by values of this size."""
    return DIFFERENCE * max(float(np.abs(values).max()), SMALLEST)
