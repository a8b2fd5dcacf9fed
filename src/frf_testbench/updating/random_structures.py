"""Random beams, frames and plates whose real stiffness differs from the model's: truth for updating.

The elements are written here, apart from those of the package. Every structure is a nominal model with named elements,
a true factor on the stiffness of each of them (up to 20 % off: all alike, in some segments, or both), the points where
it is excited and measured, and points that nobody measures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from scipy import sparse

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.dofs import Dof
from frf_ipz.structure import Geometry, Part, StructuralModel

Element: TypeAlias = tuple[tuple[int, ...], FloatArray, FloatArray]  # nodes, stiffness, mass
LARGEST_ERROR = 0.2  # largest relative error of stiffness


@dataclass(frozen=True, kw_only=True)
class RandomStructure:
    """A structure and what is known of it: `nominal_model` to the program, the rest to its judge."""

    name: str
    nominal_model: StructuralModel
    true_model: StructuralModel
    input_dofs: tuple[Dof, ...]
    sensors: tuple[Dof, ...]
    points: tuple[Dof, ...]
    n_modes: int
    damping: FloatArray


def draw_structure(seed: int) -> RandomStructure:
    """Draw the structure that a seed stands for."""
    rng = np.random.default_rng(seed)
    kind = ("beam", "frame", "plate")[rng.integers(3)]
    nominal_model = {"beam": draw_beam, "frame": draw_frame, "plate": draw_plate}[kind](rng)
    factors, extent = draw_stiffness_errors(nominal_model, rng)
    n_frfs = int(rng.integers(1, 5))
    n_inputs = 2 if n_frfs in {2, 4} and rng.random() < 0.5 else 1
    free_dofs = [dof for dof in nominal_model.dofs if dof.direction == bending_direction(nominal_model, dof)]
    shuffled_dofs = [free_dofs[index] for index in rng.permutation(len(free_dofs))]
    input_dofs = shuffled_dofs[:n_inputs]
    sensors = shuffled_dofs[n_inputs : n_inputs + n_frfs // n_inputs]
    if rng.random() < 0.3:
        sensors[0] = input_dofs[0]
    return RandomStructure(
        name=f"{kind} {seed}, {extent}",
        nominal_model=nominal_model,
        true_model=scale_stiffness(nominal_model, factors),
        input_dofs=tuple(input_dofs),
        sensors=tuple(sensors),
        points=tuple(shuffled_dofs[-3:]),
        n_modes=int(rng.integers(4, 7)),
        damping=rng.uniform(0.002, 0.01, 200),
    )


def scale_stiffness(model: StructuralModel, factors: FloatArray) -> StructuralModel:
    """Give the model with the stiffness of every part multiplied by its factor."""
    parts = tuple(replace(part, stiffness=f * part.stiffness) for part, f in zip(model.parts, factors, strict=True))
    return replace(model, parts=parts, stiffness_all=sum_matrices(parts, len(model.all_dofs), "stiffness"))


def draw_stiffness_errors(model: StructuralModel, rng: np.random.Generator) -> tuple[FloatArray, str]:
    """Draw factors on the stiffness of all elements, and say in words which elements they change."""
    row_of = {int(node): row for row, node in enumerate(model.geometry.nodes)}
    rows = [[row_of[node] for node in part.nodes] for part in model.parts]
    middles = np.array([model.geometry.coordinates_m[row].mean(axis=0) for row in rows])
    length = np.ptp(middles, axis=0).max()
    extent = ("all alike", "in segments", "both")[rng.integers(3)]
    factors = np.ones(len(middles))
    if extent != "in segments":
        factors *= 1 + rng.uniform(-LARGEST_ERROR, LARGEST_ERROR)
    if extent != "all alike":
        for _ in range(int(rng.integers(1, 4))):
            middle = middles[rng.integers(len(middles))]
            in_segment = np.linalg.norm(middles - middle, axis=1) <= length * rng.uniform(0.05, 0.2)
            factors[in_segment] *= 1 + rng.uniform(-LARGEST_ERROR, LARGEST_ERROR)
    return factors, extent


def bending_direction(model: StructuralModel, dof: Dof) -> str:
    """Name the direction in which a node of a frame, beam or plate bends."""
    if model.name != "frame":
        return "z"
    row = int(np.flatnonzero(model.geometry.nodes == dof.node)[0])
    x = model.geometry.coordinates_m[:, 0]
    return "x" if x[row] in {x.min(), x.max()} else "z"


def draw_beam(rng: np.random.Generator) -> StructuralModel:
    """Build a straight beam on random supports."""
    count = int(rng.integers(20, 41))
    length = rng.uniform(0.3, 1.5)
    thickness = length * rng.uniform(0.008, 0.02)
    width = thickness * rng.uniform(1, 4)
    modulus, density = ((69e9, 2700.0), (210e9, 7850.0))[rng.integers(2)]
    step = length / count
    stiffness, mass = bending_element(modulus * width * thickness**3 / 12, density * width * thickness, step)
    supports = ("clamped free", "pinned pinned", "clamped pinned", "clamped clamped", "free free", "clamped sliding")
    ends = supports[rng.integers(len(supports))].split()
    held: dict[str, tuple[str, ...]] = {"clamped": ("z", "ry"), "pinned": ("z",), "sliding": ("ry",), "free": ()}
    fixed = {(1, d) for d in held[ends[0]]} | {(count + 1, d) for d in held[ends[1]]}
    nodes = np.arange(1, count + 2)
    coordinates = np.column_stack([np.arange(count + 1) * step, np.zeros((count + 1, 2))])
    elements = [((n, n + 1), stiffness, mass) for n in range(1, count + 1)]
    return assemble_model("beam", nodes, coordinates, ("z", "ry"), fixed, elements)


def draw_frame(rng: np.random.Generator) -> StructuralModel:
    """Build a plane portal frame of one or two storeys, clamped to the ground."""
    height, width, storeys, count = rng.uniform(0.4, 1), rng.uniform(0.4, 1.2), int(rng.integers(1, 3)), 8
    breadth, thickness = 0.03, rng.uniform(0.006, 0.012)
    beam = thickness * rng.uniform(0.8, 1.6)
    members = []
    for storey in range(storeys):
        low, high = storey * height, (storey + 1) * height
        members += [((0, low), (0, high), thickness), ((width, low), (width, high), thickness)]
        members += [((0, high), (width, high), beam)]
    numbers: dict[tuple[float, float], int] = {}
    elements: list[Element] = []
    for start, end, section in members:
        path = np.linspace(start, end, count + 1)
        ids = [numbers.setdefault((round(x, 9), round(z, 9)), len(numbers) + 1) for x, z in path]
        matrices = frame_element(210e9, 7850.0, breadth, section, path[1] - path[0])
        elements += [((a, b), *matrices) for a, b in pairwise(ids)]
    coordinates = np.array([(x, 0.0, z) for x, z in numbers])
    nodes = np.arange(1, len(numbers) + 1)
    fixed = {(int(n), d) for n in nodes[coordinates[:, 2] == 0] for d in ("x", "z", "ry")}
    return assemble_model("frame", nodes, coordinates, ("x", "z", "ry"), fixed, elements)


def draw_plate(rng: np.random.Generator) -> StructuralModel:
    """Build a rectangular plate of thin elements, cantilevered, on simple supports, clamped on three sides, or free."""
    nx, ny = int(rng.integers(7, 11)), int(rng.integers(5, 9))
    length = rng.uniform(0.3, 0.8)
    width, thickness = length * rng.uniform(0.5, 0.9), rng.uniform(0.002, 0.005)
    stiffness, mass = plate_element(69e9 * thickness**3 / 12 / (1 - 0.33**2), 2700 * thickness, length / nx, width / ny)
    number = np.arange(1, (nx + 1) * (ny + 1) + 1).reshape(nx + 1, ny + 1)
    x, y = np.meshgrid(np.linspace(0, length, nx + 1), np.linspace(0, width, ny + 1), indexing="ij")
    support = ("cantilever", "simple", "three sides", "free")[rng.integers(4)]
    edges = {
        "cantilever": [number[0]],
        "simple": [number[0], number[-1], number[:, 0], number[:, -1]],
        "three sides": [number[0], number[:, 0], number[:, -1]],
        "free": [],
    }[support]
    directions = ("z",) if support == "simple" else ("z", "rx", "ry")
    fixed = {(int(n), d) for edge in edges for n in edge for d in directions}
    elements = [
        (
            tuple(int(n) for n in (number[i, j], number[i + 1, j], number[i + 1, j + 1], number[i, j + 1])),
            stiffness,
            mass,
        )
        for i in range(nx)
        for j in range(ny)
    ]
    coordinates = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return assemble_model("plate", number.ravel(), coordinates, ("z", "rx", "ry"), fixed, elements)


def assemble_model(
    name: str,
    nodes: IntArray,
    coordinates: FloatArray,
    directions: tuple[str, ...],
    fixed: set[tuple[int, str]],
    elements: Sequence[Element],
) -> StructuralModel:
    """Build a model out of elements: nodes, stiffness, mass; the DOFs of a node are in the order of the directions."""
    dofs = tuple(Dof(int(node), direction) for node in nodes for direction in directions)
    first = {int(node): len(directions) * position for position, node in enumerate(nodes)}
    parts = tuple(
        Part(
            kind="element",
            name=str(number),
            nodes=tuple(int(n) for n in joined),
            indices=np.concatenate([first[n] + np.arange(len(directions)) for n in joined]),
            stiffness=stiffness,
            mass=mass,
        )
        for number, (joined, stiffness, mass) in enumerate(elements, 1)
    )
    return StructuralModel(
        name=name,
        kind="matrices",
        all_dofs=dofs,
        fixed=np.array([(dof.node, dof.direction) in fixed for dof in dofs]),
        mass_all=sum_matrices(parts, len(dofs), "mass"),
        stiffness_all=sum_matrices(parts, len(dofs), "stiffness"),
        damping_all=sparse.csr_array((len(dofs), len(dofs))),
        modal_damping=np.array([0.005]),
        geometry=Geometry(nodes=np.array(nodes), coordinates_m=coordinates, lines=np.zeros((0, 2), int)),
        parts=parts,
    )


def sum_matrices(parts: tuple[Part, ...], size: int, matrix: str) -> sparse.csr_array:
    """Add up the matrices of the parts: their ``mass`` or ``stiffness``."""
    total = np.zeros((size, size))
    for part in parts:
        total[np.ix_(part.indices, part.indices)] += getattr(part, matrix)
    return sparse.csr_array(total)


def bending_element(stiffness: float, line_density: float, length: float) -> tuple[FloatArray, FloatArray]:
    """Build an Euler-Bernoulli element, (4, 4) stiffness and mass; DOFs w and ry = -dw/dx of both nodes."""
    L = length
    k = np.array([[12, -6 * L, -12, -6 * L], [0, 4 * L**2, 6 * L, 2 * L**2], [0, 0, 12, 6 * L], [0, 0, 0, 4 * L**2]])
    m = np.array(
        [[156, -22 * L, 54, 13 * L], [0, 4 * L**2, -13 * L, -3 * L**2], [0, 0, 156, 22 * L], [0, 0, 0, 4 * L**2]]
    )
    return stiffness / L**3 * mirror_upper_triangle(k), line_density * L / 420 * mirror_upper_triangle(m)


def frame_element(
    modulus: float, density: float, breadth: float, thickness: float, step: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Build a plane frame element in the x-z plane, (6, 6); DOFs x, z, ry of both nodes."""
    length = float(np.hypot(*step))
    c, s = step / length
    area = breadth * thickness
    k, m = np.zeros((2, 6, 6))
    across, along = np.ix_([1, 2, 4, 5], [1, 2, 4, 5]), np.ix_([0, 3], [0, 3])
    k[across], m[across] = bending_element(modulus * breadth * thickness**3 / 12, density * area, length)
    k[along] = modulus * area / length * np.array([[1, -1], [-1, 1]])
    m[along] = density * area * length / 6 * np.array([[2, 1], [1, 2]])
    turn = np.kron(np.eye(2), np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]))
    return turn.T @ k @ turn, turn.T @ m @ turn


