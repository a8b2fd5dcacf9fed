"""Whether mass, stiffness and damping matrices can be those of a structure.

A large mass matrix is asked for its smallest eigenvalue by Lanczos' method, which needs products only: scaled to a
diagonal of ones, that of finite elements is far from 0 however fine the mesh. What a random start can miss is bounded
by theorem 4.2 of [KuczynskiWozniakowski1992]. Where that leaves it open, and for the stiffness, a factor tells.

[KuczynskiWozniakowski1992] J. Kuczyński, H. Woźniakowski, Estimating the largest eigenvalue by the power and Lanczos
algorithms with a random start, SIAM Journal on Matrix Analysis and Applications 13 (4), 1992, 1094-1122,
doi:10.1137/0613066.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import linalg, sparse
from scipy.sparse import linalg as sparse_linalg

from frf_ipz.errors import InputError
from frf_ipz.numerics.factorization import is_positive_definite
from frf_ipz.numerics.held_rows import NOTHING
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import BoolArray, FloatArray, IntArray, Matrix
    from frf_ipz.dofs import Dof

DENSE_ORDER = 1000  # up to here all eigenvalues are computed, and the message can name the worst DOF
# smallest eigenvalue of the mass matrix scaled to a diagonal of ones: that of a singular one after rounding
SINGULAR_MASS = 1e-12
NEGATIVE_STIFFNESS = 1e-10  # of the largest eigenvalue: allowed for rounding of printed digits
SYMMETRY_TOLERANCE = 1e-6  # of the geometric mean of the two diagonal entries: exports with six digits still pass
FACTORED_ORDER = 20_000  # beyond, a factor of the stiffness takes long enough to be left to the solve that needs one
STEPS = (50, 100, 200)  # of Lanczos' method, in turn; the last costs a tenth of a factor of a solid
RARE = 1e-12  # chance that a random start hides a smaller eigenvalue
ESTIMATE_TOLERANCE = 1e-2  # of the largest eigenvalue, which is only a yardstick
GYROSCOPIC = (
    "a skew-symmetric part is that of gyroscopic (Coriolis) forces, of what rotates, or of circulatory ones, of "
    "journal bearings and followers; the method needs symmetric matrices: measure the structure at rest, and hand in "
    "the mean of this matrix and its transpose"
)


def symmetrise(matrix: Matrix, *, rows: IntArray | None = None) -> Matrix:
    """Average out small asymmetries, as they come from few printed digits.

    Parameters
    ----------
    matrix : (n, n) sparse array
        Real.
    rows : (n,) int array, optional
        Numbers of its rows, from 0, for messages; they count through where they are left out.

    Returns
    -------
    (n, n) sparse array
        Symmetric.

    Raises
    ------
    InputError
        If it holds values that are not finite, or is not symmetric to `SYMMETRY_TOLERANCE`.
    """
    if not np.isfinite(matrix.data).all():
        raise InputError("holds values that are not finite; export it again")
    difference = sparse.coo_array(matrix - matrix.T)
    diagonal = np.abs(matrix.diagonal())
    allowed = SYMMETRY_TOLERANCE * np.sqrt(diagonal[difference.row] * diagonal[difference.col])
    excess = np.abs(difference.data) - allowed
    if excess.size and excess.max() > 0:
        worst = int(np.argmax(excess))
        row, column = int(difference.row[worst]), int(difference.col[worst])
        numbers = np.arange(len(diagonal)) if rows is None else rows
        advice = _advice_on_asymmetry(matrix, _pairs(matrix, difference, excess))
        raise InputError(
            f"is not symmetric: {matrix[row, column]:.6g} against {matrix[column, row]:.6g} in rows "
            f"{numbers[row] + 1} and {numbers[column] + 1}; {advice}"
        )
    symmetric: Any = (matrix + matrix.T) / 2
    return sparse.csr_array(symmetric)


def _pairs(matrix: Matrix, difference: sparse.coo_array, excess: FloatArray) -> FloatArray:
    """Give the pairs of entries that differ beyond rounding, that above the diagonal first, (n_pairs, 2)."""
    is_upper = (excess > 0) & (difference.row < difference.col)
    rows, columns = difference.row[is_upper], difference.col[is_upper]
    entries = sparse.csr_array(matrix)
    return np.column_stack([np.asarray(entries[rows, columns]).ravel(), np.asarray(entries[columns, rows]).ravel()])


def _advice_on_asymmetry(matrix: Matrix, pairs: FloatArray) -> str:
    """Name what makes a matrix unsymmetric, and what to hand in instead."""
    is_half = not (sparse.triu(matrix, 1).count_nonzero() and sparse.tril(matrix, -1).count_nonzero())
    if is_half:
        return "export it with both triangles, or with one of them only and 'symmetric' in its first line"
    upper, lower = pairs.T
    if (pairs == 0.0).any(axis=1).all():
        return f"of {counted(len(pairs), 'pair')} of entries one is missing, and all others agree; export it again"
    ratio = float(upper[0] / lower[0]) if lower[0] else 0.0
    is_one_ratio = bool((np.abs(upper - ratio * lower) <= SYMMETRY_TOLERANCE * np.abs(upper)).all())
    if len(pairs) > 1 and ratio > 0.0 and is_one_ratio:
        return f"above the diagonal {len(pairs)} entries are {ratio:.4g} times those below; export it again"
    if len(pairs) == 1 and upper[0] * lower[0] > 0.0:
        return f"no other pair of entries differs, so that one number may be wrong: export it again. Else {GYROSCOPIC}"
    skew, even = abs(matrix - matrix.T).sum(), abs(sparse.triu(matrix + matrix.T, 1)).sum()
    kind = "entries beside the diagonal have opposite signs in the two triangles" if even < skew else "triangles differ"
    return f"its {kind}: {GYROSCOPIC}"


def massless_rows(mass: Matrix) -> BoolArray:
    """Find the rows of a mass matrix that hold nothing.

    Parameters
    ----------
    mass : (n, n) sparse array
        Symmetric.

    Returns
    -------
    (n,) bool array
        True where no entry is larger than zero printed as 1e-30.

    Examples
    --------
    >>> massless_rows(sparse.csr_array(np.diag([2.0, 0.0])))
    array([False,  True])
    """
    sizes: FloatArray = np.asarray(abs(mass).sum(axis=1)).ravel()
    return np.asarray(sizes <= (NOTHING * float(np.median(sizes[sizes > 0])) if sizes.any() else 0.0))


def count_massless_motions(mass: Matrix, stiffness: Matrix, dofs: Sequence[Dof]) -> int:
    """Count the motions that have no mass, and refuse a mass matrix that no structure has.

    Motions without mass are DOFs of which the mass has nothing, and combinations of others: rotations of lumped masses,
    knots of shells. They follow the others statically, which they can only where the stiffness holds them.

    Parameters
    ----------
    mass, stiffness : (n, n) sparse array
        Symmetric.
    dofs : sequence of Dof
        Their rows.

    Returns
    -------
    int
        The nullity of the mass; of a large matrix only its rows that hold nothing.

    Raises
    ------
    InputError
        If no DOF has mass, a motion has a negative one, or one without mass meets no stiffness.
    """
    diagonal, massless = mass.diagonal(), massless_rows(mass)
    if massless.all():
        raise InputError("no DOF has any mass; export the mass matrix that the FE program computes modes with")
    if (diagonal[~massless] <= 0).any():
        worst = int(np.argmin(np.where(massless, np.inf, diagonal)))
        raise InputError(
            f"the DOF {dofs[worst].name} (row {worst + 1}) has the mass {diagonal[worst]:.4g}, which no structure has; "
            "export the mass matrix that the FE program computes modes with"
        )
    moving = np.flatnonzero(~massless)
    scale = sparse.diags_array(1 / np.sqrt(diagonal[moving]))
    scaled = sparse.csr_array(scale @ mass[moving][:, moving] @ scale)
    count = int(massless.sum())
    if len(dofs) > DENSE_ORDER:
        if not count and _is_surely_definite(scaled):
            return 0
        if not is_positive_definite(_shifted(scaled, SINGULAR_MASS), _nodes([dofs[row] for row in moving.tolist()])):
            raise _negative_mass("")
        if count or not is_positive_definite(_shifted(scaled, -SINGULAR_MASS), _nodes(dofs)):
            _require_held_by_stiffness(mass, stiffness, dofs)
        return count
    smallest, motion = _smallest_eigenpair(scaled)
    if smallest < -SINGULAR_MASS:
        raise _negative_mass(f", most of all at the DOF {dofs[int(moving[np.argmax(motion)])].name}")
    without = np.eye(len(dofs))[:, massless]
    if smallest <= SINGULAR_MASS:
        values, vectors = linalg.eigh(scaled.toarray())
        combinations = np.zeros((len(dofs), int(np.count_nonzero(values <= SINGULAR_MASS))))
        combinations[moving] = vectors[:, : combinations.shape[1]] / np.sqrt(diagonal[moving])[:, None]
        without = np.hstack([without, combinations])
    if without.shape[1]:
        _require_strain(stiffness, without, dofs)
    return int(without.shape[1])


def _is_surely_definite(matrix: Matrix) -> bool:
    """Whether the smallest eigenvalue is positive but for a chance that never happens; False where that stays open."""
    order = matrix.shape[0]
    largest = float(abs(matrix).sum(axis=1).max())  # no eigenvalue is larger
    rng = np.random.default_rng(0)
    vector, before = rng.standard_normal(order), np.zeros(order)
    vector /= np.linalg.norm(vector)
    diagonal: list[float] = []
    beside: list[float] = []
    for steps in STEPS:
        while len(diagonal) < steps:
            product = np.asarray(matrix @ vector) - (beside[-1] * before if beside else 0.0)
            diagonal.append(float(product @ vector))
            product -= diagonal[-1] * vector
            beside.append(float(np.linalg.norm(product)))
            if beside[-1] == 0.0:
                return False
            before, vector = vector, product / beside[-1]
        smallest = float(linalg.eigvalsh_tridiagonal(diagonal, beside[:-1], select="i", select_range=(0, 0))[0])
        missed = (np.log(1.648 * np.sqrt(order) / RARE) / (2 * steps - 1)) ** 2  # of the spread of the eigenvalues
        if smallest <= SINGULAR_MASS or smallest > missed * largest:
            return smallest > SINGULAR_MASS
    return False


def _negative_mass(where: str) -> InputError:
    return InputError(
        f"the mass matrix is indefinite: a motion has a negative mass{where}; "
        "export the mass matrix that the FE program computes modes with"
    )


def _require_strain(stiffness: Matrix, motions: FloatArray, dofs: Sequence[Dof]) -> None:
    """Refuse motions without mass that need no force."""
    energies: FloatArray = motions.T @ np.asarray(stiffness @ motions)
    scale = np.sqrt(np.where(np.diag(energies) > 0, np.diag(energies), 1.0))
    values, vectors = linalg.eigh(energies / np.outer(scale, scale))
    if values[0] <= SINGULAR_MASS:
        loose = np.abs(motions @ (vectors[:, 0] / scale))
        raise _loose(f", the DOF {dofs[int(np.argmax(loose))].name} among them")


def _require_held_by_stiffness(mass: Matrix, stiffness: Matrix, dofs: Sequence[Dof]) -> None:
    """Refuse a large model in which a motion meets neither mass nor stiffness: both together are then singular."""
    inertia = mass.diagonal()
    weight = float(np.median(stiffness.diagonal()[inertia > 0] / inertia[inertia > 0]))
    together = stiffness + weight * mass
    diagonal = together.diagonal()
    is_held = bool((diagonal > 0).all())
    if is_held:
        scale = sparse.diags_array(1 / np.sqrt(diagonal))
        is_held = is_positive_definite(
            _shifted(sparse.csr_array(scale @ together @ scale), -SINGULAR_MASS), _nodes(dofs)
        )
    if not is_held:
        raise _loose("")


def _loose(where: str) -> InputError:
    return InputError(
        f"motions without mass can take place without any force{where}: give them a mass or a stiffness in the FE "
        "program, or hold them"
    )


def require_semidefinite(matrix: Matrix, dofs: Sequence[Dof], what: str, *, rounding: float = 0.0) -> None:
    """Refuse a stiffness or damping matrix that gives off energy.

    Rows and columns are scaled to a diagonal of ones, so that units and stiff rows do not hide a negative eigenvalue.

    Parameters
    ----------
    matrix : (n, n) sparse array
        Symmetric.
    dofs : sequence of Dof
        Its rows.
    what : str
        ``stiffness`` or ``damping``.
    rounding : float
        Relative rounding of its entries, by printed digits.

    Raises
    ------
    InputError
        If an eigenvalue of the scaled matrix is below -1e-10 times the largest one, and below what rounding explains.
        That of a stiffness of more than 20 000 DOFs is found with its modes, from the factors that these need.
    """
    if what == "stiffness" and matrix.shape[0] > FACTORED_ORDER:
        return
    diagonal = matrix.diagonal()
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    scaled = sparse.csr_array(sparse.diags_array(scale) @ matrix @ sparse.diags_array(scale))
    by_rounding = rounding * float(abs(scaled).sum(axis=1).max(initial=0.0))  # no change by rounding has a larger one
    allowed = max(NEGATIVE_STIFFNESS * _largest_eigenvalue(scaled), by_rounding)
    if matrix.shape[0] <= DENSE_ORDER:
        smallest, motion = _smallest_eigenpair(scaled)
        is_semidefinite = smallest >= -allowed
        where = f" most of all at the DOF {dofs[int(np.argmax(motion))].name},"
    else:
        shifted = _shifted(scaled, allowed)
        is_semidefinite, where = matrix.nnz == 0 or is_positive_definite(shifted, _nodes(dofs)), ""
    if not is_semidefinite:
        meant = "; where that is meant, set [matrices] allow_negative_stiffness = true" if what == "stiffness" else ""
        raise InputError(
            f"the {what} matrix is indefinite: it has a negative eigenvalue,{where} beyond rounding. Check units and "
            f"signs of what was exported{meant}",
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
