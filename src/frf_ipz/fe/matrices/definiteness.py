"""Whether mass and stiffness matrices can be those of a structure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg, sparse
from scipy.sparse import linalg as sparse_linalg

from frf_ipz.errors import FileFormatError
from frf_ipz.fe.factorization import is_positive_definite

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from frf_ipz.arrays import FloatArray
    from frf_ipz.dofs import Dof
    from frf_ipz.structure import Matrix

DENSE_ORDER = 1000  # up to here all eigenvalues are computed, and the message can name the worst DOF
SINGULAR_MASS = (
    1e-12  # smallest eigenvalue of the mass matrix scaled to a diagonal of ones: that of a singular one after rounding
)
NEGATIVE_STIFFNESS = 1e-10  # of the largest eigenvalue: allowed for rounding of printed digits
ESTIMATE_TOLERANCE = 1e-2  # of the largest eigenvalue, which is only a yardstick


def require_positive_definite_mass(mass: Matrix, dofs: Sequence[Dof], path: Path) -> None:
    """Refuse a mass matrix that is not positive definite.

    Parameters
    ----------
    mass : (n, n) sparse array
        Symmetric.
    dofs : sequence of Dof
        Its rows.
    path : Path
        Its file, for the message.

    Raises
    ------
    FileFormatError
        If a DOF has no mass, or a motion has none or a negative one.
    """
    diagonal = mass.diagonal()
    if (diagonal <= 0).any():
        worst = int(np.argmin(diagonal))
        raise FileFormatError(
            path,
            f"the DOF {dofs[worst].name} has the mass {diagonal[worst]:.4g}, and {np.count_nonzero(diagonal <= 0)} "
            "DOFs have none above 0; condense massless DOFs in the FE program, or give them their (rotary) inertia",
            where=f"row {worst + 1}",
        )
    scale = sparse.diags_array(1 / np.sqrt(diagonal))
    scaled = sparse.csr_array(scale @ mass @ scale)
    if mass.shape[0] <= DENSE_ORDER:
        smallest, motion = _smallest_eigenpair(scaled)
        is_definite, where = smallest > SINGULAR_MASS, f", most of all at the DOF {dofs[int(np.argmax(motion))].name}"
    else:
        is_definite, where = is_positive_definite(_shifted(scaled, -SINGULAR_MASS), _nodes(dofs)), ""
    if not is_definite:
        raise FileFormatError(
            path,
            f"the mass matrix is not positive definite: a motion has no mass or a negative one{where}; "
            "export the mass matrix that the FE program computes modes with",
        )


def require_semidefinite(matrix: Matrix, dofs: Sequence[Dof], path: Path, what: str) -> None:
    """Refuse a stiffness or damping matrix that gives off energy.

    Parameters
    ----------
    matrix : (n, n) sparse array
        Symmetric.
    dofs : sequence of Dof
        Its rows.
    path : Path
        Its file, for the message.
    what : str
        ``stiffness`` or ``damping``.

    Raises
    ------
    FileFormatError
        If an eigenvalue is below -1e-10 times the largest one.
    """
    if matrix.shape[0] <= DENSE_ORDER:
        smallest, motion = _smallest_eigenpair(matrix)
        is_semidefinite = smallest >= -NEGATIVE_STIFFNESS * _largest_eigenvalue(matrix)
        where = f" of {smallest:.4g}, most of all at the DOF {dofs[int(np.argmax(motion))].name}"
    else:
        shifted = _shifted(matrix, NEGATIVE_STIFFNESS * _largest_eigenvalue(matrix))
        is_semidefinite, where = matrix.nnz == 0 or is_positive_definite(shifted, _nodes(dofs)), ""
    if not is_semidefinite:
        raise FileFormatError(
            path,
            f"the {what} matrix is indefinite: it has a negative eigenvalue{where}; 0 is allowed, and -1e-10 times the "
            "largest one. Check units and signs of what was exported",
        )


def _smallest_eigenpair(matrix: Matrix) -> tuple[float, FloatArray]:
    values, vectors = linalg.eigh(matrix.toarray(), subset_by_index=[0, 0])
    return float(values[0]), np.abs(vectors[:, 0])


def _largest_eigenvalue(matrix: Matrix) -> float:
    if matrix.shape[0] <= DENSE_ORDER:
        last = matrix.shape[0] - 1
        return float(linalg.eigh(matrix.toarray(), eigvals_only=True, subset_by_index=[last, last])[0])
    if matrix.nnz == 0:
        return 0.0
    start = np.ones(matrix.shape[0])
    start[::2] = -1.0  # neighbours in opposite directions: close to the stiffest motion
    values = sparse_linalg.eigsh(matrix, 1, which="LA", tol=ESTIMATE_TOLERANCE, v0=start, return_eigenvectors=False)
    return float(values[0])


def _shifted(matrix: Matrix, shift: float) -> Matrix:
    return sparse.csr_array(matrix + shift * sparse.eye_array(matrix.shape[0]))


def _nodes(dofs: Sequence[Dof]) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.array([dof.node for dof in dofs])
