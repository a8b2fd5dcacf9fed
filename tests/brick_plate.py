"""A free thin plate of eight-node bricks, for eigensolves at the size that users bring."""

from __future__ import annotations

import numpy as np
from scipy import sparse

CORNERS = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])
GAUSS = np.array([-1.0, 1.0]) / np.sqrt(3.0)


def brick_matrices(sides_m, youngs_modulus_Pa=210e9, poisson_ratio=0.3, density_kg_m3=7850.0):
    """Stiffness and mass of one brick by 2 x 2 x 2 Gauss points, (24, 24) arrays; three DOFs a corner."""
    first, second = (
        youngs_modulus_Pa * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio)),
        youngs_modulus_Pa / (2 * (1 + poisson_ratio)),
    )
    elasticity = np.diag([2 * second] * 3 + [second] * 3)
    elasticity[:3, :3] += first
    stiffness, mass = np.zeros((24, 24)), np.zeros((24, 24))
    signs = 2 * CORNERS - 1
    volume = float(np.prod(sides_m)) / 8
    for point in np.array(np.meshgrid(GAUSS, GAUSS, GAUSS)).reshape(3, -1).T:
        factors = 1 + signs * point
        shape = np.prod(factors, 1) / 8
        slope = np.stack([signs[:, i] * np.prod(np.delete(factors, i, 1), 1) / 8 * 2 / sides_m[i] for i in range(3)], 1)
        strain = np.zeros((6, 24))
        for corner in range(8):
            dx, dy, dz = slope[corner]
            strain[:, 3 * corner : 3 * corner + 3] = [
                [dx, 0, 0],
                [0, dy, 0],
                [0, 0, dz],
                [dy, dx, 0],
                [0, dz, dy],
                [dz, 0, dx],
            ]
        stiffness += strain.T @ elasticity @ strain * volume
        spread = np.kron(shape, np.eye(3))
        mass += density_kg_m3 * spread.T @ spread * volume
    return stiffness, mass


def plate_matrices(counts, sides_m):
    """Stiffness, mass (sparse) and corner coordinates of a plate of bricks."""
    stiffness, mass = brick_matrices(np.array(sides_m) / counts)
    nx, ny, nz = counts
    number = np.arange((nx + 1) * (ny + 1) * (nz + 1)).reshape(nz + 1, ny + 1, nx + 1)
    corners = np.stack(
        [number[z : z + nz, y : y + ny, x : x + nx].ravel() for x, y, z in CORNERS],
        1,
    )
    rows = (3 * corners[:, :, None] + np.arange(3)).reshape(len(corners), 24)
    at = (np.repeat(rows, 24, 1).ravel(), np.tile(rows, (1, 24)).ravel())
    order = 3 * number.size
    grid = np.stack(np.unravel_index(np.arange(number.size), number.shape)[::-1], 1)
    return (
        sparse.csr_array(sparse.coo_array((np.tile(stiffness.ravel(), len(rows)), at), shape=(order, order))),
        sparse.csr_array(sparse.coo_array((np.tile(mass.ravel(), len(rows)), at), shape=(order, order))),
        grid * (np.array(sides_m) / counts),
    )
