"""A reduced model whose modes are the measured ones, with their shapes expanded, and the model's beside them.

Each measured mode follows a mode of the model most: that one is taken out. What remains of the model (rigid-body modes,
modes out of the band, residual flexibility) stands beside the measured modes. Where several measured modes follow one,
something that the model does not know splits it; the new model then has more modes than retained DOFs, and a hidden DOF
for each of the others, which moves nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, FloatArray, IntArray
from frf_ipz.dofs import GENERALISED, AnyDof, Dof
from frf_ipz.updating.shape_expansion.random_forces import ExpandedShape, ModalModel, expand_shape

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray
    from frf_ipz.structure import ReducedModel
    from frf_ipz.updating.shape_expansion.measured_shapes import MeasuredShapes

NO_RIGID = np.zeros((0, 0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExpandedModes:
    """Measured modes over a model, and what remains of the model.

    Parameters
    ----------
    model : ModalModel
        The model in its modes.
    measured : MeasuredShapes
        What was expanded.
    shapes : tuple of ExpandedShape
        One a measured mode.
    followed : (n_modes,) int array
        Mode of the model that each measured mode follows most: an elastic one.
    gain : float
        Measured over computed amplitudes. Where the test knows its scale, the model's mass is off by it.
    unit : float
        Of the measurement over that of the model: the gain where the test does not know its scale, else 1.
    """

    model: ModalModel
    measured: MeasuredShapes
    shapes: tuple[ExpandedShape, ...]
    followed: IntArray
    gain: float
    unit: float

    @property
    def remains(self) -> BoolArray:
        """(m,) modes of the model that no measured mode follows."""
        return ~np.isin(np.arange(len(self.model.omega)), self.followed)

    @property
    def amplitudes(self) -> FloatArray:
        """(m, n_modes) measured modes in those of the model, mass-normalised in the unit of the model."""
        return np.asarray(np.stack([shape.amplitudes for shape in self.shapes], axis=1) / np.sqrt(self.unit))

    def with_splits(self, log_ratios: FloatArray) -> ExpandedModes:
        """Take other sizes of the two sides of the test, whose products stay.

        Parameters
        ----------
        log_ratios : (n_modes,) array
            Logarithm of the factor on what excited DOFs move.

        Returns
        -------
        ExpandedModes
            With shapes that follow.
        """
        pairs = zip(self.shapes, log_ratios.tolist(), strict=True)
        return replace(self, shapes=tuple(shape.with_split(log_ratio) for shape, log_ratio in pairs))


def expand_modes(
    model: ReducedModel, measured: MeasuredShapes, *, error: float, scatter: float, is_scale_known: bool
) -> ExpandedModes:
    """Expand all measured modes over a model.

    Parameters
    ----------
    model : ReducedModel
        The model.
    measured : MeasuredShapes
        Shapes at sensors and excited DOFs.
    error : float
        Relative error of the measured amplitudes.
    scatter : float
        Standard deviation of the logarithms of measured frequencies about those of the model.
    is_scale_known : bool
        Whether the unit of the measurement is that of the model.

    Returns
    -------
    ExpandedModes
        With what remains of the model.
    """
    modal = ModalModel.of(model, measured, scatter)
    shapes = tuple(expand_shape(modal, measured, mode, error) for mode in range(len(measured.poles)))
    squares = np.array([shape.amplitudes**2 for shape in shapes])
    # rigid-body modes stay: nothing splits them, and how they share their space is up to rounding
    followed = np.where(_rigid(model, modal), -1.0, squares).argmax(axis=1)
    # the median over modes of the model that measured ones follow: robust against those that are not understood
    gain = float(np.median(squares.sum(axis=0)[np.unique(followed)]))
    return ExpandedModes(
        model=modal,
        measured=measured,
        shapes=shapes,
        followed=followed,
        gain=gain,
        unit=1.0 if is_scale_known else gain,
    )


def receptance(
    modes: ExpandedModes, at_output: FloatArray, at_input: FloatArray, rest: FloatArray, s: ComplexArray
) -> ComplexArray:
    """Add up the modes of an FRF.

    Parameters
    ----------
    modes : ExpandedModes
        Measured modes and what remains of the model.
    at_output, at_input : (n_modes,) array
        Measured modes at sensor and excitation, in the unit of the measurement.
    rest : (m,) array
        Products of the model's own shapes there.
    s : (n_lines,) complex array
        rad/s.

    Returns
    -------
    (n_lines,) complex array
        In the unit of the measurement.
    """
    poles = modes.measured.poles
    values = (at_output * at_input / (s[:, None] ** 2 - 2 * poles.real * s[:, None] + np.abs(poles) ** 2)).sum(axis=1)
    remains, omega = modes.remains, modes.model.omega[modes.remains]
    return np.asarray(values + modes.gain * (rest[remains] / (s[:, None] ** 2 + omega**2)).sum(axis=1))


def build_expanded_model(
    model: ReducedModel, modes: ExpandedModes, *, count: int, calibration: float, seed: int
) -> tuple[ReducedModel, FloatArray]:
    """Build matrices with the measured modes.

    Parameters
    ----------
    model : ReducedModel
        The model over which they were expanded.
    modes : ExpandedModes
        Measured modes and what remains of the model.
    count : int
        Number of models drawn from what the measured points leave open.
    calibration : float
        Factor on the standard deviations of the expanded shapes.
    seed : int
        Of the draws.

    Returns
    -------
    model : ReducedModel
        With the measured modes; hidden DOFs follow the retained ones.
    ensemble : (count, 3, n, n) array
        Mass, damping and stiffness of the members.
    """
    modal = modes.model
    remaining = np.eye(len(modal.omega))[:, modes.remains] * np.sqrt(modes.gain / modes.unit)

    def at_retained(of_modes: ExpandedModes, besides: FloatArray | float = 0.0) -> FloatArray:
        measured = modal.shapes @ (of_modes.amplitudes + besides) + _beside_the_field(model, of_modes)
        return np.hstack([modal.shapes @ remaining, measured])

    retained = at_retained(modes)
    hidden = _completion(retained)
    poles = modes.measured.poles
    is_rigid = _rigid(model, modal)[modes.remains]
    own_damping = np.einsum("ik,ij,jk->k", modal.shapes, model.damping, modal.shapes)[modes.remains]
    rates = np.concatenate([np.where(is_rigid, 0.0, own_damping), -2 * poles.real])
    squares = np.concatenate([np.where(is_rigid, 0.0, modal.omega[modes.remains] ** 2), np.abs(poles) ** 2])

    def matrices(drawn: FloatArray) -> FloatArray:
        inverse = np.linalg.inv(np.vstack([drawn, hidden]))
        parts = [(inverse.T * weights) @ inverse for weights in (np.ones(len(rates)), rates, squares)]
        return np.array([(part + part.T) / 2 for part in parts])

    mass, damping, stiffness = matrices(retained)
    roots = [_root(shape.covariance) * calibration / np.sqrt(modes.unit) for shape in modes.shapes]
    rng = np.random.default_rng(seed)
    # drawn at the DOFs: signs of modes, and how equal ones share their space, are up to rounding
    normal = rng.standard_normal((count, len(roots), len(model.mass))) @ (modal.shapes.T @ _root(model.mass)).T
    splits = calibration * rng.standard_normal((count, len(roots))) * [float(shape.split_std) for shape in modes.shapes]
    members = [
        matrices(
            at_retained(
                modes.with_splits(split),
                np.stack([root @ draw for root, draw in zip(roots, draws, strict=True)], axis=1),
            )
        )
        for draws, split in zip(normal, splits, strict=True)
    ]
    order = len(mass)
    expansion, expanded_dofs = _with_hidden(model, len(hidden))
    rigid = np.vstack([retained, hidden])[:, np.flatnonzero(is_rigid)]
    return (
        replace(
            model,
            mass=mass,
            damping=damping,
            stiffness=stiffness,
            dofs=(*model.dofs, *expanded_dofs[len(model.expanded_dofs) :]),
            expansion=expansion,
            expanded_dofs=expanded_dofs,
            dashpots=NO_RIGID,
            rigid=rigid if rigid.size else NO_RIGID,
        ),
        np.array(members).reshape(count, 3, order, order),
    )


def _beside_the_field(model: ReducedModel, modes: ExpandedModes) -> FloatArray:
    """Measured shapes minus the field at retained DOFs: gains and positions of transducers are in every FRF of theirs.

    Where a DOF is both excited and measured, the side with fewer points counts: FRFs of other points go through it.
    """
    beside = np.zeros((len(model.dofs), len(modes.shapes)))
    place_of = {dof: place for place, dof in enumerate(model.dofs)}
    measured, root = modes.measured, np.sqrt(modes.unit)
    sides = [(measured.outputs, "at_outputs", modes.model.outputs), (measured.inputs, "at_inputs", modes.model.inputs)]
    for dofs, name, rows in sorted(sides, key=lambda side: -len(side[0])):
        for number, dof in enumerate(dofs):
            if dof.unsigned in place_of:
                values = np.array([getattr(shape, name)[number] for shape in modes.shapes]) / root
                beside[place_of[dof.unsigned]] = dof.sign * (values - rows[number] @ modes.amplitudes)
    return beside


def _rigid(model: ReducedModel, modal: ModalModel) -> BoolArray:
    """Mark the rigid-body modes: the lowest."""
    return np.arange(len(modal.omega)) < (model.rigid.shape[1] if model.rigid.size else 0)


def _completion(retained: FloatArray) -> FloatArray:
    """Rows that make the shapes at the retained DOFs a square matrix, as far from singular as can be."""
    _, sizes, right = np.linalg.svd(retained)
    return np.asarray(right[len(retained) :] * np.exp(np.mean(np.log(sizes))))


def _root(matrix: FloatArray) -> FloatArray:
    """Symmetric square root."""
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)


def _with_hidden(model: ReducedModel, count: int) -> tuple[FloatArray, tuple[AnyDof, ...]]:
    """Expansion and its DOFs with hidden DOFs behind them, which move nothing else."""
    first = 1 + max([dof.node for dof in model.expanded_dofs if isinstance(dof, Dof)], default=0)
    hidden = tuple(Dof(first + number, GENERALISED) for number in range(count))
    rows, order = model.expansion.shape
    expansion = np.zeros((rows + count, order + count))
    expansion[:rows, :order] = model.expansion
    expansion[rows:, order:] = np.eye(count)
    return expansion, (*model.expanded_dofs, *hidden)
