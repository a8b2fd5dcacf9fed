"""What a file of matrices holds, whatever its format."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from frf_ipz.errors import FileFormatError
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from frf_ipz.arrays import FloatArray, Matrix
    from frf_ipz.dofs import Dof

MOST_BYTES = 1 << 31  # of one file, expanded
LONGEST = 200  # letters of a foreign message
DOFS_SHOWN = 3
NAMES = {  # of matrices in files that hold several, in small letters, the most telling first
    "stiffness": ("k", "stiffness", "stiff", "kaa", "kxx", "kgg", "kff", "kll", "kjj", "khh", "kaax", "kmat"),
    "mass": ("m", "mass", "maa", "mxx", "mgg", "mff", "mll", "mjj", "mhh", "maax", "mmat"),
    "damping": ("c", "b", "d", "damping", "damp", "baa", "bxx1", "bxx", "bgg", "baax", "cmat"),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MatrixRequest:
    """Which matrix of which file is asked for.

    Parameters
    ----------
    path : Path
        The file.
    what : str
        ``mass``, ``stiffness`` or ``damping``.
    variable : str
        What the user says that it is called in the file; empty where nothing is said.
    order : int, optional
        Number of rows that it must have.
    ordered_by : str
        File that names the rows, for messages.
    """

    path: Path
    what: str
    variable: str = ""
    order: int | None = None
    ordered_by: str = ""

    def choose(self, known: Mapping[str, Any]) -> str:
        """Choose the variable among those of a file.

        Parameters
        ----------
        known : mapping
            Square matrices, and vectors of the name, by their names.

        Returns
        -------
        str
            A name.

        Raises
        ------
        FileFormatError
            If there is none, or it is open which.
        """
        key = f"[matrices] variables = {{ {self.what} = ... }}"
        if self.variable:
            matches = [name for name in known if name.lower() == self.variable.lower()]
            if self.variable in known or len(matches) == 1:
                return self.variable if self.variable in known else matches[0]
            raise FileFormatError(
                self.path, f"holds no square matrix '{self.variable}'; it has {_listed(known)}: correct {key}"
            )
        by_name = {name.lower(): name for name in known}
        named = [by_name[name] for name in NAMES[self.what] if name in by_name]
        if named:
            return named[0]
        if len(known) == 1 and not self._is_another(*known):
            return next(iter(known))
        raise FileFormatError(
            self.path, f"holds the matrices {_listed(known)}; {key} says which is the {self.what}"
            if known else "holds no square matrix; export mass and stiffness"
        )  # fmt: skip

    def means(self, name: str) -> bool:
        """Tell whether a variable is called what is asked for.

        Parameters
        ----------
        name : str
            Of the variable.

        Returns
        -------
        bool
            By the name that the user says, or else a usual one.
        """
        return name.lower() in ({self.variable.lower()} if self.variable else NAMES[self.what])

    def _is_another(self, name: str) -> bool:
        """Tell whether a variable has a usual name of another matrix: no stiffness is a mass for want of one."""
        return any(name.lower() in names for what, names in NAMES.items() if what != self.what)


def _listed(known: Mapping[str, Any]) -> str:
    return ", ".join(list(known)[:12]) or "none"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoredMatrix:
    """A matrix of a file.

    Parameters
    ----------
    matrix : (n, n) sparse array
        Both triangles, in the unit of the file; not yet made symmetric, perhaps complex.
    dofs : tuple of Dof, optional
        Its rows, where the file names them.
    positions : mapping of int to (3,) sequence
        Positions of nodes, where the file has them, in its unit.
    notes : tuple of str
        How it was taken, where the file leaves that open.
    """

    matrix: Matrix
    dofs: tuple[Dof, ...] | None = None
    positions: Mapping[int, Sequence[float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def in_rows(self, dofs: Sequence[Dof], path: Path, ordered_by: str) -> StoredMatrix:
        """Put the rows in the order of a table.

        Parameters
        ----------
        dofs : sequence of Dof
            The rows of the whole.
        path : Path
            The file, for messages.
        ordered_by : str
            Where the rows are named, for messages.

        Returns
        -------
        StoredMatrix
            With a row for each; those that the file lacks are zero.

        Raises
        ------
        FileFormatError
            If the file has a row that the table lacks, or no names and another number of rows.
        """
        if self.dofs is None:
            _require_order(self.matrix, len(dofs), path, ordered_by)
            return self
        if tuple(dofs) == self.dofs:
            return self
        place = {dof: row for row, dof in enumerate(dofs)}
        missing = [dof.name for dof in self.dofs if dof not in place]
        if missing:
            shown = ", ".join(missing[:DOFS_SHOWN]) + (", ..." if len(missing) > DOFS_SHOWN else "")
            raise FileFormatError(path, f"has rows for the DOFs {shown}, which {ordered_by} does not name")
        rows = np.array([place[dof] for dof in self.dofs])
        entries = sparse.coo_array(self.matrix)
        matrix: Any = sparse.coo_array((entries.data, (rows[entries.row], rows[entries.col])), shape=(len(dofs),) * 2)
        return replace(self, matrix=sparse.csr_array(matrix), dofs=tuple(dofs))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MatrixFormat:
    """A format of matrices; each is a module of `fe.matrices.formats` with a ``FORMAT``.

    Parameters
    ----------
    rank : int
        The one of the lowest rank that fits reads a file.
    fits : callable
        Given a path and the first bytes of the file: whether it is of this format.
    read : callable
        Given a `MatrixRequest`: its `StoredMatrix`.
    names : callable
        Given a path: what the matrices are called of which a file of a format without other contents holds several.
    """

    rank: int
    fits: Callable[[Path, bytes], bool]
    read: Callable[[MatrixRequest], StoredMatrix]
    names: Callable[[Path], tuple[str, ...]] = lambda path: ()  # noqa: ARG005


def as_matrix(values: Any, request: MatrixRequest) -> Matrix:  # noqa: ANN401 - an array of NumPy or SciPy
    """Take what a library gives, dense or sparse, as a sparse matrix.

    Parameters
    ----------
    values : array or sparse array
        Square.
    request : MatrixRequest
        What was asked for.

    Returns
    -------
    (n, n) sparse array
        Real, or complex where an imaginary part is not 0.

    Raises
    ------
    FileFormatError
        If it is no matrix of numbers, or not of the required order.
    """
    given: Any = values if sparse.issparse(values) else np.atleast_2d(np.asarray(values))
    if given.ndim != 2 or given.dtype.kind not in "iufc":
        raise FileFormatError(request.path, f"the {request.what} is no matrix of numbers; export it again")
    matrix: Any = sparse.csr_array(given)
    is_complex = matrix.dtype.kind == "c" and bool(np.any(matrix.data.imag))
    matrix = matrix.astype(np.complex128) if is_complex else sparse.csr_array(matrix.real).astype(np.float64)
    rows, columns = matrix.shape
    if rows != columns:
        raise FileFormatError(request.path, f"is {rows} x {columns}; a square matrix is needed")
    if request.order is not None:
        _require_order(matrix, request.order, request.path, request.ordered_by)
    return sparse.csr_array(matrix)


def both_triangles(matrix: Matrix, path: Path) -> StoredMatrix:
    """Complete a matrix of which one triangle stands in a file that does not say so.

    Parameters
    ----------
    matrix : (n, n) sparse array
        One triangle, or both.
    path : Path
        The file.

    Returns
    -------
    StoredMatrix
        With both, and a note where one was made.
    """
    beside = sparse.csr_array(sparse.triu(matrix, 1) + sparse.tril(matrix, -1))
    beside.eliminate_zeros()
    if not beside.nnz or abs(beside).sign().multiply(abs(beside).sign().T).nnz:
        return StoredMatrix(matrix=matrix)
    full: Any = matrix + beside.T
    note = f"{path.name}: only one triangle stands there; it is taken for half of a symmetric matrix"
    return StoredMatrix(matrix=sparse.csr_array(full), notes=(note,))


def positions_of_rows(dofs: Sequence[Dof], positions: FloatArray) -> dict[int, tuple[float, ...]]:
    """Take positions that stand beside each row.

    Parameters
    ----------
    dofs : sequence of Dof
        The rows.
    positions : (n, 3) array
        One a row.

    Returns
    -------
    mapping of int to (3,) tuple
        By node.
    """
    return {dof.node: tuple(place) for dof, place in zip(dofs, positions.tolist(), strict=True)}


def _require_order(matrix: Matrix, order: int, path: Path, ordered_by: str) -> None:
    rows, columns = matrix.shape
    if rows != order:
        raise FileFormatError(
            path, f"is {rows} x {columns}, but {ordered_by} names {counted(order, 'DOF')}; one row a DOF is needed"
        )
