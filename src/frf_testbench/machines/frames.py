"""Three-dimensional frames of straight members on mounts: drawing, mesh, matrices.

Members are Euler-Bernoulli beams with consistent masses, two planes of bending, torsion and extension (Przemieniecki,
Theory of Matrix Structural Analysis, 1968, chapters 5 and 11).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

FloatArray = NDArray[np.float64]
Entries = tuple[FloatArray, NDArray[np.int64], NDArray[np.int64]]  # of a matrix: values, rows, columns

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
POISSON = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """A straight bar with a rectangular section.

    Parameters
    ----------
    ends : pair of int
        Points of the drawing.
    size_m : pair of float
        Height of the section, in the plane of the bar and `up`, and its width.
    wall_m : float
        Of a tube; 0 for a solid bar.
    up : tuple of float
        A direction that is not along the bar.
    group : str
        Of which part of the machine it is one.
    """

    ends: tuple[int, int]
    size_m: tuple[float, float]
    wall_m: float
    up: tuple[float, float, float]
    group: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawing:
    """A machine as its owner has drawn it.

    Parameters
    ----------
    kind : str
        ``frame``, ``sheet`` or ``stage``.
    points : (n, 3) array
        Where members end, m.
    members : tuple of Member
        Of one material.
    elements : int
        Of each member, in the model of the owner.
    youngs_modulus_pa, density_kg_m3 : float
        Of the material.
    mounts : mapping of int to pair of float
        Points on mounts, with the stiffness along z, and across, N/m.
    lumps : mapping of int to float
        Points with masses, kg.
    """

    kind: str
    points: FloatArray
    members: tuple[Member, ...]
    elements: int
    youngs_modulus_pa: float
    density_kg_m3: float
    mounts: Mapping[int, tuple[float, float]]
    lumps: Mapping[int, float]

    @property
    def groups(self) -> tuple[str, ...]:
        """Parts whose stiffness has a matrix of its own: groups of members, and mounts."""
        return (*dict.fromkeys(member.group for member in self.members), *map(name_mount, self.mounts))


def name_mount(point: int) -> str:
    """Name the group of the mount at a point."""
    return f"mount_{point + 1}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mesh:
    """Nodes and matrices of a drawing.

    Parameters
    ----------
    nodes : (n, 3) array
        m; the points of the drawing come first, then the inner nodes of each member in its order.
    mass : (6n, 6n) sparse array
        kg, and kg m2.
    stiffness : mapping of str to (6n, 6n) sparse array
        Of each group, N/m, and N m.
    """

    nodes: FloatArray
    mass: sparse.csc_array
    stiffness: Mapping[str, sparse.csc_array]

    def total_stiffness(self, ratios: Mapping[str, float] | None = None) -> sparse.csc_array:
        """Sum up the groups, some of them softer or stiffer."""
        ratios = ratios or {}
        total = sparse.csc_array(self.mass.shape)
        for name, matrix in self.stiffness.items():
            total = total + ratios.get(name, 1.0) * matrix
        return sparse.csc_array(total)


def build_mesh(
    drawing: Drawing, *, refine: int = 1, stiffer: FloatArray | float = 1.0, heavier: FloatArray | float = 1.0
) -> Mesh:
    """Divide the members into elements and sum up their matrices.

    Parameters
    ----------
    drawing : Drawing
        The machine.
    refine : int
        Divides the elements of the owner's model further: its nodes stay nodes (`find_nominal_nodes`).
    stiffer, heavier : (n_members,) array or float
        Real stiffness and density of each member over those of the drawing.

    Returns
    -------
    Mesh
        Six DOFs a node, in the order of `DIRECTIONS`.
    """
    count = drawing.elements * refine
    nodes, chains = [*drawing.points], []
    for member in drawing.members:
        start, end = (drawing.points[point] for point in member.ends)
        inner = range(len(nodes), len(nodes) + count - 1)
        nodes += [start + (end - start) * i / count for i in range(1, count)]
        chains.append((member.ends[0], *inner, member.ends[1]))
    n = 6 * len(nodes)
    ones = np.ones(len(drawing.members))
    entries: dict[str, list[Entries]] = {name: [] for name in ("mass", *drawing.groups)}
    for member, chain, by_stiffness, by_mass in zip(
        drawing.members, chains, stiffer * ones, heavier * ones, strict=True
    ):
        stiffness, mass = compute_element(drawing, member, 1 / count)
        for a, b in pairwise(chain):
            rows = np.concatenate([6 * a + np.arange(6), 6 * b + np.arange(6)])
            i, j = np.repeat(rows, 12), np.tile(rows, 12)
            entries[member.group].append((by_stiffness * stiffness.ravel(), i, j))
            entries["mass"].append((by_mass * mass.ravel(), i, j))
    for point, (along, across) in drawing.mounts.items():
        rows = 6 * point + np.arange(3)
        entries[name_mount(point)].append((np.array([across, across, along]), rows, rows))
    for point, mass_kg in drawing.lumps.items():
        rows = 6 * point + np.arange(3)
        entries["mass"].append((np.full(3, mass_kg), rows, rows))
    matrices = {name: _sum_up(parts, n) for name, parts in entries.items()}
    return Mesh(nodes=np.array(nodes), mass=matrices.pop("mass"), stiffness=matrices)


def _sum_up(parts: list[Entries], n: int) -> sparse.csc_array:
    values, i, j = (np.concatenate(column) for column in zip(*parts, strict=True))
    return sparse.csc_array(sparse.coo_array((values, (i, j)), (n, n)))


def find_nominal_nodes(drawing: Drawing, refine: int) -> NDArray[np.int64]:
    """Find the nodes of the owner's model among those of a finer mesh of it."""
    n_points, inner = len(drawing.points), drawing.elements * refine - 1
    own = np.arange(1, drawing.elements) * refine - 1
    return np.concatenate(
        [np.arange(n_points), *(n_points + number * inner + own for number in range(len(drawing.members)))]
    )


