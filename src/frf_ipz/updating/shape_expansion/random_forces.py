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

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.numerics.pencils import modes_of_stack

if TYPE_CHECKING:
    from frf_ipz.structure import ReducedModel
    from frf_ipz.updating.shape_expansion.measured_shapes import MeasuredShapes


LEAST_DAMPING = 1e-6  # where none is measured: a mode of the model at the very frequency would have no bound


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModalModel:
    """A reduced model in its modes, or many.

    Parameters
    ----------
    omega : (..., m) array
        Natural frequencies, ascending, rad/s.
    shapes : (..., r, m) array
        Mass-normalised.
    outputs, inputs : (..., n_outputs, m), (..., n_inputs, m) array
        Shapes at the sensors and at the excited DOFs.
    scatter : (...) array
        Standard deviation of the logarithms of measured frequencies about those of the model.
    """

    omega: FloatArray
    shapes: FloatArray
    outputs: FloatArray
    inputs: FloatArray
    scatter: FloatArray

    @classmethod
    def of(cls, model: ReducedModel, measured: MeasuredShapes, scatter: float) -> ModalModel:
        """Solve a model for its modes.

        Parameters
        ----------
        model : ReducedModel
            The model.
        measured : MeasuredShapes
            Names the sensors and excited DOFs.
        scatter : float
            Standard deviation of the logarithms of measured frequencies about those of the model.

        Returns
        -------
        ModalModel
            All of its modes.
        """
        return cls.of_matrices(model.mass, model.stiffness, *rows_of_ends(model, measured), np.asarray(scatter))

    @classmethod
    def of_matrices(
        cls, mass: FloatArray, stiffness: FloatArray, outputs: FloatArray, inputs: FloatArray, scatter: FloatArray
    ) -> ModalModel:
        """Solve models for their modes.

        Parameters
        ----------
        mass, stiffness : (..., r, r) array
            Of each.
        outputs, inputs : (n_outputs, r), (n_inputs, r) array
            Rows of the sensors and excited DOFs.
        scatter : (...) array
            Of each, of the logarithms of measured frequencies.

        Returns
        -------
        ModalModel
            All of their modes.
        """
        squares, shapes = modes_of_stack(mass, (stiffness + stiffness.swapaxes(-1, -2)) / 2)
        omega = np.sqrt(np.maximum(squares, 0.0))
        return cls(omega=omega, shapes=shapes, outputs=outputs @ shapes, inputs=inputs @ shapes, scatter=scatter)


