"""Mode shapes and the numbers that compare them.

[Allemang2003] R. J. Allemang, The modal assurance criterion: twenty years of use and abuse, Sound and Vibration 37 (8),
2003, 14-23.
[Pappa1993] R. S. Pappa, K. B. Elliott, A. Schenk, Consistent-mode indicator for the eigensystem realization algorithm,
J. Guidance, Control and Dynamics 16 (5), 1993, 852-858, doi:10.2514/3.21092.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, require_shape
from frf_ipz.display import Concise
from frf_ipz.dofs import Dof


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class ModeSet(Concise):
    """Modes at some DOFs.

    Parameters
    ----------
    natural_frequency_hz, damping_ratio : (n_modes,) array
        Hz and 1.
    shapes : (n_dofs, n_modes) complex array
        Mass-normalised where the scale is known.
    dofs : tuple of Dof
        Rows of the shapes.

    Examples
    --------
    >>> import frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> modes = frf_ipz.solve_modes(beam, n_modes=2)
    >>> modes.shapes.shape, modes.damping_ratio.tolist()
    ((20, 2), [0.01, 0.01])
    """

    natural_frequency_hz: FloatArray
    damping_ratio: FloatArray
    shapes: ComplexArray
    dofs: tuple[Dof, ...]

    def __post_init__(self) -> None:
        require_shape("the mode shapes", self.shapes, (len(self.dofs), len(self.natural_frequency_hz)))


def modal_assurance(first: ComplexArray, second: ComplexArray) -> FloatArray:
    """Modal assurance criterion between two sets of shapes [Allemang2003].

    Parameters
    ----------
    first : (n_dofs, n_first) complex array
        Shapes.
    second : (n_dofs, n_second) complex array
        Shapes at the same DOFs.

    Returns
    -------
    (n_first, n_second) array
        1 where two shapes are the same but for a factor, 0 where they are orthogonal.

    Examples
    --------
    >>> shape = np.array([[1.0], [2.0]]) + 0j
    >>> float(modal_assurance(shape, -3 * shape)[0, 0])
    1.0
    """
    inner = np.abs(first.conj().T @ second) ** 2
    lengths = np.outer(np.sum(np.abs(first) ** 2, 0), np.sum(np.abs(second) ** 2, 0))
    return np.asarray(inner / np.where(lengths > 0, lengths, 1.0))


def modal_phase_collinearity(shapes: ComplexArray) -> FloatArray:
    """How nearly each shape is real but for a factor [Pappa1993].

    Parameters
    ----------
    shapes : (n_dofs, n_modes) complex array
        Shapes.

    Returns
    -------
    (n_modes,) array
        1 for a normal mode, 0 for one without any common phase.

    Examples
    --------
    >>> float(modal_phase_collinearity(np.array([[1j], [2j]]))[0])
    1.0
    """
    real, imag = shapes.real, shapes.imag
    xx, yy, xy = np.sum(real * real, 0), np.sum(imag * imag, 0), np.sum(real * imag, 0)
    total = xx + yy
    return np.asarray(((xx - yy) ** 2 + 4 * xy**2) / np.where(total > 0, total, 1.0) ** 2)
