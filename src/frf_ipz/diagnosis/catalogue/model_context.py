"""What effects may use of the structure and its test."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.diagnosis.model.layout import AXES, Layout, measure_extents
from frf_ipz.diagnosis.model.motion import Motion
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.dofs import Dof
from frf_ipz.fe.assembly import multiply

if TYPE_CHECKING:
    from frf_ipz.diagnosis.location import Location
    from frf_ipz.diagnosis.model.basis import Basis
    from frf_ipz.structure import Part, StructuralModel

NEAREST = 8  # nodes that count as neighbours where nodes are not in a row


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelContext:
    """The nominal model, the layout of its test, and the tolerances.

    Parameters
    ----------
    basis : Basis
        The nominal model in few coordinates.
    layout : Layout
        Sensors and excited points.
    band_hz : pair of float
        Hz.
    contour : (n_points,) complex array
        Where effects are searched, rad/s.
    options : DiagnoseOptions
        Tolerances.

    Examples
    --------
    >>> import frf_ipz
    >>> class Ballast(frf_ipz.Effect):
    ...     name = "ballast"
    ...     def locations(self, context: frf_ipz.ModelContext):
    ...         return [frf_ipz.Location.at_node(dof.node) for dof in context.moving_dofs]
    ...     def parameters(self, context: frf_ipz.ModelContext, location):
    ...         return (frf_ipz.Parameter(name="mass_kg", low=1e-3 * context.mass_kg, high=context.mass_kg),)
    ...     def build(self, context, location):
    ...         return lambda values: frf_ipz.Change(mass=values[0] * context.model.mass_all)
    ...     def statement(self, context, location, values):
    ...         return f"Ballast at {context.describe_node(location.node)}."
    >>> Ballast().name
    'ballast'
    """

    basis: Basis
    layout: Layout
    band_hz: tuple[float, float]
    contour: ComplexArray
    options: DiagnoseOptions

    @property
    def model(self) -> StructuralModel:
        """The nominal model."""
        return self.basis.model

    @cached_property
    def directions(self) -> tuple[str, ...]:
        """Directions of sensors and excited points, and of the DOFs of those that are ports."""
        return tuple(dict.fromkeys(dof.direction for dof in self.model.dofs_in(self.layout.dofs)))

    @cached_property
    def moving_dofs(self) -> tuple[Dof, ...]:
        """DOFs in these directions that are free, by node."""
        model = self.model
        free = [dof for dof, fixed in zip(model.all_dofs, model.fixed, strict=True) if not fixed]
        return tuple(sorted(dof for dof in free if dof.direction in self.directions))

    @cached_property
    def moving_nodes(self) -> dict[str, IntArray]:
        """Nodes that move in each direction of the test, ascending."""
        return {
            direction: np.array([dof.node for dof in self.moving_dofs if dof.direction == direction], np.int64)
            for direction in self.directions
        }

    @cached_property
    def mass_kg(self) -> float:
        """Mass of the structure, supported parts included."""
        direction = self.directions[0]
        rigid = np.array([float(dof.direction == direction) for dof in self.model.all_dofs])
        return float(rigid @ multiply(self.model.mass_all, rigid))

    @cached_property
    def positions(self) -> dict[int, FloatArray]:
        """Where each node is, m."""
        geometry = self.model.geometry
        return dict(zip(geometry.nodes.tolist(), geometry.coordinates_m, strict=True))

    def unit_motion(self, dof: Dof) -> FloatArray:
        """Motion of one DOF, (n_all,) array."""
        return self.motion(dof).dense(len(self.model.all_dofs))

    def motion(self, dof: Dof) -> Motion:
        """Motion of one DOF, by index."""
        return Motion(rows=(self.model.full_index(dof),), weights=(1.0,))

    def other_translations(self, dof: Dof) -> tuple[Motion, ...]:
        """Motions of the node of a DOF along the other axes in which it is free to move."""
        others = [Dof(dof.node, axis) for axis in AXES if axis != dof.direction]
        indices, fixed = self.model.full_indices, self.model.fixed
        return tuple(self.motion(other) for other in others if other in indices and not fixed[indices[other]])

    def spring_at(self, location: Location) -> Part:
        """Find the spring of the model that a location names."""
        return next(part for part in self.model.parts if part.kind == "spring" and part.name in location.springs)

    def extension(self, spring: Part) -> Motion:
        """Motion of the second end of a spring against its first."""
        return Motion(rows=tuple(spring.indices.tolist()), weights=(-1.0, 1.0))

    def stiffness_against(self, motion: FloatArray | Motion) -> float:
        """Stiffness against a motion by the elastic modes near the band, N/m; N m/rad against a rotation."""
        shapes, squares, largest = self._elastic_modes
        moving = Motion.of(motion)
        amplitudes = np.array(moving.weights) @ shapes[list(moving.rows)]
        compliance = float(np.sum(amplitudes**2 / squares))
        return 1.0 / max(compliance, 1e-6 * largest)

    @cached_property
    def _elastic_modes(self) -> tuple[FloatArray, FloatArray, float]:
        """Elastic shapes near the band at all DOFs, their squared frequencies, and the largest compliance of a DOF."""
        shapes = self.basis.loaded_shapes
        squares = self.basis.modes.eigenvalues[: shapes.shape[1]]
        elastic = squares > 0
        shapes, squares = shapes[:, elastic], squares[elastic]
        return shapes, squares, float(np.max(np.sum(shapes**2 / squares, axis=1)))

    def neighbouring_nodes(self, node: int, direction: str, furthest: int = 2) -> list[int]:
        """Nodes near one that move in a direction: as many on each side in a row, the nearest ones elsewhere."""
        nodes = self.moving_nodes[direction]
        if self.model.kind in ("beam", "lumped"):
            return [neighbour for neighbour in nodes.tolist() if 0 < abs(neighbour - node) <= furthest]
        others = nodes[nodes != node]
        geometry = self.model.geometry
        positions = geometry.coordinates_m[np.searchsorted(geometry.nodes, others)]
        distances = np.linalg.norm(positions - self.positions[node], axis=1)
        return [int(neighbour) for neighbour in others[np.argsort(distances, kind="stable")[:NEAREST]]]

    def describe_node(self, node: int) -> str:
        """Name a node: its number, and its position on structures that have positions."""
        if self.model.kind == "lumped" or node not in self.positions:
            return f"node {node}"
        span = measure_extents(self.model)
        position = ", ".join(f"{axis} = {self.positions[node]['xyz'.index(axis)]:.3f} m" for axis in span)
        return f"node {node} ({position})"
