"""Structures in generalised coordinates, and the points where they are struck, sensed and changed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Point:
    """A place and a direction on a structure.

    Parameters
    ----------
    node : int
        Node of the nominal model; 0 is the ground.
    direction : str
        ``x``, ``z``, ``rx`` or ``ry``.
    offset_m : tuple of float
        How far the real place is from the node, along x and y.
    """

    node: int
    direction: str = "z"
    offset_m: tuple[float, float] = (0.0, 0.0)


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

    def with_mass(self, point: Point, mass: float) -> Structure:
        """Add a point mass, kg (or a rotary inertia, kg m^2, where the point is a rotation)."""
        row = self.row(point)
        return replace(self, mass=self.mass + mass * np.outer(row, row))

    def with_spring(self, first: Point, stiffness: float, second: Point | None = None) -> Structure:
        """Add a spring, N/m or N m/rad, to the ground or to a second point."""
        row = self.row(first) - (0 if second is None else self.row(second))
        return replace(self, stiffness=self.stiffness + stiffness * np.outer(row, row))
