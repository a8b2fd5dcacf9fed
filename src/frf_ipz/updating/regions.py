"""Regions of the FE model: parts whose stiffness may be off together, as seen by the reduced model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.arrays import BoolArray, FloatArray, IntArray
from frf_ipz.fe.assembly import multiply

if TYPE_CHECKING:
    from frf_ipz.arrays import Matrix
    from frf_ipz.structure import Part, ReducedModel, StructuralModel

MAX_REGIONS = 150  # finer than any number of poles and zeros can tell apart


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Region:
    """One part of the FE model, or neighbours taken together where there are very many.

    Parameters
    ----------
    name : str
        In words.
    kind : str
        ``element``, ``spring`` or ``group``.
    nodes : tuple of int
        The nodes it touches.
    coordinates_m : (3,) array
        Its middle.
    mass, stiffness : (r, r) array
        Its share of the reduced matrices.
    """

    name: str
    kind: str
    nodes: tuple[int, ...]
    coordinates_m: FloatArray
    mass: FloatArray
    stiffness: FloatArray


def reduced_regions(full: StructuralModel, model: ReducedModel) -> tuple[Region, ...]:
    """Express the parts of an FE model in the coordinates of its reduced model.

    Parameters
    ----------
    full : StructuralModel
        The FE model.
    model : ReducedModel
        What it was reduced to; a part with DOFs that its expansion does not know is left out.

    Returns
    -------
    tuple of Region
        Parts that have stiffness, at most `MAX_REGIONS`; none where the model names no parts.
    """
    motion, known = motion_of_all_dofs(full, model)
    parts = [part for part in full.parts if part.kind != "point" and known[part.indices].all()]
    if not parts:
        return ()
    coordinates = _middles(full, parts)
    regions = [
        _region([parts[index] for index in members], coordinates[members].mean(axis=0), motion)
        for members in _neighbours(coordinates, MAX_REGIONS)
    ]
    return tuple(region for region in regions if np.abs(region.stiffness).max() > 0)


def motion_of_all_dofs(full: StructuralModel, model: ReducedModel) -> tuple[FloatArray, BoolArray]:
    """Give the motion of every DOF of an FE model for unit motions of the retained ones.

    Parameters
    ----------
    full : StructuralModel
        The FE model.
    model : ReducedModel
        What it was reduced to.

    Returns
    -------
    motion : (n_all, r) array
        0 for DOFs that are held or that the expansion does not know.
    known : (n_all,) bool array
        False for those that the expansion does not know.
    """
    motion = np.zeros((len(full.all_dofs), len(model.dofs)))
    known = full.fixed.copy()
    places = np.array([full.full_index(dof) for dof in model.expanded_dofs], int)
    motion[places] = model.expansion
    known[places] = True
    return motion, known


def _middles(full: StructuralModel, parts: list[Part]) -> FloatArray:
    where = {int(node): place for place, node in enumerate(full.geometry.nodes)}
    coordinates = full.geometry.coordinates_m
    rows = [[where[node] for node in part.nodes if node in where] for part in parts]
    return np.array([coordinates[row].mean(axis=0) if row else np.zeros(3) for row in rows])


def _region(parts: list[Part], middle: FloatArray, motion: FloatArray) -> Region:
    mass = sum(_share(motion[part.indices], part.mass) for part in parts)
    stiffness = sum(_share(motion[part.indices], part.stiffness) for part in parts)
    kind = parts[0].kind
    many = "" if len(parts) == 1 else f" to {parts[-1].name}"
    return Region(
        name=f"{kind} {parts[0].name}{many}",
        kind=kind,
        nodes=tuple(dict.fromkeys(node for part in parts for node in part.nodes)),
        coordinates_m=middle,
        mass=np.asarray(mass),
        stiffness=np.asarray(stiffness),
    )


def _share(motion: FloatArray, matrix: FloatArray | Matrix) -> FloatArray:
    share = motion.T @ multiply(sparse.csr_array(matrix), motion)
    return np.asarray((share + share.T) / 2)


def _neighbours(coordinates: FloatArray, most: int) -> list[IntArray]:
    """Split points into at most so many sets of neighbours, halving the set with the largest extent each time."""
    sets = [np.arange(len(coordinates))]
    if len(coordinates) <= most:
        return [np.array([index]) for index in sets[0]]
    while len(sets) < most:
        extents = [float(np.ptp(coordinates[members], axis=0).max()) if len(members) > 1 else -1.0 for members in sets]
        members = sets.pop(int(np.argmax(extents)))
        axis = int(np.argmax(np.ptp(coordinates[members], axis=0)))
        order = members[np.argsort(coordinates[members, axis], kind="stable")]
        half = len(order) // 2
        sets += [np.sort(order[:half]), np.sort(order[half:])]
    return sets
