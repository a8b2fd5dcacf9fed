"""Matrix Market files into square sparse matrices.

The text is checked first, by one regular expression: SciPy's reader is fast, but takes of a number what it can read and
leaves the rest. A file that does not pass is read line by line, and the line at fault is named.
"""

from __future__ import annotations

import bz2
import gzip
import re
import zlib
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from scipy import sparse

from frf_ipz.arrays import ComplexArray, IntArray
from frf_ipz.errors import FileFormatError, did_you_mean
from frf_ipz.fe.matrices.stored import MatrixFormat, MatrixRequest, StoredMatrix
from frf_ipz.input_files import MISSING, read_bytes
from frf_ipz.late_imports import import_late
from frf_ipz.numerics.definiteness import SYMMETRY_TOLERANCE
from frf_ipz.text_numbers import NumberError, parse_number
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from pathlib import Path

    from scipy import io

    from frf_ipz.arrays import FloatArray, Matrix
else:
    io = import_late("scipy.io")

LARGEST = 1e100  # in no unit does a structure have such an entry; products of larger ones overflow
WORDS = (
    ("object", ("matrix",)),
    ("format", ("coordinate", "array")),
    ("field", ("real", "double", "integer", "unsigned-integer", "complex", "pattern")),
    ("symmetry", ("general", "symmetric", "skew-symmetric", "hermitian")),
)
EXAMPLE = "%%MatrixMarket matrix coordinate real symmetric"
COMPRESSED = {b"\x1f\x8b": gzip.decompress, b"BZh": bz2.decompress}
COMMENT = re.compile(rb"(?m)^[ \t]*+%[^\n]*+")
HEAD = re.compile(rb"(?:[ \t]*+(?:%[^\n]*+)?\n)*+[ \t]*+")  # comments and empty lines before the size
NUMBER = rb"[+-]?(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)(?:[eEdDqQ][+-]?[0-9]++)?"
VALUES = {n: rb"(?:[ \t]++" + NUMBER + rb"){%d}" % n for n in (1, 2)}
ENTRIES = {
    ("coordinate", n): re.compile(rb"(?:[ \t]*+(?:[0-9]++[ \t]++[0-9]++" + VALUES[n] + rb")?[ \t]*+\n)*+")
    for n in VALUES
} | {
    ("array", n): re.compile(rb"(?:[ \t]*+(?:" + NUMBER + rb"(?:[ \t]++" + NUMBER + rb")*+)?[ \t]*+\n)*+")
    for n in VALUES
}
TO_E = bytes.maketrans(b"dDqQ", b"EEEE")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Text:
    """A file's lines: the words of the first, the size, and the bytes of the entries without comments."""

    path: Path
    format: str
    field: str
    symmetry: str
    size: tuple[int, ...]
    size_line: int
    body: bytes

    @property
    def n_values(self) -> int:
        return 2 if self.field == "complex" else 1


def read_matrix_market(request: MatrixRequest) -> StoredMatrix:
    """Read a square matrix.

    Parameters
    ----------
    request : MatrixRequest
        The file, in coordinate or array form; plain, or compressed by gzip or bzip2.

    Returns
    -------
    StoredMatrix
        The matrix with both its triangles, and what is to be said about the file.

    Raises
    ------
    FileFormatError
        If there is no such file, it is no Matrix Market file, is not square, of another size or skew-symmetric, holds
        imaginary parts without being a stiffness, or holds anything that is no number, no row or no column: says in
        which line.
    """
    text = _split(request.path, _read_plain_bytes(request.path))
    _require_square(text, request)
    rows, columns, values = _parse_entries(text)
    return _assemble(text, request.what, rows, columns, _values(text, values, request.what))


FORMAT = MatrixFormat(rank=9, fits=lambda path, head: True, read=read_matrix_market)  # noqa: ARG005 - its message says what is known


def _read_plain_bytes(path: Path) -> bytes:
    try:
        data = read_bytes(path)
    except FileFormatError as error:
        if MISSING in str(error):
            raise FileFormatError(path, f"{MISSING}; paths are relative to model.toml") from None
        raise
    for magic, decompress in COMPRESSED.items():
        if data.startswith(magic):
            try:
                data = decompress(data)
            except (OSError, EOFError, ValueError, zlib.error) as error:
                raise FileFormatError(path, f"cannot be decompressed: {error}; export it again") from None
    if b"\0" in data:
        raise FileFormatError(path, "holds NUL bytes: it is no text, or one in UTF-16; export it as plain text")
    data = data.removeprefix(b"\xef\xbb\xbf")
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return data if data.endswith(b"\n") else data + b"\n"


