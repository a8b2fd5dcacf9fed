"""Cholesky factors of large sparse matrices, ``P A P^T = L L^T``, by dense blocks.

The multifrontal method of [DuffReid1983] with the supernodes of [AshcraftGrimes1989]. Rows of a node of the mesh are
eliminated together, in an order of nodes that keeps factors sparse. Columns of L with the same rows are one front,
which LAPACK factors as a dense matrix; what its elimination leaves between the rows below goes to the front of the
first of them. Solids cost a few large fronts, in which BLAS works at full speed; what a front costs beside is saved by
merging small ones. What the factors and the fronts will take is known before anything is computed.

[DuffReid1983] I. S. Duff, J. K. Reid, The multifrontal solution of indefinite sparse symmetric linear equations, ACM
Transactions on Mathematical Software 9 (3), 1983, 302-325, doi:10.1145/356044.356047.
[AshcraftGrimes1989] C. C. Ashcraft, R. G. Grimes, The influence of relaxed supernode partitions on the multifrontal
method, ACM Transactions on Mathematical Software 15 (4), 1989, 291-309, doi:10.1145/76909.76910.
[Liu1990] J. W. H. Liu, The role of elimination trees in sparse factorization, SIAM Journal on Matrix Analysis and
Applications 11 (1), 1990, 134-172, doi:10.1137/0611010.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.linalg import blas, lapack

from frf_ipz.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import Matrix

FRONT_OVERHEAD = 2e6  # multiplications in the time that the interpreter needs for one front
BLOCK = 128  # columns that are added at once, so that most of the other triangle is left out
BYTES = 8  # of a number


@dataclass(frozen=True, slots=True, eq=False)
class _Front:
    """Columns that are eliminated together, as positions in the order, and the rows below them in their columns of L.

    Parameters
    ----------
    first, last : int
        The columns are first to last - 1.
    below : (n_below,) int array
        Ascending.
    children : tuple of int
        Fronts that leave something to this one.
    """

    first: int
    last: int
    below: IntArray
    children: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Elimination:
    """Fronts in the order of their elimination, children first.

    Parameters
    ----------
    order : (n,) int array
        Row of the matrix at each position.
    fronts : sequence of _Front
        All.
    factor_bytes, peak_bytes : int
        Of the factors, and of these with the largest fronts beside them.
    """

    order: IntArray
    fronts: Sequence[_Front]
    factor_bytes: int
    peak_bytes: int

    @classmethod
    def of(cls, graph: Matrix, group: IntArray, permutation: IntArray) -> Elimination:
        """Plan the elimination of a matrix.

        Parameters
        ----------
        graph : (n_nodes, n_nodes) sparse array
            Nonzero where rows of two nodes are coupled; symmetric.
        group : (n,) int array
            Node of each row.
        permutation : (n_nodes,) int array
            Nodes in an order that keeps factors sparse.

        Returns
        -------
        Elimination
            The fronts.
        """
        ordered = sparse.csr_array(graph[permutation][:, permutation])
        parent = _elimination_tree(ordered)
        postorder = _postorder(parent)
        permutation = permutation[postorder]
        ordered = sparse.csr_array(ordered[postorder][:, postorder])
        ordered.sort_indices()
        place = np.empty(len(postorder), np.int64)
        place[postorder] = np.arange(len(postorder))
        parent = np.where(parent[postorder] >= 0, place[parent[postorder]], -1)
        size = np.bincount(group, minlength=len(permutation))[permutation]
        starts, belows = _supernodes(ordered, parent)
        fronts = _merged(starts, belows, size)
        rank = np.empty(len(permutation), np.int64)
        rank[permutation] = np.arange(len(permutation))
        factor_bytes, peak_bytes = _bytes(fronts)
        return cls(np.argsort(rank[group], kind="stable"), fronts, factor_bytes, peak_bytes)


def _elimination_tree(graph: Matrix) -> IntArray:
    """Parent of each node: the first one below it in its column of L; -1 for a root. Section 3 of [Liu1990]."""
    n = graph.shape[0]
    starts, neighbours = graph.indptr.tolist(), graph.indices.tolist()
    parent, ancestor = [-1] * n, [-1] * n
    for node in range(n):
        for other in neighbours[starts[node] : starts[node + 1]]:
            while other < node:
                above = ancestor[other]
                ancestor[other] = node
                if above < 0:
                    parent[other] = node
                if above < 0 or above == node:
                    break
                other = above
    return np.array(parent, np.int64)


def _postorder(parent: IntArray) -> IntArray:
    """Nodes, each after those of its subtree."""
    n = len(parent)
    first_child, sibling = [-1] * (n + 1), [-1] * n
    parents = parent.tolist()
    for node in range(n - 1, -1, -1):
        above = parents[node]
        sibling[node], first_child[above] = first_child[above], node  # -1 is the last: the root of all roots
    order: list[int] = []
    stack = [first_child[n]]
    while stack:
        node = stack.pop()
        if node < 0:
            continue
        if node >= n:  # its subtree is done
            order.append(node - n)
            continue
        stack += [sibling[node], node + n, first_child[node]]
    return np.array(order, np.int64)


def _supernodes(graph: Matrix, parent: IntArray) -> tuple[list[int], list[IntArray]]:
    """First node of each run of nodes with the same rows below, and these rows."""
    starts: list[int] = []
    belows: list[IntArray] = []
    waiting: dict[int, list[IntArray]] = {}  # rows that children leave, by their parent
    chain = np.zeros(0, np.int64)
    indptr, indices = graph.indptr.tolist(), graph.indices.astype(np.int64)
    for node, above in enumerate(parent.tolist()):
        own = indices[indptr[node] : indptr[node + 1]]
        pieces = waiting.pop(node, [])
        largest = max(pieces, key=len, default=chain[:0])
        further = [piece for piece in (own[np.searchsorted(own, node, "right") :], *pieces) if piece is not largest]
        below = _union(largest[1:] if len(largest) and largest[0] == node else largest, further, node)
        continues = len(chain) > 0 and chain[0] == node and len(chain) == len(below) + 1
        if continues:
            belows[-1] = below
        else:
            starts.append(node)
            belows.append(below)
        chain = below
        if above >= 0:
            waiting.setdefault(above, []).append(below)
    return [*starts, graph.shape[0]], belows


def _union(rows: IntArray, further: Sequence[IntArray], node: int) -> IntArray:
    """Ascending rows beyond a node; the first array itself where the others add nothing."""
    for piece in further:
        added = piece[piece > node]
        if len(rows):
            at = np.minimum(np.searchsorted(rows, added), len(rows) - 1)
            added = added[rows[at] != added]
        if len(added):
            rows = np.union1d(rows, added)
    return rows


def _merged(starts: list[int], belows: list[IntArray], size: IntArray) -> list[_Front]:
    """Merge fronts with children that stand right before them, where it saves more overhead than it costs work."""
    first_row = np.concatenate([[0], np.cumsum(size)])
    merged: list[tuple[int, int, IntArray]] = []  # first node, one beyond the last, nodes below
    for first, last, below in zip(starts, starts[1:], belows, strict=False):
        n_below, start, work = int(size[below].sum()), first, 0.0
        while merged and len(merged[-1][2]) and merged[-1][2][0] < last:
            child_first, _, child_below = merged[-1]
            child = _work(int(first_row[start] - first_row[child_first]), int(size[child_below].sum()))
            alone = work or _work(int(first_row[last] - first_row[start]), n_below)
            work = _work(int(first_row[last] - first_row[child_first]), n_below)
            if work > alone + child + FRONT_OVERHEAD:
                break
            start = child_first
            merged.pop()
        merged.append((start, last, below))
    front_of = np.repeat(np.arange(len(merged)), [last - first for first, last, _ in merged])
    children: list[list[int]] = [[] for _ in merged]
    for number, (_, _, below) in enumerate(merged):
        if len(below):
            children[front_of[below[0]]].append(number)
    return [
        _Front(int(first_row[first]), int(first_row[last]), _rows_of(below, first_row), tuple(children[number]))
        for number, (first, last, below) in enumerate(merged)
    ]


def _work(width: int, below: int) -> float:
    """Multiplications of a front."""
    return width * (width * width / 6 + width * below / 2 + below * below / 2)


def _rows_of(nodes: IntArray, first_row: IntArray) -> IntArray:
    counts = first_row[nodes + 1] - first_row[nodes]
    before = np.cumsum(counts) - counts
    return np.repeat(first_row[nodes] - before, counts) + np.arange(int(counts.sum()))


def _bytes(fronts: Sequence[_Front]) -> tuple[int, int]:
    """Bytes of the factors, and the most that they and the fronts beside them take."""
    factor = waiting = peak = 0
    for front in fronts:
        width, below = front.last - front.first, len(front.below)
        factor += width * (width + below)
        left = below * below
        peak = max(peak, factor + waiting + left)
        waiting += left - sum(len(fronts[child].below) ** 2 for child in front.children)
    return BYTES * factor, BYTES * peak


@dataclass(frozen=True, slots=True, eq=False)
class CholeskyFactors:
    """L of ``P A P^T = L L^T``, front by front.

    Parameters
    ----------
    elimination : Elimination
        The fronts.
    triangles : sequence of (width, width) array
        The diagonal block of each front; only its lower triangle counts.
    rest : sequence of (n_below, width) array
        The rows below.
    """

    elimination: Elimination
    triangles: Sequence[FloatArray]
    rest: Sequence[FloatArray]

    @classmethod
    def of(cls, matrix: Matrix, elimination: Elimination) -> CholeskyFactors:
        """Factor a matrix.

        Parameters
        ----------
        matrix : (n, n) sparse array
            Symmetric; both triangles.
        elimination : Elimination
            How.

        Returns
        -------
        CholeskyFactors
            The factors.

        Raises
        ------
        numpy.linalg.LinAlgError
            If the matrix is not positive definite.
        """
        order = elimination.order
        place = np.empty(len(order), np.int64)
        place[order] = np.arange(len(order))
        rows = sparse.csr_array(matrix)[order]
        starts, columns, values = rows.indptr.tolist(), place[rows.indices], rows.data
        at = np.zeros(len(order), np.int64)  # where a row stands in the front at hand
        triangles: list[FloatArray] = []
        rests: list[FloatArray] = []
        waiting: dict[int, FloatArray] = {}
        for number, front in enumerate(elimination.fronts):
            first, last, below = front.first, front.last, front.below
            width = last - first
            triangle = np.zeros((width, width), order="F")
            rest = np.zeros((len(below), width), order="F")
            left = np.zeros((len(below), len(below)), order="F")
            at[below] = np.arange(len(below))
            entries = slice(starts[first], starts[last])
            column = columns[entries]  # of A, whose rows are the columns of L
            row = np.repeat(np.arange(width), np.diff(rows.indptr[first : last + 1]))
            inside, beyond = (column >= first) & (column < last), column >= last
            triangle[column[inside] - first, row[inside]] = values[entries][inside]
            rest[at[column[beyond]], row[beyond]] = values[entries][beyond]
            for child in front.children:
                _add(waiting.pop(child), elimination.fronts[child].below, first, last, at, triangle, rest, left)
            triangle, failed = lapack.dpotrf(triangle, lower=1, clean=0, overwrite_a=1)
            if failed:
                raise np.linalg.LinAlgError
            if len(below):
                rest = blas.dtrsm(1.0, triangle, rest, side=1, lower=1, trans_a=1, overwrite_b=1)
                waiting[number] = blas.dsyrk(-1.0, rest, beta=1.0, c=left, lower=1, overwrite_c=1)
            triangles.append(triangle)
            rests.append(rest)
        return cls(elimination, triangles, rests)

    def solve(self, loads: FloatArray) -> FloatArray:
        """Solve for several right-hand sides at once.

        Parameters
        ----------
        loads : (n,) or (n, n_loads) array
            Right-hand sides.

        Returns
        -------
        (n,) or (n, n_loads) array
            Solutions.
        """
        order = self.elimination.order
        motion = np.array(loads[order], np.float64, order="C")
        if motion.ndim == 1:
            motion = motion[:, None]
        steps = list(zip(self.elimination.fronts, self.triangles, self.rest, strict=True))
        for front, triangle, rest in steps:
            block = motion[front.first : front.last]
            block[:] = blas.dtrsm(1.0, triangle, block, lower=1)
            if len(front.below):
                motion[front.below] -= rest @ block
        for front, triangle, rest in reversed(steps):
            block = motion[front.first : front.last]
            if len(front.below):
                block -= rest.T @ motion[front.below]
            block[:] = blas.dtrsm(1.0, triangle, block, lower=1, trans_a=1)
        solution = np.empty(loads.shape)
        solution[order] = motion.reshape(loads.shape)
        return solution


def _add(
    left: FloatArray,
    rows: IntArray,
    first: int,
    last: int,
    at: IntArray,
    triangle: FloatArray,
    rest: FloatArray,
    further: FloatArray,
) -> None:
    """Add what a child leaves between its rows; the lower triangle of each counts."""
    split = int(np.searchsorted(rows, last))
    inside, beyond = rows[:split] - first, at[rows[split:]]
    left = left.T  # in the order of memory
    triangle.T[np.ix_(inside, inside)] += left[:split, :split]
    rest.T[np.ix_(inside, beyond)] += left[:split, split:]
    for start in range(split, len(rows), BLOCK):  # only the triangle that counts
        stop = start + BLOCK
        further.T[np.ix_(beyond[start - split : stop - split], beyond[start - split :])] += left[start:stop, start:]
