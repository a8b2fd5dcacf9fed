"""Shares of an assembled stiffness in regions of the structure: what elements would tell, where there are none.

Matrices from an FE program do not say which element an entry comes from. Where a smooth field ``w`` scales the modulus,
an entry between nodes i and j changes about by ``(w_i + w_j) / 2``. Shares made so are not in balance: a rigid-body
motion would strain them. Each share is corrected by the least change of its entries, relative to the diagonal, with
which it takes rigid-body motions as the whole does: as many forces as the field has of those to the ground. No entry is
added, and the shares of fields that sum to one sum to the stiffness. [Doebling1998] disassembles a measured flexibility
in the same spirit, with energies of elements that are presumed.

[Doebling1998] S. W. Doebling, L. D. Peterson, K. F. Alvin, Experimental determination of local structural stiffness by
disassembly of measured flexibility matrices, Journal of Vibration and Acoustics 120, 1998, 949-957.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.arrays import FloatArray, IntArray, Matrix
from frf_ipz.fe.global_motions import rigid_body_motions
from frf_ipz.numerics.factorization import factorize

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.dofs import Dof
    from frf_ipz.structure import Geometry

SHIFT = 1e-9  # of the mean diagonal: conditions of a symmetric matrix depend on one another
REFINEMENTS = 2  # which take the shift out again


def stiffness_shares(
    stiffness: Matrix, dofs: Sequence[Dof], geometry: Geometry, weights: FloatArray
) -> tuple[Matrix, ...]:
    """Give the share of a stiffness that belongs to each of some fields.

    Parameters
    ----------
    stiffness : (n, n) sparse array
        Symmetric, N/m.
    dofs : sequence of n Dof
        Its rows.
    geometry : Geometry
        Where the nodes are.
    weights : (n, f) array
        Of each DOF in each field.

    Returns
    -------
    tuple of f (n, n) sparse arrays
        Symmetric; their sum is the stiffness where the weights of each DOF sum to 1.
    """
    sizes = np.sqrt(np.abs(stiffness.diagonal()))
    sizes[sizes == 0.0] = 1.0
    upper = sparse.coo_array(sparse.triu(stiffness))
    rows, columns = (np.asarray(places, np.int64) for places in upper.coords)
    entries = upper.data / (sizes[rows] * sizes[columns])
    motions = rigid_body_motions(dofs, geometry)
    motions = motions * sizes[:, None]  # relative, as the entries are
    lengths = np.linalg.norm(motions, axis=0)
    motions = motions / np.where(lengths > 0.0, lengths, 1.0)
    shares = entries[:, None] * (weights[rows] + weights[columns]) / 2
    forces = _forces_of(rows, columns, motions)
    grounded = forces @ entries
    wanted = grounded[:, None] * np.repeat(weights, motions.shape[1], axis=0)
    # both halves of a matrix count: an entry beside the diagonal stands for two
    doubled = np.where(rows == columns, 1.0, 0.5)
    weighted = sparse.csr_array(forces * doubled)
    product = sparse.csr_array(weighted @ forces.T)
    shifted = product + sparse.eye_array(product.shape[0]) * (SHIFT * float(product.diagonal().mean()))
    nodes = np.repeat([dof.node for dof in dofs], motions.shape[1])
    factor = factorize(sparse.csr_array(shifted), nodes)
    for _ in range(1 + REFINEMENTS):
        shares += doubled[:, None] * (forces.T @ factor.solve(wanted - forces @ shares))
    shape = stiffness.shape
    halves = (
        sparse.coo_array((share * sizes[rows] * sizes[columns], (rows, columns)), shape=shape) for share in shares.T
    )
    return tuple(sparse.csr_array(half + sparse.triu(half, 1).T) for half in halves)


def _forces_of(rows: IntArray, columns: IntArray, motions: FloatArray) -> Matrix:
    """Give the forces of a symmetric matrix under motions by its upper entries, (n_dofs * n_motions, n_entries)."""
    n_dofs, n_motions = motions.shape
    number, beside = np.arange(len(rows)), rows != columns
    at, by, values = [], [], []
    for motion in range(n_motions):
        at += [rows * n_motions + motion, (columns * n_motions + motion)[beside]]
        by += [number, number[beside]]
        values += [motions[columns, motion], motions[rows, motion][beside]]
    places = np.concatenate(at), np.concatenate(by)
    return sparse.csr_array(sparse.coo_array((np.concatenate(values), places), shape=(n_dofs * n_motions, len(rows))))