def plate_element(stiffness: float, area_density: float, a: float, b: float) -> tuple[FloatArray, FloatArray]:
    """Build a thin rectangular plate element of twelve terms, (12, 12), by integration; DOFs z, rx, ry of its nodes."""
    powers = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3), (3, 1), (1, 3)]

    def row(x: float, y: float, dx: int = 0, dy: int = 0) -> FloatArray:
        def term(u: float, p: int, d: int) -> float:
            return float(np.prod(np.arange(p, p - d, -1)) * u ** max(p - d, 0)) if p >= d else 0.0

        return np.array([term(x, p, dx) * term(y, q, dy) for p, q in powers])

    corners = [(0, 0), (a, 0), (a, b), (0, b)]
    nodal = np.array([values for x, y in corners for values in (row(x, y), row(x, y, 0, 1), -row(x, y, 1, 0))])
    shape = np.linalg.inv(nodal)
    law = stiffness * np.array([[1, 0.33, 0], [0.33, 1, 0], [0, 0, 0.335]])
    k, m = np.zeros((2, 12, 12))
    points, weights = np.polynomial.legendre.leggauss(4)
    for u, wu in zip(points, weights, strict=True):
        for v, wv in zip(points, weights, strict=True):
            x, y, area = a * (u + 1) / 2, b * (v + 1) / 2, wu * wv * a * b / 4
            curvature = np.array([row(x, y, 2, 0), row(x, y, 0, 2), 2 * row(x, y, 1, 1)]) @ shape
            deflection = row(x, y) @ shape
            k += area * curvature.T @ law @ curvature
            m += area * area_density * np.outer(deflection, deflection)
    return mirror_upper_triangle(np.triu(k)), mirror_upper_triangle(np.triu(m))


def mirror_upper_triangle(upper: FloatArray) -> FloatArray:
    """Give the symmetric matrix with this upper triangle."""
    return np.triu(upper) + np.triu(upper, 1).T
