"""Lines to draw a model that is known by its matrices only: between nodes that its stiffness couples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.dofs import Dof
    from frf_ipz.structure import Matrix

FEW_NEIGHBOURS = 6.0  # on average: frames and grids, of which every coupling is drawn
NEAR = 1.5  # of the distance to the nearest neighbour: sides of elements are drawn, diagonals of squares just so
MAX_LINES = 50_000  # more make a picture slow and black


def lines_between_neighbours(
    stiffness: Matrix, dofs: Sequence[Dof], nodes: IntArray, coordinates_m: FloatArray
) -> IntArray:
    """Find pairs of nodes to join by a line.

    Solids couple many nodes, and condensed matrices all of them; then only the near ones are joined.

    Parameters
    ----------
    stiffness : (n, n) sparse array
        Stiffness matrix.
    dofs : sequence of Dof
        Its rows.
    nodes : (n_nodes,) int array
        Node numbers, ascending.
    coordinates_m : (n_nodes, 3) array
        Where they are.

    Returns
    -------
    (n_lines, 2) int array
        Node numbers; empty where there would be too many lines.
    """
    place = np.searchsorted(nodes, [dof.node for dof in dofs])
    members = sparse.csr_array((np.ones(len(dofs)), (place, np.arange(len(dofs)))), shape=(len(nodes), len(dofs)))
    graph = sparse.coo_array(sparse.triu(members @ abs(stiffness) @ members.T, k=1))
    is_coupled = graph.data > 0
    first, second = graph.row[is_coupled].astype(np.int64), graph.col[is_coupled].astype(np.int64)
    if first.size > FEW_NEIGHBOURS / 2 * len(nodes):
        distance = np.linalg.norm(coordinates_m[first] - coordinates_m[second], axis=1)
        nearest = np.full(len(nodes), np.inf)
        np.minimum.at(nearest, first, distance)
        np.minimum.at(nearest, second, distance)
        is_near = distance <= NEAR * np.maximum(nearest[first], nearest[second])
        first, second = first[is_near], second[is_near]
    if first.size > MAX_LINES:
        return np.zeros((0, 2), np.int64)
    return np.stack([nodes[first], nodes[second]], 1)
