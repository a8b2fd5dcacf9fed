"""Grillages: rails along x and ties along y, joined rigidly, bending out of their plane and twisting.

The drawing numbers the crossings first, rail by rail, then the nodes between them, along the rails and then the ties.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.structures.reality import Reality
from frf_testbench.simulator.structures.structure import Point, Structure, suspend

FloatArray = NDArray[np.float64]

DIRECTIONS = ("z", "rx", "ry")
BUBBLES = 6  # polynomials of degree 9 between mesh nodes: converged to 1e-7 in band


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """A straight beam of a grid: its name, its nodes in order, whether it runs along x, width and thickness."""

    name: str
    nodes: tuple[int, ...]
    along_x: bool
    width_m: float
    thickness_m: float

    @property
    def area(self) -> float:
        """Of the cross-section, m^2."""
        return self.width_m * self.thickness_m

    @property
    def bending_moment(self) -> float:
        """Second moment of area, m^4."""
        return self.width_m * self.thickness_m**3 / 12

    @property
    def polar_moment(self) -> float:
        """Polar moment of area, m^4."""
        return self.area * (self.width_m**2 + self.thickness_m**2) / 12

    @property
    def torsion_constant(self) -> float:
        """Of a rectangle, m^4, to 0.5 % (a closed approximation; both models use it)."""
        long, short = max(self.width_m, self.thickness_m), min(self.width_m, self.thickness_m)
        return long * short**3 * (1 / 3 - 0.21 * short / long * (1 - short**4 / (12 * long**4)))


@dataclass(frozen=True, kw_only=True)
class GridDrawing:
    """A grillage as drawn.

    Parameters
    ----------
    ties_x_m, rails_y_m : tuple of float
        Where the ties and the rails run.
    divisions_x, divisions_y : tuple of int
        Elements of a rail between two ties, and of a tie between two rails.
    rail, tie : tuple of float
        Width and thickness, m.
    supports : dict of int to str
        Crossings that are ``clamped`` or ``pinned``.
    """

    ties_x_m: tuple[float, ...]
    rails_y_m: tuple[float, ...]
    divisions_x: tuple[int, ...]
    divisions_y: tuple[int, ...]
    rail: tuple[float, float]
    tie: tuple[float, float]
    youngs_modulus_pa: float
    density_kg_m3: float
    poisson_ratio: float
    supports: dict[int, str]

    @property
    def n_rigid(self) -> int:
        """Motions without strain."""
        clamped = any(kind == "clamped" for kind in self.supports.values())
        return 0 if clamped else max(3 - len(self.supports), 0)

    @property
    def size_m(self) -> tuple[float, float]:
        """Extent along x and y."""
        return self.ties_x_m[-1], self.rails_y_m[-1]

    @property
    def mass_kg(self) -> float:
        """Of all members."""
        spans = {True: self.size_m[0], False: self.size_m[1]}
        return self.density_kg_m3 * sum(member.area * spans[member.along_x] for member in self.layout[1])

    @cached_property
    def layout(self) -> tuple[dict[int, tuple[float, float, float]], tuple[Member, ...]]:
        """Positions of all nodes, and the members."""
        nodes = {
            1 + r * len(self.ties_x_m) + t: (x, y, 0.0)
            for r, y in enumerate(self.rails_y_m)
            for t, x in enumerate(self.ties_x_m)
        }
        rails = [
            [1 + r * len(self.ties_x_m) + t for t in range(len(self.ties_x_m))] for r in range(len(self.rails_y_m))
        ]
        ties = [list(column) for column in zip(*rails, strict=True)]
        members = []
        for name, crossings, divisions, section in (
            *((f"rail_{i + 1}", line, self.divisions_x, self.rail) for i, line in enumerate(rails)),
            *((f"tie_{i + 1}", line, self.divisions_y, self.tie) for i, line in enumerate(ties)),
        ):
            chain = _divide(nodes, crossings, divisions)
            along_x = name.startswith("rail")
            members.append(Member(name=name, nodes=chain, along_x=along_x, width_m=section[0], thickness_m=section[1]))
        return nodes, tuple(members)

    def held(self, node: int) -> tuple[str, ...]:
        """Directions that a support holds."""
        kind = self.supports.get(node)
        directions: dict[str | None, tuple[str, ...]] = {"clamped": ("z", "rx", "ry"), "pinned": ("z",), None: ()}
        return directions[kind]


def _divide(
    nodes: dict[int, tuple[float, float, float]], crossings: list[int], divisions: tuple[int, ...]
) -> tuple[int, ...]:
    """Put nodes between crossings, with the next free numbers; returns the member's nodes in order."""
    chain = [crossings[0]]
    for start, stop, count in zip(crossings, crossings[1:], divisions, strict=False):
        a, b = np.array(nodes[start]), np.array(nodes[stop])
        for i in range(1, count):
            number = max(nodes) + 1
            x, y, z = (a + (b - a) * i / count).tolist()
            nodes[number] = (x, y, z)
            chain.append(number)
        chain.append(stop)
    return tuple(chain)


