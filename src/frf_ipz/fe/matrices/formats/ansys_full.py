"""Ansys's ``.full`` files with mass, stiffness and the names of their rows, by ansys-mapdl-reader."""

from __future__ import annotations

from functools import lru_cache
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from scipy import sparse

from frf_ipz.dofs import DIRECTIONS, GENERALISED, Dof
from frf_ipz.errors import FileFormatError
from frf_ipz.fe.matrices.stored import MOST_BYTES, MatrixFormat, MatrixRequest, StoredMatrix, both_triangles
from frf_ipz.input_files import digest_file, require_size
from frf_ipz.reader_process import read_in_process

if TYPE_CHECKING:
    from pathlib import Path

LIBRARY = "ansys.mapdl.reader"
PROCESS = "frf_ipz.fe.matrices.ansys_full_process"
INTERNAL, MOST_LABELS = 10**12, 100  # numbers of DOFs that are no motions


def _read(request: MatrixRequest) -> StoredMatrix:
    path = request.path
    if request.what == "damping":
        raise FileFormatError(path, "has mass and stiffness; give the damping as Matrix Market, or as a ratio")
    if not _is_installed():
        raise FileFormatError(
            path,
            "is a .full file of Ansys, whose reader ansys-mapdl-reader is not installed: run pip install "
            "'frf_ipz[ansys]', or export it by HBMAT",
        )
    arrays = _arrays(path, digest_file(path))
    labels = arrays["labels"]
    if f"{request.what}_values" not in arrays:
        raise FileFormatError(path, f"has no {request.what} matrix; write it by a modal analysis (WRFULL)")
    rows, columns, values = (arrays[f"{request.what}_{part}"] for part in ("rows", "columns", "values"))
    entries: Any = sparse.coo_array((values, (rows, columns)), shape=(len(labels),) * 2)
    return StoredMatrix(matrix=both_triangles(sparse.csr_array(entries), path).matrix, dofs=_dofs(labels))


FORMAT = MatrixFormat(rank=3, fits=lambda path, head: path.suffix.lower() == ".full", read=_read)  # noqa: ARG005


def _is_installed() -> bool:
    try:
        return find_spec(LIBRARY) is not None
    except ModuleNotFoundError:
        return False


@lru_cache(maxsize=1)  # mass and stiffness are asked for one after the other
def _arrays(path: Path, digest: str) -> Any:  # noqa: ANN401 - named arrays
    """Let another process read the file: a damaged one ends it."""
    del digest
    require_size(path, most_bytes=MOST_BYTES)
    return read_in_process(path, PROCESS, kind="a .full file of Ansys", most_bytes=MOST_BYTES).arrays


def _dofs(labels: Any) -> tuple[Dof, ...]:  # noqa: ANN401 - node and number of the DOF, from 0
    return tuple(
        Dof(node, DIRECTIONS[number])
        if 0 <= number < len(DIRECTIONS) and node > 0
        else Dof(INTERNAL + MOST_LABELS * abs(node) + number, GENERALISED)
        for node, number in labels.tolist()
    )
