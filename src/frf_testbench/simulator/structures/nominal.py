"""Nominal models: what a user's FE program would export, with coarser and different elements.

Grids: cubic elements between all nodes. Plates: bicubic elements, reduced to the DOFs of the nodes so that the lowest
modes, and what a softer panel does to them, are kept exactly, and the static compliance nearly so. Beams are stated by
their drawing in a model file; their two-node elements here only serve to check the truth against.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, null_space, svd

from frf_testbench.simulator.structures.beams import BeamDrawing
from frf_testbench.simulator.structures.frames import FrameDrawing, build_frame
from frf_testbench.simulator.structures.grids import GridDrawing
from frf_testbench.simulator.structures.plates import (
    PlateDrawing,
    assemble_plate_matrix,
    evaluate_plate_row,
    make_panel_term,
    select_free_functions,
)
from frf_testbench.simulator.structures.splines import make_spline_basis
from frf_testbench.simulator.structures.structure import Point, Structure

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int_]
Dof = tuple[int, str]

PLATE_ELEMENTS = 15  # at least, to a side: 5e-5 in the frequencies in band


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NominalModel:
    """Matrices of the free DOFs, and their additive parts.

    Parameters
    ----------
    dofs : tuple of (node, direction)
        Rows.
    mass, stiffness : (n, n) array
        Symmetric.
    groups : dict of str to (stiffness, mass)
        Parts that add up to the whole.
    """

    dofs: tuple[Dof, ...]
    mass: FloatArray
    stiffness: FloatArray
    groups: dict[str, tuple[FloatArray, FloatArray]]
    nodes: dict[int, tuple[float, float, float]]
    n_rigid: int

    def structure(self) -> Structure:
        """Return the model as a structure, to compare it with the truth."""

        def row(point: Point) -> FloatArray:
            return np.asarray(np.eye(len(self.dofs))[self.dofs.index((point.node, point.direction))])

        direction = self.dofs[0][1]
        return Structure(
            mass=self.mass,
            stiffness=self.stiffness,
            row=row,
            nodes=self.nodes,
            direction=direction,
            n_rigid=self.n_rigid,
        )


def _assemble(size: int, elements: list[tuple[IntArray, FloatArray]]) -> FloatArray:
    total = np.zeros((size, size))
    for index, matrix in elements:
        total[np.ix_(index, index)] += matrix
    return total


def _add(matrices: list[FloatArray]) -> FloatArray:
    total = matrices[0].copy()
    for matrix in matrices[1:]:
        total = total + matrix
    return total


def _timoshenko_element(length: float, phi: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give stiffness over EI/l^3, translational mass over rho A l, rotary mass over rho I / l; DOFs w, slope, w, slope.

    Przemieniecki (1968), sections 5.6 and 11.3; phi = 12 EI / (k G A l^2).
    """
    x, weights = np.polynomial.legendre.leggauss(6)
    x, weights = (x + 1) / 2, weights / 2
    c = 1 / (1 + phi)
    deflection = np.array([
        c * (1 - 3 * x**2 + 2 * x**3 + phi * (1 - x)), c * length * (x - 2 * x**2 + x**3 + phi / 2 * (x - x**2)),
        c * (3 * x**2 - 2 * x**3 + phi * x), c * length * (-(x**2) + x**3 + phi / 2 * (x**2 - x)),
    ])  # fmt: skip
    slope = np.array([
        c * 6 * (x**2 - x), c * length * (1 - 4 * x + 3 * x**2 + phi * (1 - x)),
        c * 6 * (x - x**2), c * length * (3 * x**2 - 2 * x + phi * x),
    ])  # fmt: skip
    l2 = length**2
    stiffness = c * np.array([
        [12, 6 * length, -12, 6 * length], [6 * length, (4 + phi) * l2, -6 * length, (2 - phi) * l2],
        [-12, -6 * length, 12, -6 * length], [6 * length, (2 - phi) * l2, -6 * length, (4 + phi) * l2],
    ])  # fmt: skip
    return stiffness, (weights * deflection) @ deflection.T, (weights * slope) @ slope.T


