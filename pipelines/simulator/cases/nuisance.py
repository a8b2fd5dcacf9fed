"""How far two sets of FRFs are apart beyond what noise and the tolerances of a nominal model explain.

The distance is half a chi-square, in nats: the difference over the standard deviation of noise and of a model error,
after the best small changes of each natural frequency, damping ratio, gain and position, each with its tolerance as a
prior.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from simulator.cases.detectability import Lines
from simulator.cases.scatter import POSITION_M_PER_M
from simulator.cases.world import World
from simulator.signals.receptance import ModalReceptance
from simulator.structures.points import Point

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

MODEL_ERROR = 0.003  # of each value: meshes, and what no tolerance covers
MOST_LINES = 400  # of all that the band has, evenly; the distance is scaled to all
FREQUENCY, DAMPING, GAIN, POSITION = 5e-4, 0.17, 3e-3, 0.6  # standard deviations; positions in units of the tolerance


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ruler:
    """Measures distances from the FRFs of a world.

    Parameters
    ----------
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
        """Whitened differences after the best changes of what nobody knows, their cost included."""
        plain = self.whiten(other)
        along = self.projector.T @ plain
        return plain - self.projector @ ((1 - np.sqrt(self.weights)) * along)

    def nats(self, other: ComplexArray) -> float:
        """Distance of other FRFs."""
        return float(0.5 * self.scale * np.sum(self.residuals(other) ** 2))


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
    plain = Ruler(
        frequencies_hz=frequencies,
        truth=truth,
        sigma=sigma,
        projector=np.zeros((2 * truth.size, 0)),
        weights=np.zeros(0),
        scale=scale,
    )
    columns = [prior * plain.whiten(other) / size for other, size, prior in _variants(world, frequencies, truth)]
    directions, sizes, _ = np.linalg.svd(np.column_stack(columns), full_matrices=False)
    return replace(plain, projector=directions, weights=1 / (1 + scale * sizes**2))


def _variants(world: World, frequencies: FloatArray, truth: ComplexArray) -> list[tuple[ComplexArray, float, float]]:
    """FRFs after a small change of each thing nobody knows, its size, and the standard deviation of its prior."""
    model, low_high = world.receptance, world.set_up.band_hz
    hz = model.omega_rad_s / (2 * np.pi)
    near = np.flatnonzero((hz > 0.5 * low_high[0]) & (hz < 1.5 * low_high[1]))
    variants = []
    for mode in near:
        for name, size, prior in (("omega_rad_s", 1e-5, FREQUENCY), ("damping_ratio", 1e-2, DAMPING)):
            values = getattr(model, name).copy()
            values[mode] *= 1 + size
            variants.append((_frf(world, replace(model, **{name: values}), frequencies), size, prior))
    for i in range(truth.shape[1]):
        scaled = truth.copy()
        scaled[:, i] *= 1 + 1e-3
        variants.append((scaled, 1e-3, GAIN))
    variants.append((truth * (1 + 1e-3), 1e-3, GAIN))  # of the force
    for row, step in _moves(world):
        shapes = model.shapes.copy()
        shapes[row] += step
        variants.append((_frf(world, replace(model, shapes=shapes), frequencies), 1.0, POSITION))
    return variants


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


def _frf(world: World, model: ModalReceptance, frequencies: FloatArray) -> ComplexArray:
    return replace(world, receptance=model).measured_frf(frequencies)
