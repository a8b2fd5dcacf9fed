"""Lines to draw a model of which only matrices are known: between nodes that its stiffness couples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import Matrix
    from frf_ipz.dofs import Dof

FEW_NEIGHBOURS = 6.0  # on average: frames and grids, whose couplings are all drawn
NEAREST = 30  # neighbours of a node that are considered: an eight-node brick has 26
MAX_NODES = 20_000  # more make a picture slow and black
TOLERANCE = 1 - 1e-9  # so that equal sides of a triangle all remain


def lines_between_neighbours(
    stiffness: Matrix, dofs: Sequence[Dof], nodes: IntArray, coordinates_m: FloatArray
) -> IntArray:
    """Find pairs of nodes to join by a line.

    Solids couple many nodes, and condensed matrices all of them; then two are joined only if no third lies nearer to
    both than they to each other (the relative neighbourhood graph), which gives the edges of elements.

    Parameters
    ----------
    stiffness : (n, n) sparse array
        Stiffness matrix.
    dofs : sequence of Dof
        Its rows.
    nodes : (n_nodes,) int array
        Node numbers, ascending.
    coordinates_m : (n_nodes, 3) array
        Their positions.

    Returns
    -------
    (n_lines, 2) int array
        Node numbers; empty for a model of too many nodes.
    """
    if len(nodes) > MAX_NODES:
        return np.zeros((0, 2), np.int64)
    node_index = np.searchsorted(nodes, [dof.node for dof in dofs])
    members = sparse.csr_array((np.ones(len(dofs)), (node_index, np.arange(len(dofs)))), shape=(len(nodes), len(dofs)))
    graph = sparse.csr_array(members @ abs(stiffness) @ members.T)
    graph.setdiag(0)
    graph.eliminate_zeros()
    if graph.nnz > FEW_NEIGHBOURS * len(nodes):
        pairs = [pair for node in range(len(nodes)) for pair in _neighbour_pairs(node, graph, coordinates_m)]
    else:
        pairs = list(zip(*graph.nonzero(), strict=True))
    lines = sorted({(min(pair), max(pair)) for pair in pairs})
    return nodes[np.array(lines, dtype=np.int64).reshape(-1, 2)]


def _neighbour_pairs(node: int, graph: Matrix, coordinates_m: FloatArray) -> list[tuple[int, int]]:
    """Pair a node with its neighbours that no other neighbour lies between."""
    coupled = graph.indices[graph.indptr[node] : graph.indptr[node + 1]]
    distance = np.linalg.norm(coordinates_m[coupled] - coordinates_m[node], axis=1)
    nearest = np.argsort(distance, kind="stable")[:NEAREST]
    coupled, distance = coupled[nearest], distance[nearest]
    mutual = np.linalg.norm(coordinates_m[coupled][:, None] - coordinates_m[coupled], axis=2)
    np.fill_diagonal(mutual, np.inf)
    is_between = np.maximum(mutual, distance) < TOLERANCE * distance[:, None]
    return [(node, int(neighbour)) for neighbour in coupled[~is_between.any(axis=1)]]
