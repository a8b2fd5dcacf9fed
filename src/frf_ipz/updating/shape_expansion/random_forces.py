"""Fields of motion that random forces drive in a model, conditioned on what was measured of them.

At the frequency of a measured mode its shape is a motion ``u`` with ``Z u = f``, Z the dynamic stiffness of the model
and f the forces of all that the model lacks. With forces in proportion to the mass, ``E f f^T = M``, the covariance of
the motion is ``Z^-1 M Z^-H``: in the modes of the model it is diagonal, ``1 / |omega_k^2 - omega^2 + 2 i zeta omega_k
omega|^2``. A mode of the model near the measured frequency stands out in it, so that a shape follows that mode as far
as it can, and the least forces make up for the rest. Several measured modes may follow one mode of the model.

[Girolami2021]: M. Girolami, E. Febrianto, G. Yin, F. Cirak, The statistical finite element method (statFEM) for
coherent synthesis of observation data and model predictions, Computer Methods in Applied Mechanics and Engineering 375
(2021) 113533 (doi:10.1016/j.cma.2020.113533).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.arrays import FloatArray

if TYPE_CHECKING:
    from frf_ipz.structure import ReducedModel
    from frf_ipz.updating.shape_expansion.measured_shapes import MeasuredShapes


LEAST_DAMPING = 1e-6  # where none is measured: a mode of the model at the very frequency would have no bound


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModalModel:
    """A reduced model in its modes.

    Parameters
    ----------
    omega : (m,) array
        Natural frequencies, ascending, rad/s.
    shapes : (r, m) array
        Mass-normalised.
    outputs, inputs : (n_outputs, m), (n_inputs, m) array
        Shapes at the sensors and at the excited DOFs.
    """

    omega: FloatArray
    shapes: FloatArray
    outputs: FloatArray
    inputs: FloatArray

    @classmethod
    def of(cls, model: ReducedModel, measured: MeasuredShapes) -> ModalModel:
        """Solve a model for its modes.

        Parameters
        ----------
        model : ReducedModel
            The model.
        measured : MeasuredShapes
            Names the sensors and excited DOFs.

        Returns
        -------
        ModalModel
            All of its modes.
        """
        stiffness = (model.stiffness + model.stiffness.T) / 2
        squares, shapes = linalg.eigh(stiffness, model.mass)
        return cls(
            omega=np.sqrt(np.maximum(squares, 0.0)),
            shapes=shapes,
            outputs=np.array([model.row(dof) for dof in measured.outputs]) @ shapes,
            inputs=np.array([model.row(dof) for dof in measured.inputs]) @ shapes,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExpandedShape:
    """A measured mode in the modes of a model.

    Parameters
    ----------
    amplitudes : (m,) array
        Of the model's modes, with which shape times shape is the measured amplitude.
    covariance : (m, m) array
        Of these.
    at_outputs, at_inputs : (n_outputs,), (n_inputs,) array
        The measured shape, in the same unit.
    sign : float
        1; or -1 where the polarity of the measurement is the opposite of the model's.
    log_evidence : float
        Logarithm of the probability of the directions measured, but for a constant.
    """

    amplitudes: FloatArray
    covariance: FloatArray
    at_outputs: FloatArray
    at_inputs: FloatArray
    sign: float
    log_evidence: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldAtPoints:
    """What random forces drive at the frequency of a measured mode, at sensors and excited DOFs, in a unit of its own.

    Parameters
    ----------
    rows : (n_outputs + n_inputs, m) array
        Shapes of the model there.
    power : (m,) array
        Variance of the amplitude of each of its modes.
    prior : (n_outputs + n_inputs, n_outputs + n_inputs) array
        Covariance of the motion.
    unit_variance : (n_outputs + n_inputs,) array
        Of an error of 100 % of the typical motion of a side.
    own : (n_outputs + n_inputs,) array
        Relative variance of noise and of doubted points.
    """

    rows: FloatArray
    power: FloatArray
    prior: FloatArray
    unit_variance: FloatArray
    own: FloatArray

    def error_variance(self, error: float) -> FloatArray:
        """Variance of what is measured beside the field.

        Parameters
        ----------
        error : float
            Relative, of each measured amplitude beside its noise.

        Returns
        -------
        (n_outputs + n_inputs,) array
            In the unit of `prior`.
        """
        return np.asarray(self.unit_variance * (error**2 + self.own))


def field_at_points(model: ModalModel, measured: MeasuredShapes, mode: int) -> FieldAtPoints:
    """Tell what random forces drive at the frequency of a measured mode.

    Parameters
    ----------
    model : ModalModel
        The model in its modes.
    measured : MeasuredShapes
        Shapes at sensors and excited DOFs.
    mode : int
        Which one.

    Returns
    -------
    FieldAtPoints
        Before anything is known of its shape.
    """
    rows = np.vstack([model.outputs, model.inputs])
    count, n_outputs = len(rows), len(model.outputs)
    omega, damping = measured.omega[mode], max(float(measured.damping[mode]), LEAST_DAMPING)
    power = 1 / np.abs(model.omega**2 - omega**2 + 2j * damping * model.omega * omega) ** 2
    power = power / np.mean((rows**2) @ power)
    prior = (rows * power) @ rows.T
    sizes = np.diag(prior)
    unit = [np.full(n_outputs, sizes[:n_outputs].mean()), np.full(count - n_outputs, sizes[n_outputs:].mean())]
    return FieldAtPoints(
        rows=rows,
        power=power,
        prior=prior,
        unit_variance=np.concatenate(unit),
        own=measured.noise[mode] + measured.doubt,
    )


def expand_shape(model: ModalModel, measured: MeasuredShapes, mode: int, error: float) -> ExpandedShape:
    """Expand a measured mode over a model.

    Parameters
    ----------
    model : ModalModel
        The model in its modes.
    measured : MeasuredShapes
        Shapes at sensors and excited DOFs.
    mode : int
        Which one.
    error : float
        Relative error of each measured amplitude beside its noise: gains, positions, motion that a sensor sees besides.

    Returns
    -------
    ExpandedShape
        The mean of the field given what was measured, and its covariance.
    """
    field = field_at_points(model, measured, mode)
    rows, power = field.rows, field.power
    count, n_outputs = len(rows), len(model.outputs)
    factor = linalg.cho_factor(field.prior + np.diag(field.error_variance(error)), lower=True)
    output = np.concatenate([measured.at_outputs[mode], np.zeros(count - n_outputs)])
    force = np.concatenate([np.zeros(n_outputs), measured.at_inputs[mode]])
    by_output, by_force = linalg.cho_solve(factor, output), linalg.cho_solve(factor, force)
    # sizes of both directions whose product is given: the least forces
    ratio = float((force @ by_force) / (output @ by_output)) ** 0.25
    sign = 1.0 if output @ by_force <= 0 else -1.0  # with which the forces are least
    root = np.sqrt(measured.size[mode])
    values = root * (ratio * output + sign * force / ratio)
    weights = root * (ratio * by_output + sign * by_force / ratio)
    square, degrees = float(values @ weights), max(count - 1, 1)
    spread = (rows * power).T
    left_over = np.diag(power) - spread @ linalg.cho_solve(factor, spread.T)
    log_determinant = 2 * float(np.log(np.diag(factor[0])).sum())
    return ExpandedShape(
        amplitudes=np.asarray(spread @ weights),
        covariance=np.asarray(left_over * square / degrees),
        at_outputs=values[:n_outputs],
        at_inputs=values[n_outputs:],
        sign=sign,
        log_evidence=-0.5 * (log_determinant + degrees * np.log(square / measured.size[mode] / degrees)),
    )
