"""Effect of position errors of sensors and excitation on zeros.

Poles belong to the structure, wherever it is excited. Zeros depend on both positions: where the row of the output or
of the input changes by dr, the zero z of H = r_o D^-1 r_i moves by - dH(z) / H'(z).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.dofs import AnyDof
from frf_ipz.identification.root_covariance import RootCovariance

if TYPE_CHECKING:
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
    if not misplacements:
        return problem.covariance
    changes = np.zeros((len(problem.values), len(misplacements)), complex)
    for target in np.flatnonzero(problem.frf >= 0).tolist():
        changes[target] = _zero_changes(problem, target, misplacements)
    parts = np.stack([changes.real, changes.imag], axis=1).reshape(2 * len(changes), len(misplacements))
    covariance = problem.covariance
    if isinstance(covariance, RootCovariance):
        return replace(covariance, common=np.hstack([covariance.common, parts]))
    return np.asarray(covariance + parts @ parts.T)


def _zero_changes(problem: UpdateProblem, target: int, misplacements: tuple[PositionUncertainty, ...]) -> ComplexArray:
    """Change of a zero by one standard deviation of each position, rad/s."""
    model, zero, frf = problem.model, complex(problem.computed[target]), int(problem.frf[target])
    label = problem.labels[frf]
    output, force = problem.rows(frf)
    dynamic = zero**2 * model.mass + zero * model.damping + model.stiffness
    motion, adjoint = np.linalg.solve(dynamic, force), np.linalg.solve(dynamic.T, output)
    slope = -adjoint @ (2 * zero * model.mass + model.damping) @ motion
    value_changes = [
        position.row @ (motion if position.is_output else adjoint)
        if position.dof == (label.output_dof if position.is_output else label.input_dof)
        else 0.0
        for position in misplacements
    ]
    return np.asarray(-np.array(value_changes, complex) / slope)
