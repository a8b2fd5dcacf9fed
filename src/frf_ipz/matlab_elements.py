"""The structure of a MATLAB file of version 5, checked before SciPy follows it.

SciPy trusts the types and sizes that such a file states: a wrong one ends the interpreter or takes minutes. So every
element is walked through first: its type is one that may stand there, it lies within what holds it, and what is said to
be many has the bytes of many. Elements, tags and classes: MathWorks, *MAT-File Format*, R2024a, "Level 5 MAT-File
Format".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Collection

HEADER_BYTES, TAG_BYTES = 128, 8
INT8, UINT8, UINT16, INT32, UINT32, MATRIX, COMPRESSED, UTF8, UTF16, UTF32 = 1, 2, 4, 5, 6, 14, 15, 16, 17, 18
DTYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}  # of numbers
NAMES, TEXTS = {INT8, UTF8}, {INT8, UINT8, UINT16, UTF8, UTF16, UTF32}
CELL, STRUCT, OBJECT, CHAR, SPARSE, FUNCTION, OPAQUE = 1, 2, 3, 4, 5, 16, 17
NUMERIC = range(6, 16)  # double, single, and integers of 8 to 64 bits
IS_COMPLEX, IS_LOGICAL = 0x800, 0x200
MOST_DIMENSIONS, MOST_DEPTH = 32, 50


class DamagedError(Exception):
    """What is wrong with the structure, in a few words."""


@dataclass
class Elements:
    """The elements of one part of a file, from the first to the last.

    Parameters
    ----------
    data : bytes
        The file.
    start, end : int
        The part.
    order : str
        ``<`` or ``>``: how numbers stand.
    depth : int
        How many elements it lies within.
    """

    data: bytes
    start: int
    end: int
    order: str
    depth: int = 0

    def take(self, types: Collection[int]) -> tuple[int, int, int]:
        """Give type, first byte and length of the next element, and go on behind it."""
        if self.start + TAG_BYTES > self.end:
            raise DamagedError("it is cut off")
        kind, length = (int(number) for number in np.frombuffer(self.data, f"{self.order}u4", 2, self.start))
        first = self.start + TAG_BYTES
        if kind >> 16:  # a small element: both in the first four bytes, its content in the next four
            kind, length, first = kind & 0xFFFF, kind >> 16, self.start + TAG_BYTES // 2
            if length > TAG_BYTES // 2:
                raise DamagedError("a small element is too long")
            self.start += TAG_BYTES
        else:
            self.start = first + -(-length // TAG_BYTES) * TAG_BYTES
        if kind not in types:
            raise DamagedError(f"an element is of the type {kind}")
        if first + length > self.end:
            raise DamagedError("it is cut off")
        return kind, first, length

    def take_numbers(self, types: Collection[int] = DTYPES.keys()) -> np.ndarray:
        """Give the numbers of the next element."""
        kind, first, length = self.take(types)
        dtype = np.dtype(self.order + DTYPES[kind])
        if length % dtype.itemsize:
            raise DamagedError("a number is cut off")
        return np.frombuffer(self.data, dtype, length // dtype.itemsize, first)

    def require_matrices(self, number: int) -> None:
        """Walk through matrices within a matrix."""
        if number > (self.end - self.start) // TAG_BYTES:
            raise DamagedError("cells or fields are missing")
        for _ in range(number):
            self.require_matrix()

    def require_matrix(self) -> None:
        """Walk through a matrix and all that lies in it."""
        if self.depth > MOST_DEPTH:
            raise DamagedError("it is nested too deeply")
        _, first, length = self.take({MATRIX})
        if length:  # else an empty cell
            Elements(self.data, first, first + length, self.order, self.depth + 1)._require_content()

    def _require_content(self) -> None:
        if self.start + 2 * TAG_BYTES > self.end:
            raise DamagedError("it is cut off")
        flags = self.take_numbers({UINT32})
        if len(flags) != 2:
            raise DamagedError("the flags of a matrix are no two numbers")
        kind, is_complex = int(flags[0]) & 0xFF, bool(int(flags[0]) & IS_COMPLEX)
        if kind == OPAQUE:
            for _ in range(3):
                self.take(NAMES)
            self.require_matrix()
            return
        dimensions = [int(number) for number in self.take_numbers({INT32, UINT32})]
        if not 0 < len(dimensions) <= MOST_DIMENSIONS or min(dimensions) < 0:
            raise DamagedError("a matrix has no dimensions, or a negative one")
        self.take(NAMES)
        if kind == SPARSE:
            self._require_sparse(dimensions, 1 + is_complex, is_logical=bool(int(flags[0]) & IS_LOGICAL))
        else:
            self._require_values(kind, dimensions, n_parts=1 + is_complex)

    def _require_values(self, kind: int, dimensions: list[int], *, n_parts: int) -> None:
        number = math.prod(dimensions)
        if kind in NUMERIC:
            if any(len(self.take_numbers()) != number for _ in range(n_parts)):
                raise DamagedError("a matrix has not as many numbers as its dimensions say")
        elif kind == CHAR:
            length = self.take(TEXTS)[2]
            is_blank = not length and number <= TAG_BYTES  # some programs write no letters where all are blanks
            if number > length and not is_blank:
                raise DamagedError("a text has fewer letters than its dimensions say")
        elif kind in {CELL, FUNCTION}:
            self.require_matrices(number if kind == CELL else 1)
        elif kind in {STRUCT, OBJECT}:
            self._require_fields(number, has_class=kind == OBJECT)
        else:
            raise DamagedError(f"a matrix is of the class {kind}")

    def _require_sparse(self, dimensions: list[int], n_parts: int, *, is_logical: bool) -> None:
        if len(dimensions) != 2:
            raise DamagedError("a sparse matrix has not two dimensions")
        rows, columns = (self.take_numbers({INT32, UINT32}) for _ in range(2))
        if len(columns) != dimensions[1] + 1 or columns[0] != 0 or (np.diff(columns.astype(np.int64)) < 0).any():
            raise DamagedError("the columns of a sparse matrix do not follow one another")
        n_entries = int(columns[-1])
        used = rows[:n_entries].astype(np.int64)
        if len(used) < n_entries or (used < 0).any() or (used >= dimensions[0]).any():
            raise DamagedError("an entry of a sparse matrix lies outside it")
        if is_logical and n_parts > 1:
            raise DamagedError("a sparse matrix is logical and complex")
        if is_logical:  # of one byte each, whatever the type says
            if self.take(DTYPES.keys())[2] < n_entries:
                raise DamagedError("entries of a sparse matrix are missing")
        elif any(len(self.take_numbers()) < n_entries for _ in range(n_parts)):
            raise DamagedError("entries of a sparse matrix are missing")

    def _require_fields(self, number: int, *, has_class: bool) -> None:
        if has_class:
            self.take(NAMES)
        width = self.take_numbers({INT32, UINT32})
        _, _, length = self.take(NAMES)
        if len(width) != 1 or width[0] <= 0 or length % width[0]:
            raise DamagedError("the names of fields have no length")
        self.require_matrices(number * (length // int(width[0])))


def require_elements(data: bytes, order: str) -> None:
    """Walk through the elements of a file in which nothing is compressed any more.

    Parameters
    ----------
    data : bytes
        The file, its header too.
    order : str
        ``<`` or ``>``: how numbers stand.

    Raises
    ------
    DamagedError
        If an element is not what may stand there.
    """
    elements = Elements(data, HEADER_BYTES, len(data), order)
    while elements.start < elements.end:
        elements.require_matrix()
