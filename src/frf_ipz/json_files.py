"""JSON that may come from anybody: parsed only where its values fit into memory.

A text of a few megabytes can hold millions of empty lists, each of which takes far more room in memory than on disk. So
the room is estimated from the text before it is parsed.
"""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from frf_ipz.errors import FileFormatError
from frf_ipz.input_files import read_bytes

if TYPE_CHECKING:
    from pathlib import Path

HALF_A_LETTER = re.compile(rb"\\u[dD][89a-fA-F]")
MOST_MEMORY = 1 << 28  # bytes of values from one text: half of what looking at any folder may take
# Bytes of CPython on a 64-bit machine. One letter beyond the Basic Multilingual Plane makes all letters take 4 bytes,
# in the file's text and in its values, beside the bytes of the file. A text takes 80 more, and a key up to 100 in its
# table while that grows: a text has two quotation marks. An empty dictionary takes 64, the header of its garbage
# collection 16 and the table of its first key 160. A number takes 32, and its place in a list 8.
BYTES_OF_LETTER, BYTES_OF_QUOTATION_MARK, BYTES_OF_CONTAINER, BYTES_OF_ITEM = 9, 90, 240, 40


def read_json(path: Path, *, most_memory: int = MOST_MEMORY) -> dict[str, Any]:
    """Read a JSON file that holds one object.

    Parameters
    ----------
    path : Path
        The file.
    most_memory : int, optional
        Bytes that its values may take.

    Returns
    -------
    dict
        Its keys and values.

    Raises
    ------
    FileFormatError
        If it is missing, no file, no JSON object, nested too deeply or too large.
    """
    return parse_json(read_bytes(path, most_bytes=most_memory // BYTES_OF_LETTER), path, most_memory=most_memory)


def parse_json(data: bytes, path: Path, *, most_memory: int = MOST_MEMORY) -> dict[str, Any]:
    """Parse a JSON text that holds one object.

    Parameters
    ----------
    data : bytes
        The text, UTF-8.
    path : Path
        The file that it comes from, for the message.
    most_memory : int, optional
        Bytes that its values may take.

    Returns
    -------
    dict
        Its keys and values.

    Raises
    ------
    FileFormatError
        If it is no JSON object, nested too deeply, or its values take too much memory.
    """
    if memory_of_values(data) > most_memory:
        raise FileFormatError(path, f"holds more values than {most_memory >> 20} MB of memory take; is it damaged?")
    try:
        values = json.loads(data.decode("utf-8"))
        if HALF_A_LETTER.search(data):
            json.dumps(values, ensure_ascii=False).encode("utf-8")  # fails where a half has no other half
    except (ValueError, RecursionError) as error:
        raise FileFormatError(path, f"is no JSON text ({error}); is it damaged?") from None
    if not isinstance(values, dict):
        raise FileFormatError(path, "holds no JSON object; is it damaged?")
    return values


def memory_of_values(data: bytes) -> int:
    """Bound the memory that the values of a JSON text take.

    Parameters
    ----------
    data : bytes
        The text.

    Returns
    -------
    int
        Bytes.

    Examples
    --------
    >>> memory_of_values(b"[1, 2]")
    334
    """
    containers = data.count(b"[") + data.count(b"{")
    texts = BYTES_OF_LETTER * len(data) + BYTES_OF_QUOTATION_MARK * data.count(b'"')
    return texts + BYTES_OF_CONTAINER * containers + BYTES_OF_ITEM * data.count(b",")
