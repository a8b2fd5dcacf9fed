"""Undamped modes of an FE model, and the flexibility of the modes beyond them.

``K phi = omega^2 M phi`` is solved by shift and inversion, ``(K + tau M)^-1 M``, with tau near the square of 0.4 times
the first elastic mode: the low modes then keep their digits however fine the mesh, and a free structure stays positive
definite. Small models take LAPACK, large ones block Lanczos on a sparse factor.

Whether a structure is free is asked of the geometry first: the motions of a rigid body that strain no row of the
stiffness beyond its rounding are modes of frequency 0, and the elastic modes are sought beside them. Few printed digits
then neither turn a rotation into a mode of 0.1 Hz nor make the stiffness indefinite.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg, sparse

from frf_ipz.arguments import require_type
from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.dofs import TRANSLATIONS, Dof
from frf_ipz.errors import ConvergenceError, IllConditionedError, InputError, errors_of_arithmetic
from frf_ipz.fe.assembly import multiply
from frf_ipz.fe.global_motions import bending_motions, rigid_body_motions
from frf_ipz.modes import ModeSet
from frf_ipz.numerics.block_lanczos import largest_pairs
from frf_ipz.numerics.factorization import DENSE_ORDER, Factorization, factorize
from frf_ipz.numerics.rounding import printed_decimals
from frf_ipz.structure import Geometry, StructuralModel
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from frf_ipz.arrays import Matrix

EPS = float(np.finfo(float).eps)
SHIFT = 0.4  # of the first elastic frequency: the low modes come out to rounding
HELD_SHIFT = 0.01  # of the estimate, for a structure that is held: its stiffness needs no shift to be factored
USEFUL_SHIFTS = (1e-3, 4.0)  # of the first elastic frequency: below, digits are lost; above, Lanczos crawls
LOST = 1e-6  # of the shift: squares of frequencies below have no digit
NO_ENERGY = 16.0  # roundings of the sum of all terms' sizes: strain energy below is indistinguishable from zero
MAX_ROUNDING = 1e-9  # of a stiffness matrix that a condensation has rounded
PRINTED = 2.0  # roundings of the sum of all terms' sizes: no row of a matrix that is rounded, or cut off, has more
SHIFT_UP = 10.0  # times, until a stiffness with negative eigenvalues is positive definite with it
SHIFTS_UP = 40  # of such steps: no negative stiffness is beyond
BENT = (
    1e-4  # of the kinetic energy: a cantilever's first mode, nearly a rotation, has 3e-3 beside it; rounding far less
)
SPREAD = 4.0  # half units of the last digit of all terms, added in squares: no sum of rounded terms is farther off
FREE_ROWS = 0.9  # of the rows lie away from supports, so that a translation strains nothing there
N_TRANSLATIONS = 3  # of the motions of a rigid body, which come first: no rounded position makes them strain anything
DEPENDENT = 1e-10  # of the largest weight: a combination of motions below is linearly dependent
MANY_MODES = 4  # a larger share of all modes than one in so many is found faster by LAPACK
FLEXIBILITY_STEPS = 60
FLEXIBILITY_TOLERANCE = 1e-12  # change of a step, relative: the limit of double precision


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModalBasis:
    """The lowest modes of a model, and the factors from which the contribution of all others follows.

    Parameters
    ----------
    eigenvalues : (n_modes,) array
        omega^2 in ascending order, (rad/s)^2; exactly 0 for rigid-body modes. Negative ones only where the model allows
        a negative stiffness: with them a mode has two real poles, +-sqrt(-omega^2).
    shapes : (n, n_modes) array
        Mode shapes at the free DOFs, mass-normalised.
    n_rigid : int
        Number of modes that do not vibrate, which come first: those of rigid bodies and of negative stiffness.
    stiffness, mass : (n, n) sparse array
        Matrices of the free DOFs.
    factor : Factorization
        Of K + shift M, between the forces and motions that constraint equations allow.
    shift : float
        tau, (rad/s)^2.
    """

    eigenvalues: FloatArray
    shapes: FloatArray
    n_rigid: int
    stiffness: Matrix
    mass: Matrix
    factor: Factorization
    shift: float

    @property
    def natural_frequency_hz(self) -> FloatArray:
        """Natural frequencies, (n_modes,) array, Hz; that of a negative omega^2 with a minus sign."""
        return np.sign(self.eigenvalues) * np.sqrt(np.abs(self.eigenvalues)) / (2 * np.pi)

    @property
    def omega_rad_s(self) -> FloatArray:
        """Natural frequencies, (n_modes,) array, rad/s; 0 for modes that do not vibrate."""
        return np.sqrt(np.maximum(self.eigenvalues, 0.0))

    def first(self, n_modes: int) -> ModalBasis:
        """Select the lowest modes.

        Parameters
        ----------
        n_modes : int
            Number of modes.

        Returns
        -------
        ModalBasis
            The same basis with fewer modes.
        """
        return ModalBasis(
            eigenvalues=self.eigenvalues[:n_modes],
            shapes=self.shapes[:, :n_modes],
            n_rigid=min(self.n_rigid, n_modes),
            stiffness=self.stiffness,
            mass=self.mass,
            factor=self.factor,
            shift=self.shift,
        )

    def residual_flexibility(self, loads: FloatArray) -> FloatArray:
        """Find the static deflection under loads without the contribution of the modes of the basis.

        The part of the loads that excites none of the modes is in balance, also on a free structure, and its deflection
        is found by correcting that of K + tau M. Each step reduces the error by the factor ``tau / (omega^2 + tau)``
        of the first mode beyond.

        Parameters
        ----------
        loads : (n, n_loads) array
            Loads at the free DOFs, N.

        Returns
        -------
        (n, n_loads) array
            m; the sum over all further modes of ``phi phi^T / omega^2`` times the loads.
        """
        loads = loads - multiply(self.mass, self.shapes @ (self.shapes.T @ loads))
        deflection = self._without_modes(self.factor.solve(loads))
        for _ in range(FLEXIBILITY_STEPS):
            step = self._without_modes(self.factor.solve(loads - multiply(self.stiffness, deflection)))
            deflection += step
            if np.abs(step).max(initial=0.0) <= FLEXIBILITY_TOLERANCE * np.abs(deflection).max(initial=0.0):
                break
        return deflection

    def _without_modes(self, motion: FloatArray) -> FloatArray:
        return np.asarray(motion - self.shapes @ (self.shapes.T @ multiply(self.mass, motion)))


def solve_modes(model: StructuralModel, *, n_modes: int | None = None, up_to_hz: float | None = None) -> ModeSet:
    """Find the lowest modes of a model.

    Parameters
    ----------
    model : StructuralModel
        The FE model.
    n_modes : int, optional
        Number of modes, rigid-body modes included; at most as many as free DOFs with mass.
    up_to_hz : float, optional
        Only modes up to this frequency, Hz. With neither of the two, all modes of a model of fewer than 600 DOFs.

    Returns
    -------
    ModeSet
        By ascending frequency, at the free DOFs and then at the ports, mass-normalised; rigid-body modes have the
        frequency 0, and those of a negative stiffness, ``omega^2 < 0``, a negative one. The damping ratios are those
        that the model states, plus the diagonal of its viscous and structural damping in each mode.

    Raises
    ------
    InputError
        If nothing limits the number of modes of a large model, or a limit makes no sense.
    ConvergenceError
        If the iteration for a large model ends without result.
    IllConditionedError
        If mass or stiffness is indefinite, or few printed digits hide an elastic mode.

    Examples
    --------
    >>> import frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> frf_ipz.solve_modes(beam, n_modes=3).natural_frequency_hz.round(2)
    array([ 16.45, 103.04, 288.36])
    """
    require_type("model", model, StructuralModel)
    require_type("n_modes", n_modes, int, np.integer, optional=True)
    require_type("up_to_hz", up_to_hz, float, int, np.number, optional=True)
    basis = solve_basis(model, n_modes=n_modes, up_to_hz=up_to_hz)
    ports = tuple(model.port_dofs)
    at_ports = [np.asarray(model.rows(ports) @ basis.shapes)] if ports else []
    return ModeSet(
        natural_frequency_hz=basis.natural_frequency_hz,
        damping_ratio=damping_ratios(model, basis),
        shapes=np.vstack([basis.shapes, *at_ports]).astype(np.complex128),
        dofs=(*model.dofs, *ports),
    )


def damping_ratios(model: StructuralModel, basis: ModalBasis) -> FloatArray:
    """Damping ratio of each mode: the stated one, and the diagonal term of the viscous matrix.

    Parameters
    ----------
    model : StructuralModel
        The FE model.
    basis : ModalBasis
        Its modes.

    Returns
    -------
    (n_modes,) array
        0 for rigid-body modes.
    """
    ratios = mode_damping_ratios(model, basis.eigenvalues, basis.shapes, basis.n_rigid)
    viscous = np.sum(basis.shapes * multiply(model.damping, basis.shapes), 0)
    elastic = slice(basis.n_rigid, None)
    ratios[elastic] += viscous[elastic] / (2 * np.sqrt(basis.eigenvalues[elastic]))
    return ratios


def mode_damping_ratios(
    model: StructuralModel, eigenvalues: FloatArray, shapes: FloatArray, n_rigid: int
) -> FloatArray:
    """Damping ratios of modes without the viscous matrix: those that a model states, and by its structural damping.

    Parameters
    ----------
    model : StructuralModel
        The FE model.
    eigenvalues : (n_modes,) array
        omega^2, (rad/s)^2.
    shapes : (n, n_modes) array
        Mass-normalised, at the free DOFs.
    n_rigid : int
        Number of modes that do not vibrate.

    Returns
    -------
    (n_modes,) array
        0 for modes that do not vibrate, and for all where nothing is stated.
    """
    ratios = stated_damping_ratios(model.modal_damping, len(eigenvalues), n_rigid)
    structural = model.structural_damping
    if structural is not None:
        lost = np.sum(shapes * multiply(structural, shapes), 0)
        ratios[n_rigid:] += lost[n_rigid:] / (2 * eigenvalues[n_rigid:])
    return ratios


def stated_damping_ratios(modal_damping: FloatArray, n_modes: int, n_rigid: int) -> FloatArray:
    """Damping ratios of modes from those that a model states for its elastic ones.

    Parameters
    ----------
    modal_damping : (n,) array
        Ratios of the elastic modes; the last one holds for all further ones. May be empty.
    n_modes, n_rigid : int
        Number of modes, and of those that do not vibrate among them.

    Returns
    -------
    (n_modes,) array
        0 for modes that do not vibrate, and for all where nothing is stated.
    """
    ratios = np.zeros(n_modes)
    if modal_damping.size:
        number = np.arange(n_modes - n_rigid)
        ratios[n_rigid:] = modal_damping[np.minimum(number, modal_damping.size - 1)]
    return ratios


def solve_basis(model: StructuralModel, *, n_modes: int | None = None, up_to_hz: float | None = None) -> ModalBasis:
    """Find the lowest modes of a model, with the factor for static solves.

    Parameters
    ----------
    model : StructuralModel
        The FE model.
    n_modes, up_to_hz
        As for `solve_modes`.

    Returns
    -------
    ModalBasis
        The modes.

    Raises
    ------
    InputError, ConvergenceError, IllConditionedError
        As `solve_modes`.
    """
    if model.fixed.all():
        raise InputError(f"every DOF of the model '{model.name}' is held: it has no modes")
    order = model.n_modes
    if n_modes is not None and not 0 < n_modes <= order:
        with_mass = "" if order == np.count_nonzero(~model.fixed) else " with a mass of their own"
        raise InputError(f"{n_modes} modes are requested; the model '{model.name}' has {order} free DOFs{with_mass}")
    if up_to_hz is not None and not up_to_hz > 0:
        raise InputError(f"modes up to {up_to_hz:g} Hz are requested; give a frequency above 0")
    n_free = int(np.count_nonzero(~model.fixed))
    if n_free >= DENSE_ORDER and n_modes is None and up_to_hz is None:
        raise InputError(
            f"the model '{model.name}' has {n_free} free DOFs: say how many modes, or up to which frequency"
        )
    for matrix in (model.mass, model.stiffness):
        if not np.isfinite(matrix.data).all():
            raise IllConditionedError(f"the model '{model.name}' has masses or springs beyond any; check their units")
    with errors_of_arithmetic(f"the modes of the model '{model.name}'"):
        if n_free < DENSE_ORDER or (n_modes or 0) > order // MANY_MODES:
            basis = _solve_dense(model, n_modes or order, up_to_hz)
        else:
            basis = _solve_sparse(model, n_modes, up_to_hz)
    if up_to_hz is not None:
        basis = basis.first(int(np.count_nonzero(basis.natural_frequency_hz <= up_to_hz)))
    return basis


def _solve_dense(model: StructuralModel, n_modes: int, up_to_hz: float | None) -> ModalBasis:
    """Solve the inverted problem by LAPACK: Cholesky's factor is as right in soft rows as in stiff ones."""
    system = _System.of(model)
    order = system.mass.shape[0]
    shift, rough = _rough_squares(model, system, (2 * np.pi * SHIFT * _first_elastic_hz(system, up_to_hz)) ** 2)
    if up_to_hz is not None:
        # one mode more, so that rounding at the limit loses none
        n_modes = min(n_modes, 1 + int(np.searchsorted(rough, (2 * np.pi * up_to_hz) ** 2)))
    elastic = rough[max(int(np.count_nonzero(rough <= LOST * shift)), system.rigid.shape[1]) :]
    if elastic.size and rough[0] > -LOST * shift:
        shift = SHIFT**2 * float(elastic[0])
    shifted = system.stiffness + shift * system.mass
    _, shapes = linalg.eigh(
        system.mass.toarray(), shifted.toarray(), subset_by_index=[order - min(n_modes, len(rough)), order - 1]
    )
    shapes = shapes[:, ::-1]
    shapes = shapes / np.sqrt(np.sum(shapes * multiply(system.mass, shapes), 0))
    return _orthonormalised(model, system, shapes, factorize(shifted, system.node_numbers), shift)


