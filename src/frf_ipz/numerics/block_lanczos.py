"""Largest eigenvalues of ``B^-1 M``, by block Lanczos with all vectors orthogonal to each other.

``B`` is symmetric positive definite and given by its solves, ``M`` positive semidefinite and given by its products. A
block of vectors at a time uses the factors of B at the speed of dense algebra and finds as many copies of a repeated
eigenvalue; vectors beside it, drawn anew once all that is sought has been found, find further copies. The sequence ends
where the bounds of all other Ritz values lie clear of what is sought, [GrimesLewisSimon1994].

[GrimesLewisSimon1994] R. G. Grimes, J. G. Lewis, H. D. Simon, A shifted block Lanczos algorithm for solving sparse
symmetric generalized eigenproblems, SIAM Journal on Matrix Analysis and Applications 15 (1), 1994, 228-272,
doi:10.1137/S0895479888151111.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.errors import ConvergenceError

if TYPE_CHECKING:
    from collections.abc import Callable

EPS = float(np.finfo(float).eps)
BLOCK = 8  # vectors: two more than a body has rigid motions
CONVERGED = 1e-11  # residual of an eigenpair, of its eigenvalue: the eigenvalue is then right to rounding
NOISE = 16 * EPS  # of a vector: what remains of it beside the others is rounding
LOST = 0.5  # of a unit vector that should have been beside the others: less remains of rounding alone
# of orthogonalisation: each removes the rounding of the one before, which a nearly dependent block amplifies
PASSES = 3
MOST_VECTORS = 12  # times what is sought and a block: a sequence so long has lost its digits


def largest_pairs(
    solve: Callable[[FloatArray], FloatArray],
    multiply: Callable[[FloatArray], FloatArray],
    *,
    order: int,
    count: int,
    least: float | None = None,
) -> FloatArray:
    """Find the eigenvectors of the largest eigenvalues of ``B^-1 M``.

    Parameters
    ----------
    solve, multiply : callable
        ``B^-1`` and ``M`` times an (n, k) array.
    order : int
        n.
    count : int
        How many are sought.
    least : float, optional
        Eigenvalues below are not sought, but the largest of them is given too.

    Returns
    -------
    (n, n_found) array
        M-orthonormal, by descending eigenvalue.

    Raises
    ------
    ConvergenceError
        If the sequence does not converge.
    """
    space = _Space(solve, multiply, order)
    sure = np.zeros(0)
    while True:
        is_whole = not space.extend()
        values, weights, bounds = space.ritz()
        is_right = bounds <= CONVERGED * np.abs(values) + EPS * values[0]
        wanted = min(count, len(values) if least is None else 1 + int(np.count_nonzero(values >= least)))
        is_found = len(values) >= wanted and is_right[:wanted].all()
        if (is_found and (is_right | (values + bounds < values[wanted - 1]))[wanted:].all()) or is_whole:
            known, sure = sure, values[:wanted]
            if is_whole or (len(known) == len(sure) and np.allclose(known, sure, rtol=CONVERGED, atol=EPS * values[0])):
                return space.combine(weights[:, :wanted])
            space.freshen()
        elif space.size > MOST_VECTORS * (wanted + BLOCK):
            found = min(int(np.argmin(np.append(is_right, False))), wanted)
            raise ConvergenceError(
                f"the eigensolver found {found} of {wanted} modes; request fewer modes or a lower band"
            )


class _Space:
    """Vectors that are M-orthonormal, and the matrix of ``B^-1 M`` between them."""

    def __init__(
        self, solve: Callable[[FloatArray], FloatArray], multiply: Callable[[FloatArray], FloatArray], order: int
    ) -> None:
        self.solve, self.multiply, self.order = solve, multiply, order
        self.rng = np.random.default_rng(0)  # the same digits in every run
        self.blocks: list[FloatArray] = []
        self.matrix = np.zeros((0, 0))
        self.beyond = np.zeros((0, 0))  # what the last block leaves beside the space, in terms of the next
        self.next = np.zeros((order, 0))

    @property
    def size(self) -> int:
        """Number of vectors."""
        return len(self.matrix)

    def extend(self) -> bool:
        """Take the next block into the space; False where there is none, as the space is the whole."""
        if not self.next.shape[1]:
            self.freshen()
        block, known = self.next, self.size
        width = block.shape[1]
        if not width:
            return False
        self.blocks.append(block)
        self.next = np.zeros((self.order, 0))
        mapped = self.solve(self.multiply(block))
        self.next, inside, self.beyond = self._beside(mapped)
        matrix = np.zeros((known + width, known + width))
        matrix[:known, :known] = self.matrix
        matrix[:, known:] = inside
        matrix[known:, :known] = inside[:known].T
        matrix[known:, known:] = (inside[known:] + inside[known:].T) / 2
        self.matrix = matrix
        return True

    def freshen(self) -> None:
        """Put new vectors beside the next block, in which the largest eigenvalues stand out."""
        fresh = self.rng.standard_normal((self.order, min(BLOCK, self.order)))
        for _ in range(2):
            fresh = self.solve(self.multiply(fresh))
            fresh = self._beside(fresh)[0]
        self.next = np.hstack([self.next, fresh])

    def ritz(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Eigenvalues in the space, descending, their vectors in terms of its own, and bounds of their errors."""
        values, weights = np.linalg.eigh(self.matrix)
        values, weights = values[::-1], weights[:, ::-1]
        width = self.beyond.shape[1]
        return values, weights, np.linalg.norm(self.beyond @ weights[len(weights) - width :], axis=0)

    def combine(self, weights: FloatArray) -> FloatArray:
        """Combine the vectors of the space."""
        starts = np.cumsum([0, *(block.shape[1] for block in self.blocks)])
        vectors = np.zeros((self.order, weights.shape[1]))
        for block, start in zip(self.blocks, starts, strict=False):
            vectors += block @ weights[start : start + block.shape[1]]
        return vectors

    def _beside(self, vectors: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Orthonormal vectors beside all others, the parts of the given ones in the space, and those in the new ones.

        What remains of a vector by rounding is left out.
        """
        others = [*self.blocks, self.next]
        inside = np.zeros((sum(block.shape[1] for block in others), vectors.shape[1]))
        into = np.eye(vectors.shape[1])
        products = self.multiply(vectors)
        length = _lengths(vectors, products)
        least = NOISE * length
        for _ in range(PASSES):
            parts = np.vstack([block.T @ products for block in others])
            start = 0
            for block in others:
                vectors = vectors - block @ parts[start : start + block.shape[1]]
                start += block.shape[1]
            inside += parts @ into
            products = self.multiply(vectors)
            size = _lengths(vectors, products)
            remains = size > least
            vectors, products, size = vectors[:, remains], products[:, remains], size[remains]
            weights, axes = np.linalg.eigh((vectors.T @ products) / np.outer(size, size))
            independent = weights > EPS * len(weights)
            turn = axes[:, independent] / np.sqrt(weights[independent]) / size[:, None]
            into = np.sqrt(weights[independent])[:, None] * (axes[:, independent].T * size) @ into[remains]
            vectors, products = vectors @ turn, products @ turn
            least = np.full(vectors.shape[1], LOST)
        return vectors, inside[: len(inside) - self.next.shape[1]], into


def _lengths(vectors: FloatArray, products: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.maximum(np.sum(vectors * products, 0), 0.0)))