def _split(path: Path, data: bytes) -> _Text:
    first, _, rest = data.partition(b"\n")
    words = first.decode("latin-1").lower().split()
    if not words or words[0] not in {"%%matrixmarket", "%matrixmarket"}:
        raise FileFormatError(
            path, f"cannot be read as a Matrix Market file, which begins with '{EXAMPLE}'", where="line 1"
        )
    for place, (name, known) in enumerate(WORDS, start=1):
        if place >= len(words):
            raise FileFormatError(path, f"names no {name}; expected is '{EXAMPLE}' or the like", where="line 1")
        if words[place] not in known:
            advice = did_you_mean(words[place], known)
            raise FileFormatError(path, f"'{words[place]}' is no {name} of a matrix; {advice}", where="line 1")
    if len(words) > len(WORDS) + 1:
        raise FileFormatError(path, f"'{words[len(WORDS) + 1]}' stands behind the symmetry; omit it", where="line 1")
    if words[3] == "pattern":
        raise FileFormatError(path, "holds pattern values: places without numbers; export it with its values")
    head = HEAD.match(rest)
    start = 0 if head is None else head.end()
    size_line = 2 + rest.count(b"\n", 0, start)
    stop = (rest.find(b"\n", start) + 1) or len(rest)
    sizes, entries = rest[start:stop], rest[stop:]
    if b"%" in entries:
        entries = COMMENT.sub(b"", entries)
    if any(byte > 127 for byte in sizes) or not all(word.isdigit() for word in sizes.split()):
        shown = sizes.decode("latin-1").strip()[:60]
        raise FileFormatError(path, f"'{shown}' is no size of a matrix", where=f"line {size_line}")
    size = tuple(int(word[:18]) for word in sizes.split())
    expected = 3 if words[2] == "coordinate" else 2
    if len(size) != expected:
        needed = "rows, columns and number of entries" if expected == 3 else "rows and columns"
        raise FileFormatError(path, f"{len(size)} numbers stand here; {needed} are needed", where=f"line {size_line}")
    return _Text(
        path=path, format=words[2], field=words[3], symmetry=words[4], size=size, size_line=size_line, body=entries
    )


def _require_square(text: _Text, request: MatrixRequest) -> None:
    rows, columns, *_ = text.size
    if rows != columns:
        raise FileFormatError(text.path, f"is {rows} x {columns}; a square matrix is needed")
    if request.order is not None and rows != request.order:
        raise FileFormatError(
            text.path,
            f"is {rows} x {columns}, but {request.ordered_by} names {request.order} DOFs; one row a DOF is needed",
        )


def _parse_entries(text: _Text) -> tuple[IntArray, IntArray, ComplexArray | FloatArray]:
    """Rows and columns from 0, and values, as they stand in the file."""
    entries = _parse_fast(text)
    if entries is None:
        entries = _parse_lines(text)
    rows, columns, values = entries
    too_large = np.abs(values) > LARGEST
    if too_large.any():
        worst = int(np.argmax(too_large))
        raise FileFormatError(
            text.path, f"holds {values[worst]:.4g} in row {rows[worst] + 1}, which no structure has; check its export"
        )
    return rows, columns, values


def _parse_fast(text: _Text) -> tuple[IntArray, IntArray, Any] | None:
    """Read a text in which every number is plain; None for any other, and for one that does not fit its size."""
    match = ENTRIES[text.format, text.n_values].match(text.body)
    if match is None or match.end() != len(text.body):
        return None
    order = text.size[0]
    field = "complex" if text.field == "complex" else "real"
    body = text.body.translate(TO_E) if any(letter in text.body for letter in (b"d", b"D", b"q", b"Q")) else text.body
    if text.format == "array":
        counts = {count: triangle for triangle, count in _array_counts(text)}
        n_values = len(body.split()) // text.n_values
        if n_values not in counts:
            return None
        header = f"%%MatrixMarket matrix array {field} general\n{n_values} 1\n".encode()
        body = b"\n".join(body.split()) if text.n_values == 1 else body
    elif text.body.count(b"\n") < text.size[2]:  # nothing is allocated for entries that are not there
        return None
    else:
        header = f"%%MatrixMarket matrix coordinate {field} general\n{order} {order} {text.size[2]}\n".encode()
    try:
        loaded: Any = io.mmread(BytesIO(header + body))
    except (ValueError, OverflowError, MemoryError):
        return None
    if text.format == "array":
        values = np.asarray(loaded).ravel()
        rows, columns = _array_places(order, counts[len(values)])
    else:
        entries = sparse.coo_array(loaded)
        rows, columns, values = entries.row.astype(np.int64), entries.col.astype(np.int64), entries.data
    return (rows, columns, values) if np.isfinite(values).all() else None