def _rough_squares(model: StructuralModel, system: _System, shift: float) -> tuple[float, FloatArray]:
    """omega^2 of all modes, right for those above `LOST` times the shift; and a shift that resolves them."""
    n_modes = model.n_modes
    rough = _squares_at_shift(system, shift, n_modes)
    if rough is None:
        shift, rough = _squares_of_indefinite(system, shift, n_modes)
        if not model.allows_negative_stiffness:
            raise _indefinite_error(model, float(rough[0]))
        return shift, rough
    while len(rough) / 2 < np.count_nonzero(rough <= LOST * shift) < len(rough):  # a stiff row has misled the guess
        lower = _squares_at_shift(system, LOST * shift, n_modes)
        if lower is None:
            break
        shift, rough = LOST * shift, lower
    return shift, rough


def _squares_of_indefinite(system: _System, shift: float, n_modes: int) -> tuple[float, FloatArray]:
    """omega^2 of all modes of a stiffness with negative eigenvalues, and a shift that makes it positive definite."""
    for _ in range(SHIFTS_UP):
        shift *= SHIFT_UP
        rough = _squares_at_shift(system, shift, n_modes)
        if rough is not None:
            return shift, rough
    raise np.linalg.LinAlgError


def _squares_at_shift(system: _System, shift: float, n_modes: int) -> FloatArray | None:
    """omega^2 of all modes, ascending; None where the shifted stiffness is not positive definite."""
    shifted = (system.stiffness + shift * system.mass).toarray()
    try:
        inverses = linalg.eigh(system.mass.toarray(), shifted, eigvals_only=True)
    except linalg.LinAlgError:
        return None
    return np.asarray(1 / inverses[: -n_modes - 1 : -1] - shift)


