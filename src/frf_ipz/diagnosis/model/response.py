"""FRFs of a modified model, and their derivatives by nuisance parameters.

Structural changes are solved for in the basis, so that damping belongs to the modes that the structure really has.
Scatter then acts on those modes, and what has dynamics of its own (resonators, dampers) is attached last, by the
inversion lemma.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.diagnosis.model.modes import coupling_scale

if TYPE_CHECKING:
    from collections.abc import Callable

    from frf_ipz.diagnosis.model.basis import Basis
    from frf_ipz.diagnosis.model.change import Change
    from frf_ipz.diagnosis.model.layout import Layout
    from frf_ipz.diagnosis.model.modes import Modes
    from frf_ipz.diagnosis.model.nuisance import NuisancePrior, NuisanceValues


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModalStiffness:
    """Dynamic stiffness of modes, without attachments.

    Parameters
    ----------
    diagonal : (n_points, q) complex array
        Of each mode.
    coupling : (n_points, r, r) complex array
        What damping couples the first modes by; r is 0 where it couples none.
    """

    diagonal: ComplexArray
    coupling: ComplexArray

    @property
    def n_coupled(self) -> int:
        """Number of modes that damping couples, r."""
        return int(self.coupling.shape[1])

    def at(self, points: IntArray) -> ModalStiffness:
        """Give the dynamic stiffness at some points of the contour, by an (n,) int array."""
        return ModalStiffness(diagonal=self.diagonal[points], coupling=self.coupling[points])

    def move(self, loads: FloatArray) -> ComplexArray:
        """Give the modal motion under loads, (n_loads, q): (n_points, q, n_loads) complex array."""
        r = self.n_coupled
        motion = np.empty((*self.diagonal.shape, len(loads)), np.complex128)
        if r:
            motion[:, :r] = self._move_coupled(loads)
        motion[:, r:] = loads[:, r:].T / self.diagonal[:, r:, None]
        return motion

    def receptances(self, motions: FloatArray, loads: FloatArray) -> ComplexArray:
        """Give motions, (n_motions, q), under loads, (n_loads, q): (n_points, n_motions, n_loads) complex array."""
        r = self.n_coupled
        products = (motions[:, None, r:] * loads[:, r:]).reshape(len(motions) * len(loads), motions.shape[1] - r)
        across = (1 / self.diagonal[:, r:] @ products.T).reshape(len(self.diagonal), len(motions), len(loads))
        if r:  # real motions of real and imaginary parts: half the work
            across += (motions[:, :r] @ self._move_coupled(loads).view(np.float64)).view(np.complex128)
        return across

    def _move_coupled(self, loads: FloatArray) -> ComplexArray:
        """Give the motion of the modes that are coupled, (n_points, r, n_loads) complex array."""
        r = self.n_coupled
        dynamic = self.coupling + self.diagonal[:, :r, None] * np.eye(r)
        return np.asarray(np.linalg.solve(dynamic, np.broadcast_to(loads[:, :r].T, (len(dynamic), r, len(loads)))))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """FRFs, and what the modal motions that they are made of follow from.

    Parameters
    ----------
    values : (n_points, n_frfs) complex array
        SI, in the quantities of the FRFs, as the channels record them.
    modes : Modes
        The modes.
    outputs, inputs, attached : (n, q) array
        Modal shapes at sensors, at excited points and where something is attached.
    stiffness : ModalStiffness
        Of the modes, without attachments.
    attached_stiffness : (n_points, n, n) complex array
        Forces on the structure where something is attached, per motion that it would have without attachments.
    chain : (n_points, n_frfs) complex array
        Factor from receptance to the measured quantity.
    s : (n_points,) complex array
        rad/s.
    """

    values: ComplexArray
    modes: Modes
    outputs: FloatArray
    inputs: FloatArray
    attached: FloatArray
    stiffness: ModalStiffness
    attached_stiffness: ComplexArray
    chain: ComplexArray
    s: ComplexArray
    _motions: dict[str, ComplexArray] = field(init=False, default_factory=dict, repr=False)

    @property
    def output_motion(self) -> ComplexArray:
        """Modal motion for unit forces at sensors, attachments included, (n_points, q, n_outputs) complex array."""
        return self._remember("outputs", self._move_with_attachments, self.outputs)

    @property
    def input_motion(self) -> ComplexArray:
        """Modal motion for unit forces at excited points, attachments included, (n_points, q, n_inputs)."""
        return self._remember("inputs", self._move_with_attachments, self.inputs)

    @property
    def attached_motion(self) -> ComplexArray:
        """Modal motion for unit forces where something is attached, without attachments, (n_points, q, n)."""
        return self._remember("attached", self.stiffness.move, self.attached)

    def receptances_at(self, points: IntArray) -> Response:
        """Give the receptances at some points of the contour, by an (n,) int array: in the place of FRFs."""
        chain = self.chain[points]
        some = replace(
            self,
            values=self.values[points] / chain,
            stiffness=self.stiffness.at(points),
            attached_stiffness=self.attached_stiffness[points],
            chain=np.ones_like(chain),
            s=self.s[points],
        )
        some._motions.update({name: motion[points] for name, motion in self._motions.items()})
        return some

    def _move_with_attachments(self, loads: FloatArray) -> ComplexArray:
        motion = self.stiffness.move(loads)
        if not len(self.attached):
            return motion
        return motion - self.attached_motion @ (self.attached_stiffness @ (self.attached @ motion))

    def _remember(self, name: str, move: Callable[[FloatArray], ComplexArray], loads: FloatArray) -> ComplexArray:
        """Solve for motions when they are first asked for: FRFs alone do not need them."""
        if name not in self._motions:
            self._motions[name] = move(loads)
        return self._motions[name]


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
    motions = [attachment.motions for attachment in change.attachments]
    attached = np.hstack(motions).T @ basis.vectors @ modes.vectors if motions else np.zeros((0, len(modes.omega)))
    stiffness = _modal_stiffness(modes, _modulus(change, modes, s), s)
    n_outputs, n_inputs = len(outputs), len(inputs)
    across = stiffness.receptances(np.vstack([outputs, attached]), np.vstack([inputs, attached]))  # solved for once
    receptance = across[:, :n_outputs, :n_inputs]
    attached_stiffness = _coupled_stiffness(across[:, n_outputs:, n_inputs:], change, s)
    if motions:
        free_motion = across[:, n_outputs:, :n_inputs]
        receptance = receptance - across[:, :n_outputs, n_inputs:] @ (attached_stiffness @ free_motion)
    chain = (
        s[:, None] ** layout.power * _channels(change, layout, s) * np.exp(layout.gain_signs @ nuisance_values.gains)
    )
    return Response(
        values=(receptance[:, layout.output_index, layout.input_index] + nuisance_values.local) * chain,
        modes=modes,
        outputs=outputs,
        inputs=inputs,
        attached=attached,
        stiffness=stiffness,
        attached_stiffness=attached_stiffness,
        chain=chain,
        s=s,
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


def _modal_stiffness(modes: Modes, modulus: ComplexArray, s: ComplexArray) -> ModalStiffness:
    damping = 2 * modes.ratio * np.sqrt(np.abs(modes.squares))
    diagonal = s[:, None] ** 2 + s[:, None] * damping + modulus * modes.squares
    viscous = np.zeros((0, 0)) if modes.viscous is None else modes.viscous
    return ModalStiffness(diagonal=diagonal, coupling=s[:, None, None] * viscous)


def _coupled_stiffness(receptance: ComplexArray, change: Change, s: ComplexArray) -> ComplexArray:
    """D (1 + R D)^-1 of all attachments, (n_points, n, n); R is the receptance where they are attached."""
    n = receptance.shape[1]
    if n == 0:
        return np.zeros((len(s), 0, 0), complex)
    stiffness = np.concatenate(
        [
            np.repeat(attachment.stiffness(s)[:, None], attachment.motions.shape[1], 1)
            for attachment in change.attachments
        ],
        axis=1,
    )
    inner = np.eye(n) + stiffness[:, :, None] * receptance
    return np.asarray(np.linalg.solve(inner, stiffness[:, :, None] * np.eye(n)), np.complex128)


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
    own, used = np.sqrt(coupling_scale(omega**2, modes.stated_ratio[:m])), nuisance_prior.is_coupled
    across = (own[i] * own[j] * nuisance_prior.coupling_std[i, j])[used]
    jacobian[:, :, blocks.coupling] = products[:, :, used] * across * s[:, None, None]
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
