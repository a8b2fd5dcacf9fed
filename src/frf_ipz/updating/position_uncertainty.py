"""Effect of position errors of sensors and excitation on zeros.

Poles belong to the structure, wherever it is excited. Zeros depend on both positions: where the row of the output or
of the input changes by dr, the zero z of H = r_o D^-1 r_i moves by - dH(z) / H'(z), to first order. Few positions move
many zeros: if that were all, the zeros would have to lie where so few numbers take them, to all digits, and what they
miss of that would be taken for a change of the structure. So what the first order leaves is a noise too, of each zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.linalg import eigh

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.dofs import AnyDof
from frf_ipz.identification.root_covariance import RootCovariance
from frf_ipz.numerics.damped_modes import receptance_roots, softly_held
from frf_ipz.numerics.pole_forms import damped_form

DRAWS, SEED = 32, 0  # of all positions: the root of a mean square of so many is known to a third

if TYPE_CHECKING:
    from frf_ipz.frf import FrfLabel
    from frf_ipz.updating.problem import UpdateProblem


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PositionUncertainty:
    """Uncertainty of the position of a sensor or an excitation, along one axis.

    Parameters
    ----------
    dof : Dof or PortDof
        DOF of the sensor or the excitation.
    is_output : bool
        True for a sensor.
    row : (r,) array
        Change of the row of the DOF by one standard deviation of the position.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    >>> uncertain = frf_ipz.propagate_position_tolerance(
    ...     fit, reduced_model, fe_model=beam, tolerance_m_per_m=1e-3
    ... )
    >>> uncertain[0].is_output, uncertain[0].row.shape
    (True, (6,))
    """

    dof: AnyDof
    is_output: bool
    row: FloatArray


def with_position_uncertainty(
    problem: UpdateProblem, misplacements: tuple[PositionUncertainty, ...]
) -> FloatArray | RootCovariance:
    """Add the effect of position errors to the covariance of the targets.

    Parameters
    ----------
    problem : UpdateProblem
        Model and targets.
    misplacements : tuple of PositionUncertainty
        Independent of each other.

    Returns
    -------
    (2 n, 2 n) array, or RootCovariance
        Of the real and the imaginary part of each target in turn, (rad/s)^2.
    """
    covariance = problem.covariance
    if not misplacements or not np.any(problem.frf >= 0):
        return covariance
    changes = _zero_changes(problem, misplacements)
    beyond = _beyond_first_order(problem, misplacements, changes)
    if not isinstance(covariance, RootCovariance):
        return np.asarray(covariance + (changes @ changes.T + beyond).toarray())
    is_output = np.array([position.is_output for position in misplacements])
    # what few positions are is common to many FRFs; each of the many is that of a few FRFs, which become one block
    is_common = is_output if 2 * is_output.sum() < len(is_output) else ~is_output
    own = changes[:, ~is_common]
    return RootCovariance(
        common=np.hstack([covariance.common, changes[:, is_common].toarray()]),
        blocks=sparse.csr_array(covariance.blocks + own @ own.T + beyond),
    )


def _zero_changes(
    problem: UpdateProblem, misplacements: tuple[PositionUncertainty, ...]
) -> sparse.csc_array[np.float64]:
    """Change of real and imaginary part of each target in turn by one standard deviation of each position, rad/s."""
    zeros = np.flatnonzero(problem.frf >= 0)
    motions, adjoints, slopes = _motions(problem, zeros)
    labels = [problem.labels[frf] for frf in problem.frf[zeros].tolist()]
    of_output, of_input = (_places([ends(label) for label in labels]) for ends in (_output, _input))
    columns, rows, values = [], [], []
    for column, position in enumerate(misplacements):
        mine = (of_output if position.is_output else of_input).get(position.dof, np.zeros(0, np.int64))
        moved = -position.row @ (motions if position.is_output else adjoints)[:, mine] / slopes[mine]
        rows.append((2 * zeros[mine, None] + np.arange(2)).ravel())
        values.append(np.stack([moved.real, moved.imag], axis=1).ravel())
        columns.append(np.full(2 * len(mine), column))
    at = np.concatenate(rows), np.concatenate(columns)
    return sparse.csc_array(
        (np.concatenate(values), at), shape=(2 * len(problem.values), len(misplacements)), dtype=np.float64
    )


def _beyond_first_order(
    problem: UpdateProblem,
    misplacements: tuple[PositionUncertainty, ...],
    changes: sparse.csc_array[np.float64],
) -> sparse.csr_array[np.float64]:
    """Covariance, (2 n, 2 n), of how zeros miss the first order: Newton's next step, where positions are drawn."""
    zeros = np.flatnonzero(problem.frf >= 0)
    receptance = _Receptance.at_zeros(problem, zeros)
    labels = [problem.labels[frf] for frf in problem.frf[zeros].tolist()]
    turns = [_incidence([end(label) for label in labels], misplacements, is_output=end is _output) for end in ENDS]
    rows = np.array([position.row for position in misplacements])
    white = np.random.default_rng(SEED).standard_normal((DRAWS, len(misplacements)))
    blocks = np.zeros((len(zeros), 2, 2))
    for draw in white:
        moved = (changes @ draw).reshape(-1, 2)[zeros] @ np.array([1.0, 1j])
        outputs, inputs = (turn @ (draw[:, None] * rows) for turn in turns)
        further = receptance.newton_step(outputs, inputs, problem.computed[zeros] + moved)
        further *= np.minimum(1.0, np.abs(moved) / np.maximum(np.abs(further), np.finfo(float).tiny))
        parts = np.stack([further.real, further.imag], axis=1)
        blocks += parts[:, :, None] * parts[:, None, :] / DRAWS
    places = 2 * zeros[:, None] + np.arange(2)
    at = np.broadcast_to(places[:, :, None], blocks.shape), np.broadcast_to(places[:, None, :], blocks.shape)
    shape = (2 * len(problem.values),) * 2
    return sparse.csr_array((blocks.ravel(), (at[0].ravel(), at[1].ravel())), shape=shape)