def rows_of_ends(model: ReducedModel, measured: MeasuredShapes) -> tuple[FloatArray, FloatArray]:
    """Give the motion of sensors and excited DOFs.

    Parameters
    ----------
    model : ReducedModel
        The model.
    measured : MeasuredShapes
        Names them.

    Returns
    -------
    outputs, inputs : (n_outputs, r), (n_inputs, r) array
        For unit motions of its retained DOFs.
    """
    outputs, inputs = (np.array([model.row(dof) for dof in dofs]) for dofs in (measured.outputs, measured.inputs))
    return outputs, inputs


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExpandedShape:
    """A measured mode in the modes of a model, or of many.

    Parameters
    ----------
    of_outputs, of_inputs : (..., m) array
        What sensors and excited DOFs tell of the amplitudes of the model's modes.
    covariance : (..., m, m) array
        Of these amplitudes, for sizes of both sides as they are.
    split_std : (...) array
        Standard deviation of the logarithm of the size of one side: only the product of both sizes is measured, and
        either follows from the other as the model has it.
    at_outputs, at_inputs : (..., n_outputs), (..., n_inputs) array
        The measured shape, in the same unit.
    sign : (...) array
        1; or -1 where the polarity of the measurement is the opposite of the model's.
    log_evidence : (...) array
        Logarithm of the probability of the directions measured, but for a constant.
    """

    of_outputs: FloatArray
    of_inputs: FloatArray
    covariance: FloatArray
    split_std: FloatArray
    at_outputs: FloatArray
    at_inputs: FloatArray
    sign: FloatArray
    log_evidence: FloatArray

    @property
    def amplitudes(self) -> FloatArray:
        """(..., m) of the model's modes, with which shape times shape is the measured amplitude."""
        return self.of_outputs + self.of_inputs

    def with_split(self, log_ratio: float) -> ExpandedShape:
        """Make the excited DOFs move more and the sensors less, so that their products stay.

        Parameters
        ----------
        log_ratio : float
            Logarithm of the factor on what excited DOFs move.

        Returns
        -------
        ExpandedShape
            The mean of the field under that condition.
        """
        ratio = np.exp(log_ratio)
        return replace(
            self,
            of_outputs=self.of_outputs / ratio,
            of_inputs=self.of_inputs * ratio,
            at_outputs=self.at_outputs / ratio,
            at_inputs=self.at_inputs * ratio,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldAtPoints:
    """What random forces drive at the frequency of a measured mode, at sensors and excited DOFs, in a unit of its own.

    Parameters
    ----------
    rows : (..., n_outputs + n_inputs, m) array
        Shapes of the model there.
    power : (..., m) array
        Variance of the amplitude of each of its modes.
    prior : (..., n_outputs + n_inputs, n_outputs + n_inputs) array
        Covariance of the motion.
    unit_variance : (..., n_outputs + n_inputs) array
        Of an error of 100 % of the typical motion of a side.
    own : (n_outputs + n_inputs,) array
        Relative variance of noise and of doubted points.
    """

    rows: FloatArray
    power: FloatArray
    prior: FloatArray
    unit_variance: FloatArray
    own: FloatArray

    def error_variance(self, error: float | FloatArray) -> FloatArray:
        """Variance of what is measured beside the field.

        Parameters
        ----------
        error : float or (...) array
            Relative, of each measured amplitude beside its noise.

        Returns
        -------
        (..., n_outputs + n_inputs) array
            In the unit of `prior`.
        """
        return np.asarray(self.unit_variance * (np.square(error)[..., None] + self.own))


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
    rows = np.concatenate([model.outputs, model.inputs], axis=-2)
    n_outputs, n_inputs = model.outputs.shape[-2], model.inputs.shape[-2]
    omega, damping = measured.omega[mode], max(float(measured.damping[mode]), LEAST_DAMPING)
    width = np.hypot(damping, np.asarray(model.scatter)[..., None])
    power = 1 / np.abs(model.omega**2 - omega**2 + 2j * width * model.omega * omega) ** 2
    power = power / np.mean(rows**2 @ power[..., None], axis=-2)
    prior = (rows * power[..., None, :]) @ rows.swapaxes(-1, -2)
    sizes = np.diagonal(prior, axis1=-2, axis2=-1)
    unit = [
        np.repeat(side.mean(axis=-1, keepdims=True), count, axis=-1)
        for side, count in ((sizes[..., :n_outputs], n_outputs), (sizes[..., n_outputs:], n_inputs))
    ]
    return FieldAtPoints(
        rows=rows,
        power=power,
        prior=prior,
        unit_variance=np.concatenate(unit, axis=-1),
        own=measured.noise[mode] + measured.doubt,
    )


def expand_shape(model: ModalModel, measured: MeasuredShapes, mode: int, error: float | FloatArray) -> ExpandedShape:
    """Expand a measured mode over a model, or over many.

    Parameters
    ----------
    model : ModalModel
        The model in its modes.
    measured : MeasuredShapes
        Shapes at sensors and excited DOFs.
    mode : int
        Which one.
    error : float or (...) array
        Relative error of each measured amplitude beside its noise: gains, positions, motion that a sensor sees besides.

    Returns
    -------
    ExpandedShape
        The mean of the field given what was measured, and its covariance.
    """
    field = field_at_points(model, measured, mode)
    rows, power = field.rows, field.power
    count, n_outputs = rows.shape[-2], model.outputs.shape[-2]
    total = field.prior + field.error_variance(error)[..., None] * np.eye(count)
    output = np.concatenate([measured.at_outputs[mode], np.zeros(count - n_outputs)])
    force = np.concatenate([np.zeros(n_outputs), measured.at_inputs[mode]])
    spread = (rows * power[..., None, :]).swapaxes(-1, -2)
    sides = np.broadcast_to(np.stack([output, force], axis=-1), (*total.shape[:-1], 2))
    solved = np.linalg.solve(total, np.concatenate([sides, spread.swapaxes(-1, -2)], axis=-1))
    by_output, by_force = solved[..., 0], solved[..., 1]
    # sizes of both directions whose product is given: the least forces
    ratio = (by_force @ force / (by_output @ output))[..., None] ** 0.25
    sign = np.where(by_force @ output <= 0, 1.0, -1.0)  # with which the forces are least
    root = np.sqrt(measured.size[mode])
    values = root * (ratio * output + sign[..., None] * force / ratio)
    of_outputs = root * ratio * by_output
    of_inputs = root * sign[..., None] * by_force / ratio
    weights = of_outputs + of_inputs
    # both sides alone: by the curvature of the square over the logarithm of the ratio of their sizes
    alone = 2 * root**2 * np.sqrt((by_output @ output) * (by_force @ force))
    square, degrees = np.sum(values * weights, axis=-1), max(count - 1, 1)
    left_over = power[..., None] * np.eye(power.shape[-1]) - spread @ solved[..., 2:]
    log_determinant = np.linalg.slogdet(total)[1]
    return ExpandedShape(
        of_outputs=(spread @ of_outputs[..., None])[..., 0],
        of_inputs=(spread @ of_inputs[..., None])[..., 0],
        split_std=np.sqrt(square / degrees / (2 * alone)),
        covariance=np.asarray(left_over * square[..., None, None] / degrees),
        at_outputs=values[..., :n_outputs],
        at_inputs=values[..., n_outputs:],
        sign=sign,
        log_evidence=np.asarray(-0.5 * (log_determinant + degrees * np.log(square / measured.size[mode] / degrees))),
    )