def _solve_sparse(model: StructuralModel, n_modes: int | None, up_to_hz: float | None) -> ModalBasis:
    system = _System.of(model)
    frequency_hz = _first_shift_hz(system, up_to_hz)
    try:
        basis = _solve_at_shift(model, system, frequency_hz, n_modes, up_to_hz)
    except ConvergenceError:  # parts of a held structure may be loose all the same: shift them farther from 0
        return _solve_at_shift(model, system, SHIFT / HELD_SHIFT * frequency_hz, n_modes, up_to_hz)
    elastic_hz, frequency_hz = basis.natural_frequency_hz[basis.n_rigid :], np.sqrt(basis.shift) / (2 * np.pi)
    is_far = elastic_hz.size and not USEFUL_SHIFTS[0] <= frequency_hz / elastic_hz[0] <= USEFUL_SHIFTS[1]
    if is_far and basis.eigenvalues[0] >= 0:
        basis = _solve_at_shift(model, system, SHIFT * float(elastic_hz[0]), n_modes, up_to_hz)
    return basis


def _solve_at_shift(
    model: StructuralModel, system: _System, frequency_hz: float, n_modes: int | None, up_to_hz: float | None
) -> ModalBasis:
    """Find modes with one factorization."""
    factor, shift = _factor_at_shift(model, system, (2 * np.pi * frequency_hz) ** 2)
    shapes = _lanczos(system, factor, shift, min(n_modes or model.n_modes, model.n_modes), up_to_hz)
    return _orthonormalised(model, system, shapes, factor, shift)


