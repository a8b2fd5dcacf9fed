"""Structures in generalised coordinates, and the points where they are excited, measured, changed and suspended."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, eigvalsh

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Point:
    """A location and a direction on a structure.

    Parameters
    ----------
    node : int
        Node of the nominal model; 0 is the ground.
    direction : str
        ``x``, ``z``, ``rx`` or ``ry``.
    offset_m : tuple of float
        How far the real location is from the node, along x and y.
    """

    node: int
    direction: str = "z"
    offset_m: tuple[float, float] = (0.0, 0.0)


Motion = tuple[Point, Point | None]  # of one point, or of the first one minus the second


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Structure:
    """An undamped linear structure ``M q'' + K q = rows^T f``.

    Parameters
    ----------
    mass, stiffness : (n, n) array
        In generalised coordinates.
    row : callable
        Gives for a `Point` the (n,) row that turns generalised coordinates into its motion.
    nodes : dict of int to tuple
        Node number to its position, m.
    direction : str
        Of the translations.
    n_rigid : int
        Motions without strain.
    """

    mass: FloatArray
    stiffness: FloatArray
    row: Callable[[Point], FloatArray]
    nodes: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    direction: str = "z"
    n_rigid: int = 0

    def motion_row(self, motion: Motion) -> FloatArray:
        """Return the (n,) row that turns generalised coordinates into a motion."""
        first, second = motion
        return np.asarray(self.row(first) - (0 if second is None else self.row(second)))

    def with_mass(self, point: Point, mass: float) -> Structure:
        """Add a point mass, kg (or a rotary inertia, kg m^2, where the point is a rotation)."""
        row = self.row(point)
        return replace(self, mass=self.mass + mass * np.outer(row, row))

    def with_spring(self, first: Point, stiffness: float, second: Point | None = None) -> Structure:
        """Add a spring, N/m or N m/rad, to the ground or to a second point."""
        row = self.motion_row((first, second))
        return replace(self, stiffness=self.stiffness + stiffness * np.outer(row, row))


def suspend(structure: Structure, suspension_hz: float) -> Structure:
    """Suspend a free structure softly.

    Parameters
    ----------
    structure : Structure
        With rigid-body motions.
    suspension_hz : float
        Highest frequency it then has as a rigid body; 0 leaves it as it is.

    Returns
    -------
    Structure
        With springs to the ground at two or four outer nodes.
    """
    if not suspension_hz:
        return structure
    _, shapes = eigh(structure.stiffness, structure.mass, subset_by_index=(0, structure.n_rigid - 1))
    outer_nodes = {
        min(structure.nodes, key=lambda node: float(np.dot(structure.nodes[node], corner)))
        for corner in ((1, 0.9, 0), (-1, 0.9, 0), (1, -0.9, 0), (-1, -0.9, 0))
    }
    rows = np.array([structure.row(Point(node, structure.direction)) for node in sorted(outer_nodes)]) @ shapes
    highest = eigvalsh(rows.T @ rows).max()
    stiffness = (2 * np.pi * suspension_hz) ** 2 / highest
    for node in sorted(outer_nodes):
        structure = structure.with_spring(Point(node, structure.direction), stiffness)
    return structure
