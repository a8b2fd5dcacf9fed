"""Modes and FRFs of all members of an update's ensemble at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray

if TYPE_CHECKING:
    from collections.abc import Iterator

FRFS_AT_ONCE, LINES_AT_ONCE = 64, 128
SOFT = 1e-3  # of the lowest line: frequency given to rigid-body modes, whose double poles at 0 have no residues


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelEnsemble:
    """ModelEnsemble of an ensemble, in modes.

    Parameters
    ----------
    matrices : (m, 3, r, r) array
        Mass, damping and stiffness of each.
    lowest_rad_s : float
        Lowest frequency at which FRFs are evaluated.
    """

    matrices: FloatArray
    lowest_rad_s: float

    @cached_property
    def modes(self) -> tuple[FloatArray, FloatArray]:
        """Squared natural frequencies (m, r), ascending, and mass-normalised shapes (m, r, r)."""
        mass, stiffness = self.matrices[:, 0], self.matrices[:, 2]
        lower = np.linalg.inv(np.linalg.cholesky(mass))
        values, vectors = np.linalg.eigh(lower @ stiffness @ lower.swapaxes(1, 2))
        return np.maximum(values, (SOFT * self.lowest_rad_s) ** 2), lower.swapaxes(1, 2) @ vectors

    @cached_property
    def roots(self) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Poles (m, 2 r), and right and left vectors (m, r, 2 r) whose product is the receptance's residue."""
        squares, shapes = self.modes
        count, order = squares.shape
        damping = shapes.swapaxes(1, 2) @ self.matrices[:, 1] @ shapes
        state = np.zeros((count, 2 * order, 2 * order))
        state[:, :order, order:] = np.eye(order)
        diagonal = np.arange(order)
        state[:, order + diagonal, diagonal] = -squares
        state[:, order:, order:] = -damping
        poles, vectors = np.linalg.eig(state)
        left_vectors = shapes @ np.linalg.inv(vectors)[:, :, order:].swapaxes(1, 2)
        return poles.astype(complex), (shapes @ vectors[:, :order]).astype(complex), left_vectors.astype(complex)

    def receptance(self, output: FloatArray, force: FloatArray, s: ComplexArray) -> ComplexArray:
        """Evaluate one FRF of every member.

        Parameters
        ----------
        output, force : (r,) array
            Rows of sensor and excitation.
        s : (n_lines,) complex array
            rad/s.

        Returns
        -------
        (m, n_lines) complex array
            m/N.
        """
        poles, right_vectors, left_vectors = self.roots
        residues = (output @ right_vectors) * (force @ left_vectors)
        return np.stack([(1 / (s[:, None] - p)) @ residue for p, residue in zip(poles, residues, strict=True)])

    def receptances(
        self, outputs: FloatArray, forces: FloatArray, s: ComplexArray
    ) -> Iterator[tuple[slice, slice, ComplexArray]]:
        """Evaluate many FRFs of every member, some lines of some FRFs at a time.

        Parameters
        ----------
        outputs, forces : (n_frfs, r) array
            Rows of sensors and excitations.
        s : (n_lines,) complex array
            rad/s.

        Yields
        ------
        slice, slice, (m, lines, frfs) complex array
            Lines, FRFs, and their values, m/N.
        """
        poles, right_vectors, left_vectors = self.roots
        for first_frf in range(0, len(outputs), FRFS_AT_ONCE):
            frfs = slice(first_frf, first_frf + FRFS_AT_ONCE)
            residues = (outputs[frfs] @ right_vectors) * (forces[frfs] @ left_vectors)
            for first_line in range(0, len(s), LINES_AT_ONCE):
                lines = slice(first_line, first_line + LINES_AT_ONCE)
                values = [(1 / (s[lines, None] - p)) @ residue.T for p, residue in zip(poles, residues, strict=True)]
                yield lines, frfs, np.stack(values)

    def amplitudes(self, output: FloatArray, force: FloatArray, count: int) -> FloatArray:
        """Mass-normalised products of shapes at sensor and excitation.

        Parameters
        ----------
        output, force : (r,) array
            Rows of sensor and excitation.
        count : int
            Number of modes, from the lowest.

        Returns
        -------
        (m, count) array
            1/kg.
        """
        shapes = self.modes[1][:, :, :count]
        return np.asarray((output @ shapes) * (force @ shapes))
