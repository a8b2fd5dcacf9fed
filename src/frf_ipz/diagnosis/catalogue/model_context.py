"""What effects may use of the structure and its test."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.model.layout import Layout, measure_extents
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.dofs import Dof
from frf_ipz.fe.assembly import multiply

if TYPE_CHECKING:
    from frf_ipz.diagnosis.model.basis import Basis
    from frf_ipz.structure import StructuralModel

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
    ...         return [frf_ipz.Location(key=(dof.node,)) for dof in context.moving_dofs]
    ...     def parameters(self, context: frf_ipz.ModelContext, location):
    ...         return (frf_ipz.Parameter(name="mass_kg", low=1e-3 * context.mass_kg, high=context.mass_kg),)
    ...     def build(self, context, location):
    ...         return lambda values: frf_ipz.Change(mass=values[0] * context.model.mass_all)
    ...     def statement(self, context, location, values):
    ...         return f"Ballast at {context.describe_node(location.key[0])}."
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
        motion = np.zeros(len(self.model.all_dofs))
        motion[self.model.full_index(dof)] = 1.0
        return motion

    def stiffness_against(self, motion: FloatArray) -> float:
        """Stiffness against a motion by the elastic modes near the band, N/m; N m/rad against a rotation."""
        shapes = motion @ self.basis.loaded_shapes
        squares = self.basis.modes.eigenvalues[: len(shapes)]
        elastic = squares > 0
        compliance = float(np.sum(shapes[elastic] ** 2 / squares[elastic]))
        largest = float(np.max(np.sum(self.basis.loaded_shapes[:, elastic] ** 2 / squares[elastic], axis=1)))
        return 1.0 / max(compliance, 1e-6 * largest)

    def neighbouring_nodes(self, node: int, direction: str, furthest: int = 2) -> list[int]:
        """Nodes near one that move in a direction: as many on each side in a row, the nearest ones elsewhere."""
        nodes = [dof.node for dof in self.moving_dofs if dof.direction == direction]
        if self.model.kind in ("beam", "lumped"):
            return [neighbour for neighbour in nodes if 0 < abs(neighbour - node) <= furthest]
        here = self.positions[node]
        candidates = (neighbour for neighbour in nodes if neighbour != node)
        return sorted(candidates, key=lambda neighbour: self._distance(neighbour, here))[:NEAREST]

    def describe_node(self, node: int) -> str:
        """Name a node: its number, and its position on structures that have positions."""
        if self.model.kind == "lumped" or node not in self.positions:
            return f"node {node}"
        span = measure_extents(self.model)
        position = ", ".join(f"{axis} = {self.positions[node]['xyz'.index(axis)]:.3f} m" for axis in span)
        return f"node {node} ({position})"

    def _distance(self, node: int, here: FloatArray) -> float:
        return float(np.linalg.norm(self.positions[node] - here))
