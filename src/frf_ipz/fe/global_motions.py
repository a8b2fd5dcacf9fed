"""Motions of the whole structure from the coordinates of its nodes: rigid-body motion, and slow bending."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.dofs import GENERALISED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.dofs import Dof
    from frf_ipz.structure import Geometry

AXES = ("x", "y", "z")
ROTATIONS = ("rx", "ry", "rz")
MONOMIALS = tuple(powers for powers in product(range(3), repeat=3) if sum(powers) <= 2)


def rigid_body_motions(dofs: Sequence[Dof], geometry: Geometry) -> FloatArray:
    """Motion of each DOF in the three translations and three small rotations of a rigid body.

    Parameters
    ----------
    dofs : sequence of Dof
        DOFs.
    geometry : Geometry
        Where the nodes are.

    Returns
    -------
    (n_dofs, 6) array
        m/m and m/rad, rad/rad; rotations about the nodes' centre. A column is 0 where the DOFs do not take part.
    """
    positions, directions = _positions(dofs, geometry), _direction_numbers(dofs)
    motions = np.zeros((len(dofs), 6))
    for axis in range(3):
        turn = np.eye(3)[axis]
        motions[directions == axis, axis] = 1.0
        swept = np.cross(turn, positions)
        for along in range(3):
            motions[directions == along, 3 + axis] = swept[directions == along, along]
        motions[directions == 3 + axis, 3 + axis] = 1.0
    return motions


def bending_motions(dofs: Sequence[Dof], geometry: Geometry) -> FloatArray:
    """Bend the whole structure along each axis by polynomials of degree two, cross-sections staying plane and normal.

    A deflection p(x, y, z) along the axis d rotates cross-sections by ``grad p x e_d``, and moves points off the axis
    by ``-x_d dp/dx_c``. These motions hold the lowest modes of most free structures well enough to estimate their
    frequencies to a factor of two; extension, twist and rigid-body motion are among them.

    Parameters
    ----------
    dofs : sequence of Dof
        DOFs.
    geometry : Geometry
        Where the nodes are.

    Returns
    -------
    (n_dofs, 30) array
        One column an axis and monomial; some may vanish or be equal.
    """
    positions, directions = _positions(dofs, geometry), _direction_numbers(dofs)
    size = float(np.abs(positions).max(initial=0.0)) or 1.0
    scaled = positions / size
    still = np.zeros((len(directions), 1))
    deflections = [_monomial(scaled, powers) for powers in MONOMIALS]
    columns = []
    for along in range(3):
        for value, gradient in deflections:
            translation = -scaled[:, [along]] * gradient
            translation[:, along] = value
            rotation = np.cross(gradient, np.eye(3)[along]) / size
            columns.append(
                np.take_along_axis(np.hstack([translation, rotation, still]), directions[:, None], axis=1)[:, 0]
            )
    return np.stack(columns, 1)


def _monomial(points: FloatArray, powers: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    """Value and gradient of x^a y^b z^c."""
    gradient = np.zeros_like(points)
    for axis, power in enumerate(powers):
        if power:
            lowered = [exponent - (index == axis) for index, exponent in enumerate(powers)]
            gradient[:, axis] = power * np.prod(points ** np.array(lowered), axis=1)
    return np.prod(points ** np.array(powers), axis=1), gradient


def _positions(dofs: Sequence[Dof], geometry: Geometry) -> FloatArray:
    order = np.argsort(geometry.nodes)
    rows = order[np.searchsorted(geometry.nodes[order], [dof.node for dof in dofs])]
    positions = geometry.coordinates_m[rows]
    return np.asarray(positions - geometry.coordinates_m.mean(0))


def _direction_numbers(dofs: Sequence[Dof]) -> IntArray:
    number = {name: index for index, name in enumerate((*AXES, *ROTATIONS, GENERALISED))}
    return np.array([number[dof.direction] for dof in dofs])
