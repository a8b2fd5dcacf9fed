"""Effect of position errors of sensors and excitation on zeros.

Poles belong to the structure, wherever it is excited. Zeros depend on both positions: where the row of the output or
of the input changes by dr, the zero z of H = r_o D^-1 r_i moves by - dH(z) / H'(z).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.dofs import AnyDof
from frf_ipz.identification.root_covariance import RootCovariance
from frf_ipz.numerics.pole_forms import damped_form

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
    if not isinstance(covariance, RootCovariance):
        return np.asarray(covariance + (changes @ changes.T).toarray())
    is_output = np.array([position.is_output for position in misplacements])
    # what few positions are is common to many FRFs; each of the many is that of a few FRFs, which become one block
    is_common = is_output if 2 * is_output.sum() < len(is_output) else ~is_output
    own = changes[:, ~is_common]
    return RootCovariance(
        common=np.hstack([covariance.common, changes[:, is_common].toarray()]),
        blocks=sparse.csr_array(covariance.blocks + own @ own.T),
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


def _output(label: FrfLabel) -> AnyDof:
    return label.output_dof


def _input(label: FrfLabel) -> AnyDof:
    return label.input_dof


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
