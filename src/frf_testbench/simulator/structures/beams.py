"""Straight beams as Rayleigh-Ritz models on quintic B-splines.

Euler-Bernoulli beams have one field, the deflection w; Timoshenko beams two, w and the slope of the cross-section.
Positive rotation of a node is ``ry = -slope``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from frf_testbench.simulator.structures.reality import Reality
from frf_testbench.simulator.structures.splines import SplineBasis, make_spline_basis
from frf_testbench.simulator.structures.structure import Point, Structure, suspend

FloatArray = NDArray[np.float64]

INTERVALS = 26  # converged to 1e-6 in the first ten frequencies


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """Another rectangle for the elements `first` to `last`."""

    first: int
    last: int
    width_m: float
    thickness_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PointPart:
    """A mass or a spring at a node, known to the nominal model."""

    node: int
    mass_kg: float = 0.0
    rotary_inertia_kgm2: float = 0.0
    stiffness_n_m: float = 0.0
    rotational_stiffness_nm_rad: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamDrawing:
    """What is known about a beam: the table ``[beam]`` of a model file."""

    length_m: float
    elements: int
    formulation: str
    youngs_modulus_pa: float
    density_kg_m3: float
    poisson_ratio: float
    width_m: float
    thickness_m: float
    left: str
    right: str
    sections: tuple[Section, ...] = ()
    parts: tuple[PointPart, ...] = ()

    @property
    def shear_coefficient(self) -> float:
        """Cowper's coefficient of a rectangle."""
        nu = self.poisson_ratio
        return 10 * (1 + nu) / (12 + 11 * nu)

    @property
    def mass_kg(self) -> float:
        """Of the beam and its point masses."""
        middles = np.array([self.position(k) for k in range(1, self.elements + 1)]) + self.length_m / self.elements / 2
        width, thickness = self.rectangle(middles)
        beam = self.density_kg_m3 * float(np.sum(width * thickness)) * self.length_m / self.elements
        return beam + sum(part.mass_kg for part in self.parts)

    @property
    def n_rigid(self) -> int:
        """Motions without strain."""
        held = {"clamped": 2, "pinned": 1, "sliding": 1, "free": 0}
        both_sliding = self.left == self.right == "sliding"
        return max(2 - held[self.left] - held[self.right], int(both_sliding))

    def position(self, node: int) -> float:
        """Position of a node, m from the left end."""
        return (node - 1) * self.length_m / self.elements

    def rectangle(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Width and thickness at positions `x`, m."""
        width = np.full_like(x, self.width_m)
        thickness = np.full_like(x, self.thickness_m)
        for section in self.sections:
            inside = (x > self.position(section.first)) & (x < self.position(section.last + 1))
            width[inside], thickness[inside] = section.width_m, section.thickness_m
        return width, thickness


def build_beam(drawing: BeamDrawing, reality: Reality | None = None, *, intervals: int = INTERVALS) -> Structure:
    """Build the Rayleigh-Ritz model of a beam.

    Parameters
    ----------
    drawing : BeamDrawing
        The nominal beam.
    reality : Reality, optional
        How the real one differs.
    intervals : int
        Uniform knot intervals.

    Returns
    -------
    Structure
        Its rows know the directions ``z`` and ``ry`` at every node, with offsets along x.
    """
    reality = reality or Reality()
    builder = _Builder(drawing, reality, intervals)
    mass, stiffness = builder.matrices()
    basis = null_space(builder.held_rows()) if builder.held_rows().size else np.eye(builder.size)

    def row(point: Point) -> FloatArray:
        x = drawing.position(point.node) + point.offset_m[0]
        return builder.row(x, point.direction) @ basis

    nodes = {node: (drawing.position(node), 0.0, 0.0) for node in range(1, drawing.elements + 2)}
    beam = Structure(
        mass=basis.T @ mass @ basis,
        stiffness=basis.T @ stiffness @ basis,
        row=row,
        nodes=nodes,
        n_rigid=drawing.n_rigid,
    )
    return suspend(reality.add_extras(beam), reality.suspension_hz)


class _Builder:
    """Bases, quadrature and matrices before the supports are put in."""

    def __init__(self, drawing: BeamDrawing, reality: Reality, intervals: int) -> None:
        self.drawing, self.reality = drawing, reality
        self.timoshenko = (reality.formulation or drawing.formulation) == "timoshenko"
        steps = {drawing.position(n) for s in drawing.sections for n in (s.first, s.last + 1)}
        steps |= {drawing.position(n) for first, last, _ in reality.softened_segments for n in (first, last + 1)}
        nodes = {*reality.all_stations, *(part.node for part in drawing.parts)}
        loads = {drawing.position(node) for node in nodes}
        # a step makes the curvature jump, a force the shear force; with shear flexibility both make corners of w
        kinks = dict.fromkeys(loads, 0 if self.timoshenko else 2) | dict.fromkeys(steps, 0 if self.timoshenko else 1)
        self.deflection = make_spline_basis(drawing.length_m, intervals, kinks)
        slopes = dict.fromkeys(loads, 1) | dict.fromkeys(steps, 0)
        self.slope: SplineBasis | None = (
            make_spline_basis(drawing.length_m, intervals, slopes) if self.timoshenko else None
        )

    @property
    def size(self) -> int:
        return self.deflection.size + (self.slope.size if self.slope else 0)

    def row(self, x: float, direction: str) -> FloatArray:
        """Motion at a position for unit generalised coordinates; ``ry`` is minus the slope."""
        position = np.array([x])
        row = np.zeros(self.size)
        n_w = self.deflection.size
        if direction == "z":
            row[:n_w] = self.deflection.values(position)[0]
        elif self.slope:
            row[n_w:] = -self.slope.values(position)[0]
        else:
            row[:n_w] = -self.deflection.values(position, 1)[0]
        return row

    def held_rows(self) -> FloatArray:
        """Rows that supports hold at zero."""
        rows = []
        for end, x in (("left", 0.0), ("right", self.drawing.length_m)):
            support = getattr(self.drawing, end)
            rotational, translational = self.reality.released.get(end, (None, None))
            if support in ("clamped", "pinned") and translational is None:
                rows.append(self.row(x, "z"))
            if support in ("clamped", "sliding") and rotational is None:
                rows.append(self.row(x, "ry"))
        return np.array(rows)

    def matrices(self) -> tuple[FloatArray, FloatArray]:
        """Mass and stiffness with all fields, parts and released supports."""
        mass, stiffness = self._continuum()
        for part in self.drawing.parts:
            for direction, m, k in (
                ("z", part.mass_kg, part.stiffness_n_m),
                ("ry", part.rotary_inertia_kgm2, part.rotational_stiffness_nm_rad),
            ):
                row = self.row(self.drawing.position(part.node), direction)
                mass += m * np.outer(row, row)
                stiffness += k * np.outer(row, row)
        for end, springs in self.reality.released.items():
            x = 0.0 if end == "left" else self.drawing.length_m
            for direction, spring in zip(("ry", "z"), springs, strict=True):
                row = self.row(x, direction)
                stiffness += (spring or 0.0) * np.outer(row, row)
        return mass, stiffness

    def _continuum(self) -> tuple[FloatArray, FloatArray]:
        x, weights = self._quadrature()
        width, thickness = self.drawing.rectangle(x)
        area, second_moment = width * thickness, width * thickness**3 / 12
        xi = x / self.drawing.length_m
        relative_stiffness = self.reality.stiffness_ratio * self.reality.stiffness(xi)
        for first, last, ratio in self.reality.softened_segments:
            inside = (x > self.drawing.position(first)) & (x < self.drawing.position(last + 1))
            relative_stiffness = np.where(inside, ratio * relative_stiffness, relative_stiffness)
        bending = weights * self.drawing.youngs_modulus_pa * second_moment * relative_stiffness
        line_mass = weights * self.drawing.density_kg_m3 * area * self.reality.density(xi)
        value, slope = self._fields(x, 0), self._fields(x, 1)
        mass = _gram(value, line_mass)
        stiffness = _gram(slope, self.reality.axial_load_n * weights)
        if not self.slope:
            return mass, stiffness + _gram(self._fields(x, 2), bending)
        turn, curvature = self._slopes(x, 0), self._slopes(x, 1)
        modulus = self.drawing.youngs_modulus_pa / (2 * (1 + self.drawing.poisson_ratio))
        shear = weights * self.drawing.shear_coefficient * modulus * area * relative_stiffness
        rotary = line_mass * second_moment / area
        return mass + _gram(turn, rotary), stiffness + _gram(curvature, bending) + _gram(slope - turn, shear)

    def _quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Gauss points of the intervals between the knots of both fields."""
        knots = [self.deflection.knots] + ([self.slope.knots] if self.slope else [])
        edges = np.unique(np.concatenate(knots))
        edges = edges[np.append(True, np.diff(edges) > 1e-12 * self.drawing.length_m)]
        return SplineBasis(knots=edges, degree=0).quadrature()

    def _fields(self, x: FloatArray, derivative: int) -> FloatArray:
        block = np.zeros((x.size, self.size))
        block[:, : self.deflection.size] = self.deflection.values(x, derivative)
        return block

    def _slopes(self, x: FloatArray, derivative: int) -> FloatArray:
        block = np.zeros((x.size, self.size))
        if self.slope:
            block[:, self.deflection.size :] = self.slope.values(x, derivative)
        return block


def _gram(rows: FloatArray, weights: FloatArray) -> FloatArray:
    return np.asarray(rows.T @ (weights[:, None] * rows))
