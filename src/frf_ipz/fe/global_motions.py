"""Motions of the whole structure that follow from where its nodes lie: rigid-body motion, and low polynomials."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.dofs import Dof
    from frf_ipz.structure import Geometry

AXES = ("x", "y", "z")
ROTATIONS = ("rx", "ry", "rz")


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


def quadratic_motions(dofs: Sequence[Dof], geometry: Geometry) -> FloatArray:
    """Every field of displacements (and of rotations) that is a polynomial of degree two in the coordinates.

    They hold the lowest modes of most free structures well enough to tell their frequencies to a factor of two.

    Parameters
    ----------
    dofs : sequence of Dof
        DOFs.
    geometry : Geometry
        Where the nodes are.

    Returns
    -------
    (n_dofs, n_motions) array
        At most 60 motions; those that are 0 everywhere are left out.
    """
    places, directions = _places(dofs, geometry), _directions(dofs)
    x, y, z = (places / max(float(np.abs(places).max(initial=0.0)), np.finfo(float).tiny)).T
    monomials = np.stack([np.ones_like(x), x, y, z, x * x, y * y, z * z, x * y, y * z, z * x], 1)
    present = np.unique(directions)
    blocks = [monomials * (directions == direction)[:, None] for direction in present]
    motions = np.concatenate(blocks, axis=1)
    return motions[:, np.abs(motions).max(0) > 0]


def _places(dofs: Sequence[Dof], geometry: Geometry) -> FloatArray:
    order = np.argsort(geometry.nodes)
    found = order[np.searchsorted(geometry.nodes[order], [dof.node for dof in dofs])]
    places = geometry.coordinates_m[found]
    return np.asarray(places - geometry.coordinates_m.mean(0))


def _directions(dofs: Sequence[Dof]) -> IntArray:
    number = {name: place for place, name in enumerate((*AXES, *ROTATIONS))}
    return np.array([number[dof.direction] for dof in dofs])
