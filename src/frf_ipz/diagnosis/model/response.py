"""FRFs of a modified model, and their derivatives by nuisance parameters.

Structural changes are solved for in the basis, so that damping belongs to the modes that the structure really has.
Scatter then acts on those modes, and what has dynamics of its own (resonators, dampers) is attached last, by the
inversion lemma.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray

if TYPE_CHECKING:
    from frf_ipz.diagnosis.model.basis import Basis
    from frf_ipz.diagnosis.model.change import Change
    from frf_ipz.diagnosis.model.layout import Layout
    from frf_ipz.diagnosis.model.modes import Modes
    from frf_ipz.diagnosis.model.nuisance import NuisancePrior, NuisanceValues


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """FRFs, and the modal motions that they are made of.

    Parameters
    ----------
    values : (n_points, n_frfs) complex array
        SI, in the quantities of the FRFs, as the channels record them.
    modes : Modes
        The modes.
    output_motion, input_motion : (n_points, q, n) complex array
        Modal motion for unit forces at sensors and excited points, attachments included.
    chain : (n_points, n_frfs) complex array
        Factor from receptance to the measured quantity.
    s : (n_points,) complex array
        rad/s.
    attached_motion : (n_points, q, n) complex array
        Modal motion for unit forces where something is attached, without attachments.
    attached_stiffness : (n_points, n, n) complex array
        Forces on the structure there per motion that it would have without attachments.
    """

    values: ComplexArray
    modes: Modes
    output_motion: ComplexArray
    input_motion: ComplexArray
    chain: ComplexArray
    s: ComplexArray
    attached_motion: ComplexArray
    attached_stiffness: ComplexArray


def respond(
    modes: Modes, change: Change, layout: Layout, nuisance_values: NuisanceValues, s: ComplexArray, basis: Basis
) -> Response:
    """Evaluate the FRFs of a modified structure.

    Parameters
    ----------
    modes : Modes
        Of the structure.
    change : Change
        Its attachments, loss factor and channels.
    layout : Layout
        Sensors and excited points.
    nuisance_values : NuisanceValues
        Shifts of sensors and excited points, and gains.
    s : (n_points,) complex array
        rad/s.
    basis : Basis
        Of the structure.

    Returns
    -------
    Response
        What would be measured without noise.
    """
    outputs = modes.outputs + _shift(nuisance_values.output_shift, modes.output_shifts)
    inputs = modes.inputs + _shift(nuisance_values.input_shift, modes.input_shifts)
    n_outputs = len(outputs)
    motions = [attachment.motions for attachment in change.attachments]
    attached = np.hstack(motions).T @ basis.vectors @ modes.vectors if motions else np.zeros((0, len(modes.omega)))
    loads = np.concatenate([outputs, inputs, attached])
    motion = _solve(modes, _modulus(change, modes, s), loads, s)
    attached_motion = motion[:, :, n_outputs + len(inputs) :]
    stiffness = _coupled_stiffness(attached_motion, attached, change, s)
    if motions:
        motion = motion - np.matmul(attached_motion, np.matmul(stiffness, np.matmul(attached, motion)))
    output_motion, input_motion = motion[:, :, :n_outputs], motion[:, :, n_outputs : n_outputs + len(inputs)]
    receptance = np.matmul(outputs, input_motion)[:, layout.output_index, layout.input_index] + nuisance_values.local
    chain = (
        s[:, None] ** layout.power * _channels(change, layout, s) * np.exp(layout.gain_signs @ nuisance_values.gains)
    )
    return Response(
        values=receptance * chain,
        modes=modes,
        output_motion=output_motion,
        input_motion=input_motion,
        chain=chain,
        s=s,
        attached_motion=attached_motion,
        attached_stiffness=stiffness,
    )


def _shift(distances: FloatArray, slopes: FloatArray) -> FloatArray:
    """Change of shapes, (n, q), by distances, (n, n_axes), with slopes, (n, n_axes, q)."""
    return np.asarray(np.matmul(distances[:, None], slopes)[:, 0])


def _modulus(change: Change, modes: Modes, s: ComplexArray) -> ComplexArray:
    """Stiffness over that of the model, (n_points, 1 or q); of Kjartansson (1979) where it has to be causal."""
    loss = change.loss_factor
    if not loss or not (change.reference_rad_s or change.keeps_modes):
        return np.full((len(s), 1), 1 + 1j * loss)
    middle = np.array([change.reference_rad_s])
    if change.keeps_modes:
        middle = np.where(modes.omega > 0, modes.omega, 1.0)  # rigid-body modes have no stiffness to lose energy
    return np.asarray(np.hypot(1, loss) * (s[:, None] / middle) ** (2 / np.pi * np.arctan(loss)))


def _solve(modes: Modes, modulus: ComplexArray, loads: FloatArray, s: ComplexArray) -> ComplexArray:
    """Modal motion under loads, (n_points, q, n_loads)."""
    damping = 2 * modes.ratio * np.sqrt(np.abs(modes.squares))
    denominators = s[:, None] ** 2 + s[:, None] * damping + modulus * modes.squares
    if modes.viscous is None:
        return np.asarray(loads.T[None] / denominators[:, :, None])
    dynamic = s[:, None, None] * modes.viscous + denominators[:, :, None] * np.eye(len(damping))
    return np.asarray(np.linalg.solve(dynamic, np.broadcast_to(loads.T, (len(s), *loads.T.shape))), np.complex128)


def _coupled_stiffness(
    attached_motion: ComplexArray, attached: FloatArray, change: Change, s: ComplexArray
) -> ComplexArray:
    """D (1 + R D)^-1 of all attachments, (n_points, n, n)."""
    n = len(attached)
    if n == 0:
        return np.zeros((len(s), 0, 0), complex)
    stiffness = np.concatenate(
        [
            np.repeat(attachment.stiffness(s)[:, None], attachment.motions.shape[1], 1)
            for attachment in change.attachments
        ],
        axis=1,
    )
    inner = np.eye(n) + stiffness[:, :, None] * np.matmul(attached, attached_motion)
    return np.linalg.solve(inner, stiffness[:, :, None] * np.eye(n))


def _channels(change: Change, layout: Layout, s: ComplexArray) -> ComplexArray:
    factors = np.ones((len(s), len(layout.output_index)), complex)
    for channel, transfer in change.channels.items():
        gain = transfer(s)
        for index, name in enumerate(layout.input_channels):
            if name == channel:
                factors[:, layout.input_index == index] /= gain[:, None]
        for index, (name, _) in enumerate(layout.outputs):
            if name == channel:
                factors[:, layout.output_index == index] *= gain[:, None]
    return factors


def nuisance_jacobian(response: Response, nuisance_prior: NuisancePrior, layout: Layout) -> ComplexArray:
    """Differentiate FRFs by nuisance parameters.

    Parameters
    ----------
    response : Response
        At the point of linearisation.
    nuisance_prior : NuisancePrior
        The parameters.
    layout : Layout
        Sensors and excited points.

    Returns
    -------
    (n_points, n_frfs, size) complex array
        Per standard deviation of each parameter.
    """
    modes, s, m = response.modes, response.s, nuisance_prior.n_modes
    scattered_outputs = response.output_motion[:, :m].swapaxes(1, 2)[:, layout.output_index]  # point, FRF, mode
    scattered_inputs = response.input_motion[:, :m].swapaxes(1, 2)[:, layout.input_index]
    outputs, inputs = scattered_outputs @ modes.rotation.T, scattered_inputs @ modes.rotation.T
    i, j = nuisance_prior.pairs
    omega = modes.omega[:m]
    products = outputs[:, :, i] * inputs[:, :, j]
    products += np.where(i != j, outputs[:, :, j] * inputs[:, :, i], 0.0)
    products *= -response.chain[:, :, None]
    damping = 2 * modes.stated_ratio[:m] * np.sqrt(np.abs(modes.squares[:m])) * nuisance_prior.damping_std
    rigid = slice(0, nuisance_prior.n_rigid)
    changed = -response.chain[:, :, None] * scattered_outputs * scattered_inputs
    chain, blocks = response.chain[:, :, None], nuisance_prior.blocks
    jacobian = np.empty((*response.values.shape, nuisance_prior.size), np.complex128)
    jacobian[:, :, blocks.stiffness] = products * (omega[i] * omega[j] * nuisance_prior.kappa_std[i, j])
    jacobian[:, :, blocks.mass] = products * nuisance_prior.mu_std[i, j] * (s**2)[:, None, None]
    jacobian[:, :, blocks.damping] = changed * damping * s[:, None, None]
    jacobian[:, :, blocks.suspension] = (
        -chain * outputs[:, :, rigid] * inputs[:, :, rigid] * nuisance_prior.suspension_std
    )
    shifts = _shift_jacobians(response, nuisance_prior, layout)
    for block, shift in zip((blocks.output_shifts, blocks.input_shifts), shifts, strict=True):
        jacobian[:, :, block] = np.moveaxis(shift, 1, 2) * chain
    jacobian[:, :, blocks.local] = chain * np.diag(nuisance_prior.local_std)
    jacobian[:, :, blocks.gains] = response.values[:, :, None] * (layout.gain_signs * nuisance_prior.gain_std)
    return jacobian


def _shift_jacobians(response: Response, nuisance_prior: NuisancePrior, layout: Layout) -> list[ComplexArray]:
    modes = response.modes
    outputs = np.einsum("naq,kqi->knai", modes.output_shifts, response.input_motion)
    inputs = np.einsum("naq,kqo->knao", modes.input_shifts, response.output_motion)
    n_frfs = len(layout.output_index)
    jacobians: list[ComplexArray] = []
    for count, shifted, opposite, motion in (
        (nuisance_prior.n_outputs, layout.output_index, layout.input_index, outputs),
        (nuisance_prior.n_inputs, layout.input_index, layout.output_index, inputs),
    ):
        part = np.zeros((len(response.s), count, len(nuisance_prior.axes), n_frfs), np.complex128)
        frf = np.arange(n_frfs)
        part[:, shifted, :, frf] = motion[:, shifted, :, opposite]
        jacobians.append((part * nuisance_prior.shift_std[:, None]).reshape(len(response.s), -1, n_frfs))
    return jacobians
