"""How far two sets of FRFs are apart beyond what noise and the tolerances of a nominal model explain.

The distance is half a chi-square, and so a log Bayes factor: the difference over the standard deviation of noise and of
a model error, after the best changes of each natural frequency, damping ratio, gain and position (the nuisance
parameters), each with its tolerance as a prior. Between FRFs that are close these changes are small, and what they do
is linear. From afar it is not: a natural frequency that moves by a part of a resonance's width bends an FRF more than
noise hides.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from frf_testbench.simulator.cases.detectability import FrfNoise
from frf_testbench.simulator.cases.scatter import POSITION_M_PER_M
from frf_testbench.simulator.cases.system import TrueSystem
from frf_testbench.simulator.structures.structure import Point

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

MODEL_ERROR = 0.003  # of each value: meshes, and what no tolerance covers
MOST_LINES = 400  # of all that the band has, evenly; the distance is scaled to all
FREQUENCY, DAMPING, GAIN, POSITION = 5e-4, 0.17, 3e-3, 0.6  # standard deviations; positions in units of the tolerance
SMALL = 0.02  # standard deviations: a change whose effect is linear
EVALUATIONS, SETTLED = 12, 1e-3  # of the changes between FRFs that are far apart, and relative drop worth another


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Nuisance:
    """Nuisance parameters of a system, in standard deviations.

    Parameters
    ----------
    system : TrueSystem
        The truth.
    modes : (n_modes,) array
        Those near the band.
    moves : tuple of (int, array)
        Rows of sensors and excited points, and how their shapes change over a tolerance.
    """

    system: TrueSystem
    modes: NDArray[np.int_]
    moves: tuple[tuple[int, FloatArray], ...]

    @property
    def size(self) -> int:
        """How many numbers."""
        return 2 * len(self.modes) + len(self.system.set_up.sensors) + 1 + len(self.moves)

    def frf(self, values: FloatArray, frequencies_hz: FloatArray) -> ComplexArray:
        """Return the (n, n_sensors, n_excited) FRFs of the system with these nuisance values."""
        n_modes, n_sensors = len(self.modes), len(self.system.set_up.sensors)
        frequencies, dampings, gains, positions = np.split(values, [n_modes, 2 * n_modes, 2 * n_modes + n_sensors + 1])
        model = self.system.receptance
        omega, ratio, shapes = model.omega_rad_s.copy(), model.damping_ratio.copy(), model.shapes.copy()
        omega[self.modes] *= np.exp(FREQUENCY * frequencies)
        ratio[self.modes] *= np.exp(DAMPING * dampings)
        for value, (row, step) in zip(positions, self.moves, strict=True):
            shapes[row] += POSITION * value * step
        receptance = replace(model, omega_rad_s=omega, damping_ratio=ratio, shapes=shapes)
        frf = replace(self.system, receptance=receptance).measured_frf(frequencies_hz)
        return np.asarray(frf * np.exp(GAIN * (gains[:-1] + gains[-1]))[:, None])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrfDistance:
    """Measures distances from the FRFs of a system.

    Parameters
    ----------
    nuisance : Nuisance
        Of the system.
    frequencies_hz : (n,) array
        Lines that are compared.
    truth : (n, n_sensors, n_excited) array
        FRFs of the system.
    sigma : (n, n_sensors, n_excited) array
        Standard deviation of noise and model error.
    projector : (2 n n_sensors n_excited, k) array
        Orthonormal whitened directions that cost nothing but their priors.
    weights : (k,) array
        How much of each direction the priors leave to pay.
    scale : float
        All lines of the band over those that are compared.
    """

    nuisance: Nuisance
    frequencies_hz: FloatArray
    truth: ComplexArray
    sigma: FloatArray
    projector: FloatArray
    weights: FloatArray
    scale: float

    def whiten(self, frf: ComplexArray) -> FloatArray:
        """Return (2 n n_sensors n_excited,) differences from the system over the standard deviation of each part."""
        ratio = ((frf - self.truth) / self.sigma).ravel() * np.sqrt(2)
        return np.concatenate([ratio.real, ratio.imag])

    def misfit(self, frf: ComplexArray) -> FloatArray:
        """Return whitened differences of close FRFs after the best nuisance values, whose cost is included."""
        whitened = self.whiten(frf)
        explained = self.projector.T @ whitened
        return np.asarray(whitened - self.projector @ ((1 - np.sqrt(self.weights)) * explained))

    def measure(self, frf: ComplexArray) -> float:
        """Return the distance of FRFs, however far: half a chi-square."""

        def misfit(values: FloatArray) -> FloatArray:
            changed = self.nuisance.frf(values, self.frequencies_hz)
            return np.concatenate([np.sqrt(self.scale) * (self.whiten(frf) - self.whiten(changed)), values])

        def slopes(values: FloatArray) -> FloatArray:
            reference = misfit(values)
            steps = SMALL * np.eye(len(values))
            return np.column_stack([(misfit(values + step) - reference) / SMALL for step in steps])

        fit = least_squares(misfit, np.zeros(self.nuisance.size), slopes, ftol=SETTLED, max_nfev=EVALUATIONS)
        return float(fit.cost)


def make_distance(system: TrueSystem, noise: FrfNoise) -> FrfDistance:
    """Prepare to measure distances from the FRFs of a system.

    Parameters
    ----------
    system : TrueSystem
        The truth.
    noise : FrfNoise
        Noise of the FRFs.

    Returns
    -------
    FrfDistance
        On at most `MOST_LINES` lines.
    """
    step = -(-noise.frequencies_hz.size // MOST_LINES)
    frequencies = noise.frequencies_hz[::step]
    truth = system.measured_frf(frequencies)
    sigma = np.sqrt(noise.sigma[::step] ** 2 + (MODEL_ERROR * np.abs(truth)) ** 2)
    scale = noise.frequencies_hz.size / frequencies.size
    nuisance = _list_nuisance(system)
    noise_only = FrfDistance(
        nuisance=nuisance,
        frequencies_hz=frequencies,
        truth=truth,
        sigma=sigma,
        projector=np.zeros((2 * truth.size, 0)),
        weights=np.zeros(0),
        scale=scale,
    )
    changes = [nuisance.frf(SMALL * direction, frequencies) for direction in np.eye(nuisance.size)]
    columns = np.column_stack([noise_only.whiten(changed) / SMALL for changed in changes])
    directions, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return replace(noise_only, projector=directions, weights=1 / (1 + scale * sizes**2))


def _list_nuisance(system: TrueSystem) -> Nuisance:
    hz, (low, high) = system.receptance.omega_rad_s / (2 * np.pi), system.set_up.band_hz
    modes = np.flatnonzero((hz > 0.5 * low) & (hz < 1.5 * high))
    return Nuisance(system=system, modes=modes, moves=tuple(_list_moves(system)))


def _list_moves(system: TrueSystem) -> list[tuple[int, FloatArray]]:
    """List rows of sensors and excited points, and how their shapes change over a tolerance along x and y."""
    moves = []
    n_modes = system.receptance.omega_rad_s.size
    nodes = [*(sensor.node for sensor in system.set_up.sensors), *(node for node, _ in system.set_up.excited_points)]
    for row, node in zip([*system.sensor_rows, *system.excited_rows], nodes, strict=True):
        position = system.structure.nodes[node]
        for axis, size in enumerate(system.specimen.length_m):
            if not size:
                continue
            step = POSITION_M_PER_M * size * (1 if position[axis] < size / 2 else -1)  # never off the structure
            offset = (step, 0.0) if axis == 0 else (0.0, step)
            at_node, beside = (
                system.structure.row(Point(node, system.specimen.direction, shift)) for shift in ((0.0, 0.0), offset)
            )
            moves.append((row, (beside - at_node) @ system.modes.shapes[:, :n_modes]))
    return moves
