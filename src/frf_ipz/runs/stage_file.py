"""The file that keeps a stage's result: a JSON text, then the numbers of its arrays, nothing packed.

::

    frf_ipz result 1          what it is, with a line feed
    32 bytes                  SHA-256 of all that follows
    8 bytes                   length of the text, little-endian
    {"key": .., "tree": .., "arrays": [["<f8", [3, 2], "C"], ..]}
    the arrays' numbers, one after the other

So nothing in memory is larger than on disk, and every length is known before anything is read.
"""

from __future__ import annotations

import hashlib
import json
import math
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.errors import FileFormatError
from frf_ipz.input_files import open_input, require_regular_file
from frf_ipz.json_files import MOST_MEMORY, memory_of_values, parse_json
from frf_ipz.output_files import replacing

if TYPE_CHECKING:
    from collections.abc import Sequence
    from io import BufferedReader
    from pathlib import Path

    from numpy.typing import NDArray

SUFFIX = ".result"
MAGIC = b"frf_ipz result 1\n"
DIGEST_BYTES, LENGTH_BYTES = hashlib.sha256().digest_size, 8
START = len(MAGIC) + DIGEST_BYTES + LENGTH_BYTES
NUMBERS = frozenset(f"<{kind}" for kind in ("f8", "f4", "c16", "c8", "i8", "i4", "i2", "u8", "u4", "u2")) | {
    "|b1",
    "|i1",
    "|u1",
}
MOST_AXES = 8
ADVICE = "delete it or run again"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StageFile:
    """What a file holds.

    Parameters
    ----------
    key : str
        Digest of all that the result depends on.
    tree : object
        JSON values that refer to the arrays by their place.
    arrays : sequence of array
        Numbers.
    """

    key: str
    tree: Any
    arrays: Sequence[NDArray[Any]]


def write_stage_file(content: StageFile, path: Path) -> None:
    """Write a file.

    Parameters
    ----------
    content : StageFile
        What it shall hold.
    path : Path
        The file.

    Raises
    ------
    TypeError
        If an array holds no numbers, or the tree is too large to be read again: a fault of the program.
    OSError
        If it cannot be written.
    """
    arrays = [_plain_numbers(array) for array in content.arrays]
    described = [[array.dtype.str, array.shape, _order(array)] for array in arrays]
    text = json.dumps({"key": content.key, "tree": content.tree, "arrays": described}).encode("ascii")
    if memory_of_values(text) > MOST_MEMORY:
        raise TypeError("a stage's result holds too many values outside of arrays to be kept")
    parts: list[Any] = [len(text).to_bytes(LENGTH_BYTES, "little"), text, *(_bytes_of(array) for array in arrays)]
    total = hashlib.sha256()
    for part in parts:
        total.update(part)
    with replacing(path) as target, target.open("wb") as stream:
        for part in (MAGIC, total.digest(), *parts):
            stream.write(part)


def read_stage_file(path: Path) -> StageFile:
    """Read what `write_stage_file` wrote.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    StageFile
        Equal to the last bit.

    Raises
    ------
    FileFormatError
        If it is missing, damaged, or no such file.
    """
    size = require_regular_file(path)
    with open_input(path) as stream:
        start = stream.read(START)
        length = int.from_bytes(start[-LENGTH_BYTES:], "little")
        if len(start) < START or not start.startswith(MAGIC) or length > size - START:
            raise FileFormatError(path, f"is damaged or from another version; {ADVICE}")
        total = hashlib.sha256(start[-LENGTH_BYTES:])
        text = stream.read(length)
        total.update(text)
        header = parse_json(text, path)
        arrays = _read_arrays(header.get("arrays"), stream, size - START - length, path)
    for array in arrays:
        total.update(_bytes_of(array))
    if total.digest() != start[len(MAGIC) : len(MAGIC) + DIGEST_BYTES]:
        raise FileFormatError(path, f"is damaged: its content has changed since it was written; {ADVICE}")
    return StageFile(key=str(header.get("key", "")), tree=header.get("tree"), arrays=arrays)


def _read_arrays(described: Any, stream: BufferedReader, n_bytes: int, path: Path) -> list[NDArray[Any]]:  # noqa: ANN401
    """Read the arrays, once their sizes are known to fill the file exactly."""
    try:
        kinds = [(str(name), tuple(int(length) for length in shape), str(order)) for name, shape, order in described]
    except (TypeError, ValueError, OverflowError):
        raise FileFormatError(path, f"is damaged: its arrays are not described; {ADVICE}") from None
    sizes = [_size(name, shape, order, most=START + n_bytes) for name, shape, order in kinds]
    if min(sizes, default=0) < 0 or sum(sizes) != n_bytes:
        raise FileFormatError(path, f"is damaged: it does not hold the arrays that it names; {ADVICE}")
    return [_read_array(stream, *kind) for kind in kinds]


def _size(name: str, shape: tuple[int, ...], order: str, *, most: int) -> int:
    """Give the bytes of an array; -1 for one that cannot be in a file with so many bytes, an empty one among them."""
    lengths_fit = len(shape) <= MOST_AXES and all(0 <= length <= most for length in shape)
    if name not in NUMBERS or order not in {"C", "F"} or not lengths_fit:
        return -1
    return math.prod(shape) * np.dtype(name).itemsize


def _read_array(stream: BufferedReader, name: str, shape: tuple[int, ...], order: str) -> NDArray[Any]:
    flat = np.empty(math.prod(shape), np.dtype(name))
    room: Any = flat.view(np.uint8)
    stream.readinto(room)
    return flat.reshape(shape, order="F" if order == "F" else "C")


def _plain_numbers(array: NDArray[Any]) -> NDArray[Any]:
    numbers = array if sys.byteorder == "little" else array.astype(array.dtype.newbyteorder("<"))
    if numbers.dtype.str not in NUMBERS:
        raise TypeError(f"a stage's result holds an array of {array.dtype}, which cannot be kept")
    return numbers


def _order(array: NDArray[Any]) -> str:
    return "F" if array.flags.f_contiguous and not array.flags.c_contiguous else "C"


def _bytes_of(array: NDArray[Any]) -> memoryview:
    numbers: Any = array.ravel(order="A" if _order(array) == "F" else "C").view(np.uint8)
    return memoryview(numbers)