def build_grid(drawing: GridDrawing, reality: Reality | None = None) -> Structure:
    """Build the model of a grid with long elements of high degree.

    Parameters
    ----------
    drawing : GridDrawing
        The nominal grid.
    reality : Reality, optional
        How the real one differs.

    Returns
    -------
    Structure
        Its rows know ``z``, ``rx`` and ``ry`` at every node, with offsets along the member and beside it.
    """
    reality = reality or Reality()
    mesh = _Mesh(drawing, reality)
    mass, stiffness = mesh.matrices()
    free = mesh.free

    def row(point: Point) -> FloatArray:
        return mesh.row(point)[free]

    grid = Structure(
        mass=mass[np.ix_(free, free)],
        stiffness=stiffness[np.ix_(free, free)],
        row=row,
        nodes=drawing.layout[0],
        n_rigid=drawing.n_rigid,
    )
    return suspend(reality.add_extras(grid), reality.suspension_hz)


def _bending(xi: FloatArray, length: float, derivative: int) -> FloatArray:
    """Evaluate cubic end functions (w, slope, w, slope) and bubbles on -1..1, differentiated along the beam."""
    p = np.polynomial.Polynomial
    half = length / 2
    ends = [p([2, -3, 0, 1]) / 4, p([1, -1, -1, 1]) * half / 4, p([2, 3, 0, -1]) / 4, p([-1, -1, 1, 1]) * half / 4]
    bubbles = [p([1, 0, -1]) ** 2 * np.polynomial.Legendre.basis(j).convert(kind=p) for j in range(BUBBLES)]
    return np.column_stack(
        [(f.deriv(derivative) if derivative else f)(xi) / half**derivative for f in (*ends, *bubbles)]
    )


