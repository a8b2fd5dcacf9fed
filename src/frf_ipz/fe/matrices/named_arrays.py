"""Matrices among named arrays, as files of NumPy and MATLAB hold them, with the names of their rows."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from frf_ipz.arrays import as_whole_numbers
from frf_ipz.dofs import DIRECTIONS, GENERALISED, Dof, parse_dof
from frf_ipz.errors import FileFormatError, InputError, errors_of_file
from frf_ipz.fe.matrices.stored import MatrixRequest, StoredMatrix, as_matrix, both_triangles, positions_of_rows
from frf_ipz.numerics.compressed_places import require_places

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from frf_ipz.arrays import IntArray, Matrix

ROWS = ("dofs", "dof", "labels")
PLACES = ("coordinates", "coordinates_m", "coords", "xyz")
COMPRESSED = {"csr": sparse.csr_array, "csc": sparse.csc_array}


def read_named(arrays: Mapping[str, Any], request: MatrixRequest) -> StoredMatrix:
    """Choose a matrix among named arrays.

    Parameters
    ----------
    arrays : mapping of str to array
        Dense or sparse arrays, texts, or the parts of a sparse one as (format, shape, arrays).
    request : MatrixRequest
        Which is asked for.

    Returns
    -------
    StoredMatrix
        The matrix, with its rows where an array ``dofs`` names them.

    Raises
    ------
    FileFormatError
        If there is no such matrix.
    """
    matrices = {name: value for name, value in arrays.items() if _is_square(value)}
    diagonals = {name: np.ravel(value) for name, value in arrays.items() if _is_vector(value) and request.means(name)}
    chosen = request.choose(matrices | diagonals)
    value = matrices[chosen] if chosen in matrices else sparse.diags_array(diagonals[chosen]).tocsr()
    matrix = as_matrix(_sparse_of_parts(value, request.path) if isinstance(value, tuple) else value, request)
    by_name = {name.lower(): value for name, value in arrays.items()}
    stored = both_triangles(matrix, request.path)
    if chosen not in matrices:
        vector = f"'{chosen}' is a vector of {matrix.shape[0]} values"
        note = f"{request.path.name}: {vector}: the diagonal of the {request.what}"
        stored = replace(stored, notes=(*stored.notes, note))
    labels = next((by_name[name] for name in ROWS if name in by_name), None)
    if labels is None:
        return stored
    dofs = _dofs(labels, request.path)
    if len(dofs) != matrix.shape[0]:
        raise FileFormatError(request.path, f"names {len(dofs)} DOFs, but '{chosen}' has {matrix.shape[0]} rows")
    places = next((np.asarray(by_name[name]) for name in PLACES if name in by_name), None)
    if places is None:
        return StoredMatrix(matrix=stored.matrix, dofs=dofs, notes=stored.notes)
    if places.shape != (len(dofs), 3) or places.dtype.kind not in "iuf":
        raise FileFormatError(request.path, f"has coordinates of the shape {places.shape}; one x, y, z a row is needed")
    positions = positions_of_rows(dofs, places.astype(float))
    return StoredMatrix(matrix=stored.matrix, dofs=dofs, positions=positions, notes=stored.notes)


def _is_square(value: Any) -> bool:  # noqa: ANN401 - any variable of a file
    if isinstance(value, tuple):
        return True
    kind = getattr(getattr(value, "dtype", None), "kind", "")
    shape: Any = getattr(value, "shape", ())
    return kind in "iufcb" and len(shape) == 2 and shape[0] == shape[1] and shape[0] > 0


def _is_vector(value: Any) -> bool:  # noqa: ANN401 - any variable of a file
    """Tell lumped values, as of a mass: one a row."""
    kind = getattr(getattr(value, "dtype", None), "kind", "")
    shape: Any = getattr(value, "shape", ())
    return kind in "iufc" and not sparse.issparse(value) and np.prod(shape) == max(shape, default=0) > 1


def _sparse_of_parts(parts: tuple[str, tuple[int, ...], Mapping[str, Any]], path: Path) -> Matrix:
    """Assemble a sparse matrix whose places are checked first: SciPy trusts them."""
    kind, shape, arrays = parts
    if len(shape) != 2:
        raise FileFormatError(path, f"holds an array of the shape {shape}; a matrix is needed")
    if kind == "coo":
        rows, columns = (_places_in(arrays, name, path) for name in ("row", "col"))
        matrix: Any = sparse.coo_array((arrays["data"], (rows, columns)), shape=shape)
    elif kind in COMPRESSED:
        indices, pointers = (_places_in(arrays, name, path) for name in ("indices", "indptr"))
        matrix = COMPRESSED[kind]((arrays["data"], indices, pointers), shape=shape)
        require_places(matrix)
    else:
        raise FileFormatError(path, f"holds a sparse matrix in the format '{kind}'; save it as csr, csc or coo")
    return sparse.csr_array(matrix)


def _places_in(arrays: Mapping[str, Any], name: str, path: Path) -> IntArray:
    with errors_of_file(path, where=f"array '{name}'"):
        return as_whole_numbers(arrays[name], "its places")


def _dofs(labels: Any, path: Path) -> tuple[Dof, ...]:  # noqa: ANN401 - an array of texts, or of numbers
    """Read texts such as ``1:x``, or pairs of node and number of the direction, 1 to 6."""
    items = np.asarray(labels)
    if items.ndim == 2 and items.shape[1] == 2 and items.dtype.kind in "iuf":
        if not (np.isfinite(items) & (items == np.rint(items))).all() or items[:, 0].min(initial=1) < 1:
            problem = "has nodes and directions that are no whole numbers from 1; write the DOFs as texts such as '1:x'"
            raise FileFormatError(path, problem, where="array 'dofs'")
        pairs = [(int(node), int(number)) for node, number in items.tolist()]
        if all(1 <= number <= len(DIRECTIONS) for _, number in pairs):
            return tuple(Dof(node, DIRECTIONS[number - 1]) for node, number in pairs)
    texts = [_text(item) for item in items.ravel().tolist()]
    try:
        return tuple(_dof(text) for text in texts)
    except InputError as error:
        raise FileFormatError(path, str(error), where="array 'dofs'") from None


def _text(item: Any) -> str:  # noqa: ANN401 - MATLAB has texts within arrays
    while isinstance(item, np.ndarray) and item.size == 1:
        item = item.item()
    return item.decode("utf-8", "replace") if isinstance(item, bytes) else str(item).strip()


def _dof(text: str) -> Dof:
    node, _, direction = text.partition(":")
    if direction.strip().lower() in {GENERALISED, "0"} and node.strip().isdecimal():
        return Dof(int(node[:18]), GENERALISED)
    return parse_dof(text).unsigned
