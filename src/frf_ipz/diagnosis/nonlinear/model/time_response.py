"""Motion of a location in time: without a law, from initial states, and by small changes of the linear model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.nonlinear.model.time_stepping import DiscreteModes, LocationCompliance, discretise_modes

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.model.modal_model import NuisanceValues
    from frf_ipz.diagnosis.nonlinear.model.nuisance_prior import NuisancePrior
    from frf_ipz.diagnosis.nonlinear.segments import SegmentSet

DIFFERENCE = 1e-4  # of a frequency or damping ratio: step of a derivative
RESIDUAL_DAMPING = 0.05  # of the one mode that stands for all modes left out
LEAST_PART = 1e-9  # of the compliance: smaller residual terms are left out


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TimeResponse:
    """Response of a location of a structure over the times of segments.

    Parameters
    ----------
    segments : SegmentSet
        The data.
    nuisance_prior : NuisancePrior
        Of the linear model.
    nuisance : (n_nuisance,) array
        In prior standard deviations.
    location : int
        Index in `ModalModel.locations`.
    """

    segments: SegmentSet
    nuisance_prior: NuisancePrior
    nuisance: FloatArray
    location: int

    @property
    def step_s(self) -> float:
        """Time step, s."""
        return self.segments.step_s / self.segments.steps_per_sample

    @property
    def shapes(self) -> FloatArray:
        """(n_modes,) at the location."""
        return np.asarray(
            self.nuisance_prior.modal_model.at_locations.shapes[self.location] + self.nuisance_values.location
        )

    @property
    def nuisance_values(self) -> NuisanceValues:
        """Of the structure."""
        return self.nuisance_prior.to_values(self.nuisance, self.location)

    def modes(self) -> DiscreteModes:
        """Discretise the modes that are kept."""
        return discretise_modes(*self.nuisance_prior.modal_model.poles(self.nuisance_values), self.step_s)

    def compliance(self, *, hold: bool) -> LocationCompliance:
        """Compute how the location moves under a force; see `discretise_modes` for `hold`."""
        points = self.nuisance_prior.modal_model.at_locations
        omega, ratio = self.nuisance_prior.modal_model.poles(self.nuisance_values)
        weights = self.shapes**2
        static, inertial = (
            points.weights[self.location] @ part[:, self.location] for part in (points.static, points.inertial)
        )
        if static > LEAST_PART * np.sum(weights / omega**2) and inertial > 0:
            above = np.sqrt(static / inertial)
            omega, ratio = np.append(omega, above), np.append(ratio, RESIDUAL_DAMPING)
            weights = np.append(weights, static * above**2)
        return LocationCompliance(modes=discretise_modes(omega, ratio, self.step_s, hold=hold), weights=weights)

    def motion_without_law(self) -> FloatArray:
        """(2, n_segments, n_times) motion and velocity by the measured force and by the initial states."""
        modes, force = self.modes(), self.segments.fine_force
        z = modes.drive(self.input_forces())
        moving = self.nuisance_prior.moving
        if len(moving):
            z[moving[:, None], self.nuisance_prior.modes] += self._free_vibration(modes)
        modal = np.stack([np.einsum("m,bmt->bt", self.shapes, part) for part in self._motion_and_velocity(modes, z)])
        residual = self._residual_motion(force)
        return np.asarray(modal + np.stack([residual, np.gradient(residual, self.step_s, axis=1)]))

    def derivatives(self, law_force: FloatArray) -> FloatArray:
        """Derive motion and velocity by nuisance parameters, at a constant force of the law.

        Parameters
        ----------
        law_force : (n_segments, n_times) array
            Against the motion, N.

        Returns
        -------
        (n_columns, 2, n_segments, n_times) array
            Per prior standard deviation: frequencies, damping ratios, shapes at the input and at the location, and,
            where segments start in motion, displacements and velocities at the start; of each mode that is free.
        """
        nuisance_prior, modes = self.nuisance_prior, self.modes()
        free = nuisance_prior.modes
        total = self.input_forces()[:, free] - self.shapes[free, None] * law_force[:, None]
        columns = [self._derive_by_poles(total, which) for which in (0, 1)]
        free_modes = _select_modes(modes, free)
        inputs = nuisance_prior.inputs[self.segments.input_of]
        by_input = free_modes.drive(inputs[:, :, None] * self.segments.fine_force[:, None])
        columns.append(np.stack(self._motion_and_velocity(free_modes, by_input), 1) * self.shapes[free, None])
        columns.append(self._derive_by_location_shapes(free_modes, total, law_force))
        if len(nuisance_prior.moving):
            columns += self._derive_by_initial_states(free_modes)
        return np.concatenate([column.transpose(2, 1, 0, 3) for column in columns])

    def input_forces(self) -> FloatArray:
        """Give the modal forces by the measured force, (n_segments, n_modes, n_times)."""
        shapes = self.nuisance_prior.modal_model.at_inputs.shapes + self.nuisance_values.inputs
        return np.asarray(shapes[self.segments.input_of][:, :, None] * self.segments.fine_force[:, None])

    def _motion_and_velocity(self, modes: DiscreteModes, z: np.ndarray) -> list[FloatArray]:
        return [modes.displacement(z), modes.velocity(z)]

    def _residual_motion(self, force: FloatArray) -> FloatArray:
        """(n_segments, n_times) motion by the modes left out."""
        modal_model = self.nuisance_prior.modal_model
        points, inputs = modal_model.at_locations, modal_model.at_inputs
        static, inertial = (inputs.weights @ part[:, self.location] for part in (points.static, points.inertial))
        second = np.gradient(np.gradient(force, self.step_s, axis=1), self.step_s, axis=1)
        rows = self.segments.input_of
        return np.asarray(static[rows, None] * force - inertial[rows, None] * second)

    def _derive_by_poles(self, total: FloatArray, which: int) -> FloatArray:
        """(n_segments, 2, n_free, n_times) change by frequencies (0) or damping ratios (1)."""
        nuisance_prior = self.nuisance_prior
        free = nuisance_prior.modes
        omega, ratio = nuisance_prior.modal_model.poles(self.nuisance_values)
        sizes = (nuisance_prior.frequency, nuisance_prior.damping)[which]
        ends = []
        for sign in (1, -1):
            factor = np.ones((2, len(free)))
            factor[which] += sign * DIFFERENCE
            modes = discretise_modes(omega[free] * factor[0], ratio[free] * factor[1], self.step_s)
            z = modes.drive(total)
            if len(nuisance_prior.moving):
                z[nuisance_prior.moving] += self._free_vibration(modes)
            ends.append(np.stack(self._motion_and_velocity(modes, z), 1))
        return np.asarray((ends[0] - ends[1]) * (sizes * self.shapes[free] / (2 * DIFFERENCE))[:, None])

    def _derive_by_location_shapes(self, modes: DiscreteModes, total: FloatArray, law_force: FloatArray) -> FloatArray:
        """(n_segments, 2, n_free, n_times) change by the shapes at the location, as output and as input."""
        nuisance_prior, shapes = self.nuisance_prior, self.shapes[self.nuisance_prior.modes, None]
        z = modes.drive(total - shapes * law_force[:, None])
        if len(nuisance_prior.moving):
            z[nuisance_prior.moving] += self._free_vibration(modes)
        sizes = nuisance_prior.locations[self.location][:, None]
        return np.asarray(np.stack(self._motion_and_velocity(modes, z), 1) * sizes)

    def _free_vibration(self, modes: DiscreteModes) -> np.ndarray:
        """(n_moving, n_free, n_times) free vibrations of the free modes, which are the first of `modes` or all."""
        states = self.nuisance_prior.initial_states_of(self.nuisance)
        free = self.nuisance_prior.modes
        free_modes = _select_modes(modes, free) if len(modes.poles) > len(free) else modes
        return np.asarray(_to_complex(free_modes, states[0], states[1])[:, :, None] * self._unit_motion(free_modes))

    def _derive_by_initial_states(self, modes: DiscreteModes) -> list[FloatArray]:
        """Each (n_segments, 2, n_free, n_times): change by displacement and velocity at the start."""
        nuisance_prior, unit_motion = self.nuisance_prior, self._unit_motion(modes)
        columns = []
        for which in (0, 1):
            unit = [nuisance_prior.initial_states * (which == 0), nuisance_prior.initial_states * (which == 1)]
            z = np.zeros((self.segments.n_segments, *unit_motion.shape), complex)
            z[nuisance_prior.moving] = _to_complex(modes, *unit)[:, :, None] * unit_motion
            motion = np.stack(self._motion_and_velocity(modes, z), 1)
            columns.append(motion * self.shapes[nuisance_prior.modes, None])
        return columns

    def _unit_motion(self, modes: DiscreteModes) -> np.ndarray:
        times = self.step_s * np.arange(self.segments.fine_force.shape[1])
        return np.exp(modes.poles[:, None] * times)


def _to_complex(modes: DiscreteModes, motion: FloatArray, velocity: FloatArray) -> np.ndarray:
    """Complex modes, (n_moving, n_modes), from displacements times omega, and velocities."""
    displacement = motion / np.abs(modes.poles)
    return np.asarray(velocity - modes.poles.real * displacement + 1j * modes.poles.imag * displacement)


def _select_modes(modes: DiscreteModes, which: np.ndarray) -> DiscreteModes:
    return DiscreteModes(
        poles=modes.poles[which], turn=modes.turn[which], before=modes.before[which], after=modes.after[which]
    )