def _array_counts(text: _Text) -> list[tuple[str, int]]:
    """How many values an array may have, by what they are: column by column."""
    order = text.size[0]
    full = [("full", order * order)]
    if text.symmetry == "general":
        return full
    below = order * (order + 1) // 2 if text.symmetry != "skew-symmetric" else order * (order - 1) // 2
    return [*full, (text.symmetry, below)]


def _array_places(order: int, triangle: str) -> tuple[IntArray, IntArray]:
    if triangle == "full":
        columns, rows = np.divmod(np.arange(order * order, dtype=np.int64), order)
        return rows, columns
    columns, rows = np.triu_indices(order, 1 if triangle == "skew-symmetric" else 0)
    return rows.astype(np.int64), columns.astype(np.int64)


def _parse_lines(text: _Text) -> tuple[IntArray, IntArray, Any]:
    """Read line by line, and name the line that is at fault."""
    rows, columns, values = [], [], []
    order, per_entry = text.size[0], text.n_values
    leading = 2 if text.format == "coordinate" else 0
    for number, line in enumerate(text.body.decode("latin-1").split("\n"), start=text.size_line + 1):
        words = line.split()
        if not words:
            continue
        if leading and len(words) != leading + per_entry:
            what = "row, column and value" if per_entry == 1 else "row, column, real and imaginary part"
            _refuse(text, number, f"'{line.strip()[:60]}' has {len(words)} columns; {what} are needed")
        places = [_parse_place(text, number, word, order) for word in words[:leading]]
        if places:
            rows.append(places[0])
            columns.append(places[1])
        try:
            values += [parse_number(word) for word in words[leading:]]
        except NumberError as error:
            _refuse(text, number, str(error))
    found = len(values) // per_entry
    if text.format == "array":
        counts = {count: triangle for triangle, count in _array_counts(text)}
        if found not in counts:
            stated = " or ".join(str(count) for count in counts)
            _refuse(text, text.size_line, f"{order} x {order} values are announced: {stated} of them; {found} follow")
        places_of_array = _array_places(order, counts[found])
        return *places_of_array, _as_complex(values, per_entry)
    if found != text.size[2]:
        _refuse(text, text.size_line, f"{text.size[2]} entries are announced, but {found} follow; is the file cut off?")
    return np.array(rows, np.int64), np.array(columns, np.int64), _as_complex(values, per_entry)


def _parse_place(text: _Text, number: int, word: str, order: int) -> int:
    if not (word.isascii() and word.isdigit()):
        _refuse(text, number, f"'{word}' is no number of a row or column")
    place = int(word[:18])
    if place == 0:
        _refuse(text, number, "row or column 0: rows and columns count from 1")
    if place > order:
        _refuse(text, number, f"row or column {place} of a matrix of {order} rows")
    return place - 1


def _as_complex(values: list[float], per_entry: int) -> Any:  # noqa: ANN401 - real or complex
    array = np.array(values, float)
    return array if per_entry == 1 else array[::2] + 1j * array[1::2]


def _refuse(text: _Text, line: int, problem: str) -> NoReturn:
    raise FileFormatError(text.path, problem, where=f"line {line}")


def _values(text: _Text, values: ComplexArray | FloatArray, what: str) -> ComplexArray | FloatArray:
    """Real values, or complex ones of a stiffness."""
    if "integer" in text.field and (values != np.rint(values)).any():
        raise FileFormatError(text.path, "holds fractions, but its first line says integer; write real there")
    if not np.iscomplexobj(values) or not values.imag.any():
        return np.asarray(values.real, np.float64)
    if not values.real.any():
        raise FileFormatError(text.path, "holds imaginary values only; the real matrix is needed")
    if text.symmetry == "hermitian":
        raise FileFormatError(
            text.path, "says hermitian in its first line; a stiffness with structural damping is symmetric: write that"
        )
    if what != "stiffness":
        raise FileFormatError(
            text.path, f"holds complex values; only a stiffness can, K (1 + i eta): write the {what} as a real matrix"
        )
    return values


