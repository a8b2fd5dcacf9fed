"""Mode shapes from residues: one vector a mode over the measured DOFs.

The residue of a receptance at a normal mode is ``phi_output phi_input / (2 i omega_d)``: sec. 2.6 of [Ewins2000],
D. J. Ewins, Modal Testing: Theory, Practice and Application, 2nd ed., Research Studies Press, 2000.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.modes import ModeSet
from frf_ipz.numerics.low_rank_fit import fit_products
from frf_ipz.rational import damping_ratio, natural_frequency_hz

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import BoolArray, ComplexArray
    from frf_ipz.dofs import AnyDof
    from frf_ipz.frf import FrfLabel
    from frf_ipz.identification.modal_fit import ModalFit


def mode_shapes(fit: ModalFit) -> ModeSet:
    """Assemble the mode shapes of a fit.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.

    Returns
    -------
    ModeSet
        At all measured DOFs, unsigned and mass-normalised, where a driving point was measured; else at the sensors or
        at the excited DOFs, whichever are more, with the largest entry 1.
    """
    if fit.modes_given is not None:
        return fit.modes_given.as_model_has_them()
    poles = fit.model.poles[: fit.n_modes]
    outputs = tuple(dict.fromkeys(label.output_dof.unsigned for label in fit.labels))
    inputs = tuple(dict.fromkeys(label.input_dof.unsigned for label in fit.labels))
    matrices, measured = _residue_matrices(fit, poles, outputs, inputs)
    driving = [dof for dof in outputs if dof in inputs and measured[outputs.index(dof), inputs.index(dof)]]
    dofs = tuple(dict.fromkeys((*outputs, *inputs))) if driving else max(outputs, inputs, key=len)
    shapes = np.empty((len(dofs), len(poles)), complex)
    for mode, matrix in enumerate(matrices):
        at_outputs, at_inputs = (vectors[:, 0] for vectors in fit_products(matrix, measured.astype(float), 1))
        if driving:
            at_outputs, at_inputs = _scaled_at_driving_points(at_outputs, at_inputs, outputs, inputs, driving)
        shapes[:, mode] = _normalised(at_outputs, at_inputs, outputs, inputs, dofs, keep_size=bool(driving))
    return ModeSet(
        natural_frequency_hz=natural_frequency_hz(poles), damping_ratio=damping_ratio(poles), shapes=shapes, dofs=dofs
    )


def driving_points(labels: Sequence[FrfLabel]) -> tuple[AnyDof, ...]:
    """Name the DOFs at which force and response were measured together.

    Parameters
    ----------
    labels : sequence of FrfLabel
        What was measured.

    Returns
    -------
    tuple of Dof
        Unsigned.
    """
    return tuple(
        dict.fromkeys(label.output_dof.unsigned for label in labels if label.output_dof.name == label.input_dof.name)
    )


def product_factors(fit: ModalFit) -> ComplexArray:
    """Give what makes products of mode shapes, ``phi_output phi_input``, out of the residues of a fit.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.

    Returns
    -------
    (n_modes, n_frfs) complex array
        2 i omega_d over what the quantity, the gain and the signs of the labels have put into a residue.
    """
    poles = fit.model.poles[: fit.n_modes, None]
    powers = np.array([label.quantity.power for label in fit.labels])
    signs = np.array([label.sign for label in fit.labels])
    scale = 2j * np.maximum(poles.imag, np.finfo(float).tiny)  # the residues of a model know no delay
    return np.asarray(signs * scale / poles**powers / fit.gain)


def _residue_matrices(
    fit: ModalFit, poles: ComplexArray, outputs: tuple[AnyDof, ...], inputs: tuple[AnyDof, ...]
) -> tuple[ComplexArray, BoolArray]:
    """Give 2 i omega_d times the receptances' residues, (n_modes, n_outputs, n_inputs), and what was measured."""
    matrices = np.zeros((len(poles), len(outputs), len(inputs)), complex)
    measured = np.zeros((len(outputs), len(inputs)), bool)
    products = fit.model.residues[: len(poles)] * product_factors(fit)
    for column, label in enumerate(fit.labels):
        entry = outputs.index(label.output_dof.unsigned), inputs.index(label.input_dof.unsigned)
        matrices[:, *entry] = products[:, column]
        measured[entry] = True
    return matrices, measured


def _scaled_at_driving_points(
    at_outputs: ComplexArray,
    at_inputs: ComplexArray,
    outputs: tuple[AnyDof, ...],
    inputs: tuple[AnyDof, ...],
    driving: list[AnyDof],
) -> tuple[ComplexArray, ComplexArray]:
    """Share the size between the two vectors so that they agree at the driving points."""
    output_values = np.array([at_outputs[outputs.index(dof)] for dof in driving])
    input_values = np.array([at_inputs[inputs.index(dof)] for dof in driving])
    weight = np.vdot(output_values, output_values).real
    ratio = np.vdot(output_values, input_values) / weight if weight > 0 else 1.0
    factor = np.sqrt(complex(ratio) or 1.0)
    return at_outputs * factor, at_inputs / factor


def _normalised(
    at_outputs: ComplexArray,
    at_inputs: ComplexArray,
    outputs: tuple[AnyDof, ...],
    inputs: tuple[AnyDof, ...],
    dofs: tuple[AnyDof, ...],
    *,
    keep_size: bool,
) -> ComplexArray:
    """One vector over the DOFs, its largest entry real and positive."""
    values = dict(zip(inputs, at_inputs, strict=True)) | dict(zip(outputs, at_outputs, strict=True))
    if not keep_size:
        values = dict(zip(*((outputs, at_outputs) if dofs == outputs else (inputs, at_inputs)), strict=True))
    shape = np.array([values[dof] for dof in dofs])
    largest = shape[np.argmax(np.abs(shape))]
    if not abs(largest) > 0:
        return shape
    return np.asarray(shape * (abs(largest) / largest if keep_size else 1 / largest))
