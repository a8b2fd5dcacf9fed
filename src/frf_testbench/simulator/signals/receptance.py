"""Receptances of a structure between named rows, exact in s up to any frequency of interest.

Modes up to far above the band are summed one by one; what is above them enters by its static compliance, so that
nothing is truncated. Attachments with any dynamic stiffness D(s) are put in by the matrix inversion
lemma.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from frf_testbench.simulator.structures.structure import Structure

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
DynamicStiffness = Callable[[ComplexArray], ComplexArray]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Modes:
    """Undamped modes of a structure.

    Parameters
    ----------
    omega_rad_s : (n_modes,) array
        All of them, ascending.
    shapes : (n, n_modes) array
        Mass-normalised, in generalised coordinates.
    """

    omega_rad_s: FloatArray
    shapes: FloatArray

    @property
    def frequencies_hz(self) -> FloatArray:
        """Natural frequencies."""
        return self.omega_rad_s / (2 * np.pi)


def solve_modes(structure: Structure) -> Modes:
    """Solve for all modes of a structure.

    Parameters
    ----------
    structure : Structure
        Its mass matrix is positive definite.

    Returns
    -------
    Modes
        Rigid-body modes come out with frequencies near zero.
    """
    squares, shapes = eigh(structure.stiffness, structure.mass)
    return Modes(omega_rad_s=np.sqrt(np.clip(squares, 0, None)), shapes=shapes)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Attachment:
    """A dynamic stiffness between rows of a `ModalReceptance`.

    Parameters
    ----------
    rows : (r, n_rows) array
        Motions it acts on, in terms of the rows of the receptance.
    stiffness : callable
        (n_s,) complex s to (n_s, r, r) dynamic stiffness, N/m.
    """

    rows: FloatArray
    stiffness: DynamicStiffness


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModalReceptance:
    """Receptance matrix between rows of interest.

    Parameters
    ----------
    omega_rad_s, damping_ratio : (m,) array
        Modes that are summed.
    shapes : (n_rows, m) array
        Mass-normalised, at the rows.
    static : (n_rows, n_rows) array
        Sum of shapes shapes^T / omega^2 over all higher modes.
    modulus : callable, optional
        Factor of the whole stiffness matrix at `s`.
    attachments : tuple of Attachment
        Parts with a dynamic stiffness of their own.
    """

    omega_rad_s: FloatArray
    damping_ratio: FloatArray
    shapes: FloatArray
    static: FloatArray
    modulus: DynamicStiffness | None = None
    attachments: tuple[Attachment, ...] = ()

    def __call__(self, s: ComplexArray, outputs: list[int], inputs: list[int]) -> ComplexArray:
        """Return the (n_s, n_outputs, n_inputs) receptance at `s`, m/N."""
        if not self.attachments:
            return self._without_attachments(s, self._rows(outputs), self._rows(inputs))
        P = np.vstack([a.rows for a in self.attachments])
        D = self._dynamic_stiffness(s, len(P))
        H_op = self._without_attachments(s, self._rows(outputs), P)
        H_pi = self._without_attachments(s, P, self._rows(inputs))
        inner = np.eye(len(P)) + self._without_attachments(s, P, P) @ D
        return self._without_attachments(s, self._rows(outputs), self._rows(inputs)) - H_op @ D @ np.linalg.solve(
            inner, H_pi
        )

    def _rows(self, indices: list[int]) -> FloatArray:
        return np.eye(len(self.shapes))[indices]

    def _dynamic_stiffness(self, s: ComplexArray, size: int) -> ComplexArray:
        D = np.zeros((s.size, size, size), dtype=complex)
        start = 0
        for attachment in self.attachments:
            stop = start + len(attachment.rows)
            D[:, start:stop, start:stop] = attachment.stiffness(s)
            start = stop
        return D

    def _without_attachments(self, s: ComplexArray, left: FloatArray, right: FloatArray) -> ComplexArray:
        """Return the receptance without attachments."""
        modulus = np.ones_like(s) if self.modulus is None else self.modulus(s)
        square = self.omega_rad_s**2
        gains = 1 / (
            (s * s)[:, None] + s[:, None] * (2 * self.damping_ratio * self.omega_rad_s) + modulus[:, None] * square
        )
        at_left, at_right = left @ self.shapes, right @ self.shapes
        pairs = (at_left[:, None, :] * at_right[None, :, :]).reshape(-1, square.size)
        total = (gains @ pairs.T).reshape(s.size, len(left), len(right))
        return total + left @ self.static @ right.T / modulus[:, None, None]


def make_receptance(
    modes: Modes,
    rows: FloatArray,
    damping_ratio: FloatArray,
    highest_hz: float,
    *,
    modulus: DynamicStiffness | None = None,
) -> ModalReceptance:
    """Make the receptance between rows of a structure with modal damping.

    Parameters
    ----------
    modes : Modes
        All modes.
    rows : (n_rows, n) array
        Rows of interest in generalised coordinates.
    damping_ratio : (k,) array
        Ratios of the first modes; the last one holds for all further modes.
    highest_hz : float
        Modes above are replaced by their static compliance: many times the highest frequency of interest.
    modulus : callable, optional
        Factor of the whole stiffness matrix.

    Returns
    -------
    ModalReceptance
        Without attachments.
    """
    shapes = rows @ modes.shapes
    n_modes = max(int(np.count_nonzero(modes.frequencies_hz <= highest_hz)), 1)
    high, omega = shapes[:, n_modes:], modes.omega_rad_s[n_modes:]
    ratio = np.full(n_modes, damping_ratio[-1])
    n_ratios = min(n_modes, damping_ratio.size)
    ratio[:n_ratios] = damping_ratio[:n_ratios]
    return ModalReceptance(
        omega_rad_s=modes.omega_rad_s[:n_modes],
        damping_ratio=ratio,
        shapes=shapes[:, :n_modes],
        static=(high / omega**2) @ high.T,
        modulus=modulus,
    )
