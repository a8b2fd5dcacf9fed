"""Motions of a structure by index: of thousands of possible locations each moves one DOF or two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from frf_ipz.arrays import FloatArray, Matrix


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """A motion of few DOFs.

    Parameters
    ----------
    rows : tuple of int
        The DOFs that move, as rows of all of the model.
    weights : tuple of float
        How far each of them does.
    """

    rows: tuple[int, ...]
    weights: tuple[float, ...]

    @classmethod
    def of(cls, weights: FloatArray | Motion) -> Motion:
        """Take a motion as it is, or from the weights of all DOFs, (n_all,) array."""
        if isinstance(weights, Motion):
            return weights
        rows = np.flatnonzero(weights)
        return cls(rows=tuple(rows.tolist()), weights=tuple(weights[rows].tolist()))

    def dense(self, n_all: int) -> FloatArray:
        """Give the weights of all DOFs, (n_all,) array."""
        weights = np.zeros(n_all)
        weights[list(self.rows)] = self.weights
        return weights

    def __sub__(self, second: Motion) -> Motion:
        """Give the motion of one against another that moves other DOFs."""
        return Motion(rows=(*self.rows, *second.rows), weights=(*self.weights, *(-weight for weight in second.weights)))


def stack_motions(motions: Sequence[Motion], n_all: int) -> sparse.csc_array:
    """Put motions side by side.

    Parameters
    ----------
    motions : sequence of Motion
        The motions.
    n_all : int
        Number of DOFs of the model.

    Returns
    -------
    (n_all, n_motions) sparse array
        Weights of all DOFs.
    """
    sizes = [len(motion.rows) for motion in motions]
    rows = np.array([row for motion in motions for row in motion.rows], int)
    weights = np.array([weight for motion in motions for weight in motion.weights], float)
    return sparse.csc_array((weights, rows, np.cumsum([0, *sizes])), shape=(n_all, len(motions)))


def make_unit_stiffness(motion: Motion, n_all: int) -> Matrix:
    """Make the matrix of a spring of stiffness 1 against a motion.

    Parameters
    ----------
    motion : Motion
        The motion.
    n_all : int
        Number of DOFs of the model.

    Returns
    -------
    (n_all, n_all) sparse array
        The outer product of the motion with itself.
    """
    rows = np.repeat(motion.rows, len(motion.rows))
    values = np.outer(motion.weights, motion.weights).ravel()
    return sparse.csr_array((values, (rows, np.tile(motion.rows, len(motion.rows)))), shape=(n_all, n_all))
