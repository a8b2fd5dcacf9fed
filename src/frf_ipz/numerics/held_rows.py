"""Rows that FE programs leave in exported matrices for DOFs that are held.

Five ways are common: the rows are zero in mass and stiffness (Ansys); they are those of the identity (FEniCS and many
scripts); they are zero in the stiffness and have a mass of 1, which puts their modes at 0 Hz; a number on the diagonal
of the stiffness and one on that of the mass, such as the means of either, put all their modes at one frequency; or a
penalty such as 1e36 stands on the diagonal of the stiffness (Abaqus, CalculiX). None of them is physics, and each
becomes a mode that is not there, or drowns the modes that are. Masses that nothing joins to the structure, and that
nothing holds, or springs to the ground which give them the same frequency, look as the third and the fourth way: they
belong to the structure as little. One such spring and mass alone may be either, and stays.

The scale is that of each row's own diagonal. With ``c`` the largest ``|K_ij| / sqrt(K_ii K_jj)`` of a row, to hold its
DOF changes the stiffness of the others by ``c^2`` at most.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import sparse

from frf_ipz.arrays import BoolArray, FloatArray
from frf_ipz.numerics.rounding import printed_rounding

if TYPE_CHECKING:
    from frf_ipz.arrays import Matrix

UNCOUPLED = 1e-4  # c of a row that is held by a penalty: to hold its DOF changes others' stiffness by 1e-8 at most
PENALTY = 1e8  # of the structure's median K_ii / M_ii: the DOF moves less than 1e-8 of what a free one does
UNIT = 1e3  # times stiffer than 1 is the median row of a structure in which a lone 1 on the diagonal is no spring
NOTHING = 1e-20  # of the median entry on the diagonal: zero, printed as 1e-30


class HeldRows(NamedTuple):
    """Marks of held rows by the way in which they are held, each an (n,) bool array; a row has one mark at most."""

    zero: BoolArray
    identity: BoolArray
    loose: BoolArray
    shared: BoolArray
    penalty: BoolArray
    lone: BoolArray  # not held for certain: a row with a frequency of its own that couples to nothing

    @property
    def any(self) -> BoolArray:
        """(n,) bool array: rows that are held in one way or another."""
        return np.asarray(self.zero | self.identity | self.loose | self.shared | self.penalty)


def find_held_rows(mass: Matrix, stiffness: Matrix, *further: Matrix) -> HeldRows:
    """Find the rows of held DOFs.

    Parameters
    ----------
    mass, stiffness : (n, n) sparse array
        Both triangles; a held DOF's row or its column may be cleared, or both.
    *further : (n, n) sparse array
        What may join a mass to others besides (damping).

    Returns
    -------
    HeldRows
        Nothing is marked in matrices that are diagonal altogether: they may be those of modes.

    Examples
    --------
    >>> stiffness = sparse.csr_array([[3.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    >>> find_held_rows(sparse.csr_array(np.diag([2.0, 1.0, 0.0])), stiffness).any
    array([False, False,  True])
    """
    inertia, rigidity = np.abs(mass.diagonal()), np.abs(stiffness.diagonal())
    coupling = _coupling(stiffness, rigidity)
    coupled = coupling > UNCOUPLED
    none = np.zeros(len(inertia), bool)
    if not (coupled & (inertia > 0)).any():
        return HeldRows(none, none, none, none, none, none)
    no_rigidity, no_inertia = (NOTHING * float(np.median(diagonal[coupled])) for diagonal in (rigidity, inertia))
    has_no_spring_beside = ~coupled & (_largest_beside(stiffness) <= no_rigidity)
    is_alone = has_no_spring_beside & (_largest_beside(mass) <= no_inertia)
    massless = inertia <= no_inertia
    zero = is_alone & massless & (rigidity <= no_rigidity)
    is_foreign = float(np.median(rigidity[coupled])) > UNIT
    identity = is_alone & ~zero & (massless | (rigidity == inertia))
    identity |= has_no_spring_beside & (rigidity == 1.0) & is_foreign
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # no mass: no motion ever
        square = np.where(rigidity > 0, rigidity / inertia, 0.0)
    beyond = square > PENALTY * float(np.median(square[coupled & ~massless]))
    is_joined = np.any([_largest_beside(matrix) > 0 for matrix in further], axis=0) if further else none
    alone = is_alone & ~massless & ~identity & ~is_joined
    loose = alone & (rigidity <= no_rigidity)
    rounding = printed_rounding(stiffness.data) + printed_rounding(mass.data)
    shared = _repeated(np.where(alone & ~loose & ~beyond, square, np.nan), 2 * rounding)
    return HeldRows(
        zero=zero,
        identity=identity,
        loose=loose,
        shared=shared,
        penalty=~coupled & ~zero & ~identity & ~loose & beyond,
        lone=alone & ~loose & ~shared & ~beyond,
    )


def _repeated(values: FloatArray, rounding: float) -> BoolArray:
    """Mark values that come more than once, to a relative rounding; one that is NaN is none."""
    order = np.argsort(values)
    ascending = values[order]
    with np.errstate(invalid="ignore"):
        is_next = np.diff(ascending) <= rounding * ascending[1:]
    repeated = np.zeros(len(values), bool)
    repeated[order] = np.append(is_next, False) | np.append(False, is_next)
    return repeated


def _largest_beside(matrix: Matrix) -> FloatArray:
    """Largest entry off the diagonal of each row, or of its column where that is smaller."""
    absolute = sparse.csr_array(abs(matrix))
    beside = sparse.csr_array(absolute - sparse.diags_array(absolute.diagonal()))
    return np.minimum(beside.max(axis=1).toarray(), beside.max(axis=0).toarray()).ravel()


def _coupling(stiffness: Matrix, rigidity: FloatArray) -> FloatArray:
    """Largest entry off the diagonal of each row of the stiffness scaled to a diagonal of ones."""
    scale = 1 / np.sqrt(np.where(rigidity > 0, rigidity, 1.0))
    scaled = sparse.csr_array(sparse.diags_array(scale) @ stiffness @ sparse.diags_array(scale))
    return _largest_beside(scaled)
