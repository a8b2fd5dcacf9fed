"""Motions of the whole structure that follow from where its nodes lie: rigid-body motion, and slow bending."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray

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
    places, directions = _places(dofs, geometry), _directions(dofs)
    motions = np.zeros((len(dofs), 6))
    for axis in range(3):
        turn = np.eye(3)[axis]
        motions[directions == axis, axis] = 1.0
        swept = np.cross(turn, places)
        for along in range(3):
            motions[directions == along, 3 + axis] = swept[directions == along, along]
        motions[directions == 3 + axis, 3 + axis] = 1.0
    return motions


def bending_motions(dofs: Sequence[Dof], geometry: Geometry) -> FloatArray:
    """Bend the whole structure along each axis by polynomials of degree two, cross-sections staying plane and normal.

    A deflection p(x, y, z) along the axis d turns what lies beside by ``grad p x e_d``, and moves it sideways by
    ``-x_d dp/dx_c``. These motions hold the lowest modes of most free structures well enough to tell their frequencies
    to a factor of two; extension, twist and rigid-body motion are among them.

    Parameters
    ----------
    dofs : sequence of Dof
        DOFs.
    geometry : Geometry
        Where the nodes are.

    Returns
    -------
    (n_dofs, 30) array
        One column an axis and monomial; some may vanish or be alike.
    """
    places, directions = _places(dofs, geometry), _directions(dofs)
    size = float(np.abs(places).max(initial=0.0)) or 1.0
    at = places / size
    columns = []
    for along in range(3):
        for powers in MONOMIALS:
            value, gradient = _monomial(at, powers)
            moved = -at[:, [along]] * gradient
            moved[:, along] = value
            turned = np.cross(gradient, np.eye(3)[along]) / size
            columns.append(np.take_along_axis(np.hstack([moved, turned]), directions[:, None], axis=1)[:, 0])
    return np.stack(columns, 1)


def _monomial(at: FloatArray, powers: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    """Value and gradient of x^a y^b z^c."""
    gradient = np.zeros_like(at)
    for axis, power in enumerate(powers):
        if power:
            lowered = [other - (place == axis) for place, other in enumerate(powers)]
            gradient[:, axis] = power * np.prod(at ** np.array(lowered), axis=1)
    return np.prod(at ** np.array(powers), axis=1), gradient


def _places(dofs: Sequence[Dof], geometry: Geometry) -> FloatArray:
    order = np.argsort(geometry.nodes)
    found = order[np.searchsorted(geometry.nodes[order], [dof.node for dof in dofs])]
    places = geometry.coordinates_m[found]
    return np.asarray(places - geometry.coordinates_m.mean(0))


def _directions(dofs: Sequence[Dof]) -> IntArray:
    number = {name: place for place, name in enumerate((*AXES, *ROTATIONS))}
    return np.array([number[dof.direction] for dof in dofs])