def build_nominal_beam(drawing: BeamDrawing) -> NominalModel:
    """Build the two-node elements of the model file."""
    size = 2 * (drawing.elements + 1)
    length = drawing.length_m / drawing.elements
    shear_modulus = drawing.youngs_modulus_pa / (2 * (1 + drawing.poisson_ratio))
    turn = np.diag([1.0, -1.0, 1.0, -1.0])  # ry is minus the slope
    stiffness, mass = [], []
    for k in range(1, drawing.elements + 1):
        middle = np.array([drawing.position(k) + length / 2])
        width, thickness = (float(value[0]) for value in drawing.rectangle(middle))
        area, moment = width * thickness, width * thickness**3 / 12
        bending = drawing.youngs_modulus_pa * moment
        timoshenko = drawing.formulation == "timoshenko"
        phi = 12 * bending / (drawing.shear_coefficient * shear_modulus * area * length**2) if timoshenko else 0.0
        elastic, translation, rotary = _timoshenko_element(length, phi)
        inertia = drawing.density_kg_m3 * (area * length * translation + timoshenko * moment / length * rotary)
        index = np.arange(2 * k - 2, 2 * k + 2)
        stiffness.append((index, turn @ elastic @ turn * bending / length**3))
        mass.append((index, turn @ inertia @ turn))
    for part in drawing.parts:
        index = np.array([2 * part.node - 2, 2 * part.node - 1])
        mass.append((index, np.diag([part.mass_kg, part.rotary_inertia_kgm2])))
        stiffness.append((index, np.diag([part.stiffness_n_m, part.rotational_stiffness_nm_rad])))
    held = {"clamped": (0, 1), "pinned": (0,), "sliding": (1,), "free": ()}
    fixed = [*held[drawing.left], *(size - 2 + i for i in held[drawing.right])]
    free = np.setdiff1d(np.arange(size), fixed)
    pick = np.ix_(free, free)
    return NominalModel(
        dofs=tuple((int(i) // 2 + 1, ("z", "ry")[i % 2]) for i in free),
        mass=_assemble(size, mass)[pick],
        stiffness=_assemble(size, stiffness)[pick],
        groups={},
        nodes={n: (drawing.position(n), 0.0, 0.0) for n in range(1, drawing.elements + 2)},
        n_rigid=drawing.n_rigid,
    )


def build_nominal_grid(drawing: GridDrawing) -> NominalModel:
    """Build cubic elements between all nodes of a grid; one group a member."""
    nodes, members = drawing.layout
    size = 3 * max(nodes)
    shear_modulus = drawing.youngs_modulus_pa / (2 * (1 + drawing.poisson_ratio))
    groups = {}
    for member in members:
        stiffness, mass = [], []
        for a, b in zip(member.nodes, member.nodes[1:], strict=False):
            length = float(np.linalg.norm(np.subtract(nodes[b], nodes[a])))
            elastic, translation, _ = _timoshenko_element(length, 0.0)
            slope, twist = (2, 1) if member.along_x else (1, 2)
            sign = np.diag([1, -1, 1, -1] if member.along_x else [1, 1, 1, 1])
            i, j = 3 * a - 3, 3 * b - 3
            bent, twisted = np.array([i, i + slope, j, j + slope]), np.array([i + twist, j + twist])
            bending = drawing.youngs_modulus_pa * member.bending_moment / length**3
            torsion = shear_modulus * member.torsion_constant / length
            stiffness += [(bent, bending * sign @ elastic @ sign), (twisted, torsion * np.array([[1, -1], [-1, 1]]))]
            inertia = drawing.density_kg_m3 * length
            mass += [
                (bent, inertia * member.area * sign @ translation @ sign),
                (twisted, inertia * member.polar_moment * np.array([[1 / 3, 1 / 6], [1 / 6, 1 / 3]])),
            ]
        groups[member.name] = (_assemble(size, stiffness), _assemble(size, mass))
    dofs = [(node, d) for node in sorted(nodes) for d in ("z", "rx", "ry")]
    free = np.array([i for i, (node, d) in enumerate(dofs) if d not in drawing.held(node)])
    pick = np.ix_(free, free)
    parts = {name: (k[pick], m[pick]) for name, (k, m) in groups.items()}
    return NominalModel(
        dofs=tuple(dofs[i] for i in free),
        mass=_add([m for _, m in parts.values()]),
        stiffness=_add([k for k, _ in parts.values()]),
        groups=parts,
        nodes=nodes,
        n_rigid=drawing.n_rigid,
    )


def build_nominal_plate(drawing: PlateDrawing) -> NominalModel:
    """Build bicubic elements, reduced to the DOFs of the nodes; one group a panel."""
    counts = (drawing.nodes_x - 1, drawing.nodes_y - 1)
    bases = []
    for size, count in zip(drawing.size_m, counts, strict=True):
        fineness = -(-PLATE_ELEMENTS // count)
        lines = {float(x): 1 for x in np.linspace(0, size, fineness * count + 1)[1:-1]}
        bases.append(make_spline_basis(size, 1, lines, degree=3))
    pair = (bases[0], bases[1])
    free = select_free_functions(drawing, pair)
    pick = np.ix_(free, free)
    panels = {}
    for i in range(1, 5):
        terms = [make_panel_term(drawing, i, 1.0)]
        stiffness, mass = (assemble_plate_matrix(drawing, pair, terms, mass=mass)[pick] for mass in (False, True))
        panels[f"panel_{i}"] = (stiffness, mass)
    nodes = [node for node in drawing.nodes if not drawing.held(node)]
    dofs = [(node, direction) for node in nodes for direction in ("z", "rx", "ry")]
    rows = np.array([evaluate_plate_row(pair, drawing.nodes[node], direction)[free] for node, direction in dofs])
    moving = np.abs(rows).max(axis=1) > 1e-9 * np.abs(rows).max()
    T = _reduction(list(panels.values()), rows[moving], drawing.n_rigid + 8)
    groups = {name: (T.T @ k @ T, T.T @ m @ T) for name, (k, m) in panels.items()}
    return NominalModel(
        dofs=tuple(dof for dof, moves in zip(dofs, moving, strict=True) if moves),
        mass=_add([m for _, m in groups.values()]),
        stiffness=_add([k for k, _ in groups.values()]),
        groups=groups,
        nodes={node: drawing.nodes[node] for node in nodes},
        n_rigid=drawing.n_rigid,
    )


def _reduction(parts: list[tuple[FloatArray, FloatArray]], rows: FloatArray, n_modes: int) -> FloatArray:
    """Compute the motions of all coordinates for unit motions of the rows.

    They span the lowest modes, how these change with the stiffness of each part, and the static shapes of all loads
    at the rows that do not excite these.
    """
    stiffness, mass = (_add([part[i] for part in parts]) for i in (0, 1))
    squares, shapes = eigh(stiffness, mass)
    n_exact = n_modes + 4
    high, high_squares = shapes[:, n_exact:], squares[n_exact:]
    changes = np.hstack(
        [(high.T @ part[0] @ shapes[:, :n_modes]) / (high_squares[:, None] - squares[:n_modes]) for part in parts[:-1]]
    )  # of all parts together the modes do not change
    scale = np.sqrt(high_squares)[:, None]  # in the norm of the elastic energy
    strained = scale * changes
    directions, sizes, _ = svd(strained / np.linalg.norm(strained, axis=0), full_matrices=False)
    corrections = directions[:, sizes > 0.05 * sizes[0]] / scale
    low = np.hstack([shapes[:, :n_exact], high @ corrections])
    static = high / high_squares @ (rows @ high).T
    basis = np.hstack([low, static @ null_space((rows @ low).T)])
    return np.asarray(basis @ np.linalg.inv(rows @ basis))


def build_nominal_frame(drawing: FrameDrawing) -> NominalModel:
    """Build the matrices of a frame as drawn."""
    frame = build_frame(drawing)
    n = len(drawing.masses_kg)
    return NominalModel(
        dofs=tuple((node, drawing.direction) for node in range(1, n + 1)),
        mass=frame.mass,
        stiffness=frame.stiffness,
        groups={},
        nodes=frame.nodes,
        n_rigid=frame.n_rigid,
    )