def _factor_at_shift(model: StructuralModel, system: _System, shift: float) -> tuple[Factorization, float]:
    """Factor the shifted stiffness; with a larger shift where negative eigenvalues are meant, or feigned by digits."""
    for _ in range(SHIFTS_UP):
        try:
            return factorize(sparse.csr_array(system.stiffness + shift * system.mass), system.node_numbers), shift
        except IllConditionedError:
            if not (model.allows_negative_stiffness or system.in_print):
                raise IllConditionedError(
                    f"the stiffness matrix of the model '{model.name}' is indefinite: it has a negative eigenvalue, "
                    "beyond rounding. Check units and signs of what was exported; where that is meant, set [matrices] "
                    "allow_negative_stiffness = true"
                ) from None
        shift *= SHIFT_UP
    raise np.linalg.LinAlgError


def _lanczos(system: _System, factor: Factorization, shift: float, n_modes: int, up_to_hz: float | None) -> FloatArray:
    """Shapes of the lowest modes, up to one beyond the frequency, or as many as are sought."""
    return largest_pairs(
        factor.solve,
        lambda block: multiply(system.mass, block),
        order=system.mass.shape[0],
        count=n_modes,
        least=None if up_to_hz is None else 1 / ((2 * np.pi * up_to_hz) ** 2 + shift),
    )


