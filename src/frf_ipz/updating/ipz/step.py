"""One step of the published Iterative Pole-Zero update for one FRF: eqs. (4) to (34) of [Dorosti2018].

The iteration needs tens of thousands of steps with matrices of order six, so it is written for few and small calls:
LAPACK directly, arrays that are allocated once, and rows and columns in such an order that the substructure matrices
(without the row of the actuator and the column of the sensor) are the leading block.

Poles and zeros come from QZ on the pencil ``[[K, 0], [0, I]] - s [[-B, -M], [I, 0]]`` without balancing. Close to its
end the published iteration creeps, and where a small delta stops it depends on the rounding of this pencil: with a
balanced one the stop at delta = 1e-5 is not reached at all.

[Dorosti2018] M. Dorosti, R. H. B. Fey, M. F. Heertjes, H. Nijmeijer, Iterative Pole-Zero model updating: A combined
sensitivity approach, Control Engineering Practice 71, 2018, 164-174, doi:10.1016/j.conengprac.2017.11.002.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING, cast

import numpy as np
from scipy.linalg import lapack

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.errors import NumericalError
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from scipy.optimize import linear_sum_assignment
else:
    linear_sum_assignment = import_late("scipy.optimize", "linear_sum_assignment")

DOMINANT = 5.0  # imaginary over real part of a root that a measurement shows as a resonance or antiresonance
ILL_CONDITIONED = 1e5  # condition number of S^H W S from which alpha is used (step 2g)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StepSettings:
    """Options of the published iteration.

    Parameters
    ----------
    alpha, beta : float
        Regularisation, eq. (15), and scaling of the step, eq. (19).
    cross_sensitivities : bool
        Use the off-diagonal blocks of eq. (14).
    damping : bool
        Change the damping matrix instead of the stiffness matrix.
    """

    alpha: float
    beta: float
    cross_sensitivities: bool
    damping: bool


class PublishedStep:
    """Evaluates poles and zeros of one FRF and moves them towards their targets.

    Parameters
    ----------
    mass, damping, stiffness : (r, r) array
        Nominal matrices.
    sensor, actuator : int
        Column and row that are deleted for the substructure.
    targets : (m,) complex array
        Measured poles, then measured zeros of the FRF, rad/s.
    computed : (m,) complex array
        Their nominal counterparts.
    n_poles : int
        Number of poles among them.
    settings : StepSettings
        Options of the iteration.
    """

    def __init__(
        self,
        mass: FloatArray,
        damping: FloatArray,
        stiffness: FloatArray,
        *,
        sensor: int,
        actuator: int,
        targets: ComplexArray,
        computed: ComplexArray,
        n_poles: int,
        settings: StepSettings,
    ) -> None:
        order, count = len(mass), len(targets)
        all_dofs = np.arange(order)
        self.settings, self.n_poles, self.order = settings, n_poles, order
        self.rows = np.append(np.delete(all_dofs, actuator), actuator)
        self.columns = np.append(np.delete(all_dofs, sensor), sensor)
        self.forward = order * self.rows[:, None] + self.columns
        self.back = np.argsort(self.forward, axis=None).reshape(order, order)
        self.mass, self.damping, self.stiffness = (m.take(self.forward) for m in (mass, damping, stiffness))
        self.targets = np.stack([targets.real, targets.imag])
        self.roots = np.zeros((2, count))
        self.right, self.left = np.zeros((2, order, count), complex)
        self.slope_matrix = np.concatenate([2 * self.mass, self.damping])
        sizes = ((order, slice(0, n_poles)), (order - 1, slice(n_poles, count)))
        self.pencils = [_Pencil(self, size, part) for size, part in sizes if part.stop > part.start]
        self.unit = [np.eye(size, order="F") for size in (order, order - 1)]
        self.vectors, self.duals = np.zeros((order, count)), np.zeros((count, order))
        self.theta, self.change, self.predicted = np.ones(count), np.zeros(count), np.zeros(2 * count)
        self.changed = (self.damping if settings.damping else self.stiffness).copy()
        for pencil in self.pencils:
            pencil.choose_roots(computed[pencil.part])
        self.chosen = self._choose_parameters()

    def evaluate(self, matrix: FloatArray) -> float:
        """Compute poles and zeros for a stiffness (or damping) matrix.

        Parameters
        ----------
        matrix : (r, r) array
            K^u or B^u.

        Returns
        -------
        float
            epsilon, eq. (6), with the weights of eq. (7).

        Raises
        ------
        NumericalError
            If a target has lost its counterpart.
        """
        matrix.take(self.forward, out=self.changed)
        for pencil in self.pencils:
            pencil.solve()
        error = self.targets - self.roots
        squares = self.roots * self.roots
        modulus = squares[0] + squares[1]
        self.weights = np.sqrt(modulus.max() / modulus)
        error *= self.weights
        self.error = error.reshape(-1)
        misfit = float(self.error @ self.error)
        if not isfinite(misfit):
            raise NumericalError("a pole or zero that is to be updated has disappeared")
        return misfit

    def step(self) -> FloatArray:
        """Make the step of eqs. (18) and (19), and put the substructure back, steps 2j to 2l.

        Returns
        -------
        (r, r) array
            The next matrix.

        Raises
        ------
        NumericalError
            If the step has no solution.
        """
        poles, size = self.n_poles, self.order - 1
        self._eigenvectors()
        sensitivity = self._sensitivity()
        weighted = np.concatenate([sensitivity.real, sensitivity.imag], 1)
        normal = weighted @ weighted.T
        spectrum = lapack.dsyev(normal, compute_v=0)[0]
        if spectrum[-1] >= ILL_CONDITIONED * spectrum[0]:
            diagonal = normal.diagonal()
            inverse = 1 / diagonal
            normal.flat[:: len(normal) + 1] += self.settings.alpha**2 * (diagonal.sum() / inverse.sum()) * inverse
        _, change, info = lapack.dposv(normal, weighted @ self.error)
        if info or not isfinite(float(change @ change)):
            raise NumericalError("the equations of the step are singular: no parameter moves one of the targets")
        change *= self.settings.beta
        self.change, self.predicted = change, change @ weighted
        scaled = self.vectors * change
        self.changed[:size, :size] += scaled[:size, poles:] @ self.duals[poles:, :size]
        whole = scaled[:, :poles] @ self.duals[:poles]
        self.changed[size] += whole[size]
        self.changed[:size, size] += whole[:size, size]
        return np.asarray(self.changed.take(self.back))

    def size_of_change(self) -> float:
        """Give the norm of the last change of the parameters over their own norm."""
        return float(np.sqrt((self.change @ self.change) / (self.theta @ self.theta)))

    def predicted_poles(self) -> FloatArray:
        """Give the change of the poles that the last step predicts, eq. (40): real, then imaginary parts, rad/s."""
        predicted = self.predicted.reshape(2, -1) / self.weights
        return np.asarray(predicted[:, : self.n_poles].reshape(-1))

    def _eigenvectors(self) -> None:
        """Columns of V and rows of its inverse for the chosen eigenvalues, eqs. (22) and (24)."""
        poles, size = self.n_poles, self.order - 1
        for_poles, for_zeros = self.chosen
        if poles:
            values, vectors, order, inverse = _decomposition(self.changed.take(self.back), self.unit[0])
            chosen = order.take(for_poles)
            self.theta[:poles] = values.take(chosen)
            self.vectors[:, :poles] = vectors.take(chosen, 1).take(self.rows, 0)
            self.duals[:poles] = inverse.take(chosen, 0).take(self.columns, 1)
        if len(for_zeros):
            values, vectors, order, inverse = _decomposition(self.changed[:size, :size], self.unit[1])
            chosen = order.take(for_zeros)
            self.theta[poles:] = values.take(chosen)
            self.vectors[:size, poles:] = vectors.take(chosen, 1)
            self.duals[poles:, :size] = inverse.take(chosen, 0)

    def _sensitivity(self) -> ComplexArray:
        """Transposed sensitivities of eqs. (21) to (34), with the sign and left vectors they need, times weights."""
        values: ComplexArray = self.roots[0] + 1j * self.roots[1]
        products: ComplexArray = self.slope_matrix @ self.right
        slope = products[: self.order]
        slope *= values
        slope += products[self.order :]
        slope *= self.left
        factor: ComplexArray = -self.weights / np.add.reduce(slope, 0)
        if self.settings.damping:
            factor = np.asarray(factor * values)
        result = cast("ComplexArray", (self.vectors.T @ self.left) * (self.duals @ self.right))
        result *= factor
        if not self.settings.cross_sensitivities:
            result[self.n_poles :, : self.n_poles] = 0
            result[: self.n_poles, self.n_poles :] = 0
        return result

    def _choose_parameters(self) -> tuple[IntArray, IntArray]:
        """Eigenvalues of the matrix and of its substructure to which the targets are most sensitive (2a, 2b)."""
        self.evaluate((self.damping if self.settings.damping else self.stiffness).take(self.back))
        poles, size, count = self.n_poles, self.order - 1, self.targets.shape[1]
        whole = _decomposition(self.changed.take(self.back), self.unit[0])
        for_poles = self._most_sensitive(whole, slice(0, poles), self.rows, self.columns)
        if poles == count:  # a single mass has no zero and no substructure
            return for_poles, np.zeros(0, np.int64)
        part = _decomposition(self.changed[:size, :size], self.unit[1])
        for_zeros = self._most_sensitive(part, slice(poles, count), np.arange(size), np.arange(size))
        return for_poles, for_zeros

    def _most_sensitive(
        self,
        decomposition: tuple[FloatArray, FloatArray, IntArray, FloatArray],
        part: slice,
        rows: IntArray,
        columns: IntArray,
    ) -> IntArray:
        values, vectors, order, inverse = decomposition
        left_vectors, right_vectors = self.left[: len(rows), part], self.right[: len(columns), part]
        sensitivity = (vectors[rows][:, order].T @ left_vectors) * (inverse[order][:, columns] @ right_vectors)
        effect = np.abs(sensitivity * values[order][:, None])
        rigid = np.abs(values[order]) < 1e-10 * np.abs(values).max()
        effect[rigid] = 0
        effect /= np.maximum(effect.max(axis=0), np.finfo(float).tiny)
        chosen, _ = linear_sum_assignment(-effect)
        return np.sort(chosen)


class _Pencil:
    """QZ of the whole or of the substructure, written into the step's arrays."""

    def __init__(self, step: PublishedStep, size: int, part: slice) -> None:
        self.step, self.size, self.part = step, size, part
        self.first, self.second = (np.zeros((2 * size, 2 * size), order="F") for _ in range(2))
        self.first[size:, size:] = self.second[size:, :size] = np.eye(size)
        self.first[:size, :size] = step.stiffness[:size, :size]
        self.second[:size, :size] = -step.damping[:size, :size]
        self.second[:size, size:] = -step.mass[:size, :size]
        self.values = step.roots[:, part]
        self.right = step.right.real[:size, part], step.right.imag[:size, part]
        self.left = step.left.real[:size, part], step.left.imag[:size, part]
        self.indices = np.zeros(part.stop - part.start, int)

    def choose_roots(self, computed: ComplexArray) -> None:
        """Find the indices of the targets' roots, by ascending imaginary part."""
        real, imaginary, beta = lapack.dggev(self.first, self.second)[:3]
        with np.errstate(divide="ignore", invalid="ignore"):  # zeros at infinity have beta = 0
            values = (real + 1j * imaginary) / beta
        dominant = np.sort_complex(-1j * values[values.imag > DOMINANT * np.abs(values.real)])
        distance = np.abs(1j * dominant[None, :] - computed[:, None])
        rows, indices = linear_sum_assignment(distance)
        if len(rows) < len(computed):
            raise NumericalError(
                "the model has fewer dominant poles or zeros than are to be updated: look at the pairs"
            )
        self.indices = indices

    def solve(self) -> None:
        """Compute roots and vectors for the current matrix."""
        size, step = self.size, self.step
        block = step.changed[:size, :size]
        if step.settings.damping:
            np.negative(block, out=self.second[:size, :size])
        else:
            self.first[:size, :size] = block
        real, imaginary, beta, left_vectors, right_vectors, _, _ = lapack.dggev(self.first, self.second)
        real /= beta
        imaginary /= beta
        imaginary[~(imaginary > DOMINANT * np.abs(real))] = np.inf
        order = imaginary.argsort().take(self.indices)
        imaginary_part = order + 1
        real.take(order, out=self.values[0])
        imaginary.take(order, out=self.values[1])
        self.right[0][...] = right_vectors.take(order, 1)[:size]
        self.right[1][...] = right_vectors.take(imaginary_part, 1)[:size]
        self.left[0][...] = left_vectors.take(order, 1)[:size]
        np.negative(left_vectors.take(imaginary_part, 1)[:size], out=self.left[1])


def _decomposition(matrix: FloatArray, unit: FloatArray) -> tuple[FloatArray, FloatArray, IntArray, FloatArray]:
    """Real parts of the eigenvalues, vectors as LAPACK packs them, ascending order, inverse of the vectors."""
    values, _, _, vectors, _ = lapack.dgeev(matrix, compute_vl=0)
    return values, vectors, values.argsort(), lapack.dgesv(vectors, unit)[2]
