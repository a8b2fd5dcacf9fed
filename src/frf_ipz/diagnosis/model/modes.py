"""The modes of a modified structure: those of its matrices, and with scatter within the tolerances.

Structural changes are solved for in the basis, so that damping belongs to the modes that the structure really has;
scatter then acts on those modes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.model.basis import solve_changed_modes
from frf_ipz.diagnosis.model.change import place_sensor
from frf_ipz.diagnosis.model.nuisance import make_all_shift_rows
from frf_ipz.fe.eigen import mode_damping_ratios
from frf_ipz.numerics.pencils import generalised_eigh

if TYPE_CHECKING:
    from frf_ipz.diagnosis.model.basis import Basis
    from frf_ipz.diagnosis.model.change import Change
    from frf_ipz.diagnosis.model.layout import Layout
    from frf_ipz.diagnosis.model.nuisance import NuisancePrior, NuisanceValues

RIGID = 1e-9  # of the first elastic eigenvalue: below, a mode is a rigid-body mode
MIN_RATIO = 1e-6  # where a model states no damping at all
UNCOUPLED = 1e-3  # of the largest damping of a mode: what a matrix couples modes by that counts for nothing
SUSPENSION_RATIO = 0.03  # typical damping ratio of rigid-body modes on their suspension
MAX_MASS_PART = 0.5  # of a modal mass: scatter takes no more away


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModifiedStructure:
    """A modified structure without scatter.

    Parameters
    ----------
    change : Change
        What is different.
    squares : (q,) array
        Squared frequencies, ascending, (rad/s)^2; 0 for rigid-body modes.
    vectors : (q_basis, q) array
        The modes in terms of the basis.
    stated_ratio : (q,) array
        Damping ratios, with what a damping matrix of the model adds to each mode.
    is_coupled : bool
        The damping matrix couples modes.
    """

    change: Change
    squares: FloatArray
    vectors: FloatArray
    stated_ratio: FloatArray
    is_coupled: bool


def modify_structure(basis: Basis, change: Change) -> ModifiedStructure:
    """Solve for the modes of a modified structure.

    Parameters
    ----------
    basis : Basis
        Coordinates.
    change : Change
        What is different in structure and damping.

    Returns
    -------
    ModifiedStructure
        Its modes, by ascending frequency.
    """
    squares, vectors = solve_changed_modes(basis, change)
    largest = vectors[np.argmax(np.abs(vectors), 0), np.arange(len(squares))]
    vectors = vectors * np.sign(largest)  # scatter between two modes has a sign: theirs must not change by chance
    n_rigid = basis.modes.n_rigid
    elastic = squares[n_rigid] if len(squares) > n_rigid else 1.0
    squares = np.where(np.abs(squares) <= RIGID * abs(elastic), 0.0, squares)
    if change.floating:
        squares[:n_rigid] = 0.0
    stated = _ratios(basis, change, squares) + change.added_ratio
    is_coupled = False
    if change.modal_ratio is None and basis.damping.any():
        viscous = vectors.T @ basis.damping @ vectors
        modal, omega = np.diag(viscous), np.sqrt(np.abs(squares))
        stated[n_rigid:] += modal[n_rigid:] / (2 * omega[n_rigid:])
        is_coupled = bool(np.abs(modal_coupling(viscous)).max() > UNCOUPLED * modal.max())
    stated[:n_rigid] = SUSPENSION_RATIO
    return ModifiedStructure(
        change=change, squares=squares, vectors=vectors, stated_ratio=stated, is_coupled=is_coupled
    )


def modal_coupling(viscous: FloatArray) -> FloatArray:
    """Give the part of a damping matrix in modal coordinates, (q, q), that couples modes."""
    return viscous - np.diag(np.diag(viscous))


def _ratios(basis: Basis, change: Change, squares: FloatArray) -> FloatArray:
    if change.modal_ratio is not None:
        return np.full(len(squares), change.modal_ratio)
    stated = basis.model.modal_damping
    if basis.model.structural_damping is not None:
        of_modes = basis.modes
        stated = mode_damping_ratios(basis.model, of_modes.eigenvalues, of_modes.shapes, of_modes.n_rigid)
        stated = stated[of_modes.n_rigid :]
    if not stated.size:
        return np.full(len(squares), MIN_RATIO if not basis.damping.any() else 0.0)
    number = np.maximum(np.arange(len(squares)) - basis.modes.n_rigid, 0)
    return stated[np.minimum(number, stated.size - 1)].copy()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Modes:
    """Modes of a modified structure at sensors and excited points.

    Parameters
    ----------
    omega : (q,) array
        rad/s, before scatter; 0 for rigid-body modes.
    squares : (q,) array
        Squared frequencies with scatter.
    stated_ratio, ratio : (q,) array
        Damping ratios without and with scatter.
    rotation : (m, m) array
        Columns are the modes with scatter in terms of those without.
    outputs, inputs : (n, q) array
        Shapes with scatter, with signs.
    output_shifts, input_shifts : (n, n_axes, q) array
        How they change with positions, 1/m.
    vectors : (q_basis, q) array
        The modes in terms of the basis.
    viscous : (r, r) array, optional
        What damping couples the first modes by: the model's matrix all of them, scatter those with scatter.
    """

    omega: FloatArray
    squares: FloatArray
    stated_ratio: FloatArray
    ratio: FloatArray
    rotation: FloatArray
    outputs: FloatArray
    inputs: FloatArray
    output_shifts: FloatArray
    input_shifts: FloatArray
    vectors: FloatArray
    viscous: FloatArray | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotionRows:
    """Sensors and excited points in the coordinates of a basis.

    Parameters
    ----------
    outputs, inputs : (n, q) array
        With signs.
    output_shifts, input_shifts : (n, n_axes, q) array
        Their change with positions, 1/m.
    """

    outputs: FloatArray
    inputs: FloatArray
    output_shifts: FloatArray
    input_shifts: FloatArray


def make_motion_rows(basis: Basis, layout: Layout, change: Change, nuisance_prior: NuisancePrior) -> MotionRows:
    """Bring sensors and excited points into the coordinates of a basis.

    Parameters
    ----------
    basis : Basis
        Coordinates.
    layout : Layout
        Sensors and excited points.
    change : Change
        Says which sensors are elsewhere.
    nuisance_prior : NuisancePrior
        Says along which axes positions are uncertain.

    Returns
    -------
    MotionRows
        Sensors where the change says they are.
    """
    outputs = tuple(place_sensor(dof, change.moved.get(channel)) for channel, dof in layout.outputs)
    return MotionRows(
        outputs=np.asarray(basis.model.full_rows(outputs) @ basis.vectors),
        inputs=np.asarray(basis.model.full_rows(layout.inputs) @ basis.vectors),
        output_shifts=make_all_shift_rows(basis, nuisance_prior, outputs),
        input_shifts=make_all_shift_rows(basis, nuisance_prior, layout.inputs),
    )


def scatter_modes(
    basis: Basis, modified: ModifiedStructure, rows: MotionRows, nuisance_values: NuisanceValues
) -> Modes:
    """Scatter the modes of a modified structure by nuisance parameters.

    Parameters
    ----------
    basis : Basis
        Coordinates.
    modified : ModifiedStructure
        The structure.
    rows : MotionRows
        Sensors and excited points.
    nuisance_values : NuisanceValues
        Nuisance parameters.

    Returns
    -------
    Modes
        By ascending frequency without scatter.
    """
    omega = np.sqrt(np.abs(modified.squares))
    scattered, rotation = _scatter_squares(modified.squares, omega, nuisance_values)
    m = len(rotation)
    turned = modified.vectors.copy()
    turned[:, :m] = modified.vectors[:, :m] @ rotation
    ratio = modified.stated_ratio.copy()
    ratio[:m] *= 1 + nuisance_values.damping
    viscous = _scatter_coupling(modified, rotation, nuisance_values.coupling)
    if modified.is_coupled:
        stated = modal_coupling(turned.T @ basis.damping @ turned)
        if viscous is not None:
            stated[:m, :m] += viscous
        viscous = stated
    return Modes(
        omega=omega,
        squares=scattered,
        stated_ratio=modified.stated_ratio,
        ratio=ratio,
        rotation=rotation,
        outputs=rows.outputs @ turned,
        inputs=rows.inputs @ turned,
        output_shifts=rows.output_shifts @ turned,
        input_shifts=rows.input_shifts @ turned,
        vectors=turned,
        viscous=viscous,
    )


def _scatter_coupling(modified: ModifiedStructure, rotation: FloatArray, coupling: FloatArray) -> FloatArray | None:
    """Couple the modes with scatter, (m, m), by what damping couples those without by."""
    if not coupling.any():
        return None
    m = len(coupling)
    own = np.sqrt(coupling_scale(modified.squares[:m], modified.stated_ratio[:m]))
    return rotation.T @ (np.outer(own, own) * coupling) @ rotation


def coupling_scale(squares: FloatArray, ratio: FloatArray) -> FloatArray:
    """Give the damping of modes, 2 zeta omega, rad/s: (m,) arrays of squared frequencies and damping ratios."""
    return np.asarray(2 * ratio * np.sqrt(np.abs(squares)))


def _scatter_squares(
    squares: FloatArray, omega: FloatArray, nuisance_values: NuisanceValues
) -> tuple[FloatArray, FloatArray]:
    m, rigid = len(nuisance_values.kappa), len(nuisance_values.suspension)
    if not (nuisance_values.kappa.any() or nuisance_values.mu.any() or nuisance_values.suspension.any()):
        return squares, np.eye(m)
    block = np.diag(squares[:m]) + np.outer(omega[:m], omega[:m]) * nuisance_values.kappa
    block[np.arange(rigid), np.arange(rigid)] += nuisance_values.suspension
    mu = nuisance_values.mu
    if np.linalg.norm(mu) > MAX_MASS_PART:  # no step may take all mass away
        least = float(linalg.eigvalsh(mu, subset_by_index=(0, 0), check_finite=False)[0])
        mu = mu * min(1.0, MAX_MASS_PART / max(-least, 1e-12))
    values, rotation = generalised_eigh(block, np.eye(m) + mu)
    rotation = rotation * np.where(np.diag(rotation) < 0, -1.0, 1.0)
    return np.concatenate([values, squares[m:]]), rotation
