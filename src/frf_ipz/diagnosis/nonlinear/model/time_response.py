"""Motion of a location in time: without a law, from initial states, and by small changes of the linear model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from frf_ipz.arrays import ComplexArray, FloatArray
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
        (n_segments, n_columns, 2, n_times) array
            Per prior standard deviation: frequencies, damping ratios, shapes at the input and at the location, and,
            where segments start in motion, displacements and velocities at the start; of each mode that is free.
        """
        moving, n_free = self.nuisance_prior.moving, len(self.nuisance_prior.modes)
        n_segments, n_times = law_force.shape
        columns = np.zeros((n_segments, 6 if len(moving) else 4, n_free, 2, n_times))
        self._derive_by_forces(law_force, columns[:, :4])
        if len(moving):
            columns[moving] += self._derive_by_free_vibration()
        return columns.reshape(n_segments, -1, 2, n_times)

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

    def _derive_by_forces(self, law_force: FloatArray, columns: FloatArray) -> None:
        """Fill in what follows from the forces, (n_segments, 4, n_free, 2, n_times), without initial states.

        A mode is one filter, and its derivative by the pole the same filter once more: all four kinds of columns are
        sums of the two forces, of both forces filtered once, and of the total one filtered twice.
        """
        segments, free = self.segments, self.nuisance_prior.modes
        turns = _select_modes(self.modes(), free).turn
        weights = _as_real_weights(self._force_weights())
        at_inputs = self.nuisance_prior.modal_model.at_inputs.shapes + self.nuisance_values.inputs
        signals = np.empty((segments.n_segments, weights.shape[-1], law_force.shape[1]))
        signals[:, 0], signals[:, 1] = segments.fine_force, law_force
        for number, (mode, turn) in enumerate(zip(free, turns, strict=True)):
            by_force, by_law = (lfilter([0, 1], [1, -turn], signals[:, row]) for row in (0, 1))
            total = at_inputs[segments.input_of, mode, None] * by_force - self.shapes[mode] * by_law
            for row, part in zip((2, 4, 6), (by_force, by_law, lfilter([1], [1, -turn], total)), strict=True):
                signals[:, row], signals[:, row + 1] = part.real, part.imag
            columns[:, :, number] = (weights[:, number] @ signals).reshape(len(signals), 4, 2, -1)

    def _force_weights(self) -> ComplexArray:
        """(n_segments, n_free, 8, 5) weights of the signals, whose products have the columns as imaginary parts.

        Motion and velocity by frequency, damping ratio, shape at the input and at the location; of the measured force
        and of the law's, of both filtered with a delay of a step, and of the total one filtered so twice.
        """
        nuisance_prior = self.nuisance_prior
        free, input_of = nuisance_prior.modes, self.segments.input_of
        modes, slopes = _select_modes(self.modes(), free), self._slopes_by_poles()
        at_inputs = nuisance_prior.modal_model.at_inputs.shapes + self.nuisance_values.inputs
        shape, spread = self.shapes[free], nuisance_prior.locations[self.location]
        loads = at_inputs[input_of][:, free], np.broadcast_to(-shape, (len(input_of), len(free)))
        inputs = nuisance_prior.inputs[input_of]

        def respond(direct: ComplexArray, filtered: ComplexArray, onto: tuple[FloatArray, FloatArray]) -> ComplexArray:
            zero = np.zeros_like(onto[0])
            return np.stack([onto[0] * direct, onto[1] * direct, onto[0] * filtered, onto[1] * filtered, zero], -1)

        once = modes.before + modes.after * modes.turn
        z, pole, damped = respond(modes.after, once, loads), modes.poles[:, None], modes.poles.imag[:, None]
        weights = []
        for slope, size in zip(slopes, (nuisance_prior.frequency, nuisance_prior.damping), strict=True):
            relative = self.step_s * slope.poles  # of the turn exp(p h), which vanishes where p decays within a step
            filtered = slope.before + slope.after * modes.turn - relative * modes.before
            by_pole = respond(slope.after, filtered, loads)
            by_pole[..., 4] = slope.turn * modes.after + relative * modes.before
            by_pole = by_pole - z * (slope.poles.imag[:, None] / damped)
            scale = (shape * size)[:, None] / damped
            weights += [scale * by_pole, scale * (pole * by_pole + slope.poles[:, None] * z)]
        by_input = respond(modes.after, once, (inputs * shape, np.zeros_like(inputs))) / damped
        by_location = respond(modes.after, once, (loads[0] * spread, 2 * loads[1] * spread)) / damped
        weights += [by_input, pole * by_input, by_location, pole * by_location]
        return np.stack(weights, 2)

    def _slopes_by_poles(self) -> tuple[DiscreteModes, DiscreteModes]:
        """Derive the free modes by the logarithms of their frequencies and of their damping ratios."""
        up_down = [[self._changed_modes(which, sign * DIFFERENCE) for sign in (1, -1)] for which in (0, 1)]
        by_frequency, by_damping = (
            DiscreteModes(
                poles=(up.poles - down.poles) / (2 * DIFFERENCE),
                turn=(up.turn - down.turn) / (2 * DIFFERENCE),
                before=(up.before - down.before) / (2 * DIFFERENCE),
                after=(up.after - down.after) / (2 * DIFFERENCE),
            )
            for up, down in up_down
        )
        return by_frequency, by_damping

    def _changed_modes(self, which: int, change: float) -> DiscreteModes:
        """Discretise the free modes with other frequencies (0) or damping ratios (1)."""
        free = self.nuisance_prior.modes
        factors = [1.0, 1.0]
        factors[which] += change
        omega, ratio = self.nuisance_prior.modal_model.poles(self.nuisance_values)
        return discretise_modes(omega[free] * factors[0], ratio[free] * factors[1], self.step_s)

    def _derive_by_free_vibration(self) -> FloatArray:
        """(n_moving, 6, n_free, 2, n_times) change of what follows from the initial states, all kinds of columns."""
        nuisance_prior, shapes = self.nuisance_prior, self.shapes[self.nuisance_prior.modes, None]
        columns = []
        for which, sizes in enumerate((nuisance_prior.frequency, nuisance_prior.damping)):
            up, down = (self._free_motion(self._changed_modes(which, sign * DIFFERENCE)) for sign in (1, -1))
            columns.append((up - down) * (shapes * sizes[:, None] / (2 * DIFFERENCE))[:, None])
        modes = _select_modes(self.modes(), nuisance_prior.modes)
        by_location = self._free_motion(modes) * nuisance_prior.locations[self.location][:, None, None]
        columns += [np.zeros_like(by_location), by_location]
        for which in (0, 1):
            states = np.zeros((2, *nuisance_prior.initial_states.shape))
            states[which] = nuisance_prior.initial_states
            columns.append(self._free_motion(modes, states) * shapes[:, None])
        return np.stack(columns, 1)

    def _free_motion(self, modes: DiscreteModes, states: FloatArray | None = None) -> FloatArray:
        """(n_moving, n_free, 2, n_times) modal motion and velocity of free vibrations, by default of those fitted."""
        states = self.nuisance_prior.initial_states_of(self.nuisance) if states is None else states
        z = _to_complex(modes, states[0], states[1])[:, :, None] * self._unit_motion(modes)
        return np.stack(self._motion_and_velocity(modes, z), 2)

    def _free_vibration(self, modes: DiscreteModes) -> np.ndarray:
        """(n_moving, n_free, n_times) free vibrations of the free modes, which are the first of `modes` or all."""
        states = self.nuisance_prior.initial_states_of(self.nuisance)
        free = self.nuisance_prior.modes
        free_modes = _select_modes(modes, free) if len(modes.poles) > len(free) else modes
        return np.asarray(_to_complex(free_modes, states[0], states[1])[:, :, None] * self._unit_motion(free_modes))

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


def _as_real_weights(weights: ComplexArray) -> FloatArray:
    """Give weights of real and imaginary parts of signals, of which the first two are real: for imaginary products."""
    both = np.stack([weights.imag, weights.real], -1).reshape(*weights.shape[:-1], -1)
    return np.ascontiguousarray(both[..., [0, 2, *range(4, both.shape[-1])]])
