"""Sensors and blows that are not exactly where they should be: what that does to zeros.

Poles belong to the structure, wherever it is struck. Zeros depend on both places: where the row of the output or of the
input changes by dr, the zero z of H = r_o D^-1 r_i moves by - dH(z) / H'(z).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.dofs import Dof

if TYPE_CHECKING:
    from frf_ipz.updating.problem import UpdateProblem


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PositionUncertainty:
    """A place that is not known exactly, along one axis.

    Parameters
    ----------
    dof : Dof
        Of the sensor or the blow.
    is_output : bool
        True for a sensor.
    row : (r,) array
        By how much the row of the DOF is off, one standard deviation.
    """

    dof: Dof
    is_output: bool
    row: FloatArray


def with_position_uncertainty(problem: UpdateProblem, misplacements: tuple[PositionUncertainty, ...]) -> FloatArray:
    """Add what misplaced sensors and blows do to the covariance of the targets.

    Parameters
    ----------
    problem : UpdateProblem
        Model and targets.
    misplacements : tuple of PositionUncertainty
        Independent of each other.

    Returns
    -------
    (2 n, 2 n) array
        Of the real and the imaginary part of each target in turn, (rad/s)^2.
    """
    if not misplacements:
        return problem.covariance
    moved = np.zeros((len(problem.values), len(misplacements)), complex)
    for target in np.flatnonzero(problem.frf >= 0).tolist():
        moved[target] = _moved(problem, target, misplacements)
    parts = np.stack([moved.real, moved.imag], axis=1).reshape(2 * len(moved), len(misplacements))
    return np.asarray(problem.covariance + parts @ parts.T)


def _moved(problem: UpdateProblem, target: int, misplacements: tuple[PositionUncertainty, ...]) -> ComplexArray:
    """How far a zero moves with each misplacement, rad/s."""
    model, zero, frf = problem.model, complex(problem.computed[target]), int(problem.frf[target])
    label = problem.labels[frf]
    output, force = problem.rows(frf)
    dynamic = zero**2 * model.mass + zero * model.damping + model.stiffness
    motion, across = np.linalg.solve(dynamic, force), np.linalg.solve(dynamic.T, output)
    slope = -across @ (2 * zero * model.mass + model.damping) @ motion
    changed = [
        one.row @ (motion if one.is_output else across)
        if one.dof == (label.output_dof if one.is_output else label.input_dof)
        else 0.0
        for one in misplacements
    ]
    return np.asarray(-np.array(changed, complex) / slope)