def _about_skew(what: str, *, has_diagonal: bool) -> str:
    """Say what is wrong with a matrix whose first line says that it is skew-symmetric."""
    if what != "damping" or has_diagonal:
        why = "its diagonal is not zero" if has_diagonal else f"no {what} is (gyroscopic forces belong to the damping)"
        return (
            f"says skew-symmetric in its first line, and {why}: where one triangle of a symmetric matrix stands there, "
            "write symmetric in that line; else export it again"
        )
    return (
        "is skew-symmetric, as gyroscopic (Coriolis) matrices of what rotates are; the method needs symmetric "
        "matrices: measure the structure at rest, and leave the damping file out"
    )


def _assemble(
    text: _Text, what: str, rows: IntArray, columns: IntArray, values: ComplexArray | FloatArray
) -> StoredMatrix:
    order = text.size[0]
    entries: Any = sparse.coo_array((values, (rows, columns)), shape=(order, order))
    matrix: Matrix = sparse.csr_array(entries)
    notes = []
    if matrix.nnz < len(values):
        notes.append(f"{text.path.name}: {counted(len(values) - matrix.nnz, 'entry', 'entries')} given again, added up")
    if text.format == "array":  # which has a number in every place
        matrix.eliminate_zeros()
    if text.symmetry == "skew-symmetric" and matrix.nnz:
        raise FileFormatError(text.path, _about_skew(what, has_diagonal=bool(matrix.diagonal().any())))
    upper, lower = sparse.csr_array(sparse.triu(matrix, 1)), sparse.csr_array(sparse.tril(matrix, -1).T)
    has_both = bool(upper.nnz and lower.nnz)
    if text.symmetry == "general":
        if has_both or not matrix.nnz or not (upper.nnz or lower.nnz):
            return StoredMatrix(matrix=matrix, notes=tuple(notes))
        side = "upper" if upper.nnz else "lower"
        notes.append(
            f"{text.path.name}: only the {side} triangle stands there, though its first line says general; it is taken "
            "for half of a symmetric matrix"
        )
    elif has_both:
        lower, note = _without_twins(text, upper, lower)
        notes += [note] if note else []
    off_diagonal = upper + lower
    full: Any = off_diagonal + off_diagonal.T + sparse.diags_array(matrix.diagonal())
    return StoredMatrix(matrix=sparse.csr_array(full), notes=tuple(notes))


def _without_twins(text: _Text, upper: Matrix, lower: Matrix) -> tuple[Matrix, str]:
    """Entries below the diagonal, mirrored, without those that stand above it too; they have to be equal."""
    above, below = (
        sparse.csr_array((np.ones(half.nnz), half.indices, half.indptr), half.shape) for half in (upper, lower)
    )
    twins = sparse.coo_array(above.multiply(below))
    if not twins.nnz:
        return lower, ""
    first, second = (np.asarray(matrix[twins.row, twins.col]).ravel() for matrix in (upper, lower))
    unequal = np.abs(first - second) > SYMMETRY_TOLERANCE * np.maximum(np.abs(first), np.abs(second))
    if unequal.any():
        worst = int(np.argmax(unequal))
        row, column = int(twins.row[worst]) + 1, int(twins.col[worst]) + 1
        raise FileFormatError(
            text.path,
            f"says symmetric in its first line, where one triangle is meant, but holds both, and they differ: "
            f"{first[worst]:.6g} in row {row}, column {column} against {second[worst]:.6g} in row {column}, column "
            f"{row}; export one triangle, or a matrix that is symmetric",
        )
    rest: Any = lower - lower.multiply(sparse.csr_array(twins))
    rest.eliminate_zeros()
    note = f"{text.path.name}: both triangles stand there, though its first line says symmetric; each entry counts once"
    return sparse.csr_array(rest), note


def _pattern(matrix: Matrix) -> Matrix:
    return sparse.csr_array((np.ones(matrix.nnz), matrix.indices, matrix.indptr), matrix.shape)
