"""What an effect changes: mass and stiffness, supports, damping, the measuring chain; and a model so changed.

The changed model is given as matrices, for the stages that know no effects.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.model.matrix_sum import MatrixSum
from frf_ipz.dofs import AnyDof, Dof

if TYPE_CHECKING:
    from frf_ipz.arrays import Matrix
    from frf_ipz.structure import StructuralModel


Transfer = Callable[[ComplexArray], ComplexArray]
"""A function of s: (n_points,) complex array, rad/s, to (n_points,) complex array."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Attachment:
    """A dynamic stiffness on motions of the structure.

    Parameters
    ----------
    motions : (n_all, r) array
        Each column is a motion: weights of all DOFs of the model.
    stiffness : callable
        Dynamic stiffness against each of the motions, N/m or N m/rad.
    matrices : tuple of (1 + n, 1 + n) arrays, optional
        The same as mass, damping and stiffness between one motion and n motions of its own: with them it can be put
        into a model that has matrices only.
    """

    motions: FloatArray
    stiffness: Transfer
    matrices: tuple[FloatArray, FloatArray, FloatArray] | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Change:
    """Everything that an effect changes; the rest stays.

    Parameters
    ----------
    model : StructuralModel, optional
        A model that replaces the nominal one, with the same DOFs.
    mass, stiffness : (n_all, n_all) sparse array or MatrixSum, optional
        What is added to the matrices of all DOFs.
    released : tuple of int
        Fixed DOFs (rows of all) that may move; `stiffness` says what supports them.
    floating : bool
        A free structure stays free: what is added floats with it, and its rigid-body modes stay.
    attachments : tuple of Attachment
        What has dynamics of its own. Modal damping is that of the structure without it.
    modal_ratio : float, optional
        Damping ratio of all modes, instead of the model's.
    added_ratio : float
        Damping ratio of all modes besides their own.
    loss_factor : float
        Of the whole stiffness: K (1 + i eta), besides the modal damping.
    reference_rad_s : float
        Where the stiffness is the model's: it rises with frequency, as causality asks of a constant loss factor. 0 for
        the same at all frequencies.
    keeps_modes : bool
        The stiffness of each mode is the model's at the mode's own frequency instead, and rises from there.
    channels : mapping of str to Transfer
        What a channel shows over what it should show.
    moved : mapping of str to (int or Dof)
        Output channels, and the node where the sensor really is, or the DOF where its direction is another one too.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> stiffness = 1e5 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> dofs = ["1:x", "2:x", "3:x"]
    >>> masses = np.diag([2.0, 1.0, 1.0])
    >>> model = frf_ipz.StructuralModel.from_matrices(masses, stiffness, dofs=dofs, modal_damping=0.01)
    >>> heavier = frf_ipz.Change(mass=0.1 * model.mass_all)
    >>> (heavier + heavier).mass.toarray().diagonal().tolist()
    [0.4, 0.2, 0.2]
    """

    model: StructuralModel | None = None
    mass: MatrixSum | Matrix | None = None
    stiffness: MatrixSum | Matrix | None = None
    released: tuple[int, ...] = ()
    floating: bool = False
    attachments: tuple[Attachment, ...] = ()
    modal_ratio: float | None = None
    added_ratio: float = 0.0
    loss_factor: float = 0.0
    reference_rad_s: float = 0.0
    keeps_modes: bool = False
    channels: Mapping[str, Transfer] = field(default_factory=dict)
    moved: Mapping[str, int | Dof] = field(default_factory=dict)

    def __add__(self, second: Change) -> Change:
        """Put two effects together."""
        return Change(
            model=self.model if second.model is None else second.model,
            mass=_sum(self.mass, second.mass),
            stiffness=_sum(self.stiffness, second.stiffness),
            released=tuple(dict.fromkeys((*self.released, *second.released))),
            floating=self.floating or second.floating,
            attachments=(*self.attachments, *second.attachments),
            modal_ratio=self.modal_ratio if second.modal_ratio is None else second.modal_ratio,
            added_ratio=self.added_ratio + second.added_ratio,
            loss_factor=self.loss_factor + second.loss_factor,
            reference_rad_s=self.reference_rad_s or second.reference_rad_s,
            keeps_modes=self.keeps_modes or second.keeps_modes,
            channels=_product(self.channels, second.channels),
            moved={**self.moved, **second.moved},
        )


def place_sensor(dof: AnyDof, where: int | Dof | None) -> AnyDof:
    """Give the DOF that a sensor really shows.

    Parameters
    ----------
    dof : Dof or PortDof
        As the test says; a port stays where it is.
    where : int, Dof or None
        Where it really is, as in `Change.moved`; None where it is not moved.

    Returns
    -------
    Dof or PortDof
        With the sign of the sensor.
    """
    if where is None or not isinstance(dof, Dof):
        return dof
    if isinstance(where, Dof):
        return replace(dof, node=where.node, direction=where.direction)
    return replace(dof, node=where)


