"""A model with everything that an effect changes in it, as matrices: for the stages that know no effects."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.dofs import Dof

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.physics.change import Attachment, Change
    from frf_ipz.structure import Matrix, StructuralModel


def with_change(model: StructuralModel, change: Change) -> StructuralModel:
    """Put a change into a model.

    Modal damping cannot hold a loss factor eta: each mode gets eta / 2 besides its own ratio, which is the same at its
    resonance.

    Parameters
    ----------
    model : StructuralModel
        The nominal model.
    change : Change
        What is different; its channels are left alone.

    Returns
    -------
    StructuralModel
        With further DOFs at new nodes where something is attached that moves by itself.
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
        mass_all=changed.mass_all if change.mass is None else sparse.csr_array(changed.mass_all + change.mass),
        stiffness_all=changed.stiffness_all
        if change.stiffness is None
        else sparse.csr_array(changed.stiffness_all + change.stiffness),
        damping_all=changed.damping_all if change.modal_ratio is None else 0 * changed.damping_all,
        modal_damping=stated,
    )
    for attachment in change.attachments:
        changed = _attached(changed, attachment)
    return changed


def _attached(model: StructuralModel, attachment: Attachment) -> StructuralModel:
    """Put mass, damping and stiffness between the motions of an attachment and motions of its own."""
    if attachment.matrices is None:
        return model
    own = attachment.matrices[0].shape[0] - 1
    mass, damping, stiffness = (
        _grown(matrix, own) for matrix in (model.mass_all, model.damping_all, model.stiffness_all)
    )
    for motion in attachment.motions.T:
        padded = sparse.csr_array(np.concatenate([motion, np.zeros(len(model.all_dofs) - len(motion) + own)])[None])
        extra = sparse.csr_array(
            (np.ones(own), (np.arange(own), len(model.all_dofs) + np.arange(own))), shape=(own, padded.shape[1])
        )
        rows = sparse.vstack([padded, extra]).tocsr() if own else padded
        mass, damping, stiffness = (
            sparse.csr_array(whole + rows.T @ sparse.csr_array(part) @ rows)
            for whole, part in zip((mass, damping, stiffness), attachment.matrices, strict=True)
        )
    return _with_dofs(model, attachment.motions[:, 0], own, (mass, damping, stiffness))


def _grown(matrix: Matrix, by: int) -> Matrix:
    return sparse.csr_array(sparse.block_diag([matrix, sparse.csr_array((by, by))])) if by else matrix


def _with_dofs(
    model: StructuralModel, motion: FloatArray, count: int, matrices: tuple[Matrix, Matrix, Matrix]
) -> StructuralModel:
    """Name the new DOFs after the place where they are attached."""
    mass, damping, stiffness = matrices
    where = model.all_dofs[int(np.argmax(np.abs(motion)))]
    geometry = model.geometry
    first = int(max(geometry.nodes.max(), max(dof.node for dof in model.all_dofs))) + 1
    fresh = tuple(Dof(first + number, where.direction) for number in range(count))
    here = geometry.coordinates_m[np.searchsorted(geometry.nodes, where.node)]
    return replace(
        model,
        all_dofs=(*model.all_dofs, *fresh),
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
