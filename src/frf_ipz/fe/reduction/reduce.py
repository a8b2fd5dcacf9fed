"""Reduction of an FE model to a few physical DOFs: eigenmodes and residual flexibility, eq. (2) of [Dorosti2018].

The basis holds the lowest modes, rigid-body modes among them, and the static deflection under unit loads without the
contribution of those modes. A Ritz step makes that deflection mass- and stiffness-orthogonal too, so that the basis
contains the modes exactly and the reduced matrices are symmetric.

[Dorosti2018] M. Dorosti, R. H. B. Fey, M. F. Heertjes, H. Nijmeijer, Iterative Pole-Zero model updating: A combined
sensitivity approach, Control Engineering Practice 71, 2018, 164-174, doi:10.1016/j.conengprac.2017.11.002.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.arguments import require_type
from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.dofs import GENERALISED, TRANSLATIONS, AnyDof, as_dofs
from frf_ipz.errors import IllConditionedError, InputError
from frf_ipz.fe.assembly import multiply
from frf_ipz.fe.changes import with_default_damping
from frf_ipz.fe.eigen import ModalBasis, mode_damping_ratios, solve_basis
from frf_ipz.fe.reduction.options import ReduceOptions
from frf_ipz.fe.reduction.plan import ReductionPlan, plan_reduction
from frf_ipz.fe.reduction.retained_dofs import MAX_CONDITION, choose_retained_rows, condition_number
from frf_ipz.frf import require_measured
from frf_ipz.numerics.one_thread import on_one_thread
from frf_ipz.numerics.pencils import separate_equal_modes
from frf_ipz.structure import ReducedModel, StructuralModel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.frf import Measured

DEFAULT_DAMPING_RATIO = 0.005  # where neither model nor test states one: a bolted metal structure
BAND_MARGIN = 2.5  # modes up to this times the top of the band: the band's antiresonances are then right to about 0.1 %
NO_FLEXIBILITY = 1e-9  # of a DOF's flexibility: a residual vector below adds nothing to the modes
MAX_EXPANDED = 200_000  # free DOFs up to which the motion of all of them is stored
MAX_GROWTH = 2  # times the modes that the band needs: more are not added just to have a row for each sensor
FEW_DOFS = 24  # up to which they are added all the same
EIGENVALUE_TOLERANCE = 1e-6  # relative, of a mode's eigenvalue after the reduction: far below what a test resolves


@on_one_thread
def reduce_model(
    measured: Measured,
    fe_model: StructuralModel,
    *,
    points: Sequence[AnyDof | str] = (),
    options: ReduceOptions | None = None,
    default_damping_ratio: float | None = None,
) -> ReducedModel:
    """Reduce an FE model to the DOFs that were measured, those of interest, and what the band needs.

    Parameters
    ----------
    measured : ModalFit or FrfSet
        What was measured, and in which band.
    fe_model : StructuralModel
        The FE model.
    points : sequence of Dof or str
        Points of interest; signs are ignored.
    options : ReduceOptions, optional
        What the user has fixed.
    default_damping_ratio : float, optional
        As for `reduce_to_dofs`.

    Returns
    -------
    ReducedModel
        Matrices, retained DOFs, and the motion of the other DOFs.

    Raises
    ------
    InputError, IllConditionedError
        As for `reduce_to_dofs`.

    Examples
    --------
    >>> import frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, left="clamped"
    ... )
    >>> lines = np.arange(10, 700.0)
    >>> frfs = frf_ipz.FrfSet.from_arrays(lines, np.ones((690, 1, 1)), outputs=["101:+z"], inputs=["89:+z"])
    >>> [dof.name for dof in frf_ipz.reduce_model(frfs, beam, points=["49:+z"]).dofs][:3]
    ['89:z', '101:z', '49:z']
    """
    require_measured(measured)
    require_type("fe_model", fe_model, StructuralModel)
    require_type("options", options, ReduceOptions, optional=True)
    require_type("default_damping_ratio", default_damping_ratio, float, int, np.number, optional=True)
    if default_damping_ratio is not None and not 0 <= default_damping_ratio < 1:
        raise InputError(f"default_damping_ratio is {default_damping_ratio}; a damping ratio lies from 0 to below 1")
    return reduce_to_dofs(
        fe_model,
        options=options,
        actuators=tuple(dict.fromkeys(label.input_dof for label in measured.connections)),
        sensors=tuple(dict.fromkeys(label.output_dof for label in measured.connections)),
        points=as_dofs(points),
        band_hz=measured.band_hz,
        default_damping_ratio=default_damping_ratio,
    )


def reduce_to_dofs(
    model: StructuralModel,
    *,
    options: ReduceOptions | None = None,
    actuators: Sequence[AnyDof],
    sensors: Sequence[AnyDof],
    points: Sequence[AnyDof],
    band_hz: tuple[float, float],
    default_damping_ratio: float | None = None,
) -> ReducedModel:
    """Reduce an FE model to physical DOFs.

    Where the options are silent, the program chooses:

    - Modes: those up to 2.5 times the band's top. A residual vector holds the modes above as static flexibility, which
      is right to (f / f_k)^2 of a neglected mode's share, and zeros are most sensitive to that. If there are more
      actuators, sensors and points than retained DOFs, modes are added, up to twice as many DOFs or 24.
    - Residual vectors: at the actuators; or at the sensors and points, where these are fewer. By reciprocity both make
      the static part of every FRF between the two sides exact.
    - DOFs: the actuators, sensors and points, and further translations that make the mode matrix well conditioned.
      DOFs that cannot be retained (too many of them, or one a copy of another) follow through `expansion`, in the
      same modes.

    The damping matrix is ``M Phi diag(2 zeta omega) Phi^T M`` for modes and residual vectors, with the model's
    ratios by ascending frequency (a residual vector counts as a mode above the others, at its Ritz frequency), and
    the model's viscous damping.

    Parameters
    ----------
    model : StructuralModel
        The FE model.
    options : ReduceOptions, optional
        What the user has fixed.
    actuators, sensors, points : sequence of Dof
        DOFs of the test and points of interest; signs are ignored.
    band_hz : pair of float
        The band of the test.
    default_damping_ratio : float, optional
        Damping ratio of the modes where the model states no damping; 0.005 where this is None too.

    Returns
    -------
    ReducedModel
        Matrices, retained DOFs, and the motion of the other DOFs.

    Raises
    ------
    InputError
        If the model lacks a DOF or holds it, or the numbers of modes, residual vectors and DOFs do not fit.
    IllConditionedError
        If the DOFs that are given make the mode matrix badly conditioned; the message proposes others.
    """
    nominal = DEFAULT_DAMPING_RATIO if default_damping_ratio is None else default_damping_ratio
    damped = with_default_damping(model, nominal)
    notes = list(model.notes)
    if damped is not model:
        origin = "from the test" if default_damping_ratio is not None else "by default"
        notes.append(f"damping: {nominal:g} for every mode, {origin}")
    plan = plan_reduction(damped, options or ReduceOptions(), actuators=actuators, sensors=sensors, points=points)
    basis = _turned_to_ports(damped, _solve_retained_modes(damped, plan, band_hz, notes), plan)
    ritz = _with_residual_vectors(damped, basis, plan, notes)
    rows = _retained_rows(damped, ritz, plan, notes)
    return _reduced_model(damped, ritz, rows, plan, tuple(notes))


@dataclass(frozen=True, slots=True, eq=False)
class _Ritz:
    """Basis of modes and residual vectors, mass- and stiffness-orthogonal; `motions` has a row for each of `dofs`.

    These are the free DOFs, then the ports: a port may be retained like a DOF.
    """

    eigenvalues: FloatArray
    shapes: FloatArray
    n_modes: int
    n_rigid: int
    residual: tuple[AnyDof, ...]
    dofs: tuple[AnyDof, ...]
    motions: FloatArray

    def structural_rows(self) -> IntArray:
        """Rows of motions at nodes and of ports, without generalised DOFs."""
        return np.array([row for row, dof in enumerate(self.dofs) if dof.direction != GENERALISED], dtype=np.int64)

    def places(self, dofs: Sequence[AnyDof]) -> list[int]:
        place_of = {dof: place for place, dof in enumerate(self.dofs)}
        return [place_of[dof] for dof in dofs]


def _solve_retained_modes(
    model: StructuralModel, plan: ReductionPlan, band_hz: tuple[float, float], notes: list[str]
) -> ModalBasis:
    if plan.modes is not None:
        return solve_basis(model, n_modes=plan.modes)
    order = model.n_modes
    if plan.dofs:
        count = min(len(plan.dofs) - len(plan.residual), order)
        notes.append(f"modes: {count}, as many as dofs and residual vectors need")
        return solve_basis(model, n_modes=count)
    basis = solve_basis(model, up_to_hz=BAND_MARGIN * band_hz[1])
    at_nodes = sum(dof.direction != GENERALISED for dof in model.dofs)
    if at_nodes < len(model.dofs):
        order = min(order, max(at_nodes - len(plan.residual), 1))
    if order < len(basis.eigenvalues):
        notes.append(f"modes: {order} of {len(basis.eigenvalues)}, as few DOFs of nodes remain beside generalised ones")
        basis = basis.first(order)
    in_margin = len(basis.eigenvalues)
    rows = max(in_margin, 1) + len(plan.residual)
    allowed = max(MAX_GROWTH * rows, FEW_DOFS)
    count = min(max(in_margin, 1, min(len(plan.required), allowed) - len(plan.residual)), order)
    notes.append(f"modes: {in_margin} up to {BAND_MARGIN * band_hz[1]:g} Hz, {BAND_MARGIN:g} times the top of the band")
    if count > in_margin:
        notes.append(f"modes: {count - in_margin} more, so that actuators, sensors and points are retained DOFs")
        basis = solve_basis(model, n_modes=count)
    return basis


def _turned_to_ports(model: StructuralModel, basis: ModalBasis, plan: ReductionPlan) -> ModalBasis:
    at_ports = np.asarray(model.rows(plan.required) @ basis.shapes)
    elastic = slice(basis.n_rigid, None)
    values, turn = separate_equal_modes(basis.eigenvalues[elastic], at_ports[:, elastic])
    shapes = np.hstack([basis.shapes[:, : basis.n_rigid], basis.shapes[:, elastic] @ turn])
    return replace(basis, eigenvalues=np.concatenate([basis.eigenvalues[: basis.n_rigid], values]), shapes=shapes)


def _with_residual_vectors(model: StructuralModel, basis: ModalBasis, plan: ReductionPlan, notes: list[str]) -> _Ritz:
    vectors, residual_dofs = _residual_vectors(model, basis, plan)
    if not plan.residual_is_given:
        names = ", ".join(dof.name for dof in residual_dofs) or "none, as the modes hold all flexibility"
        notes.append(f"residual flexibility: {names}")
    eigenvalues = np.zeros(0)
    if residual_dofs:
        stiffness, mass = (vectors.T @ multiply(matrix, vectors) for matrix in (basis.stiffness, basis.mass))
        eigenvalues, axes = linalg.eigh(stiffness, mass)
        vectors = vectors @ axes
    shapes, ports = np.column_stack([basis.shapes, vectors]), tuple(model.port_dofs)
    return _Ritz(
        eigenvalues=np.concatenate([basis.eigenvalues, eigenvalues]),
        shapes=shapes,
        dofs=(*model.dofs, *ports),
        motions=np.vstack([shapes, np.asarray(model.rows(ports) @ shapes)]) if ports else shapes,
        n_modes=len(basis.eigenvalues),
        n_rigid=basis.n_rigid,
        residual=tuple(residual_dofs),
    )


def _residual_vectors(
    model: StructuralModel, basis: ModalBasis, plan: ReductionPlan
) -> tuple[FloatArray, list[AnyDof]]:
    """Residual flexibility at DOFs where modes and the vectors before do not hold all of it; columns of unit mass."""
    rows = model.rows(plan.residual)
    loads = rows.toarray().T
    elastic = slice(basis.n_rigid, None)
    in_modes = np.sum(np.asarray(rows @ basis.shapes[:, elastic]) ** 2 / basis.eigenvalues[elastic], 1)
    max_count = model.n_modes - len(basis.eigenvalues)
    deflections = basis.residual_flexibility(loads) if max_count else np.zeros_like(loads)
    vectors = np.zeros((len(basis.shapes), 0))
    residual_dofs: list[AnyDof] = []
    for column, (dof, load) in enumerate(zip(plan.residual, loads.T, strict=True)):
        rest = deflections[:, column] - vectors @ (vectors.T @ multiply(basis.mass, deflections[:, column]))
        size = float(np.sqrt(rest @ multiply(basis.mass, rest)))
        flexibility = abs(load @ deflections[:, column])
        is_new = flexibility > NO_FLEXIBILITY * in_modes[column] and abs(load @ rest) > NO_FLEXIBILITY * flexibility
        if is_new and len(residual_dofs) < max_count and size > 0:
            vectors, residual_dofs = np.column_stack([vectors, rest / size]), [*residual_dofs, dof]
        elif plan.residual_is_given:
            raise InputError(
                f"[reduce] residual_flexibility: at {dof.name} the modes, and the DOFs named before it, hold all the "
                "flexibility already; omit it"
            )
    return vectors, residual_dofs


def _retained_rows(model: StructuralModel, ritz: _Ritz, plan: ReductionPlan, notes: list[str]) -> IntArray:
    count = ritz.shapes.shape[1]
    if plan.dofs:
        if len(plan.dofs) != count:
            raise InputError(
                f"[reduce] dofs names {len(plan.dofs)} DOFs, but there are {ritz.n_modes} modes and "
                f"{len(ritz.residual)} residual vectors; name {count}, or omit dofs"
            )
        rows = np.array(ritz.places(plan.dofs))
        _require_condition(ritz, rows, plan)
    else:
        rows = _chosen_rows(ritz, plan)
        if condition_number(ritz.motions[rows]) > MAX_CONDITION:
            raise IllConditionedError(
                f"{count} modes and residual vectors cannot be distinguished at any DOFs of the model '{model.name}'; "
                "use fewer ([reduce] modes)",
                key="reduce.modes",
            )
        notes.append("dofs: " + ", ".join(ritz.dofs[row].name for row in rows.tolist()))
    retained = {ritz.dofs[row] for row in rows.tolist()}
    expanded = [dof.name for dof in plan.required if dof not in retained]
    if expanded:
        notes.append(f"dofs: {', '.join(expanded)} are not retained, but follow from the retained ones")
    return rows


def _chosen_rows(ritz: _Ritz, plan: ReductionPlan) -> IntArray:
    """Choose actuators, sensors, points and translations; rotations only where translations do not separate modes."""
    motions = ritz.motions
    required, count = ritz.places(plan.required), ritz.shapes.shape[1]
    structural = ritz.structural_rows()
    structural = structural[structural < len(ritz.shapes)]  # ports that no one asks for are no candidates
    translations = structural[[ritz.dofs[row].direction in TRANSLATIONS for row in structural.tolist()]]
    if translations.size >= count:
        rows = choose_retained_rows(motions, required, translations, count)
        if condition_number(motions[rows]) <= MAX_CONDITION:
            return rows
    # rotations have another unit: only the directions of the rows can be compared
    lengths = np.linalg.norm(motions, axis=1, keepdims=True)
    return choose_retained_rows(motions / np.where(lengths > 0, lengths, 1.0), required, structural, count)


def _require_condition(ritz: _Ritz, rows: IntArray, plan: ReductionPlan) -> None:
    condition = condition_number(ritz.motions[rows])
    if condition > MAX_CONDITION:
        better = _chosen_rows(ritz, plan)
        names = ", ".join(f'"{ritz.dofs[row].name}"' for row in better.tolist())
        raise IllConditionedError(
            f"[reduce] dofs: the modes can hardly be distinguished at these DOFs (condition number {condition:.2g}, at "
            f"most {MAX_CONDITION:g}); better is dofs = [{names}] ({condition_number(ritz.motions[better]):.2g})",
            key="reduce.dofs",
        )


def _reduced_model(
    model: StructuralModel, ritz: _Ritz, rows: IntArray, plan: ReductionPlan, notes: tuple[str, ...]
) -> ReducedModel:
    inverse = linalg.inv(ritz.motions[rows])
    omega = np.sqrt(np.abs(ritz.eigenvalues))
    negative = ritz.eigenvalues < 0
    mass, stiffness = _gram(inverse), _gram(np.where(negative, 0.0, omega)[:, None] * inverse)
    if negative.any():
        stiffness = stiffness - _gram(omega[negative, None] * inverse[negative])
    _require_modes(mass, stiffness, ritz)
    ratios = mode_damping_ratios(model, ritz.eigenvalues, ritz.shapes, ritz.n_rigid)
    rates = 2 * ratios * omega
    viscous = ritz.shapes.T @ multiply(model.damping, ritz.shapes)
    dashpots = inverse.T @ ((viscous + viscous.T) / 2) @ inverse
    damping = _gram(np.sqrt(rates)[:, None] * inverse) + dashpots
    rigid = ritz.motions[rows][:, ritz.eigenvalues == 0]
    states_both = np.any(rates) and np.any(viscous)
    dofs = ritz.dofs
    expanded = ritz.structural_rows() if len(model.dofs) <= MAX_EXPANDED else _required_rows(rows, plan, ritz)
    expansion = np.asarray(ritz.motions[expanded] @ inverse)
    return ReducedModel(
        mass=mass,
        damping=(damping + damping.T) / 2,
        stiffness=stiffness,
        dofs=tuple(dofs[row] for row in rows.tolist()),
        expansion=expansion,
        expanded_dofs=tuple(dofs[row] for row in expanded.tolist()),
        n_modes=ritz.n_modes,
        residual_dofs=ritz.residual,
        choices=notes,
        dashpots=(dashpots + dashpots.T) / 2 if states_both else np.zeros((0, 0)),
        rigid=rigid if rigid.shape[1] else np.zeros((0, 0)),
    )


def _required_rows(rows: IntArray, plan: ReductionPlan, ritz: _Ritz) -> IntArray:
    required = ritz.places((*plan.required, *ritz.residual))
    ports = np.arange(len(ritz.shapes), len(ritz.motions))
    return np.unique(np.concatenate([rows, np.array(required, dtype=np.int64), ports]))


def _require_modes(mass: FloatArray, stiffness: FloatArray, ritz: _Ritz) -> None:
    """Check that rounding in the reduced matrices does not change the modes."""
    try:
        eigenvalues = linalg.eigh(stiffness, mass, eigvals_only=True)
    except linalg.LinAlgError:
        raise IllConditionedError(
            "rounding leaves the reduced mass matrix not positive definite; use fewer modes, "
            "or DOFs that are farther apart ([reduce] modes, dofs)",
            key="reduce.modes",
        ) from None
    elastic = slice(ritz.n_rigid, ritz.n_modes)
    error = np.abs(eigenvalues[elastic] / ritz.eigenvalues[elastic] - 1).max(initial=0.0)
    if error > EIGENVALUE_TOLERANCE:
        raise IllConditionedError(
            f"rounding in the reduced matrices shifts a mode's omega^2 by {error:.1g} of its value; use fewer modes, "
            "or DOFs that are farther apart ([reduce] modes, dofs)",
            key="reduce.modes",
        )


def _gram(matrix: FloatArray) -> FloatArray:
    product = matrix.T @ matrix
    return np.asarray((product + product.T) / 2)