def _first_shift_hz(system: _System, up_to_hz: float | None) -> float:
    """Guess a good shift before anything is factored."""
    _, rigid = _ritz(system, rigid_body_motions(system.dofs, system.geometry))
    is_free = bool((system.energies(rigid) <= system.energy_uncertainty(rigid)).any())
    return (SHIFT if is_free else HELD_SHIFT) * _first_elastic_hz(system, up_to_hz)


def _first_elastic_hz(system: _System, up_to_hz: float | None) -> float:
    """Estimate the first elastic frequency from above, by slow bending of the whole structure."""
    _, motions = _ritz(system, bending_motions(system.dofs, system.geometry))
    energies = np.abs(system.energies(motions))
    elastic = energies[energies > system.energy_uncertainty(motions)]
    estimate = float(np.sqrt(elastic.min())) / (2 * np.pi) if elastic.size else np.inf
    estimate = min(estimate, up_to_hz or np.inf)
    return estimate if 0 < estimate < np.inf else 1.0


def _ritz(system: _System, motions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rayleigh-Ritz: mass-normalised combinations of motions that are stiffness-orthogonal; weights and motions."""
    weights, axes = np.linalg.eigh(motions.T @ multiply(system.mass, motions))
    independent = weights > DEPENDENT * weights[-1]
    if not independent.any():
        raise np.linalg.LinAlgError
    normalised = axes[:, independent] / np.sqrt(weights[independent])
    reduced = motions @ normalised
    _, axes = np.linalg.eigh(reduced.T @ multiply(system.stiffness, reduced))
    return normalised @ axes, reduced @ axes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _System:
    """Matrices of the independent free DOFs, and the motions of a rigid body that the structure is free to make.

    Parameters
    ----------
    stiffness, mass : (n, n) sparse array
        The matrices; of a small model printed with few digits, the stiffness without the forces that rounding feigns
        under `rigid`.
    dofs : tuple of Dof
        Their rows.
    geometry : Geometry
        Where the nodes are.
    rigid : (n, n_rigid) array
        Mass-normalised.
    in_arithmetic, in_print : float
        Relative rounding of the stiffness, by double precision or a condensation, and by printed digits.
    """

    stiffness: Matrix
    mass: Matrix
    dofs: tuple[Dof, ...]
    geometry: Geometry
    rigid: FloatArray
    in_arithmetic: float
    in_print: float

    @classmethod
    def of(cls, model: StructuralModel) -> _System:
        stiffness, mass, dofs = model.stiffness, model.mass, model.dofs
        admissible = model.free_motions
        if admissible is not None:
            stiffness, mass = admissible.reduced(stiffness), admissible.reduced(mass)
            dofs = tuple(dofs[row] for row in admissible.independent.tolist())
        motions = rigid_body_motions(dofs, model.geometry)
        in_print = model.rounding if _is_rounded(stiffness, motions, model.rounding) else 0.0
        whole = cls(
            stiffness=stiffness,
            mass=mass,
            dofs=dofs,
            geometry=model.geometry,
            rigid=motions[:, :0],
            in_arithmetic=EPS if in_print else _arithmetic_rounding(stiffness, motions[:, :N_TRANSLATIONS]),
            in_print=in_print,
        )
        weights, _ = _ritz(whole, motions)
        combined = motions @ weights  # of rigid motions again, free of the rounding of steps in between
        forces = np.abs(multiply(stiffness, combined))
        sizes = multiply(abs(stiffness), np.abs(motions) @ np.abs(weights))  # before terms cancel each other
        allowed = max(NO_ENERGY * whole.in_arithmetic, PRINTED * in_print) * sizes
        turns, by_turns = motions[:, N_TRANSLATIONS:], np.abs(weights[N_TRANSLATIONS:])
        if in_print:  # then nodes may be printed with few digits too, and rotations are rounded by that
            allowed += _by_printed_positions(whole)[:, None] * by_turns.sum(0)
        else:
            in_turns = _arithmetic_rounding(stiffness, turns)
            allowed += NO_ENERGY * in_turns * multiply(abs(stiffness), np.abs(turns) @ by_turns)
        rigid = combined[:, (forces <= allowed).all(0)]
        system = replace(whole, rigid=rigid)
        if in_print and mass.shape[0] < DENSE_ORDER:
            return replace(system, stiffness=system.without_feigned_forces())
        return system

    @property
    def node_numbers(self) -> IntArray:
        """Node of each row, (n,) array."""
        return np.array([dof.node for dof in self.dofs])

    def without_feigned_forces(self) -> Matrix:
        """Project the stiffness on motions that are orthogonal to the rigid ones in the mass."""
        momenta, forces = multiply(self.mass, self.rigid), multiply(self.stiffness, self.rigid)
        across = momenta @ forces.T
        again = momenta @ (self.rigid.T @ forces) @ momenta.T
        return sparse.csr_array(self.stiffness.toarray() - across - across.T + again)

    def energies(self, shapes: FloatArray) -> FloatArray:
        """Compute twice the strain energy of each shape."""
        return np.asarray(np.sum(shapes * multiply(self.stiffness, shapes), 0))

    def energy_uncertainty(self, shapes: FloatArray) -> FloatArray:
        """Bound twice the strain energy of each shape that rounding of the stiffness can hide or feign."""
        size = np.abs(shapes)
        squares = np.sum(size**2 * multiply(self.stiffness**2, size**2), 0)  # printed entries are rounded one by one
        return np.asarray(np.maximum(self.arithmetic_uncertainty(shapes), SPREAD * self.in_print * np.sqrt(squares)))

    def arithmetic_uncertainty(self, shapes: FloatArray) -> FloatArray:
        """Bound twice the strain energy of each shape that double precision or a condensation can hide or feign."""
        size = np.abs(shapes)
        return np.asarray(NO_ENERGY * self.in_arithmetic * np.sum(size * multiply(abs(self.stiffness), size), 0))


def _by_printed_positions(system: _System) -> FloatArray:
    """Largest force on each row under a unit rotation, by the rounding of printed coordinates."""
    rounding_m = printed_decimals(system.geometry.coordinates_m)
    moves = np.array([dof.direction in TRANSLATIONS for dof in system.dofs], float)
    return PRINTED * rounding_m * multiply(abs(system.stiffness), moves)


def _is_rounded(stiffness: Matrix, motions: FloatArray, rounding: float) -> bool:
    """Tell numbers that were rounded from round ones: in equilibrium the terms of a row cancel, of rounded ones do not.

    Rows that are off by more than the rounding are those of supports.
    """
    if rounding <= EPS:
        return False
    n_seen = 0
    for motion in motions.T:
        forces = _relative_forces(stiffness, motion)
        forces = forces[forces <= PRINTED * rounding]
        n_seen += len(forces)
        if len(forces) and np.quantile(forces, FREE_ROWS) > NO_ENERGY * EPS:
            return True
    return n_seen == 0


def _relative_forces(stiffness: Matrix, motion: FloatArray) -> FloatArray:
    """Force on each row that a motion loads, of the sum of its terms' sizes."""
    sizes = multiply(abs(stiffness), np.abs(motion))
    return np.asarray(np.abs(multiply(stiffness, motion))[sizes > 0] / sizes[sizes > 0])


def _arithmetic_rounding(stiffness: Matrix, motions: FloatArray) -> float:
    """Relative rounding of the stiffness matrix: force on most rows under rigid motions, which strain nothing.

    It is that of double precision for a model built here, and that of the condensation for one that was condensed.
    Under a rotation it may be that of the positions of the nodes as well, of which the stiffness itself knows nothing.
    """
    roundings = [EPS]
    for motion in motions.T:
        forces = _relative_forces(stiffness, motion)
        if len(forces):
            roundings.append(float(np.quantile(forces, FREE_ROWS)))
    return max(rounding for rounding in roundings if rounding <= MAX_ROUNDING)


def _orthonormalised(
    model: StructuralModel, system: _System, shapes: FloatArray, factor: Factorization, shift: float
) -> ModalBasis:
    """Make shapes exactly orthonormal, their frequencies exact to second order, and rigid-body modes rigid."""
    n_rigid = min(system.rigid.shape[1], shapes.shape[1])
    if n_rigid:
        shapes = np.column_stack([system.rigid[:, :n_rigid], _beside_rigid(system, shapes)])
    for _ in range(2):  # the second time removes the rounding errors of the first
        lower = linalg.cholesky(shapes.T @ multiply(system.mass, shapes), lower=True)
        shapes = linalg.solve_triangular(lower, shapes.T, lower=True).T
    eigenvalues = system.energies(shapes)
    eigenvalues[:n_rigid] = 0.0
    uncertainty = system.energy_uncertainty(shapes)
    if (eigenvalues < -uncertainty).any() and not model.allows_negative_stiffness:
        raise _indefinite_error(model, float(eigenvalues.min()))
    rigid = np.abs(eigenvalues) <= uncertainty
    rigid[:n_rigid] = True
    if system.in_print:
        _refuse_hidden(model, system, shapes[:, rigid & (np.abs(eigenvalues) > system.arithmetic_uncertainty(shapes))])
    eigenvalues = np.where(rigid, 0.0, eigenvalues)
    ascending = np.argsort(eigenvalues, kind="stable")
    shapes = shapes[:, ascending]
    top = shapes[np.argmax(np.abs(shapes), 0), np.arange(shapes.shape[1])]
    stiffness, mass, admissible = system.stiffness, system.mass, model.free_motions
    if admissible is not None:
        stiffness, mass = model.stiffness, model.mass
        shapes, factor = multiply(admissible.matrix, shapes), _Constrained(factor, admissible.matrix)
    return ModalBasis(
        eigenvalues=eigenvalues[ascending],
        shapes=shapes * np.sign(top),
        n_rigid=int(np.count_nonzero(eigenvalues <= 0)),
        stiffness=stiffness,
        mass=mass,
        factor=factor,
        shift=shift,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Constrained:
    """Factors between the forces and motions of all DOFs, of which some follow from others."""

    factor: Factorization
    motions: Matrix

    @property
    def made_by(self) -> str:
        return self.factor.made_by

    def solve(self, loads: FloatArray) -> FloatArray:
        inner = self.factor.solve(multiply(sparse.csr_array(self.motions.T), loads))
        return multiply(self.motions, inner)


def _beside_rigid(system: _System, shapes: FloatArray) -> FloatArray:
    """Elastic modes among the motions that are orthogonal to the rigid ones, as many as then remain of the shapes."""
    count = shapes.shape[1] - system.rigid.shape[1]
    if count <= 0:
        return shapes[:, :0]
    shapes = shapes - system.rigid @ (system.rigid.T @ multiply(system.mass, shapes))
    weights, axes = linalg.eigh(shapes.T @ multiply(system.mass, shapes))
    shapes = shapes @ (axes[:, -count:] / np.sqrt(weights[-count:]))
    _, axes = linalg.eigh(shapes.T @ multiply(system.stiffness, shapes))
    return np.asarray(shapes @ axes)


def _refuse_hidden(model: StructuralModel, system: _System, shapes: FloatArray) -> None:
    """Refuse shapes of no energy beyond the rounding of printed digits that are no motions of a rigid body."""
    motions = rigid_body_motions(system.dofs, system.geometry)
    if not shapes.size or not motions.any():
        return
    _, rigid = _ritz(system, motions)
    share = np.sum((rigid.T @ multiply(system.mass, shapes)) ** 2, 0)
    n_hidden = int(np.count_nonzero(share < 1.0 - BENT))
    if n_hidden:
        digits = f"about {1.0 - np.log10(2.0 * model.rounding):.0f} digits"
        hidden = counted(n_hidden, "elastic mode")
        raise IllConditionedError(
            f"the stiffness of the model '{model.name}' is printed with {digits}, which do not tell {hidden} from a "
            "motion without stiffness; export it with more digits"
        )


def _indefinite_error(model: StructuralModel, eigenvalue: float) -> IllConditionedError:
    return IllConditionedError(
        f"the stiffness matrix of the model '{model.name}' is indefinite: a mode has omega^2 = {eigenvalue:.4g}; "
        "check its springs, loads and units; where that is meant, [matrices] allow_negative_stiffness = true takes it"
    )
