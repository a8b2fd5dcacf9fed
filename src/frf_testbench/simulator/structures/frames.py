"""Point masses joined by springs, moving in one direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.structures.reality import Reality
from frf_testbench.simulator.structures.structure import Point, Structure, suspend

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Spring:
    """A spring between two nodes; node 0 is the ground."""

    id: str
    nodes: tuple[int, int]
    stiffness_n_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameDrawing:
    """The tables ``[[lumped.mass]]`` (masses of nodes 1, 2, ..) and ``[[lumped.spring]]`` of a model file."""

    masses_kg: tuple[float, ...]
    springs: tuple[Spring, ...]
    direction: str = "x"

    @property
    def n_rigid(self) -> int:
        """Motions without strain: a frame is one piece."""
        return int(all(0 not in spring.nodes for spring in self.springs))

    @property
    def mass_kg(self) -> float:
        """Of all masses."""
        return sum(self.masses_kg)

    def spring(self, name: str) -> Spring:
        """Find a spring by its id."""
        return next(spring for spring in self.springs if spring.id == name)


def build_frame(drawing: FrameDrawing, reality: Reality | None = None) -> Structure:
    """Build the matrices of a frame.

    Parameters
    ----------
    drawing : FrameDrawing
        The nominal frame.
    reality : Reality, optional
        How the real one differs.

    Returns
    -------
    Structure
        Its generalised coordinates are the motions of the nodes.
    """
    reality = reality or Reality()
    n = len(drawing.masses_kg)
    origin = np.zeros(1)
    masses = [m * float(reality.density(origin, part=i)[0]) for i, m in enumerate(drawing.masses_kg)]
    stiffness = np.zeros((n + 1, n + 1))
    for i, spring in enumerate(drawing.springs):
        row = np.zeros(n + 1)
        row[spring.nodes[0]], row[spring.nodes[1]] = -1, 1
        factor = (
            float(reality.stiffness(origin, part=i)[0])
            * reality.stiffness_ratio
            * reality.stiffness_ratio_of(spring.id)
        )
        stiffness += factor * spring.stiffness_n_m * np.outer(row, row)

    def point_row(point: Point) -> FloatArray:
        return np.eye(n + 1)[point.node, 1:]  # the ground does not move

    frame = Structure(
        mass=np.diag(masses),
        stiffness=stiffness[1:, 1:],
        row=point_row,
        nodes={node: (float(node), 0.0, 0.0) for node in range(1, n + 1)},
        direction=drawing.direction,
        n_rigid=drawing.n_rigid,
    )
    return suspend(reality.add_extras(frame), reality.suspension_hz)
