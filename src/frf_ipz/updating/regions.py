"""Regions of the FE model: parts whose stiffness may be wrong together, in the coordinates of the reduced model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.arrays import BoolArray, FloatArray, IntArray
from frf_ipz.dofs import GENERALISED, TRANSLATIONS, Dof, node_dofs
from frf_ipz.fe.assembly import multiply
from frf_ipz.fe.stiffness_fields import stiffness_shares

if TYPE_CHECKING:
    from frf_ipz.arrays import Matrix
    from frf_ipz.structure import Part, ReducedModel, StructuralModel

MAX_REGIONS = 150  # finer than any number of poles and zeros resolves
FIELDS = 16  # smooth fields resolve what is some four of them along and across a structure, as the lowest modes do
MOST_FIELD_DOFS = 10_000  # of a model of matrices: beyond, their shares cost more than its modes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Region:
    """One part of the FE model, or neighbouring parts together where there are very many.

    Parameters
    ----------
    name : str
        In words.
    kind : str
        ``element``, ``spring``, ``group`` or ``region``.
    nodes : tuple of int
        The nodes it touches.
    coordinates_m : (3,) array
        Its centre.
    mass, stiffness : (r, r) array
        Its share of the reduced matrices.
    """

    name: str
    kind: str
    nodes: tuple[int, ...]
    coordinates_m: FloatArray
    mass: FloatArray
    stiffness: FloatArray


def reduced_regions(fe_model: StructuralModel, reduced_model: ReducedModel) -> tuple[Region, ...]:
    """Express the parts of an FE model in the coordinates of its reduced model.

    Parameters
    ----------
    fe_model : StructuralModel
        The FE model.
    reduced_model : ReducedModel
        Its reduced model; a part with DOFs outside its expansion is omitted.

    Returns
    -------
    tuple of Region
        Parts that have stiffness, at most `MAX_REGIONS`; none where the model names no parts.
    """
    motion, known = motion_of_all_dofs(fe_model, reduced_model)
    parts = [part for part in fe_model.parts if part.kind != "point" and known[part.indices].all()]
    if not parts:
        return ()
    coordinates = _centres(fe_model, parts)
    regions = [
        _region([parts[index] for index in members], coordinates[members].mean(axis=0), motion)
        for members in _clusters(coordinates, MAX_REGIONS)
    ]
    return tuple(region for region in regions if np.abs(region.stiffness).max() > 0)


def smooth_regions(fe_model: StructuralModel, reduced_model: ReducedModel) -> tuple[Region, ...]:
    """Divide a model that is given by its matrices into regions that fade into one another.

    Parameters
    ----------
    fe_model : StructuralModel
        The FE model.
    reduced_model : ReducedModel
        Its reduced model.

    Returns
    -------
    tuple of Region
        Their matrices sum to those of the model. None where the nodes have no positions, DOFs have no node, all are
        joined with all as in a super-element, the stiffness holds a negative one that is meant (no material has it), or
        the model is too large.
    """
    dofs, coordinates = fe_model.all_dofs, fe_model.geometry.coordinates_m
    n_dofs, count = len(dofs), min(FIELDS, len(coordinates) // 2)
    is_sparse = 2 * fe_model.stiffness_all.nnz < n_dofs**2
    if fe_model.kind != "matrices" or fe_model.allows_negative_stiffness or not is_sparse:
        return ()
    if fe_model.geometry.is_schematic or count < 2:
        return ()
    row_of = {int(node): row for row, node in enumerate(fe_model.geometry.nodes)}
    has_places = all(dof.node in row_of and dof.direction != GENERALISED for dof in dofs)
    motion, known = motion_of_all_dofs(fe_model, reduced_model)
    if not has_places or not known.all() or n_dofs > MOST_FIELD_DOFS:
        return ()
    clusters = _clusters(coordinates, count)
    centres = np.array([coordinates[members].mean(axis=0) for members in clusters])
    weights = _fading_weights(coordinates, centres)
    if weights is None:
        return ()
    of_dofs = weights[[row_of[dof.node] for dof in dofs]]
    stiffness = stiffness_shares(fe_model.stiffness_all, dofs, fe_model.geometry, of_dofs)
    mass = sparse.coo_array(fe_model.mass_all)
    rows, columns = mass.coords
    regions = []
    for number, (members, centre, share) in enumerate(zip(clusters, centres, stiffness, strict=True)):
        entries = mass.data * (of_dofs[rows, number] + of_dofs[columns, number]) / 2
        nodes = tuple(int(node) for node in fe_model.geometry.nodes[members])
        middle = int(np.argmin(np.linalg.norm(coordinates[members] - centre, axis=1)))
        regions.append(
            Region(
                name=f"the region around node {nodes[middle]}",
                kind="region",
                nodes=nodes,
                coordinates_m=centre,
                mass=_share(motion, sparse.csr_array(sparse.coo_array((entries, (rows, columns)), shape=mass.shape))),
                stiffness=_share(motion, share),
            )
        )
    return tuple(regions)


def _fading_weights(coordinates: FloatArray, centres: FloatArray) -> FloatArray | None:
    """Weights of each node in each region, which sum to 1 and fade over the distance of neighbouring centres."""
    apart = np.linalg.norm(centres[:, None] - centres, axis=2)
    spacing = float(np.sort(apart, axis=1)[:, 1].mean())
    if spacing == 0.0:
        return None
    squares = (np.linalg.norm(coordinates[:, None] - centres, axis=2) / spacing) ** 2
    weights = np.exp(-(squares - squares.min(axis=1, keepdims=True)) / 2)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def points_of_mass(fe_model: StructuralModel, reduced_model: ReducedModel) -> dict[int, FloatArray]:
    """Choose nodes at which a structure may have a mass that its model lacks.

    Parameters
    ----------
    fe_model : StructuralModel
        The FE model.
    reduced_model : ReducedModel
        Its reduced model.

    Returns
    -------
    dict of int to (k, r) array
        Of each node the motion along its axes for unit motions of the retained DOFs; all nodes that move, or one amid
        each set of neighbours where there are more than `MAX_REGIONS`.
    """
    rows: dict[int, list[int]] = {}
    moves = np.asarray(reduced_model.expansion.any(axis=1))
    for row, dof in enumerate(reduced_model.expanded_dofs):
        if moves[row] and isinstance(dof, Dof) and dof.direction in TRANSLATIONS:
            rows.setdefault(dof.node, []).append(row)
    place_of = {int(node): place for place, node in enumerate(fe_model.geometry.nodes)}
    nodes = [node for node in rows if node in place_of]
    if not nodes:
        return {}
    coordinates = fe_model.geometry.coordinates_m[[place_of[node] for node in nodes]]
    chosen = [nodes[_amid(coordinates, members)] for members in _clusters(coordinates, MAX_REGIONS)]
    return {node: reduced_model.expansion[rows[node]] for node in chosen}


def _amid(coordinates: FloatArray, members: IntArray) -> int:
    """Give the one of some points that is nearest to their centre."""
    chosen = coordinates[members]
    return int(members[np.argmin(np.linalg.norm(chosen - chosen.mean(axis=0), axis=1))])


def motion_of_all_dofs(fe_model: StructuralModel, reduced_model: ReducedModel) -> tuple[FloatArray, BoolArray]:
    """Give the motion of every DOF of an FE model for unit motions of the retained ones.

    Parameters
    ----------
    fe_model : StructuralModel
        The FE model.
    reduced_model : ReducedModel
        Its reduced model.

    Returns
    -------
    motion : (n_all, r) array
        0 for DOFs that are held or outside the expansion.
    known : (n_all,) bool array
        False for DOFs outside the expansion.
    """
    motion = np.zeros((len(fe_model.all_dofs), len(reduced_model.dofs)))
    known = fe_model.fixed.copy()
    rows = [row for row, dof in enumerate(reduced_model.expanded_dofs) if isinstance(dof, Dof)]
    indices = np.array([fe_model.full_index(dof) for dof in node_dofs(reduced_model.expanded_dofs)], np.int64)
    motion[indices] = reduced_model.expansion[rows]
    known[indices] = True
    return motion, known


def _centres(fe_model: StructuralModel, parts: list[Part]) -> FloatArray:
    row_of = {int(node): row for row, node in enumerate(fe_model.geometry.nodes)}
    coordinates = fe_model.geometry.coordinates_m
    rows = [[row_of[node] for node in part.nodes if node in row_of] for part in parts]
    return np.array([coordinates[row].mean(axis=0) if row else np.zeros(3) for row in rows])


def _region(parts: list[Part], centre: FloatArray, motion: FloatArray) -> Region:
    mass = sum(_share(motion[part.indices], part.mass) for part in parts)
    stiffness = sum(_share(motion[part.indices], part.stiffness) for part in parts)
    kind = parts[0].kind
    last_part = "" if len(parts) == 1 else f" to {parts[-1].name}"
    return Region(
        name=f"{kind} {parts[0].name}{last_part}",
        kind=kind,
        nodes=tuple(dict.fromkeys(node for part in parts for node in part.nodes)),
        coordinates_m=centre,
        mass=np.asarray(mass),
        stiffness=np.asarray(stiffness),
    )


def _share(motion: FloatArray, matrix: FloatArray | Matrix) -> FloatArray:
    share = motion.T @ multiply(sparse.csr_array(matrix), motion)
    return np.asarray((share + share.T) / 2)


def _clusters(coordinates: FloatArray, max_count: int) -> list[IntArray]:
    """Split points into at most so many sets of neighbours, halving the set with the largest extent each time."""
    sets = [np.arange(len(coordinates))]
    if len(coordinates) <= max_count:
        return [np.array([index]) for index in sets[0]]
    while len(sets) < max_count:
        extents = [float(np.ptp(coordinates[members], axis=0).max()) if len(members) > 1 else -1.0 for members in sets]
        members = sets.pop(int(np.argmax(extents)))
        axis = int(np.argmax(np.ptp(coordinates[members], axis=0)))
        order = members[np.argsort(coordinates[members, axis], kind="stable")]
        half = len(order) // 2
        sets += [np.sort(order[:half]), np.sort(order[half:])]
    return sets
