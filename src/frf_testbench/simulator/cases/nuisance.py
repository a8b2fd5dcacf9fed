"""How far two sets of FRFs are apart beyond what noise and the tolerances of a nominal model explain.

The distance is half a chi-square, in nats: the difference over the standard deviation of noise and of a model error,
after the best changes of each natural frequency, damping ratio, gain and position, each with its tolerance as a prior.
Between FRFs that are close these changes are small, and what they do is linear. From afar it is not: a natural
frequency that moves by a part of a resonance's width bends an FRF more than noise hides.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from frf_testbench.simulator.cases.detectability import Lines
from frf_testbench.simulator.cases.scatter import POSITION_M_PER_M
from frf_testbench.simulator.cases.world import World
from frf_testbench.simulator.structures.points import Point

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

MODEL_ERROR = 0.003  # of each value: meshes, and what no tolerance covers
MOST_LINES = 400  # of all that the band has, evenly; the distance is scaled to all
FREQUENCY, DAMPING, GAIN, POSITION = 5e-4, 0.17, 3e-3, 0.6  # standard deviations; positions in units of the tolerance
SMALL = 0.02  # standard deviations: a change whose effect is linear
EVALUATIONS, SETTLED = 12, 1e-3  # of the changes between FRFs that are far apart, and relative drop worth another


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Unknown:
    """What nobody knows of a world, as numbers in standard deviations.

    Parameters
    ----------
    world : World
        The truth.
    modes : (n_modes,) array
        Those near the band.
    moves : tuple of (int, array)
        Rows of sensors and struck points, and how their shapes change over a tolerance.
    """

    world: World
    modes: NDArray[np.int_]
    moves: tuple[tuple[int, FloatArray], ...]

    @property
    def size(self) -> int:
        """How many numbers."""
        return 2 * len(self.modes) + len(self.world.set_up.sensors) + 1 + len(self.moves)

    def frf(self, values: FloatArray, frequencies_hz: FloatArray) -> ComplexArray:
        """(n, n_sensors, n_struck) FRFs of the world with these deviations."""
        n_modes, n_sensors = len(self.modes), len(self.world.set_up.sensors)
        by_frequency, by_damping, gains, by_place = np.split(
            values, [n_modes, 2 * n_modes, 2 * n_modes + n_sensors + 1]
        )
        model = self.world.receptance
        omega, ratio, shapes = model.omega_rad_s.copy(), model.damping_ratio.copy(), model.shapes.copy()
        omega[self.modes] *= np.exp(FREQUENCY * by_frequency)
        ratio[self.modes] *= np.exp(DAMPING * by_damping)
        for value, (row, step) in zip(by_place, self.moves, strict=True):
            shapes[row] += POSITION * value * step
        changed = replace(self.world, receptance=replace(model, omega_rad_s=omega, damping_ratio=ratio, shapes=shapes))
        return changed.measured_frf(frequencies_hz) * np.exp(GAIN * (gains[:-1] + gains[-1]))[:, None]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ruler:
    """Measures distances from the FRFs of a world.

    Parameters
    ----------
    unknown : Unknown
        What nobody knows of the world.
    frequencies_hz : (n,) array
        Lines that are compared.
    truth : (n, n_sensors, n_struck) array
        FRFs of the world.
    sigma : (n, n_sensors, n_struck) array
        Standard deviation of noise and model error.
    projector : (2 n n_sensors n_struck, k) array
        Orthonormal whitened directions that cost nothing but their priors.
    weights : (k,) array
        How much of each direction the priors leave to pay.
    scale : float
        All lines of the band over those that are compared.
    """

    unknown: Unknown
    frequencies_hz: FloatArray
    truth: ComplexArray
    sigma: FloatArray
    projector: FloatArray
    weights: FloatArray
    scale: float

    def whiten(self, other: ComplexArray) -> FloatArray:
        """(2 n n_sensors n_struck,) differences from the world over their standard deviation of each part."""
        ratio = ((other - self.truth) / self.sigma).ravel() * np.sqrt(2)
        return np.concatenate([ratio.real, ratio.imag])

    def residuals(self, other: ComplexArray) -> FloatArray:
        """Whitened differences of close FRFs after the best changes of what nobody knows, their cost included."""
        plain = self.whiten(other)
        along = self.projector.T @ plain
        return plain - self.projector @ ((1 - np.sqrt(self.weights)) * along)

    def nats(self, other: ComplexArray) -> float:
        """Distance of other FRFs, however far."""

        def left(values: FloatArray) -> FloatArray:
            changed = self.unknown.frf(values, self.frequencies_hz)
            return np.concatenate([np.sqrt(self.scale) * (self.whiten(other) - self.whiten(changed)), values])

        def slopes(values: FloatArray) -> FloatArray:
            here = left(values)
            return np.column_stack([(left(values + SMALL * one) - here) / SMALL for one in np.eye(len(values))])

        found = least_squares(left, np.zeros(self.unknown.size), slopes, ftol=SETTLED, max_nfev=EVALUATIONS)
        return float(found.cost)


def make_ruler(world: World, lines: Lines) -> Ruler:
    """Prepare to measure distances from the FRFs of a world.

    Parameters
    ----------
    world : World
        The truth.
    lines : Lines
        Noise of the FRFs.

    Returns
    -------
    Ruler
        On at most `MOST_LINES` lines.
    """
    step = -(-lines.frequencies_hz.size // MOST_LINES)
    frequencies = lines.frequencies_hz[::step]
    truth = world.measured_frf(frequencies)
    sigma = np.sqrt(lines.sigma[::step] ** 2 + (MODEL_ERROR * np.abs(truth)) ** 2)
    scale = lines.frequencies_hz.size / frequencies.size
    unknown = _unknown(world)
    plain = Ruler(
        unknown=unknown,
        frequencies_hz=frequencies,
        truth=truth,
        sigma=sigma,
        projector=np.zeros((2 * truth.size, 0)),
        weights=np.zeros(0),
        scale=scale,
    )
    changes = [unknown.frf(SMALL * one, frequencies) for one in np.eye(unknown.size)]
    columns = np.column_stack([plain.whiten(changed) / SMALL for changed in changes])
    directions, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return replace(plain, projector=directions, weights=1 / (1 + scale * sizes**2))


def _unknown(world: World) -> Unknown:
    hz, low_high = world.receptance.omega_rad_s / (2 * np.pi), world.set_up.band_hz
    near = np.flatnonzero((hz > 0.5 * low_high[0]) & (hz < 1.5 * low_high[1]))
    return Unknown(world=world, modes=near, moves=tuple(_moves(world)))


def _moves(world: World) -> list[tuple[int, FloatArray]]:
    """Rows of sensors and struck points, and how their shapes change over a tolerance along x and along y."""
    moves = []
    n_modes = world.receptance.omega_rad_s.size
    nodes = [*(sensor.node for sensor in world.set_up.sensors), *(node for node, _ in world.set_up.struck)]
    for row, node in zip([*world.sensor_rows, *world.struck_rows], nodes, strict=True):
        place = world.structure.nodes[node]
        for axis, size in enumerate(world.specimen.length_m):
            if not size:
                continue
            step = POSITION_M_PER_M * size * (1 if place[axis] < size / 2 else -1)  # never off the structure
            offset = (step, 0.0) if axis == 0 else (0.0, step)
            here, there = (
                world.structure.row(Point(node, world.specimen.direction, at)) for at in ((0.0, 0.0), offset)
            )
            moves.append((row, (there - here) @ world.modes.shapes[:, :n_modes]))
    return moves