def _torsion(xi: FloatArray, length: float, derivative: int) -> FloatArray:
    """Evaluate linear end functions and bubbles on -1..1."""
    p = np.polynomial.Polynomial
    bubbles = [p([1, 0, -1]) * np.polynomial.Legendre.basis(j).convert(kind=p) for j in range(BUBBLES)]
    shapes = (p([0.5, -0.5]), p([0.5, 0.5]), *bubbles)
    return np.column_stack(
        [(f.deriv(derivative) if derivative else f)(xi) / (length / 2) ** derivative for f in shapes]
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Element:
    member: int
    start: float  # along the member, m
    length: float
    bending: tuple[tuple[int, float], ...]  # global row and sign of each bending function
    torsion: tuple[tuple[int, float], ...]


class _Mesh:
    """Elements between crossings, supports and the nodes where forces act."""

    def __init__(self, drawing: GridDrawing, reality: Reality) -> None:
        self.drawing, self.reality = drawing, reality
        self.nodes, self.members = drawing.layout
        n_crossings = len(drawing.ties_x_m) * len(drawing.rails_y_m)
        mesh_nodes = sorted({*range(1, n_crossings + 1), *reality.all_stations})
        self.first = {node: 3 * i for i, node in enumerate(mesh_nodes)}  # rows of z, rx, ry
        self.size = 3 * len(mesh_nodes)
        self.elements = [element for i in range(len(self.members)) for element in self._elements(i)]
        held = [self.first[n] + DIRECTIONS.index(d) for n in drawing.supports for d in drawing.held(n)]
        self.free = np.setdiff1d(np.arange(self.size), held)

    def _elements(self, index: int) -> list[_Element]:
        member = self.members[index]
        chain = [node for node in member.nodes if node in self.first]
        elements = []
        for a, b in pairwise(chain):
            i, j, n = self.first[a], self.first[b], self.size
            # along x the slope is -ry and rx twists; along y the slope is rx and ry twists
            slope, sign, twist = (2, -1.0, 1) if member.along_x else (1, 1.0, 2)
            ends = ((i, 1.0), (i + slope, sign), (j, 1.0), (j + slope, sign))
            elements.append(
                _Element(
                    member=index,
                    start=self._along(member, a),
                    length=self._along(member, b) - self._along(member, a),
                    bending=(*ends, *((n + k, 1.0) for k in range(BUBBLES))),
                    torsion=((i + twist, 1.0), (j + twist, 1.0), *((n + BUBBLES + k, 1.0) for k in range(BUBBLES))),
                )
            )
            self.size += 2 * BUBBLES
        return elements

    def _along(self, member: Member, node: int) -> float:
        return self.nodes[node][0 if member.along_x else 1]

    def matrices(self) -> tuple[FloatArray, FloatArray]:
        """Mass and stiffness of all coordinates."""
        mass, stiffness = np.zeros((self.size, self.size)), np.zeros((self.size, self.size))
        drawing, reality = self.drawing, self.reality
        shear_modulus = drawing.youngs_modulus_pa / (2 * (1 + drawing.poisson_ratio))
        xi, weights = np.polynomial.legendre.leggauss(2 * BUBBLES)
        for element in self.elements:
            member, half = self.members[element.member], element.length / 2
            along = (element.start + half * (1 + xi)) / drawing.size_m[0 if member.along_x else 1]
            stiffness_weights = reality.stiffness(along, part=element.member) * half * weights
            stiffness_weights *= reality.stiffness_ratio * reality.stiffness_ratio_of(member.name)
            mass_weights = reality.density(along, part=element.member) * half * weights * drawing.density_kg_m3
            for shapes, functions, elastic, inert, order in (
                (_bending, element.bending, drawing.youngs_modulus_pa * member.bending_moment, member.area, 2),
                (_torsion, element.torsion, shear_modulus * member.torsion_constant, member.polar_moment, 1),
            ):
                index, sign = np.array([i for i, _ in functions]), np.array([s for _, s in functions])
                strain, value = sign * shapes(xi, element.length, order), sign * shapes(xi, element.length, 0)
                stiffness[np.ix_(index, index)] += elastic * strain.T @ (stiffness_weights[:, None] * strain)
                mass[np.ix_(index, index)] += inert * value.T @ (mass_weights[:, None] * value)
        return mass, stiffness

    def row(self, point: Point) -> FloatArray:
        """Motion of a point for unit coordinates, before supports; cross-sections are rigid."""
        member = next(member for member in self.members if point.node in member.nodes)
        across = point.offset_m[1 if member.along_x else 0]
        if point.direction == "z" and across:
            # beside the axis of a member its twist is felt too
            along = (point.offset_m[0], 0.0) if member.along_x else (0.0, point.offset_m[1])
            twist = self.row(Point(point.node, "rx" if member.along_x else "ry", along))
            return self.row(Point(point.node, "z", along)) + (across if member.along_x else -across) * twist
        row = np.zeros(self.size)
        if point.node in self.first and point.offset_m == (0.0, 0.0):
            row[self.first[point.node] + DIRECTIONS.index(point.direction)] = 1.0
            return row
        element, xi = self._locate(point)
        along_x = self.members[element.member].along_x
        x = np.array([xi])
        if point.direction == "z":
            functions, values = element.bending, _bending(x, element.length, 0)[0]
        elif (point.direction == "ry") == along_x:  # the slope
            functions, values = element.bending, (-1 if along_x else 1) * _bending(x, element.length, 1)[0]
        else:
            functions, values = element.torsion, _torsion(x, element.length, 0)[0]
        for (i, sign), value in zip(functions, values, strict=True):
            row[i] += sign * value
        return row

    def _locate(self, point: Point) -> tuple[_Element, float]:
        """Find the element that holds a point, and the position within it."""
        index = next(i for i, member in enumerate(self.members) if point.node in member.nodes)
        member = self.members[index]
        position = self._along(member, point.node) + point.offset_m[0 if member.along_x else 1]
        elements = [element for element in self.elements if element.member == index]
        element = next((e for e in elements if position <= e.start + e.length), elements[-1])
        return element, 2 * (position - element.start) / element.length - 1
