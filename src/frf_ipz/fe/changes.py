"""Changed copies of a model: masses and springs added, parts scaled, supports released."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.dofs import TRANSLATIONS
from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.fe.assembly import assemble, assemble_mass_and_stiffness
from frf_ipz.structure import Part

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.arrays import Matrix
    from frf_ipz.dofs import Dof
    from frf_ipz.structure import StructuralModel


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SupportBlocks:
    """Blocks of the matrices that join held DOFs to the free ones.

    Parameters
    ----------
    stiffness_across, mass_across : (n_free, n_held) array
        Columns of K and M from the held DOFs to the free ones.
    stiffness_held, mass_held : (n_held, n_held) array
        Blocks of the held DOFs.
    """

    stiffness_across: FloatArray
    mass_across: FloatArray
    stiffness_held: FloatArray
    mass_held: FloatArray


def with_default_damping(model: StructuralModel, ratio: float | None) -> StructuralModel:
    """Give all modes a damping ratio, where the model itself states no damping at all.

    Parameters
    ----------
    model : StructuralModel
        The model.
    ratio : float, optional
        Damping ratio; None leaves the model as it is.

    Returns
    -------
    StructuralModel
        The model, damped.

    Raises
    ------
    InputError
        If the ratio is negative, or 1 and more.
    """
    is_damped = model.modal_damping.size or model.structural_damping_all is not None
    if ratio is None or is_damped or model.damping_all.count_nonzero():
        return model
    if not 0 <= ratio < 1:
        raise InputError(f"{ratio:g} is no damping ratio of a mode that vibrates; give 0 or more, and less than 1")
    return replace(model, modal_damping=np.array([ratio]))


def with_point_masses(model: StructuralModel, masses_kg: Mapping[int, float]) -> StructuralModel:
    """Add masses at nodes, in all translational directions that the model has there.

    Parameters
    ----------
    model : StructuralModel
        The model.
    masses_kg : mapping of int to float
        Node and mass, kg: that of a sensor, for example.

    Returns
    -------
    StructuralModel
        The model with the masses, each one a part of kind ``point`` as well.

    Raises
    ------
    InputError
        If there is no such node, it has no translational DOF, or a mass is negative.
    """
    parts = tuple(_point_mass(model, node, mass) for node, mass in masses_kg.items())
    mass, _ = assemble_mass_and_stiffness(parts, len(model.all_dofs))
    return replace(model, mass_all=model.mass_all + mass, parts=(*model.parts, *parts))


def with_springs(model: StructuralModel, stiffness: Mapping[Dof, float]) -> StructuralModel:
    """Add springs between DOFs and the ground.

    Parameters
    ----------
    model : StructuralModel
        The model.
    stiffness : mapping of Dof to float
        DOF and stiffness, N/m or N m/rad; one at a DOF that is held changes nothing until it is released.

    Returns
    -------
    StructuralModel
        The model with the springs.

    Raises
    ------
    InputError
        If the model lacks a DOF.
    """
    indices = np.array([model.full_index(dof) for dof in stiffness], dtype=np.int64)
    added = assemble([(indices, np.diag(list(stiffness.values())))], len(model.all_dofs))
    return replace(model, stiffness_all=model.stiffness_all + added)


def with_released_supports(model: StructuralModel, stiffness: Mapping[Dof, float]) -> StructuralModel:
    """Free DOFs that are held, and hold each by a spring instead.

    Parameters
    ----------
    model : StructuralModel
        The model.
    stiffness : mapping of Dof to float
        DOF and stiffness of the spring, N/m or N m/rad; 0 leaves it free.

    Returns
    -------
    StructuralModel
        The model with more free DOFs.

    Raises
    ------
    InputError
        If the model lacks a DOF, or does not hold it.
    """
    fixed = model.fixed.copy()
    fixed[_held_indices(model, list(stiffness))] = False
    return replace(with_springs(model, stiffness), fixed=fixed)


def support_blocks(model: StructuralModel, dofs: Sequence[Dof]) -> SupportBlocks:
    """Extract the blocks that join held DOFs to the structure, to release them as a change of low rank.

    Parameters
    ----------
    model : StructuralModel
        The model.
    dofs : sequence of Dof
        Held DOFs.

    Returns
    -------
    SupportBlocks
        Their blocks of K and M.

    Raises
    ------
    InputError
        If the model lacks a DOF, or does not hold it.
    """
    held, free = _held_indices(model, dofs), np.flatnonzero(~model.fixed)
    stiffness, mass = model.stiffness_all[:, held], model.mass_all[:, held]
    return SupportBlocks(
        stiffness_across=stiffness[free].toarray(),
        mass_across=mass[free].toarray(),
        stiffness_held=stiffness[held].toarray(),
        mass_held=mass[held].toarray(),
    )


def part_matrices(model: StructuralModel, kind: str, names: Sequence[str]) -> tuple[Matrix, Matrix]:
    """Assemble the matrices of some parts, for all DOFs.

    Parameters
    ----------
    model : StructuralModel
        The model.
    kind : str
        ``element``, ``spring``, ``group`` or ``point``.
    names : sequence of str
        Names of the parts.

    Returns
    -------
    mass, stiffness : (n_all, n_all) sparse array
        kg and N/m (and their rotational counterparts).

    Raises
    ------
    InputError
        If the model has no such part.
    """
    return assemble_mass_and_stiffness(_parts(model, kind, names), len(model.all_dofs))


def with_scaled_parts(
    model: StructuralModel, kind: str, names: Sequence[str], *, stiffness_ratio: float = 1.0, mass_ratio: float = 1.0
) -> StructuralModel:
    """Make parts stiffer or heavier.

    Parameters
    ----------
    model : StructuralModel
        The model.
    kind, names
        As for `part_matrices`.
    stiffness_ratio, mass_ratio : float
        New over old.

    Returns
    -------
    StructuralModel
        The model, its parts scaled as well.

    Raises
    ------
    InputError
        If the model has no such part.
    """
    changed = {id(part) for part in _parts(model, kind, names)}
    mass, stiffness = part_matrices(model, kind, names)
    return replace(
        model,
        mass_all=sparse.csr_array(model.mass_all + (mass_ratio - 1) * mass),
        stiffness_all=sparse.csr_array(model.stiffness_all + (stiffness_ratio - 1) * stiffness),
        parts=tuple(
            replace(part, mass=mass_ratio * part.mass, stiffness=stiffness_ratio * part.stiffness)
            if id(part) in changed
            else part
            for part in model.parts
        ),
    )


def _parts(model: StructuralModel, kind: str, names: Sequence[str]) -> list[Part]:
    named = {part.name: part for part in model.parts if part.kind == kind}
    for name in names:
        if name not in named:
            raise InputError(f"the model '{model.name}' has no {kind} '{name}'; {did_you_mean(name, named)}")
    return [named[name] for name in names]


def _point_mass(model: StructuralModel, node: int, mass_kg: float) -> Part:
    if mass_kg < 0:
        raise InputError(f"the mass at node {node} is {mass_kg:g} kg; give 0 or more")
    indices = [index for dof, index in model.full_indices.items() if dof.node == node and dof.direction in TRANSLATIONS]
    if not indices:
        nodes = model.geometry.nodes
        raise InputError(
            f"a mass is to be added at node {node}, which the model '{model.name}' does not have or which cannot move; "
            f"its nodes go from {nodes.min()} to {nodes.max()}"
        )
    return Part(
        kind="point",
        name=f"added mass at node {node}",
        nodes=(node,),
        indices=np.array(indices),
        stiffness=np.zeros((len(indices), len(indices))),
        mass=mass_kg * np.eye(len(indices)),
    )


def _held_indices(model: StructuralModel, dofs: Sequence[Dof]) -> IntArray:
    indices = np.array([model.full_index(dof) for dof in dofs], dtype=np.int64)
    for dof, index in zip(dofs, indices, strict=True):
        if not model.fixed[index]:
            raise InputError(f"the DOF {dof.name} of the model '{model.name}' is not held, so it cannot be released")
    return indices
