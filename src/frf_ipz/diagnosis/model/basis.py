"""A model in few coordinates: its modes, and the static shapes that sensors, excited points and effects need.

The modes go well beyond the band. Static deflections under unit loads at sensors and excited points make the basis
exact at low frequency there; those under the loads that an effect makes (a compliant support, softer elements) do the
same for the effect, so that a large change is as exact as a small one. One basis serves every value of an effect's
parameters at a location.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg, sparse

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.model.matrix_sum import MatrixSum
from frf_ipz.diagnosis.model.motion import stack_motions
from frf_ipz.dofs import Dof
from frf_ipz.fe.assembly import multiply
from frf_ipz.fe.eigen import ModalBasis, solve_basis
from frf_ipz.numerics.factorization import DENSE_ORDER
from frf_ipz.numerics.pencils import generalised_eigh

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import IntArray, Matrix
    from frf_ipz.diagnosis.model.change import Change
    from frf_ipz.diagnosis.model.motion import Motion
    from frf_ipz.dofs import AnyDof
    from frf_ipz.structure import StructuralModel

MODES_UP_TO = 4.0  # times the highest frequency: modes of the basis
MIN_MODES = 12
INDEPENDENT = 1e-8  # of a vector: what the basis does not span
DEPENDENT = 1e-12  # of the sum of squares: new shapes that are combinations of others
LOADED_MODES = 1.5  # times the highest frequency: modes whose loads by an effect get a static shape


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Basis:
    """Coordinates in which mass is the identity.

    Parameters
    ----------
    model : StructuralModel
        The nominal model.
    modes : ModalBasis
        Its lowest modes, with the factor of K + tau M.
    vectors : (n_all, q) array
        Motion of all DOFs for each coordinate.
    stiffness, damping : (q, q) array
        Of the nominal model; damping is the viscous one of its matrix.
    highest_rad_s : float
        Top of the band.
    measured : tuple of Dof or PortDof
        Where sensors and excited points are.
    """

    model: StructuralModel
    modes: ModalBasis
    vectors: FloatArray
    stiffness: FloatArray
    damping: FloatArray
    highest_rad_s: float
    measured: tuple[AnyDof, ...]
    _projected: dict[int, tuple[Matrix, FloatArray]] = field(init=False, default_factory=dict, repr=False)
    _nominal_modes: list[tuple[FloatArray, FloatArray]] = field(init=False, default_factory=list, repr=False)

    @property
    def nominal_modes(self) -> tuple[FloatArray, FloatArray]:
        """Modes of the nominal model, as `solve_changed_modes` gives them: solved for once."""
        if not self._nominal_modes:
            self._nominal_modes.append(solve_modes(self.stiffness, np.eye(len(self.stiffness)), self.modes.shift))
        return self._nominal_modes[0]

    @property
    def loaded_shapes(self) -> FloatArray:
        """Shapes of the modes near the band, at all DOFs, (n_all, m) array."""
        count = max(int(np.count_nonzero(self.modes.omega_rad_s <= LOADED_MODES * self.highest_rad_s)), 1)
        return _to_all_dofs(self.model, self.modes.shapes[:, :count])

    def project(self, matrix: MatrixSum | Matrix) -> FloatArray:
        """Bring a matrix of all DOFs into these coordinates.

        Parameters
        ----------
        matrix : (n_all, n_all) sparse array or MatrixSum
            Symmetric; the matrices of a sum are remembered.

        Returns
        -------
        (q, q) array
            The same in the basis.
        """
        if not isinstance(matrix, MatrixSum):
            return self._project(matrix)
        total = np.zeros_like(self.stiffness)
        for factor, term in matrix.terms:
            if id(term) not in self._projected:
                self._projected[id(term)] = term, self._project(term)  # with the term, whose id stays its own
            total += factor * self._projected[id(term)][1]
        return total

    def _project(self, matrix: Matrix) -> FloatArray:
        rows = _nonzero_rows(matrix)
        return np.asarray(self.vectors[rows].T @ multiply(matrix[rows], self.vectors))

    def project_motions(self, motions: Sequence[Motion]) -> FloatArray:
        """Bring motions into these coordinates.

        Parameters
        ----------
        motions : sequence of Motion
            Of few DOFs each.

        Returns
        -------
        (n_motions, q) array
            How far each moves for each coordinate.
        """
        return np.asarray(stack_motions(motions, len(self.model.all_dofs)).T @ self.vectors)


def make_basis(model: StructuralModel, highest_rad_s: float, measured: Sequence[AnyDof]) -> Basis:
    """Find the modes of a model, and the static shapes of its sensors and excited points.

    Parameters
    ----------
    model : StructuralModel
        The nominal model.
    highest_rad_s : float
        Top of the band.
    measured : sequence of Dof or PortDof
        Where sensors and excited points are; signs are ignored.

    Returns
    -------
    Basis
        For the nominal model.
    """
    order = int(np.count_nonzero(~model.fixed))
    modes = solve_basis(model) if order < DENSE_ORDER else _solve_lowest_modes(model, highest_rad_s)
    low = max(int(np.count_nonzero(modes.omega_rad_s <= MODES_UP_TO * highest_rad_s)), min(MIN_MODES, order))
    start = modes.first(low)
    loads = model.full_rows([dof.unsigned for dof in measured]).toarray().T
    vectors = _to_all_dofs(model, start.shapes)
    plain = Basis(
        model=model,
        modes=modes,
        vectors=vectors,
        stiffness=_symmetric(vectors.T @ multiply(model.stiffness_all, vectors)),
        damping=_symmetric(vectors.T @ multiply(model.damping_all, vectors)),
        highest_rad_s=highest_rad_s,
        measured=tuple(measured),
    )
    return _add_shapes(plain, _deflections(plain, loads))


def _solve_lowest_modes(model: StructuralModel, highest_rad_s: float) -> ModalBasis:
    modes = solve_basis(model, up_to_hz=MODES_UP_TO * highest_rad_s / (2 * np.pi))
    if len(modes.eigenvalues) < MIN_MODES:
        modes = solve_basis(model, n_modes=MIN_MODES)
    return modes


def enrich_basis(basis: Basis, change: Change) -> Basis:
    """Add the static shapes that a change needs.

    Parameters
    ----------
    basis : Basis
        Of the nominal model.
    change : Change
        An effect at typical values of its parameters; only the location matters.

    Returns
    -------
    Basis
        For this effect at this location.
    """
    if change.model is not None:
        basis = _exchanged(change.model, basis.highest_rad_s, basis.measured)
    model, loads, shapes = basis.model, [], []
    if change.released:
        constraint = _constraint_shapes(basis, change.released)
        shapes.append(constraint)
        loads.append(_inertia(model, constraint))
    around = np.hstack([basis.loaded_shapes, *shapes])
    for matrix in (added.tocsr() for added in (change.stiffness, change.mass) if added is not None):
        first = multiply(matrix, around)
        loads.append(first)
        loaded = first[_nonzero_rows(matrix)]
        if np.linalg.matrix_rank(loaded, tol=1e-9 * np.linalg.norm(loaded)) > 2:
            loads.append(multiply(matrix, _deflections(basis, first)))
    loads += [attachment.motions for attachment in change.attachments]
    if change.moved:
        places = change.moved.values()
        loads.append(_unit_loads(basis, tuple(place.node if isinstance(place, Dof) else place for place in places)))
    if not loads:
        return basis
    shapes.append(_deflections(basis, np.hstack(loads)))
    return _add_shapes(basis, np.hstack(shapes))


@lru_cache(maxsize=2)  # every hypothesis with an exchanged model asks for it
def _exchanged(model: StructuralModel, highest_rad_s: float, measured: tuple[AnyDof, ...]) -> Basis:
    return make_basis(model, highest_rad_s, measured)


def solve_changed_modes(basis: Basis, change: Change) -> tuple[FloatArray, FloatArray]:
    """Solve for the modes of a modified structure; where mass and stiffness stay, those of the nominal model.

    Parameters
    ----------
    basis : Basis
        Coordinates.
    change : Change
        What is different in mass and stiffness.

    Returns
    -------
    squares : (q,) array
        Squared frequencies, ascending, (rad/s)^2.
    vectors : (q, q) array
        Columns are modes in terms of the basis, mass-normalised.
    """
    if change.stiffness is None and change.mass is None:
        return basis.nominal_modes
    stiffness = basis.stiffness if change.stiffness is None else basis.stiffness + basis.project(change.stiffness)
    mass = np.eye(len(stiffness))
    if change.mass is not None:
        mass = mass + basis.project(change.mass)
    return solve_modes(stiffness, mass, basis.modes.shift)


def solve_modes(stiffness: FloatArray, mass: FloatArray, shift: float) -> tuple[FloatArray, FloatArray]:
    """Solve for modes by the inverse problem.

    The low modes keep all their digits beside static shapes with frequencies a thousand times theirs, and derivatives
    by differences need them. A structure that a change makes unstable has no inverse.

    Parameters
    ----------
    stiffness, mass : (q, q) array
        In the coordinates of a basis.
    shift : float
        Times the mass it is added to the stiffness, (rad/s)^2: rigid-body modes have none.

    Returns
    -------
    squares : (q,) array
        Squared frequencies, ascending, (rad/s)^2.
    vectors : (q, q) array
        Columns are modes, mass-normalised.
    """
    try:
        inverses, vectors = generalised_eigh(mass, stiffness + shift * mass)
    except linalg.LinAlgError:
        squares, vectors = linalg.eigh(stiffness, mass, check_finite=False)
        return squares, vectors
    inverses, vectors = np.maximum(inverses[::-1], np.finfo(float).tiny), vectors[:, ::-1]
    return 1 / inverses - shift, vectors / np.sqrt(np.sum(vectors * (mass @ vectors), axis=0))


def _unit_loads(basis: Basis, nodes: tuple[int, ...]) -> FloatArray:
    rows = [row for dof, row in basis.model.full_indices.items() if dof.node in nodes and not basis.model.fixed[row]]
    loads = np.zeros((len(basis.model.all_dofs), len(rows)))
    loads[rows, np.arange(len(rows))] = 1.0
    return loads


def _to_all_dofs(model: StructuralModel, shapes: FloatArray) -> FloatArray:
    all_shapes = np.zeros((len(model.all_dofs), shapes.shape[1]))
    all_shapes[~model.fixed] = shapes
    return all_shapes


def _deflections(basis: Basis, loads: FloatArray) -> FloatArray:
    """(K + tau M)^-1 times loads at the free DOFs, without what is not independent."""
    free = loads[~basis.model.fixed]
    loaded = np.flatnonzero(free.any(axis=1))  # few, for an effect at a node
    sizes = np.linalg.norm(free[loaded], axis=0)
    columns, sizes, _ = np.linalg.svd(free[np.ix_(loaded, sizes > 0)] / sizes[sizes > 0], full_matrices=False)
    columns = columns[:, sizes > 1e-8 * max(sizes.max(initial=0.0), np.finfo(float).tiny)]
    free = np.zeros((len(free), columns.shape[1]))
    free[loaded] = columns
    return _to_all_dofs(basis.model, basis.modes.factor.solve(free))


def _constraint_shapes(basis: Basis, released: tuple[int, ...]) -> FloatArray:
    """Motion of all DOFs when one fixed DOF after the other is moved by 1."""
    model, free = basis.model, np.flatnonzero(~basis.model.fixed)
    shapes = np.zeros((len(model.all_dofs), len(released)))
    for column, row in enumerate(released):
        restoring = model.stiffness_all[:, [row]].toarray() + basis.modes.shift * model.mass_all[:, [row]].toarray()
        shapes[free, column] = -basis.modes.factor.solve(restoring[free, 0])
        shapes[row, column] = 1.0
    return shapes


def _inertia(model: StructuralModel, shapes: FloatArray) -> FloatArray:
    return multiply(model.mass_all, shapes)


def _add_shapes(basis: Basis, shapes: FloatArray) -> Basis:
    """Add shapes, made orthonormal in mass; those that the basis spans already are dropped."""
    model = basis.model
    for _ in range(2):  # the second time takes off what rounding left in the first
        sizes = _sizes(model, shapes)
        shapes = shapes / np.where(sizes > 0, sizes, 1.0)
        shapes = shapes - basis.vectors @ (basis.vectors.T @ multiply(model.mass_all, shapes))
        shapes = shapes[:, _sizes(model, shapes) > INDEPENDENT]
    shapes = shapes / _sizes(model, shapes)
    values, axes = linalg.eigh(shapes.T @ multiply(model.mass_all, shapes))
    independent = values > DEPENDENT
    fresh = shapes @ (axes[:, independent] / np.sqrt(values[independent]))
    vectors = np.hstack([basis.vectors, fresh])
    return Basis(
        model=model,
        modes=basis.modes,
        vectors=vectors,
        stiffness=_enlarge(basis.stiffness, vectors, multiply(model.stiffness_all, fresh)),
        damping=_enlarge(basis.damping, vectors, multiply(model.damping_all, fresh)),
        highest_rad_s=basis.highest_rad_s,
        measured=basis.measured,
    )


def _enlarge(projected: FloatArray, vectors: FloatArray, forces: FloatArray) -> FloatArray:
    """Enlarge a matrix in the coordinates of the first vectors by the forces of the others."""
    count = len(projected)
    columns = vectors.T @ forces
    return np.block([[projected, columns[:count]], [columns[:count].T, _symmetric(columns[count:])]])


def _nonzero_rows(matrix: Matrix) -> IntArray:
    """Rows of a sparse matrix that have entries: few, for an effect at a node."""
    return np.flatnonzero(np.diff(sparse.csr_array(matrix).indptr)).astype(np.int64)


def _sizes(model: StructuralModel, shapes: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.maximum(np.sum(shapes * multiply(model.mass_all, shapes), 0), 0.0)))


def _symmetric(matrix: FloatArray) -> FloatArray:
    return np.asarray((matrix + matrix.T) / 2)