def compute_element(drawing: Drawing, member: Member, part: float) -> tuple[FloatArray, FloatArray]:
    """Compute the (12, 12) stiffness and mass of a part of a member, in global directions."""
    start, end = (drawing.points[point] for point in member.ends)
    length = part * float(np.linalg.norm(end - start))
    area, about_y, about_z, torsion = compute_section(member)
    youngs, density = drawing.youngs_modulus_pa, drawing.density_kg_m3
    stiffness, mass = np.zeros((12, 12)), np.zeros((12, 12))
    shear = youngs / (2 * (1 + POISSON))
    polar = (about_y + about_z) / area
    for ends, value, inertia in (((0, 6), youngs * area, 1.0), ((3, 9), shear * torsion, polar)):
        at = np.ix_(ends, ends)
        stiffness[at] = value / length * np.array([[1.0, -1.0], [-1.0, 1.0]])
        mass[at] = density * area * length * inertia / 6 * np.array([[2.0, 1.0], [1.0, 2.0]])
    for rows, sign, bending in (((1, 5, 7, 11), 1.0, about_z), ((2, 4, 8, 10), -1.0, about_y)):
        turn = np.array([1.0, sign * length, 1.0, sign * length])
        k = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]])
        m = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]])
        stiffness[np.ix_(rows, rows)] = youngs * bending / length**3 * k * np.outer(turn, turn)
        mass[np.ix_(rows, rows)] = density * area * length / 420 * m * np.outer(turn, turn)
    along = (end - start) / np.linalg.norm(end - start)
    across = np.cross(member.up, along)
    across /= np.linalg.norm(across)
    turn_all = np.kron(np.eye(4), np.array([along, across, np.cross(along, across)]))
    return turn_all.T @ stiffness @ turn_all, turn_all.T @ mass @ turn_all


def compute_section(member: Member) -> tuple[float, float, float, float]:
    """Compute area, second moments about the local y and z axes, and the torsion constant of a section."""
    (height, width), wall = member.size_m, member.wall_m
    inner_height, inner_width = (height - 2 * wall, width - 2 * wall) if wall else (0.0, 0.0)
    about_y = (width * height**3 - inner_width * inner_height**3) / 12
    about_z = (height * width**3 - inner_height * inner_width**3) / 12
    if wall:  # Bredt's formula
        torsion = 2 * wall * (height - wall) ** 2 * (width - wall) ** 2 / (height + width - 2 * wall)
    else:
        long, short = max(height, width), min(height, width)
        torsion = long * short**3 * (1 / 3 - 0.21 * short / long * (1 - (short / long) ** 4 / 12))
    return height * width - inner_height * inner_width, about_y, about_z, torsion
