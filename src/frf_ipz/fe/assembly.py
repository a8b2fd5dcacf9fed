"""Matrices of a whole model from its parts, and the damping that its file states."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from collections.abc import Iterable

    from frf_ipz.arrays import Matrix
    from frf_ipz.fe.model_options import DampingSection
    from frf_ipz.structure import Part


def multiply(matrix: Matrix, vectors: FloatArray) -> FloatArray:
    """Multiply a sparse matrix with full vectors.

    Parameters
    ----------
    matrix : (n, n) sparse array
        The matrix.
    vectors : (n,) or (n, k) array
        The vectors.

    Returns
    -------
    (n,) or (n, k) array
        The product.
    """
    return np.asarray(matrix @ vectors)


def assemble(shares: Iterable[tuple[IntArray, FloatArray | Matrix]], n_all: int) -> Matrix:
    """Assemble a matrix from the shares of parts.

    Parameters
    ----------
    shares : iterable of pairs
        Rows that a part occupies, (k,) int array, and its (k, k) matrix.
    n_all : int
        Order of the whole.

    Returns
    -------
    (n_all, n_all) sparse array
        Their sum.
    """
    rows, columns, values = [], [], []
    for indices, share in shares:
        row, column, value = _entries(share)
        rows.append(indices[row])
        columns.append(indices[column])
        values.append(value)
    if not rows:
        return sparse.csr_array((n_all, n_all), dtype=np.float64)
    triplets = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return sparse.csr_array(sparse.coo_array(triplets, shape=(n_all, n_all), dtype=np.float64))


def _entries(share: FloatArray | Matrix) -> tuple[IntArray, IntArray, FloatArray]:
    """Rows, columns and values of what is not zero."""
    if isinstance(share, np.ndarray):  # as most are: of a few DOFs
        row, column = share.nonzero()
        return row, column, np.asarray(share[row, column])
    local = sparse.coo_array(share)
    return np.asarray(local.row, np.intp), np.asarray(local.col, np.intp), np.asarray(local.data)


def assemble_mass_and_stiffness(parts: Iterable[Part], n_all: int) -> tuple[Matrix, Matrix]:
    """Assemble mass and stiffness from parts.

    Parameters
    ----------
    parts : iterable of Part
        Elements, springs, groups, point masses and springs.
    n_all : int
        Number of DOFs, the held ones included.

    Returns
    -------
    mass, stiffness : (n_all, n_all) sparse array
        kg and N/m (and their rotational counterparts).
    """
    parts = tuple(parts)
    mass = assemble(((part.indices, part.mass) for part in parts), n_all)
    return mass, assemble(((part.indices, part.stiffness) for part in parts), n_all)


def stated_damping(section: DampingSection | None, mass: Matrix, stiffness: Matrix) -> tuple[FloatArray, Matrix]:
    """Damping as ``[damping]`` states it.

    Parameters
    ----------
    section : DampingSection, optional
        ``[damping]`` of the file.
    mass, stiffness : (n_all, n_all) sparse array
        Matrices of all DOFs.

    Returns
    -------
    modal_damping : (n,) array
        Damping ratios of the elastic modes; empty where none is stated.
    damping : (n_all, n_all) sparse array
        alpha M + beta K, N s/m; empty without Rayleigh damping.
    """
    no_damping = sparse.csr_array(mass.shape, dtype=np.float64)
    if section is None:
        return np.zeros(0), no_damping
    if section.loss_factor is not None:
        return np.array([section.loss_factor / 2]), no_damping
    if section.rayleigh is None:
        return np.array(section.modal_ratio), no_damping
    return np.zeros(0), sparse.csr_array(section.rayleigh.alpha_1_s * mass + section.rayleigh.beta_s * stiffness)