def _incidence(
    dofs: list[AnyDof], misplacements: tuple[PositionUncertainty, ...], *, is_output: bool
) -> sparse.csr_array[np.float64]:
    """Which of the positions are those of each DOF."""
    places = _places(dofs)
    pairs = [
        (place, column)
        for column, position in enumerate(misplacements)
        if position.is_output == is_output
        for place in places.get(position.dof, np.zeros(0, np.int64)).tolist()
    ]
    rows, columns = np.array(pairs, int).reshape(-1, 2).T
    return sparse.csr_array((np.ones(len(pairs)), (rows, columns)), shape=(len(dofs), len(misplacements)))


@dataclass(frozen=True, slots=True, eq=False)
class _Receptance:
    """The FRF of each of n zeros, by k poles."""

    poles: ComplexArray
    right: ComplexArray
    left: ComplexArray
    outputs: FloatArray
    inputs: FloatArray

    @classmethod
    def at_zeros(cls, problem: UpdateProblem, zeros: IntArray) -> _Receptance:
        model = problem.model
        squares, shapes = eigh(model.stiffness, model.mass)
        squares = softly_held(squares, float(np.abs(problem.computed[zeros]).min()))
        roots = receptance_roots(squares, shapes, model.damping)
        rows = {frf: problem.rows(frf) for frf in np.unique(problem.frf[zeros]).tolist()}
        outputs, inputs = (np.array([rows[frf][side] for frf in problem.frf[zeros].tolist()]) for side in range(2))
        return cls(*roots, outputs, inputs)

    def newton_step(self, outputs: FloatArray, inputs: FloatArray, s: ComplexArray) -> ComplexArray:
        """Step from s (n,) to the zero, where the rows of sensors and excitations change by (n, r) arrays."""
        residues = ((self.outputs + outputs) @ self.right) * ((self.inputs + inputs) @ self.left)
        with np.errstate(all="ignore"):  # a zero that meets a pole has no slope; what is not finite is no step
            nearness = 1 / (s[:, None] - np.concatenate([self.poles, self.poles.conj()]))
            terms = np.hstack([residues, residues.conj()]) * nearness
            step: ComplexArray = terms.sum(axis=1) / np.sum(terms * nearness, axis=1)
        return np.where(np.isfinite(step), step, 0.0)


def _output(label: FrfLabel) -> AnyDof:
    return label.output_dof


def _input(label: FrfLabel) -> AnyDof:
    return label.input_dof


ENDS = (_output, _input)


def _places(dofs: list[AnyDof]) -> dict[AnyDof, IntArray]:
    """Where each DOF stands in a list."""
    found: dict[AnyDof, list[int]] = {}
    for place, dof in enumerate(dofs):
        found.setdefault(dof, []).append(place)
    return {dof: np.array(places) for dof, places in found.items()}


def _motions(problem: UpdateProblem, zeros: IntArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Motion at zeros under a unit force, that of the adjoint under one at the sensor, and slope of the FRF."""
    model, values = problem.model, problem.computed[zeros]
    rows = {frf: problem.rows(frf) for frf in np.unique(problem.frf[zeros]).tolist()}
    outputs, inputs = (np.array([rows[frf][side] for frf in problem.frf[zeros].tolist()]) for side in range(2))
    form = damped_form(model.mass, model.damping, model.stiffness)
    roots, exact = form.roots(outputs, inputs, values)
    motions, adjoints = np.empty_like(roots.right_vectors), np.empty_like(roots.left_vectors)
    for scaled, loads, result in ((roots.right_vectors, inputs, motions), (roots.left_vectors, outputs, adjoints)):
        force = values**2 * (model.mass @ scaled) + values * (model.damping @ scaled) + model.stiffness @ scaled
        with np.errstate(divide="ignore", invalid="ignore"):  # what is not exact is computed below
            result[:] = scaled * (np.sum(loads**2, axis=1) / np.sum(force * loads.T, axis=0))
    for place in np.flatnonzero(~exact | ~np.isfinite(motions + adjoints).all(axis=0)).tolist():
        zero = values[place]
        dynamic = zero**2 * model.mass + zero * model.damping + model.stiffness
        motions[:, place] = np.linalg.solve(dynamic, inputs[place])
        adjoints[:, place] = np.linalg.solve(dynamic.T, outputs[place])
    by_s = 2 * values * (model.mass @ motions) + model.damping @ motions
    return motions, adjoints, np.asarray(-np.sum(adjoints * by_s, axis=0))