def _sum(first: MatrixSum | Matrix | None, second: MatrixSum | Matrix | None) -> MatrixSum | Matrix | None:
    if first is None or second is None:
        return first if second is None else second
    if isinstance(second, MatrixSum):
        return second + first
    return first + second


def _product(first: Mapping[str, Transfer], second: Mapping[str, Transfer]) -> dict[str, Transfer]:
    combined = {**first, **second}
    for name in first.keys() & second.keys():
        combined[name] = _product_of(first[name], second[name])
    return combined


def _product_of(first: Transfer, second: Transfer) -> Transfer:
    return lambda s: np.asarray(first(s) * second(s))


NO_CHANGE = Change()


def with_change(model: StructuralModel, change: Change) -> StructuralModel:
    """Put a change into a model.

    Modal damping cannot hold a loss factor eta: each mode gets eta / 2 besides its own ratio, which is the same at its
    resonance.

    Parameters
    ----------
    model : StructuralModel
        The nominal model.
    change : Change
        What is different; its channels are ignored.

    Returns
    -------
    StructuralModel
        With further DOFs at new nodes where something with motions of its own is attached.
    """
    changed = model if change.model is None else change.model
    fixed = changed.fixed.copy()
    fixed[list(change.released)] = False
    stated = changed.modal_damping if change.modal_ratio is None else np.array([change.modal_ratio])
    added = change.added_ratio + change.loss_factor / 2
    if added:
        stated = (stated if stated.size else np.zeros(1)) + added
    changed = replace(
        changed,
        fixed=fixed,
        mass_all=changed.mass_all if change.mass is None else sparse.csr_array(changed.mass_all + change.mass.tocsr()),
        stiffness_all=changed.stiffness_all
        if change.stiffness is None
        else sparse.csr_array(changed.stiffness_all + change.stiffness.tocsr()),
        damping_all=changed.damping_all if change.modal_ratio is None else 0 * changed.damping_all,
        structural_damping_all=changed.structural_damping_all if change.modal_ratio is None else None,
        modal_damping=stated,
    )
    for attachment in change.attachments:
        changed = _attach(changed, attachment)
    return changed


def _attach(model: StructuralModel, attachment: Attachment) -> StructuralModel:
    """Put mass, damping and stiffness between the motions of an attachment and its own motions."""
    if attachment.matrices is None:
        return model
    n_added = attachment.matrices[0].shape[0] - 1
    mass, damping, stiffness = (
        _enlarge(matrix, n_added) for matrix in (model.mass_all, model.damping_all, model.stiffness_all)
    )
    for motion in attachment.motions.T:
        padded = sparse.csr_array(np.concatenate([motion, np.zeros(len(model.all_dofs) - len(motion) + n_added)])[None])
        extra = sparse.csr_array(
            (np.ones(n_added), (np.arange(n_added), len(model.all_dofs) + np.arange(n_added))),
            shape=(n_added, padded.shape[1]),
        )
        rows = sparse.vstack([padded, extra]).tocsr() if n_added else padded
        mass, damping, stiffness = (
            sparse.csr_array(whole + rows.T @ sparse.csr_array(part) @ rows)
            for whole, part in zip((mass, damping, stiffness), attachment.matrices, strict=True)
        )
    return _with_dofs(model, attachment.motions[:, 0], n_added, (mass, damping, stiffness))


def _enlarge(matrix: Matrix, by: int) -> Matrix:
    return sparse.csr_array(sparse.block_diag([matrix, sparse.csr_array((by, by))])) if by else matrix


def _with_dofs(
    model: StructuralModel, motion: FloatArray, count: int, matrices: tuple[Matrix, Matrix, Matrix]
) -> StructuralModel:
    """Name the new DOFs after the location where they are attached."""
    mass, damping, stiffness = matrices
    where = model.all_dofs[int(np.argmax(np.abs(motion)))]
    geometry = model.geometry
    first = int(max(geometry.nodes.max(), max(dof.node for dof in model.all_dofs))) + 1
    fresh = tuple(Dof(first + number, where.direction) for number in range(count))
    here = geometry.coordinates_m[np.searchsorted(geometry.nodes, where.node)]
    return replace(
        model,
        all_dofs=(*model.all_dofs, *fresh),
        structural_damping_all=None
        if model.structural_damping_all is None
        else _enlarge(model.structural_damping_all, count),
        motions=None if model.motions is None else model.motions.extended(count),
        fixed=np.concatenate([model.fixed, np.zeros(count, bool)]),
        mass_all=mass,
        stiffness_all=stiffness,
        damping_all=damping,
        geometry=replace(
            geometry,
            nodes=np.concatenate([geometry.nodes, [dof.node for dof in fresh]]).astype(np.int64),
            coordinates_m=np.vstack([geometry.coordinates_m, *([here[None]] * count)]),
        ),
    )
