"""What a place does in time: without a law, with unknown starts, and by small changes of the linear model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.nonlinear.fitting.time_stepping import Modes, Yielding, make_modes
from frf_ipz.diagnosis.nonlinear.recorded.segments import FINER

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.linear.modal_model import NuisanceValues
    from frf_ipz.diagnosis.nonlinear.linear.nuisance_prior import NuisancePrior
    from frf_ipz.diagnosis.nonlinear.recorded.segments import SegmentSet

DIFFERENCE = 1e-4  # of a frequency or damping ratio: step of a derivative
REST_DAMPING = 0.05  # of the one mode that stands for all above those that are followed
LEAST_PART = 1e-9  # of the compliance: less than that above the followed modes is nothing


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaceInTime:
    """A place of a structure with deviations, over the times of stretches.

    Parameters
    ----------
    stretches : SegmentSet
        The data.
    nuisance_prior : NuisancePrior
        Unknowns of the linear model.
    unknowns : (n_unknowns,) array
        In prior standard deviations.
    place : int
        Index in `Plant.places`.
    """

    stretches: SegmentSet
    nuisance_prior: NuisancePrior
    unknowns: FloatArray
    place: int

    @property
    def step_s(self) -> float:
        """Time step, s."""
        return self.stretches.step_s / FINER

    @property
    def shapes(self) -> FloatArray:
        """(n_modes,) at the place."""
        return np.asarray(self.nuisance_prior.modal_model.at_places.shapes[self.place] + self.deviations.place)

    @property
    def deviations(self) -> NuisanceValues:
        """Of the structure."""
        return self.nuisance_prior.deviations(self.unknowns, self.place)

    def modes(self) -> Modes:
        """Give the modes that are followed."""
        return make_modes(*self.nuisance_prior.modal_model.poles(self.deviations), self.step_s)

    def yielding(self, *, constant: bool) -> Yielding:
        """Say how the place gives way to a force; see `make_modes` for `constant`."""
        points = self.nuisance_prior.modal_model.at_places
        omega, ratio = self.nuisance_prior.modal_model.poles(self.deviations)
        weights = self.shapes**2
        static, inertial = (
            points.weights[self.place] @ part[:, self.place] for part in (points.static, points.inertial)
        )
        if static > LEAST_PART * np.sum(weights / omega**2) and inertial > 0:
            above = np.sqrt(static / inertial)
            omega, ratio = np.append(omega, above), np.append(ratio, REST_DAMPING)
            weights = np.append(weights, static * above**2)
        return Yielding(modes=make_modes(omega, ratio, self.step_s, constant=constant), weights=weights)

    def without_law(self) -> FloatArray:
        """(2, n_blows, n_times) motion and velocity by the blows and by how stretches start."""
        modes, force = self.modes(), self.stretches.fine_force
        z = modes.drive(self.push())
        moving = self.nuisance_prior.moving
        if len(moving):
            z[moving[:, None], self.nuisance_prior.modes] += self._free(modes)
        found = np.stack([np.einsum("m,bmt->bt", self.shapes, part) for part in self._read(modes, z)])
        rest = self._rest(force)
        return np.asarray(found + np.stack([rest, np.gradient(rest, self.step_s, axis=1)]))

    def changes(self, law_force: FloatArray) -> FloatArray:
        """Change of motion and velocity by unknowns, at a constant force of the law.

        Parameters
        ----------
        law_force : (n_blows, n_times) array
            Against the motion, N.

        Returns
        -------
        (n_columns, 2, n_blows, n_times) array
            Per prior standard deviation: frequencies, damping ratios, shapes at the blow and at the place, and, where
            stretches start in motion, displacements and velocities at the start; of each mode that is free.
        """
        nuisance_prior, modes = self.nuisance_prior, self.modes()
        free = nuisance_prior.modes
        total = self.push()[:, free] - self.shapes[free, None] * law_force[:, None]
        columns = [self._by_pole(total, which) for which in (0, 1)]
        some = _some(modes, free)
        inputs = nuisance_prior.inputs[self.stretches.input_of]
        by_input = some.drive(inputs[:, :, None] * self.stretches.fine_force[:, None])
        columns.append(np.stack(self._read(some, by_input), 1) * self.shapes[free, None])
        columns.append(self._by_place(some, total, law_force))
        if len(nuisance_prior.moving):
            columns += self._by_start(some)
        return np.concatenate([column.transpose(2, 1, 0, 3) for column in columns])

    def push(self) -> FloatArray:
        """Give the modal forces of the blows, (n_blows, n_modes, n_times)."""
        shapes = (self.nuisance_prior.modal_model.at_inputs.shapes + self.deviations.inputs)[self.stretches.input_of]
        return np.asarray(shapes[:, :, None] * self.stretches.fine_force[:, None])

    def _read(self, modes: Modes, z: np.ndarray) -> list[FloatArray]:
        return [modes.displacement(z), modes.velocity(z)]

    def _rest(self, force: FloatArray) -> FloatArray:
        """(n_blows, n_times) motion by the modes that are not followed."""
        points, inputs = self.nuisance_prior.modal_model.at_places, self.nuisance_prior.modal_model.at_inputs
        static, inertial = (inputs.weights @ part[:, self.place] for part in (points.static, points.inertial))
        second = np.gradient(np.gradient(force, self.step_s, axis=1), self.step_s, axis=1)
        rows = self.stretches.input_of
        return np.asarray(static[rows, None] * force - inertial[rows, None] * second)

    def _by_pole(self, total: FloatArray, which: int) -> FloatArray:
        """(n_blows, 2, n_free, n_times) change by frequencies (0) or damping ratios (1)."""
        nuisance_prior = self.nuisance_prior
        free = nuisance_prior.modes
        omega, ratio = nuisance_prior.modal_model.poles(self.deviations)
        sizes = (nuisance_prior.frequency, nuisance_prior.damping)[which]
        ends = []
        for sign in (1, -1):
            factor = np.ones((2, len(free)))
            factor[which] += sign * DIFFERENCE
            modes = make_modes(omega[free] * factor[0], ratio[free] * factor[1], self.step_s)
            z = modes.drive(total)
            if len(nuisance_prior.moving):
                z[nuisance_prior.moving] += self._free(modes)
            ends.append(np.stack(self._read(modes, z), 1))
        return np.asarray((ends[0] - ends[1]) * (sizes * self.shapes[free] / (2 * DIFFERENCE))[:, None])

    def _by_place(self, modes: Modes, total: FloatArray, law_force: FloatArray) -> FloatArray:
        """(n_blows, 2, n_free, n_times) change by the shapes at the place: of what it reads, and of what acts on it."""
        nuisance_prior, shapes = self.nuisance_prior, self.shapes[self.nuisance_prior.modes, None]
        z = modes.drive(total - shapes * law_force[:, None])
        if len(nuisance_prior.moving):
            z[nuisance_prior.moving] += self._free(modes)
        sizes = nuisance_prior.places[self.place][:, None]
        return np.asarray(np.stack(self._read(modes, z), 1) * sizes)

    def _free(self, modes: Modes) -> np.ndarray:
        """(n_moving, n_free, n_times) free vibrations of the free modes, the last of `modes` or all of them."""
        starts = self.nuisance_prior.starts_of(self.unknowns)
        some = _some(modes, self.nuisance_prior.modes) if len(modes.poles) > len(self.nuisance_prior.modes) else modes
        return np.asarray(_begin(some, starts[0], starts[1])[:, :, None] * self._turning(some))

    def _by_start(self, modes: Modes) -> list[FloatArray]:
        """Each (n_blows, 2, n_free, n_times): change by displacement and velocity at the start."""
        nuisance_prior, turning = self.nuisance_prior, self._turning(modes)
        found = []
        for which in (0, 1):
            unit = [nuisance_prior.starts * (which == 0), nuisance_prior.starts * (which == 1)]
            z = np.zeros((self.stretches.n_records, *turning.shape), complex)
            z[nuisance_prior.moving] = _begin(modes, *unit)[:, :, None] * turning
            found.append(np.stack(self._read(modes, z), 1) * self.shapes[nuisance_prior.modes, None])
        return found

    def _turning(self, modes: Modes) -> np.ndarray:
        times = self.step_s * np.arange(self.stretches.fine_force.shape[1])
        return np.exp(modes.poles[:, None] * times)


def _begin(modes: Modes, motion: FloatArray, velocity: FloatArray) -> np.ndarray:
    """Complex modes, (n_moving, n_modes), from displacements times omega, and velocities."""
    displacement = motion / np.abs(modes.poles)
    return np.asarray(velocity - modes.poles.real * displacement + 1j * modes.poles.imag * displacement)


def _some(modes: Modes, which: np.ndarray) -> Modes:
    return Modes(poles=modes.poles[which], turn=modes.turn[which], before=modes.before[which], after=modes.after[which])
