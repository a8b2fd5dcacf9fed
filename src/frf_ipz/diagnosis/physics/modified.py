"""The modes of a modified structure, before what cannot be known acts on them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.physics.basis import solved

if TYPE_CHECKING:
    from frf_ipz.diagnosis.physics.basis import Basis
    from frf_ipz.diagnosis.physics.change import Change

RIGID = 1e-9  # of the first elastic eigenvalue: below, a mode is a rigid-body mode
LEAST_RATIO = 1e-6  # where a model states no damping at all
UNCOUPLED = 1e-3  # of the largest damping of a mode: what a matrix couples modes by that counts for nothing
SUSPENSION_RATIO = 0.03  # typical damping ratio of rigid-body modes in their cords


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Modified:
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


def modify(basis: Basis, change: Change) -> Modified:
    """Solve for the modes of a modified structure.

    Parameters
    ----------
    basis : Basis
        Coordinates.
    change : Change
        What is different in structure and damping.

    Returns
    -------
    Modified
        Its modes, by ascending frequency.
    """
    squares, vectors = solved(basis, change)
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
        own, omega = np.diag(viscous), np.sqrt(np.abs(squares))
        stated[n_rigid:] += own[n_rigid:] / (2 * omega[n_rigid:])
        is_coupled = bool(np.abs(coupling(viscous)).max() > UNCOUPLED * own.max())
    stated[:n_rigid] = SUSPENSION_RATIO
    return Modified(change=change, squares=squares, vectors=vectors, stated_ratio=stated, is_coupled=is_coupled)


def coupling(viscous: FloatArray) -> FloatArray:
    """Take the damping of each mode by itself out of a damping matrix in modal coordinates, (q, q)."""
    return viscous - np.diag(np.diag(viscous))


def _ratios(basis: Basis, change: Change, squares: FloatArray) -> FloatArray:
    if change.modal_ratio is not None:
        return np.full(len(squares), change.modal_ratio)
    stated = basis.model.modal_damping
    if not stated.size:
        return np.full(len(squares), LEAST_RATIO if not basis.damping.any() else 0.0)
    number = np.maximum(np.arange(len(squares)) - basis.modes.n_rigid, 0)
    return stated[np.minimum(number, stated.size - 1)].copy()
