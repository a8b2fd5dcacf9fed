"""Modes and FRFs of all members of an update's ensemble at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.numerics.damped_modes import receptance_roots, softly_held
from frf_ipz.numerics.pencils import modes_of_stack
from frf_ipz.numerics.pole_forms import DampedModel
from frf_ipz.numerics.pole_sums import PoleSums

if TYPE_CHECKING:
    from collections.abc import Iterator

FRFS_AT_ONCE = 256  # whose terms of all members are in memory
VALUES_AT_ONCE = 8192  # of a member: lines times FRFs


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelEnsemble:
    """An ensemble of models in modes.

    Parameters
    ----------
    matrices : (m, 3, r, r) array
        Mass, damping and stiffness of each, symmetric.
    lowest_rad_s : float
        Lowest frequency at which FRFs are evaluated.
    """

    matrices: FloatArray
    lowest_rad_s: float

    @cached_property
    def _free_modes(self) -> tuple[FloatArray, FloatArray]:
        return modes_of_stack(self.matrices[:, 0], self.matrices[:, 2])

    @cached_property
    def modes(self) -> tuple[FloatArray, FloatArray]:
        """Squared natural frequencies (m, r), ascending, and mass-normalised shapes (m, r, r)."""
        squares, shapes = self._free_modes
        return softly_held(squares, self.lowest_rad_s), shapes

    @cached_property
    def roots(self) -> list[tuple[ComplexArray, ComplexArray, ComplexArray]]:
        """Of each member k poles, and right and left vectors (r, k) whose products are the residues."""
        return [receptance_roots(*member) for member in zip(*self.modes, self.matrices[:, 1], strict=True)]

    def by_poles(self, member: int) -> DampedModel | None:
        """Express a member by its poles, those of `roots` where none of its modes is softly held.

        Parameters
        ----------
        member : int
            Which one.

        Returns
        -------
        DampedModel or None
            None where its matrices are not symmetric.
        """
        mass, damping, stiffness = self.matrices[member]
        squares, shapes = self._free_modes[0][member], self._free_modes[1][member]
        if not np.array_equal(squares, self.modes[0][member]):
            return DampedModel.of(mass, damping, stiffness)
        return DampedModel.of_roots((mass, damping, stiffness), (squares, shapes), self.roots[member][:2])

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
        blocks = self.receptances(output[None], force[None], s)
        return np.concatenate([block[:, :, 0] for _, _, block in blocks], axis=1)

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
            Lines, FRFs, and their values, m/N, which the caller may change.
        """
        sums = PoleSums.over([poles for poles, _, _ in self.roots], s)
        for first_frf in range(0, len(outputs), FRFS_AT_ONCE):
            frfs = slice(first_frf, first_frf + FRFS_AT_ONCE)
            residues = [(right.T @ outputs[frfs].T) * (left.T @ forces[frfs].T) for _, right, left in self.roots]
            terms = [sums.terms(member, of_member) for member, of_member in enumerate(residues)]
            lines_at_once = VALUES_AT_ONCE // len(outputs[frfs])
            for first_line in range(0, len(s), lines_at_once):
                lines = slice(first_line, first_line + lines_at_once)
                values = np.empty((len(terms), len(s[lines]), len(outputs[frfs])), complex)
                for member, of_member in enumerate(terms):
                    np.matmul(sums.factors(member, lines), of_member, out=values[member])
                yield lines, frfs, values

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
